#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/control/path.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/world/slip_field.hpp"
#include "rhec/sim/world/truth.hpp"

namespace rhec::sim {

/// A closed-loop experiment: the keys of RobotOptions, and what the world is like.
struct ScenarioOptions : RobotOptions {
  std::string name = "run";
  double speed = 8.0;  ///< reference ground speed [m/s]
  int seed = 1;
  Settings path, terrain, vehicle;
  RHEC_EXPORT static const OptionTable<ScenarioOptions>& table();
};

/// The sections of a scenario, its first one without a name (the root).
RHEC_EXPORT std::vector<OptionSection> scenario_sections();

/// A scenario with all that it names made: the path, the ground, the vehicle on it. Throws Error for whatever is wrong,
/// naming file, line and key.
class RHEC_EXPORT Scenario {
 public:
  Scenario(const Host& host, const Settings& settings);

  const ScenarioOptions& options() const noexcept { return options_; }
  const Robot& robot() const noexcept { return robot_; }
  const Path& path() const noexcept { return path_; }
  const SlipField& terrain() const noexcept { return *terrain_; }
  const TruthOptions& vehicle() const noexcept { return vehicle_; }
  /// The start: on the path's first point, facing along it, all else zero.
  const Eigen::VectorXd& initial_state() const noexcept { return initial_state_; }

 private:
  ScenarioOptions options_;
  Robot robot_;
  Path path_;
  std::unique_ptr<const SlipField> terrain_;
  TruthOptions vehicle_;
  Eigen::VectorXd initial_state_;
};

}  // namespace rhec::sim
