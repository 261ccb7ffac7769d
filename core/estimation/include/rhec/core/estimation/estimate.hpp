#pragma once

#include <span>

#include <Eigen/Core>

#include "rhec/core/estimation/health.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec {

/// An estimate at one time. Valid until the next call of the estimator.
struct Estimate {
  double time = 0.0;
  Eigen::VectorXd state;       ///< x_k, n_x
  Eigen::VectorXd parameters;  ///< the value of the newest interval, n_p
  /// Covariance of [x_k; p], from the information in the measurements and the prior; bounds do not narrow it.
  Eigen::MatrixXd covariance;
  Report report;          ///< of the solver; trivial for a filter
  bool fallback = false;  ///< the solver failed; this is the prediction from earlier samples
  /// The time is beyond the newest node: the state is integrated from there. The covariance is predicted too where
  /// sensors are watched; else it is that node's.
  bool predicted = false;
  /// Whether it can be used, and why not; `ok` where nobody judges (SensorWatch).
  Health health;
  /// Of the measurements since the last call, in their order; empty where nobody judges.
  std::span<const Innovation> innovations;
};

}  // namespace rhec
