#pragma once

#include <Eigen/Core>

#include "rhec/core/ocp/solver.hpp"

namespace rhec {

/// What an estimator knows at a time. Valid until the estimator is asked again.
struct Estimate {
  double time = 0.0;
  Eigen::VectorXd state;       ///< x_k, n_x
  Eigen::VectorXd parameters;  ///< the value of the newest interval, n_p
  /// Of [x_k; p], from the information in the measurements and the prior; bounds do not narrow it.
  Eigen::MatrixXd covariance;
  Report report;          ///< of the solver; trivial for a filter
  bool fallback = false;  ///< the solver failed, and the prediction from earlier samples took its place
  /// The time lies beyond the newest node: integrated from there. The covariance is still that of the newest node.
  bool predicted = false;
};

}  // namespace rhec
