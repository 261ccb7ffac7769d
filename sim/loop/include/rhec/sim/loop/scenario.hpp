#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/control/path.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/world/actuators.hpp"
#include "rhec/sim/world/faults.hpp"
#include "rhec/sim/world/sensor_schedule.hpp"
#include "rhec/sim/world/slip_field.hpp"
#include "rhec/sim/world/truth.hpp"

namespace rhec::sim {

/// A closed-loop experiment: the keys of RobotOptions plus those of the simulated world.
struct ScenarioOptions : RobotOptions {
  std::string name = "run";
  double speed = 8.0;  ///< reference ground speed [m/s]
  int seed = 1;
  Settings path, terrain, vehicle, sensors, faults;
  RHEC_EXPORT static const OptionTable<ScenarioOptions>& table();
};

/// The sections of a scenario; the first one has no name (the root).
RHEC_EXPORT std::vector<OptionSection> scenario_sections();

/// A scenario with all its objects constructed: path, ground and vehicle. Throws Error, naming file, line and key, if
/// it is invalid.
class RHEC_EXPORT Scenario {
 public:
  Scenario(const Host& host, const Settings& settings);

  const ScenarioOptions& options() const noexcept { return options_; }
  const Robot& robot() const noexcept { return robot_; }
  const Path& path() const noexcept { return path_; }
  /// How far along the path the vehicle begins [m].
  double start() const noexcept { return start_; }
  const SlipField& terrain() const noexcept { return *terrain_; }
  const TruthOptions& vehicle() const noexcept { return vehicle_; }
  /// By input of the model.
  const std::vector<ActuatorOptions>& actuators() const noexcept { return actuators_; }
  /// By output of the model.
  const std::vector<SensorTiming>& sensor_timings() const noexcept { return sensor_timings_; }
  const std::vector<FaultOptions>& faults() const noexcept { return faults_; }
  /// Initial state: on the path at `start`, heading along it, all else zero.
  const Eigen::VectorXd& initial_state() const noexcept { return initial_state_; }
  /// Those of the robot, and of a drive that no vehicle could follow: a sentence each.
  std::vector<std::string> notes() const;

 private:
  ScenarioOptions options_;
  Robot robot_;
  Path path_;
  double start_ = 0.0;
  std::unique_ptr<const SlipField> terrain_;
  TruthOptions vehicle_;
  std::vector<ActuatorOptions> actuators_;
  std::vector<SensorTiming> sensor_timings_;
  std::vector<FaultOptions> faults_;
  Eigen::VectorXd initial_state_;
};

}  // namespace rhec::sim
