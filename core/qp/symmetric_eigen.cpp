#include "rhec/core/qp/symmetric_eigen.hpp"

#include <limits>

#include <Eigen/Eigenvalues>

namespace rhec {

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& symmetric) {
  const Eigen::Index n = symmetric.rows();
  if (n == 0) return {};
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(symmetric);
  if (eigen.info() != Eigen::Success) {
    constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    return {Eigen::VectorXd::Constant(n, unknown), Eigen::MatrixXd::Constant(n, n, unknown)};
  }
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

}  // namespace rhec
