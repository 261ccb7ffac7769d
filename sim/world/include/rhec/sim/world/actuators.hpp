#pragma once

#include <limits>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/sim/world/truth.hpp"

namespace rhec::sim {

/// What an actuator makes of the input that it is given: du/dt = (clamp(given) - u) / lag.
struct ActuatorOptions {
  double lag = 0.0;  ///< time constant [s]; 0: none
  double lower = -std::numeric_limits<double>::infinity(), upper = std::numeric_limits<double>::infinity();
  RHEC_EXPORT static const OptionTable<ActuatorOptions>& table();
};

/// Reads a map from inputs to their actuators. Throws Error for unknown inputs and values out of range.
RHEC_EXPORT std::vector<ActuatorOptions> read_actuators(const Settings& map, const ModelDescription& about);

/// The actuators of a vehicle. Without lags and limits the vehicle gets what it is given.
class RHEC_EXPORT Actuators {
 public:
  /// Starts at rest, with all inputs at the value that is closest to 0.
  explicit Actuators(std::vector<ActuatorOptions> options);

  /// Advances the vehicle by `duration` [s] with constant given inputs. Does not allocate or throw.
  void advance(TruthVehicle& vehicle, const double* given, double duration) noexcept;
  /// What the vehicle has got last: the mean over the last piece of a duration, in which a lag is followed.
  const std::vector<double>& applied() const noexcept { return applied_; }

 private:
  std::vector<ActuatorOptions> options_;  ///< by input
  std::vector<double> state_, applied_;
  double shortest_lag_;  ///< infinite without lags
};

}  // namespace rhec::sim
