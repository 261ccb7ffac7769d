#include "past_places.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "innovation.hpp"

namespace rhec {

namespace {

// Of directions that are told apart, this share of the better determined one's information at least.
constexpr double least_information = 1e-9;

}  // namespace

bool displacement_of(const Innovation::OfSensor<1>& value, const Innovation::OfSensor<Eigen::Dynamic>& covariance,
                     const PositionDerivatives& derivatives, Displacement& result) noexcept {
  const Eigen::LLT<Innovation::OfSensor<Eigen::Dynamic>> root(covariance);
  if (root.info() != Eigen::Success || value.size() != derivatives.rows()) return false;
  const PositionDerivatives whitened = root.matrixL().solve(derivatives);
  const Innovation::OfSensor<1> white = root.matrixL().solve(value);
  const Eigen::Matrix2d information = whitened.transpose() * whitened;
  const double trace = information.trace();
  if (!(information.determinant() > least_information * trace * trace)) return false;
  result.covariance = information.inverse();
  result.mean = result.covariance * (whitened.transpose() * white);
  return result.mean.allFinite() && result.covariance.allFinite();
}

double log_odds_of_return(const Innovation::OfSensor<1>& value, const Innovation::OfSensor<Eigen::Dynamic>& covariance,
                          const Innovation::OfSensor<1>& jump) noexcept {
  const auto n = static_cast<double>(jump.size());
  const double moved = n * (1.0 + std::log(jump.squaredNorm() / n));
  return 0.5 * (moved - squared_size(value, covariance) - log_determinant(covariance));
}

void PastPlaces::leave(int sensor, const Displacement& step, double time) noexcept {
  if (sensor != sensor_) clear();
  sensor_ = sensor;
  if (count_ == capacity) forget_oldest();
  steps_[count_++] = {step, time};
}

void PastPlaces::forget_before(double time) noexcept {
  while (count_ > 0 && !(time - steps_[0].time <= longest_memory)) forget_oldest();
}

Displacement PastPlaces::to(std::size_t place) const noexcept {
  Displacement sum;
  for (std::size_t k = place; k < count_; ++k) {
    sum.mean -= steps_[k].displacement.mean;
    sum.covariance += steps_[k].displacement.covariance;
  }
  return sum;
}

void PastPlaces::forget_oldest() noexcept {
  std::shift_left(steps_.begin(), steps_.begin() + static_cast<std::ptrdiff_t>(count_), 1);
  --count_;
}

}  // namespace rhec
