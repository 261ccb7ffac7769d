#pragma once

#include <limits>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/sim/logs/recorded_log.hpp"

namespace rhec::sim {

/// What a filter expected of a fix before it had it: the prediction error decomposition of the likelihood (Schweppe
/// 1965; Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, 1989).
struct Innovation {
  int size = 0;                  ///< coordinates that were measured; 0: the filter did not have this fix
  double squared = 0.0;          ///< nu' S^-1 nu
  double log_determinant = 0.0;  ///< of S; [m] per coordinate
};

/// Squared innovation where a filter has no numbers any more.
inline constexpr double squared_of_lost = 1e12;

/// Innovations of all fixes that are not withheld, by their index in the log; the others have the size 0. Only fixes
/// count. The steering's readings are inputs too, by their differences, so that a filter expects them nearly exactly,
/// whatever their noise. A row of dead reckoning is known from the one before it on: a log is there as a whole, and
/// what the filter knows at a fix would else leap with its delay, from row to row.
RHEC_EXPORT std::vector<Innovation> innovations(const Robot& robot, const RecordedLog& log, const LogOptions& options,
                                                const HoldOut& hold_out);

/// From here on Student's t distribution counts as normal.
inline constexpr double normal_degrees = 1000.0;
/// Logarithm of the density of an innovation by the multivariate Student distribution with this many degrees of freedom
/// and the scale matrix S; `normal_degrees`: by the normal distribution. 0 for the size 0.
RHEC_EXPORT double log_density(const Innovation& innovation, double degrees) noexcept;

struct LogLikelihood {
  double total = -std::numeric_limits<double>::infinity();
  int count = 0;                    ///< fixes that counted
  double degrees = normal_degrees;  ///< of freedom, that explain the innovations best
};
/// Sum of the log densities of the fixes that `counts` names, at the degrees of freedom that make it largest. So tails
/// are as heavy as the log has them: one jump of metres does not rule, and a log without any has normal innovations.
RHEC_EXPORT LogLikelihood log_likelihood(const std::vector<Innovation>& innovations, const std::vector<bool>& counts);

}  // namespace rhec::sim
