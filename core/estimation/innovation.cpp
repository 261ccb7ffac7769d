#include "innovation.hpp"

#include <limits>

#include <Eigen/Cholesky>

namespace rhec {
namespace {

using Root = Eigen::LLT<Innovation::OfSensor<Eigen::Dynamic>>;

}  // namespace

double squared_size(const Innovation::OfSensor<1>& value,
                    const Innovation::OfSensor<Eigen::Dynamic>& covariance) noexcept {
  const Innovation::OfSensor<1> scaled = Root(covariance).matrixL().solve(value);
  return scaled.squaredNorm();
}

double log_determinant(const Innovation::OfSensor<Eigen::Dynamic>& covariance) noexcept {
  const Root root(covariance);
  if (root.info() != Eigen::Success) return std::numeric_limits<double>::quiet_NaN();
  return 2.0 * root.matrixLLT().diagonal().array().log().sum();
}

}  // namespace rhec
