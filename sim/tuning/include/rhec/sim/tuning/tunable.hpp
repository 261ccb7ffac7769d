#pragma once

#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/sim/logs/recorded_log.hpp"

namespace rhec::sim {

/// A number of a scenario that is to be found.
struct RHEC_EXPORT Tunable {
  enum class Kind {
    scale,  ///< positive; what counts are ratios
    offset  ///< of any sign; what counts are differences
  };
  std::string name;               ///< for tables, e.g. "noise.outputs.x_gps, y_gps"
  std::vector<std::string> keys;  ///< dotted; all of them take the value
  std::string unit;
  Kind kind = Kind::scale;
  double start = 0.0;  ///< what the scenario says, in its unit
  /// How far off that may well be: a standard deviation, of the natural logarithm for a scale. It is the unit of the
  /// search, and a weak prior about what the scenario says.
  double doubt = 1.0;
  double lower = 0.0, upper = 0.0;
  bool is_whole = false;  ///< rounded

  /// From and to the search's coordinate, 0 at the start and in units of the doubt.
  double value_at(double coordinate) const noexcept;
  double coordinate_of(double value) const noexcept;
  /// Standard error in its own unit, of one of the coordinate; of a scale by the slope at the value.
  double error_of(double coordinate_error, double value) const noexcept;
};

/// The significant digits that numbers are written with once they are found.
inline constexpr int written_digits = 4;

/// A coordinate for each of `tunables`, put into the settings of a scenario, with `digits` significant ones.
RHEC_EXPORT Settings with_values(Settings settings, const std::vector<Tunable>& tunables, const Eigen::VectorXd& at,
                                 int digits = 17);

/// What to tune beside what is tuned anyway, or not to tune: keys of the scenario. A key alone, or the start of one
/// such as "log" or "noise.inputs", and for one that is added a range: "model.wheelbase=[2.5, 3.1]".
struct TuningWishes {
  std::vector<std::string> tune, keep;
};

/// The numbers of a log's scenario that can be tuned: noise of the sensors that the log has, biases and delays of the
/// section `log`, signed lengths of the model (they are lever arms), the process noise of `ekf`, and those of priors
/// and robust losses that the settings give. `scenario` is that of `settings`, which has one variant. Throws Error for
/// a wish that is no number of the scenario.
RHEC_EXPORT std::vector<Tunable> tunables_of(const Host& host, const LogScenario& scenario, const TuningWishes& wishes);

/// The numbers of a controller that are tuned: its weights, but for those of positions on the way, which are the unit
/// of the others; and its horizon. Weights of equal value and unit in one section stay equal. Throws Error if the
/// scenario gives no weights.
RHEC_EXPORT std::vector<Tunable> controller_tunables(const Robot& robot, const Settings& settings);

}  // namespace rhec::sim
