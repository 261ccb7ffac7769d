#include "heading_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "innovation.hpp"
#include "numbers.hpp"
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
// Evidence is a sum over so many positions, by weights that fade.
constexpr double memory_of_evidence = 200.0;
// What is less probable than so many standard deviations with every heading is wrong itself; not so many positions.
constexpr double outlier_gate = 5.0;
constexpr int most_unplaced = 10;
// A place of which nothing is known [m].
constexpr double unknown_place = 1e4;

}  // namespace

HeadingSearch::HeadingSearch(const std::shared_ptr<const Model>& model, const WalkingFilter::Setup& setup, double gate)
    : gate_(gate),
      position_(static_cast<std::size_t>(model->output_count())),
      used_(static_cast<std::size_t>(model->output_count())) {
  for (int i = 0; i < starts; ++i) headings_.push_back({WalkingFilter(model, setup)});
  mean_ = best().mean();
  variances_ = best().covariance();
}

/// Whether measured outputs say where the vehicle is, by what a filter expects of them.
bool HeadingSearch::sees_position(const WalkingFilter& filter, Measured outputs) const noexcept {
  const Roles& roles = filter.model().description().roles;
  const auto is_seen = [&](int state) {
    for (int j = 0; state >= 0 && j < static_cast<int>(position_.size()); ++j)
      if (!std::isnan(outputs[j]) && filter.depends_on(j, state)) return true;
    return false;
  };
  return is_seen(roles.position_x) && is_seen(roles.position_y);
}

/// Forgets where the vehicle is, and takes it from a measured position.
void HeadingSearch::place(WalkingFilter& filter, Measured outputs) noexcept {
  const Roles& roles = filter.model().description().roles;
  if (!outputs) return;
  filter.expect();
  if (!sees_position(filter, outputs)) return;
  for (int j = 0; j < static_cast<int>(position_.size()); ++j) {
    const bool is_position = filter.depends_on(j, roles.position_x) || filter.depends_on(j, roles.position_y);
    position_[static_cast<std::size_t>(j)] = is_position ? outputs[j] : std::numeric_limits<double>::quiet_NaN();
  }
  const double x = filter.mean()[roles.position_x], y = filter.mean()[roles.position_y];
  for (const int i : {roles.position_x, roles.position_y}) {
    filter.covariance().row(i).setZero();
    filter.covariance().col(i).setZero();
    filter.covariance()(i, i) = unknown_place * unknown_place;
  }
  filter.update({position_.data(), outputs.weights});
  // One that is far from where the vehicle was thought to be may be wrong itself.
  const double away = std::hypot(filter.mean()[roles.position_x] - x, filter.mean()[roles.position_y] - y);
  const double doubt = std::min(0.5 * away, unknown_place);
  for (const int i : {roles.position_x, roles.position_y}) filter.covariance()(i, i) += doubt * doubt;
}

void HeadingSearch::start(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance, Measured outputs,
                          double sigma) noexcept {
  const Roles& roles = headings_.front().filter.model().description().roles;
  const double unknown = covariance(roles.heading, roles.heading), known = 0.25 * part * part;
  is_active_ = true;
  best_ = 0;
  unplaced_ = explained_places_ = 0;
  for (std::size_t i = 0; i < headings_.size(); ++i) {
    WalkingFilter& filter = headings_[i].filter;
    const double turn = angle_difference(part * static_cast<double>(i), 0.0) / sigma;
    headings_[i].prior = -0.5 * turn * turn;
    headings_[i].log_likelihood = 0.0;
    headings_[i].explained = 0;
    filter.mean() = mean;
    filter.covariance() = covariance;
    roles.turn(part * static_cast<double>(i), filter.mean().data());
    filter.covariance().row(roles.heading).setZero();
    filter.covariance().col(roles.heading).setZero();
    filter.covariance()(roles.heading, roles.heading) = known;
    // What turns along is not known either, but how far it is turned against the vehicle.
    for (const int body : roles.other_headings)
      if (filter.covariance()(body, body) > unknown)
        filter.covariance()(body, body) = std::max(filter.covariance()(body, body) - unknown, 0.0) + known;
    place(filter, outputs);
  }
}

void HeadingSearch::predict(const double* inputs, double duration) noexcept {
  for (Heading& heading : headings_) heading.filter.predict(inputs, duration);
}

