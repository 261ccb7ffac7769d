#pragma once

#include <Eigen/Core>

namespace rhec::testing {

/// The largest magnitude of an entry.
inline double largest(const Eigen::MatrixXd& matrix) { return matrix.cwiseAbs().maxCoeff(); }

}  // namespace rhec::testing
