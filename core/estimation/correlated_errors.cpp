#include "correlated_errors.hpp"

#include <algorithm>
#include <cmath>

#include "innovation.hpp"

namespace rhec {
namespace {

// Estimates.
constexpr double typical_volume_memory = 300.0, information_memory = 50.0;

/// What an innovation says of a direction of outputs. False where these do not see it.
bool project(const Innovation& innovation, const Innovation::OfSensor<1>& direction, Innovation& result) noexcept {
  result.value.resize(1);
  result.covariance.resize(1, 1);
  result.value[0] = direction.dot(innovation.value);
  result.covariance(0, 0) = direction.dot(innovation.covariance * direction);
  return result.covariance(0, 0) > 0.0;
}

}  // namespace

CorrelatedErrors::CorrelatedErrors(const Model& model)
    : x_(model.description().roles.position_x),
      y_(model.description().roles.position_y),
      heading_(model.description().roles.heading),
      by_output_(static_cast<std::size_t>(model.output_count()), nullptr) {}

void CorrelatedErrors::reset(std::span<const Sensor> sensors) {
  sensors_.assign(sensors.size(), {});
  directions_.assign(has_directions() ? sensors.size() : 0, {});
  std::ranges::fill(by_output_, nullptr);
  for (std::size_t s = 0; s < sensors.size(); ++s)
    for (const int j : sensors[s].outputs) by_output_[static_cast<std::size_t>(j)] = &sensors_[s];
  factors_ = {};
  typical_volume_ = volumes_ = 0.0;
}

void CorrelatedErrors::take(const WalkingFilter& filter, std::size_t index, const Sensor& sensor,
                            const Innovation& innovation) noexcept {
  if (index >= sensors_.size()) return;
  const std::size_t values = sensor.outputs.size();
  sensors_[index].take(innovation, values);
  if (directions_.empty() || values < 2 || static_cast<std::size_t>(innovation.value.size()) != values) return;
  const double cosine = std::cos(filter.mean()[heading_]), sine = std::sin(filter.mean()[heading_]);
  Innovation::OfSensor<1> along(values), across(values);
  for (std::size_t k = 0; k < values; ++k) {
    const double by_x = filter.derivative(sensor.outputs[k], x_), by_y = filter.derivative(sensor.outputs[k], y_);
    along[static_cast<Eigen::Index>(k)] = by_x * cosine + by_y * sine;
    across[static_cast<Eigen::Index>(k)] = by_y * cosine - by_x * sine;
  }
  Innovation projected;
  Directions& directions = directions_[index];
  if (!project(innovation, along, projected)) return;
  directions.along.take(projected, 1);
  directions.information += 1.0 / projected.covariance(0, 0);
  if (!project(innovation, across, projected)) return;
  directions.across.take(projected, 1);
  directions.information += 1.0 / projected.covariance(0, 0);
}

CorrelatedErrors::Factors CorrelatedErrors::found() const noexcept {
  double information = 0.0, others = 1.0;
  Factors of_position{0.0, 0.0, 0.0};
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (directions_.empty() || !(directions_[s].information > 0.0)) {
      others = std::max(others, sensors_[s].factor());
      continue;
    }
    const Directions& directions = directions_[s];
    information += directions.information;
    of_position.all_else += directions.information * sensors_[s].factor();
    of_position.along += directions.information * directions.along.factor();
    of_position.across += directions.information * directions.across.factor();
  }
  if (!(information > 0.0)) return {others, others, others};
  return {.all_else = std::max(others, of_position.all_else / information),
          .along = std::max(others, of_position.along / information),
          .across = std::max(others, of_position.across / information)};
}

void CorrelatedErrors::note(double volume, Eigen::Index size) noexcept {
  if (std::isfinite(volume)) {
    volumes_ = std::min(volumes_ + 1.0, typical_volume_memory);
    typical_volume_ += (volume - typical_volume_) / volumes_;
  }
  factors_ = found();
  for (Directions& each : directions_) each.information *= 1.0 - 1.0 / information_memory;
  if (!are_any() || !(volume > typical_volume_)) return;
  const double share = std::exp(-2.0 * (volume - typical_volume_) / static_cast<double>(size));
  for (double* factor : {&factors_.all_else, &factors_.along, &factors_.across})
    *factor = 1.0 + (*factor - 1.0) * share;
}

double CorrelatedErrors::largest() const noexcept {
  return std::max({factors_.all_else, factors_.along, factors_.across});
}

void CorrelatedErrors::scale(const Eigen::VectorXd& state, Eigen::MatrixXd& covariance) const noexcept {
  covariance *= factors_.all_else;
  if (!has_directions() || !std::isfinite(state[heading_])) return;
  const double along = std::sqrt(factors_.along / factors_.all_else),
               across = std::sqrt(factors_.across / factors_.all_else);
  const double cosine = std::cos(state[heading_]), sine = std::sin(state[heading_]);
  const double xx = along * cosine * cosine + across * sine * sine, xy = (along - across) * cosine * sine,
               yy = along * sine * sine + across * cosine * cosine;
  const auto mix = [&](double& x, double& y) {
    const double of_x = x;
    x = xx * of_x + xy * y;
    y = xy * of_x + yy * y;
  };
  const Eigen::Index n = covariance.rows();
  for (Eigen::Index j = 0; j < n; ++j) {
    mix(covariance(x_, j), covariance(y_, j));
    covariance(heading_, j) *= across;
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    mix(covariance(j, x_), covariance(j, y_));
    covariance(j, heading_) *= across;
  }
  // Rounding must not leave it unsymmetric.
  for (const int i : {x_, y_, heading_})
    for (Eigen::Index j = 0; j < n; ++j)
      covariance(j, i) = covariance(i, j) = 0.5 * (covariance(i, j) + covariance(j, i));
}

double CorrelatedErrors::in_volume(Eigen::Index size) const noexcept {
  const double all = 0.5 * static_cast<double>(size) * std::log(factors_.all_else);
  if (!has_directions()) return all;
  return all + 0.5 * std::log(factors_.along / factors_.all_else) + std::log(factors_.across / factors_.all_else);
}

double CorrelatedErrors::mean(Eigen::Index size) const noexcept {
  return size > 0 ? std::exp(2.0 * in_volume(size) / static_cast<double>(size)) : factors_.all_else;
}

}  // namespace rhec