/// Whether what was measured before goes together, so that what does not is wrong.
bool HeadingSearch::is_settled() const noexcept { return explained_places_ >= proof; }

/// Adds what a sensor says of each heading. False, and nothing of it, of what no heading explains.
bool HeadingSearch::weigh(const Sensor& sensor, Measured outputs) noexcept {
  double nearest = infinity, limit = 0.0;
  for (Heading& heading : headings_) {
    if (!heading.filter.innovation(sensor, outputs, innovation_)) return true;
    const auto size = static_cast<int>(innovation_.value.size());
    heading.is_explaining = innovation_.nis <= chi_square_limit(size, gate_);
    heading.surprise =
        std::min(innovation_.nis, most_surprise_of_headings * size) + log_determinant(innovation_.covariance);
    nearest = std::min(nearest, innovation_.nis);
    limit = chi_square_limit(size, outlier_gate);
  }
  // Where nothing is explained for long, all counts: it is the motion that is wrong.
  const bool is_used = nearest <= limit || !is_settled();
  for (Heading& heading : headings_) {
    if (is_used) heading.log_likelihood -= 0.5 * heading.surprise;
    if (!is_used || !heading.is_explaining) heading.explained = 0;
  }
  is_explained_ = is_explained_ && nearest <= limit;
  return is_used;
}

/// Where positions are elsewhere for good, it begins anew there.
void HeadingSearch::restart(Measured outputs) noexcept {
  copy_numbers(best().mean(), mean_);
  variances_.setZero();
  variances_.diagonal() = best().covariance().diagonal();
  start(mean_, variances_, outputs);
}

bool HeadingSearch::update(const std::vector<Sensor>& sensors, Measured outputs) noexcept {
  for (Heading& heading : headings_) {
    heading.filter.expect();
    ++heading.explained;
  }
  const bool is_placed = sees_position(headings_.front().filter, outputs);
  if (is_placed)
    for (Heading& heading : headings_) heading.log_likelihood *= 1.0 - 1.0 / memory_of_evidence;
  std::copy_n(outputs.values, used_.size(), used_.begin());
  is_explained_ = true;
  for (const Sensor& sensor : sensors) {
    if (weigh(sensor, outputs)) continue;
    for (const int j : sensor.outputs) used_[static_cast<std::size_t>(j)] = std::numeric_limits<double>::quiet_NaN();
  }
  const Measured used(used_.data(), outputs.weights);
  if (is_placed) {
    unplaced_ = sees_position(headings_.front().filter, used) ? 0 : unplaced_ + 1;
    if (unplaced_ == 0) explained_places_ = is_explained_ ? explained_places_ + 1 : 0;
  }
  if (unplaced_ > most_unplaced) {
    restart(outputs);
    return false;
  }
  for (Heading& heading : headings_) heading.filter.update(used);
  best_ = 0;
  for (std::size_t i = 1; i < headings_.size(); ++i)
    if (headings_[i].log_probability() > headings_[best_].log_probability()) best_ = i;
  const int h = best().model().description().roles.heading;
  for (const Heading& other : headings_) {
    const bool agrees = std::abs(angle_difference(other.filter.mean()[h], best().mean()[h])) < alike;
    if (!agrees && other.log_probability() > headings_[best_].log_probability() - decisive_for_headings) return false;
  }
  // Of headings that are alike, none may be as vague as at the start.
  if (best().covariance()(h, h) > alike * alike || headings_[best_].explained < proof) return false;
  is_active_ = false;
  return true;
}

void HeadingSearch::moments(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const noexcept {
  const Model& model = best().model();
  const auto& states = model.description().states;
  const Eigen::Index n = best().mean().size();
  copy_numbers(best().mean(), mean);
  covariance.setZero();
  double weights = 0.0;
  for (const Heading& heading : headings_) {
    const double weight = std::exp(heading.log_probability() - headings_[best_].log_probability());
    weights += weight;
    const auto away = [&](Eigen::Index j) {
      const double value = heading.filter.mean()[j];
      const bool is_angle = j < model.state_count() && states[static_cast<std::size_t>(j)].is_angle;
      return is_angle ? angle_difference(value, mean[j]) : value - mean[j];
    };
    for (Eigen::Index c = 0; c < n; ++c)
      for (Eigen::Index r = 0; r < n; ++r)
        covariance(r, c) += weight * (heading.filter.covariance()(r, c) + away(r) * away(c));
  }
  covariance /= weights;
}

}  // namespace rhec
