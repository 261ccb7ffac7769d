// How a PriorBank follows a map of the parameters over the ground.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "prior_bank_views.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

/// In place of the variance at the start of an interval: the members were not on the map before.
constexpr double from_elsewhere = -1.0;

}  // namespace

void PriorBank::Filters::check_map() const {
  const Roles& roles = model_->description().roles;
  if (roles.position_x < 0 || roles.position_y < 0)
    throw Error(fmt::format("bank: the model '{}' does not say which states are its position; it has no place on a map",
                            model_->description().name));
  if (setup_.map->setup().parameters != np_)
    throw Error(
        fmt::format("bank: the map has {} parameters; expected the model's {}", setup_.map->setup().parameters, np_));
  if (static_cast<int>(setup_.deviations.size()) != members_)
    throw Error("bank: expected deviations from the map for every member");
  for (const auto& member : setup_.deviations) {
    if (static_cast<int>(member.size()) != np_)
      throw Error(fmt::format("bank: a member has {} deviations from the map; expected {}, one a parameter",
                              member.size(), np_));
    for (const MapDeviation& deviation : member)
      if (!(deviation.length > 0.0 && deviation.inflation > 0.0 && deviation.least >= 0.0))
        throw Error("bank: a deviation from the map needs a positive length and inflation, and 0 or more at least");
  }
}

/// The map says p = m(r) + e, where its error e has the standard deviation s(r) and the correlation exp(-d / length)
/// along the way. Over an interval from place 0 to place 1, with phi = exp(-d / length),
///
///     p_1 = m_1 + phi (p_0 - m_0) + w,    w ~ N(0, s_1^2 - phi^2 s_0^2).
///
/// So what the map says is never an observation, which counts again at each node: however many nodes lie within the
/// length, p is known from it with the deviation s.
void PriorBank::Filters::follow_map() noexcept {
  const Roles& roles = model_->description().roles;
  double *const means = map_means_.data(), *const variances = map_variances_.data();
  // Both places come from `find_distance`: of the mixture, before and after the interval.
  const bool enters = variances[0] == from_elsewhere;
  const bool knows_start = setup_.map->look_up(states_[roles.position_x], states_[roles.position_y], means, variances);
  knows_place_ =
      setup_.map->look_up(next_rows_[roles.position_x], next_rows_[roles.position_y], means + np_, variances + np_);
  for (int j = 0; j < np_; ++j) std::fill(processes_[j].offset.begin(), processes_[j].offset.end(), 0.0);
  if (!knows_place_) return;
  // What the members know has been found elsewhere: it and the map are independent, and are fused once.
  for (int j = 0; enters && j < np_; ++j) {
    const int at = processes_[j].first, of_map = knows_start ? j : np_ + j;
    for (int m = 0; m < lanes_; ++m) {
      const MapDeviation& deviation = setup_.deviations[std::min(m, members_ - 1)][j];
      const auto P = [&](int r, int c) -> double& {
        return covariance_[(static_cast<std::ptrdiff_t>(c) * n_ + r) * lanes_ + m];
      };
      const auto mean = [&](int r) -> double& { return mean_[static_cast<std::ptrdiff_t>(r) * lanes_ + m]; };
      const double total =
          P(at, at) + deviation.inflation * deviation.inflation * variances[of_map] + deviation.least * deviation.least;
      const double innovation = means[of_map] - mean(at);
      for (int r = 0; r < n_; ++r) full_mean_[r] = P(r, at);
      for (int c = 0; c < n_; ++c) {
        mean(c) += full_mean_[c] / total * innovation;
        for (int r = 0; r < n_; ++r) P(r, c) -= full_mean_[r] * full_mean_[c] / total;
      }
    }
  }
  for (int j = 0; j < np_; ++j) {
    Process& process = processes_[j];
    // Where the map begins, the way there counts as if it were known as well.
    const double mean = means[np_ + j], mean_before = knows_start ? means[j] : mean;
    for (int m = 0; m < lanes_; ++m) {
      const MapDeviation& deviation = setup_.deviations[std::min(m, members_ - 1)][j];
      const double scale = deviation.inflation * deviation.inflation, least = deviation.least * deviation.least;
      const double variance = scale * variances[np_ + j] + least;
      const double variance_before = knows_start ? scale * variances[j] + least : variance;
      const double phi = std::exp(-distance_ / deviation.length);
      for (int k = 0; k < process.count; ++k) {
        process.F[static_cast<std::ptrdiff_t>(k) * process.count * lanes_ + m] = k == 0 ? phi : 0.0;
        process.Q[static_cast<std::ptrdiff_t>(k) * process.count * lanes_ + m] = 0.0;
        process.Q[static_cast<std::ptrdiff_t>(k) * lanes_ + m] = 0.0;
      }
      // A map that is sharper ahead does not take away what it has let in: as much noise as if it stayed as sharp.
      process.Q[m] = std::max(variance - phi * phi * variance_before, (1.0 - phi * phi) * variance);
      process.offset[m] = mean - phi * mean_before;
    }
  }
}

void PriorBank::Filters::add_offsets() noexcept {
  for (const Process& process : processes_)
    for (int m = 0; m < lanes_; ++m)
      mean_[static_cast<std::ptrdiff_t>(process.first) * lanes_ + m] += process.offset[m];
}

void PriorBank::Filters::take_share(double share, const double* mean, const double* covariance) noexcept {
  for (int m = 0; m < lanes_; ++m) {
    const auto own = [&](int r) -> double& { return mean_[static_cast<std::ptrdiff_t>(r) * lanes_ + m]; };
    for (int c = 0; c < n_; ++c) {
      for (int r = 0; r < n_; ++r) {
        double& P = covariance_[(static_cast<std::ptrdiff_t>(c) * n_ + r) * lanes_ + m];
        P = (1.0 - share) * P + share * covariance[c * n_ + r] +
            share * (1.0 - share) * (mean[r] - own(r)) * (mean[c] - own(c));
      }
    }
    for (int r = 0; r < n_; ++r) own(r) += share * (mean[r] - own(r));
  }
  if (share == 1.0) map_variances_[0] = from_elsewhere;
}

void PriorBank::Filters::add_saved_weights(const double* state, double* sums) const noexcept {
  const double* const weights = state + mean_.size() + covariance_.size();
  for (int m = 0; m < members_; ++m) sums[m] += weights[m];
}

void PriorBank::Filters::forget_weights() noexcept { std::fill_n(weights_.begin(), members_, 1.0 / members_); }

void PriorBank::Filters::take_noise(const Filters& other) noexcept {
  learnt_ = other.learnt_;
  spread_variances();
}

}  // namespace rhec
