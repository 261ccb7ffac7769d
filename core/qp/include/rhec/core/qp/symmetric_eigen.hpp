#pragma once

#include <Eigen/Core>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// The eigenvalues of a symmetric matrix, in ascending order, and orthonormal eigenvectors as columns:
/// A = vectors diag(values) vectors' (Golub and Van Loan, Matrix Computations, section 8.3).
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};

/// Reads the lower triangle of a matrix of any size. Where an entry is not finite, neither are values and vectors.
/// Allocates: the real-time path has decompositions of its own, for sizes known when it is compiled.
RHEC_EXPORT SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& symmetric);

}  // namespace rhec
