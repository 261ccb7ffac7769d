#include "heading_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "innovation.hpp"
#include "rhec/core/base/angle.hpp"

namespace rhec {
namespace {

constexpr double part = 2.0 * std::numbers::pi / HeadingSearch::starts;
// Headings that differ by less are one [rad].
constexpr double alike = 0.2;
// The best heading has to explain the data e^25 times better than each different one.
constexpr double decisive_for_headings = 25.0;
// A single outlier must not decide: largest share of a measurement, in squared standard deviations.
constexpr double most_surprise_of_headings = 16.0;
// Samples in a row that the heading found has to explain.
constexpr int proof = 4;

}  // namespace

HeadingSearch::HeadingSearch(const std::shared_ptr<const Model>& model, const WalkingFilter::Setup& setup, double gate)
    : gate_(gate) {
  for (int i = 0; i < starts; ++i) headings_.push_back({WalkingFilter(model, setup)});
}

void HeadingSearch::start(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  const Roles& roles = headings_.front().filter.model().description().roles;
  is_active_ = true;
  best_ = 0;
  for (std::size_t i = 0; i < headings_.size(); ++i) {
    WalkingFilter& filter = headings_[i].filter;
    headings_[i].log_likelihood = 0.0;
    headings_[i].explained = 0;
    filter.mean() = mean;
    filter.covariance() = covariance;
    roles.turn(part * static_cast<double>(i), filter.mean().data());
    filter.covariance().row(roles.heading).setZero();
    filter.covariance().col(roles.heading).setZero();
    filter.covariance()(roles.heading, roles.heading) = 0.25 * part * part;
  }
}

void HeadingSearch::predict(const double* inputs, double duration) noexcept {
  for (Heading& heading : headings_) heading.filter.predict(inputs, duration);
}

bool HeadingSearch::update(const std::vector<Sensor>& sensors, Measured outputs) noexcept {
  for (Heading& heading : headings_) {
    heading.filter.expect();
    ++heading.explained;
    for (const Sensor& sensor : sensors) {
      if (!heading.filter.innovation(sensor, outputs, innovation_)) continue;
      if (innovation_.nis > chi_square_limit(static_cast<int>(innovation_.value.size()), gate_)) heading.explained = 0;
      const double surprise =
          std::min(innovation_.nis, most_surprise_of_headings * static_cast<double>(innovation_.value.size()));
      heading.log_likelihood -= 0.5 * (surprise + log_determinant(innovation_.covariance));
    }
    heading.filter.update(outputs);
  }
  best_ = 0;
  for (std::size_t i = 1; i < headings_.size(); ++i)
    if (headings_[i].log_likelihood > headings_[best_].log_likelihood) best_ = i;
  const int h = best().model().description().roles.heading;
  for (const Heading& other : headings_) {
    const bool agrees = std::abs(angle_difference(other.filter.mean()[h], best().mean()[h])) < alike;
    if (!agrees && other.log_likelihood > headings_[best_].log_likelihood - decisive_for_headings) return false;
  }
  // Of headings that are alike, none may be as vague as at the start.
  if (best().covariance()(h, h) > alike * alike || headings_[best_].explained < proof) return false;
  is_active_ = false;
  return true;
}

}  // namespace rhec
