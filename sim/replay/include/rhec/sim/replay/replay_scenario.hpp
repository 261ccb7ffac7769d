#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rhec/logs/mapping/signal_map.hpp"
#include "rhec/plugins/robot/robot.hpp"

namespace rhec::sim {

/// The keys of a scenario whose drive is replayed: those of a robot. Those of a simulated world may be there, too, so
/// that a simulation and the replay of its log have one file.
struct ReplayOptions : RobotOptions {
  std::string name = "drive";
  Settings variants, world;
  RHEC_EXPORT static const OptionTable<ReplayOptions>& table();
};

/// One of the estimators that run side by side on a drive.
struct ReplayVariant {
  std::string name;
  Robot robot;
  logs::SignalMap signals;
  Settings settings;  ///< the scenario with the variant's keys put over it, without `variants`
};

/// A scenario for drives with the vehicle's own sensors, with all its objects constructed. Throws Error, naming file,
/// line and key, if it is invalid; `chosen` as in LogScenario.
class RHEC_EXPORT ReplayScenario {
 public:
  ReplayScenario(const Host& host, const Settings& settings, const std::vector<std::string>& chosen = {});
  const std::string& name() const noexcept { return name_; }
  const std::vector<ReplayVariant>& variants() const noexcept { return variants_; }
  /// Where the scenario's simulated drive begins, if it has one.
  const std::optional<Eigen::VectorXd>& simulated_start() const noexcept { return start_; }

 private:
  std::string name_;
  std::vector<ReplayVariant> variants_;
  std::optional<Eigen::VectorXd> start_;
};

}  // namespace rhec::sim
