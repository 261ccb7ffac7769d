#include "innovation.hpp"

#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

namespace rhec {
namespace {

using Root = Eigen::LLT<Innovation::OfSensor<Eigen::Dynamic>>;

}  // namespace

double squared_size(const Innovation::OfSensor<1>& value,
                    const Innovation::OfSensor<Eigen::Dynamic>& covariance) noexcept {
  const Eigen::Index size = value.size();
  if (size == 1 && covariance(0, 0) > 0.0) return value[0] * value[0] / covariance(0, 0);
  if (size == 2 && covariance(0, 0) > 0.0) {
    const double by = covariance(1, 0) / covariance(0, 0), rest = value[1] - by * value[0],
                 variance = covariance(1, 1) - by * covariance(1, 0);
    if (variance > 0.0) return value[0] * value[0] / covariance(0, 0) + rest * rest / variance;
  }
  return normalised(value, covariance).squaredNorm();
}

Innovation::OfSensor<1> normalised(const Innovation::OfSensor<1>& value,
                                   const Innovation::OfSensor<Eigen::Dynamic>& covariance) noexcept {
  if (value.size() == 1) return value / std::sqrt(covariance(0, 0));
  return Root(covariance).matrixL().solve(value);
}

double log_determinant(const Innovation::OfSensor<Eigen::Dynamic>& covariance) noexcept {
  const Root root(covariance);
  if (root.info() != Eigen::Success) return std::numeric_limits<double>::quiet_NaN();
  return 2.0 * root.matrixLLT().diagonal().array().log().sum();
}

}  // namespace rhec
