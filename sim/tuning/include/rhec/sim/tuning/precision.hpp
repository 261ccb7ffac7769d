#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// A log likelihood whose terms are known, one for each of `terms.size()` measurements in their order; several threads
/// call it at once.
using LikelihoodTerms = std::function<Eigen::VectorXd(const Eigen::VectorXd& at)>;

/// What a log likelihood says of the coordinates at its maximum; each coordinate has a prior N(0, 1) beside it.
struct Precision {
  std::vector<bool> is_free;       ///< false: at a bound, and held there
  Eigen::MatrixXd hessian;         ///< of the negative log likelihood, without the prior; 0 for those that are not free
  Eigen::MatrixXd covariance;      ///< of the coordinates, robust: see below
  Eigen::VectorXd hessian_errors;  ///< standard errors by the inverse Hessian alone
  Eigen::VectorXd widths;          ///< over which differences were taken; 0 for those that are not free
  /// Root mean square distance of the log likelihood from its parabolas, the median of all coordinates: where a filter
  /// finds its way again or not by chance, smaller differences mean nothing.
  double roughness = 0.0;
  RHEC_EXPORT double error(int coordinate) const noexcept;
  RHEC_EXPORT double correlation(int a, int b) const noexcept;
};

struct PrecisionOptions {
  Eigen::VectorXd lower, upper;
  int blocks = 40;  ///< the terms are divided into so many runs, taken as independent
  int threads = 1;
  std::function<bool()> stop = {};
};

/// The Hessian H by parabolas over steps that change the log likelihood by about 1, or by a few times its roughness.
/// The covariance is (H + I)^-1; where scores of blocks vary more than H says, since terms are correlated or the model
/// is not quite right, the error of that coordinate is larger in the same proportion (the sandwich of Huber 1967 and
/// White, Econometrica 50, 1982, coordinate by coordinate: as a whole it has little to stand on with a few dozen
/// blocks).
RHEC_EXPORT Precision precision_at(const LikelihoodTerms& terms, const Eigen::VectorXd& at,
                                   const PrecisionOptions& options);

}  // namespace rhec::sim
