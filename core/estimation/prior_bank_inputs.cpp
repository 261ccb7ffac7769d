// What the members of a PriorBank know of inputs that are not measured.
#include <algorithm>
#include <cmath>

#include "any_angle.hpp"
#include "prior_bank_views.hpp"

namespace rhec {

/// Moments of [x; z] of a lane.
void PriorBank::Filters::view_member(int lane) noexcept {
  for (int c = 0; c < n_; ++c) {
    full_mean_[c] = mean_[c * lanes_ + lane];
    for (int r = 0; r < n_; ++r) full_covariance_(r, c) = covariance_[(c * n_ + r) * lanes_ + lane];
  }
}

/// The inputs of an interval; of those that are guessed, the mean of the most probable member.
void PriorBank::Filters::begin_inputs(const MeasuredInterval& interval) noexcept {
  factors_->begin(interval.inputs);
  const bool is_any_missing =
      std::any_of(interval.inputs, interval.inputs + nu_, [](double u) { return std::isnan(u); });
  for (int m = 0; m < lanes_; ++m) {
    if (is_any_missing) view_member(m);
    guesses_[static_cast<std::size_t>(m)].begin(interval.inputs, interval.duration, full_covariance_);
  }
  const InputGuess& best = guesses_[static_cast<std::size_t>(most_probable())];
  for (int j = 0; j < nu_; ++j) {
    input_[j] = best.is_missing(j) ? best.mean(j) : interval.inputs[j];
    variances_[j] = best.is_missing(j) ? best.covariance()(j, j) : setup_.input_variances[j];
  }
}

double PriorBank::Filters::guessed_input(int input) const noexcept {
  return guesses_[static_cast<std::size_t>(most_probable())].mean(input);
}

/// Leaves out what parameters do that are held.
void PriorBank::Filters::hold_factors() noexcept {
  const std::ptrdiff_t columns = nx_ + nu_ + 2 * np_;
  for (int p = 0; p < np_; ++p) {
    if (!factors_->is_held(p)) continue;
    for (std::ptrdiff_t m = 0; m < lanes_; ++m)
      for (const int column : {nx_ + nu_ + p, nx_ + nu_ + np_ + p})
        std::fill_n(jacobian_rows_.data() + (m * columns + column) * nx_, nx_, 0.0);
  }
}

/// Each member has its own, together with [x; z]. Of processes that are held nothing else knows.
void PriorBank::Filters::widen_guesses() noexcept {
  const std::ptrdiff_t a = wide_count(), M = lanes_;
  for (int p = 0; p < np_; ++p) {
    if (!factors_->is_held(p)) continue;
    const Process& process = processes_[static_cast<std::size_t>(p)];
    const std::ptrdiff_t end = process.first + process.count;
    for (std::ptrdiff_t c = process.first; c < end; ++c) {
      for (std::ptrdiff_t r = 0; r < n_; ++r) {
        if (r >= process.first && r < end) continue;
        std::fill_n(wide_covariance_.begin() + (c * a + r) * M, M, 0.0);
        std::fill_n(wide_covariance_.begin() + (r * a + c) * M, M, 0.0);
      }
    }
  }
  for (std::ptrdiff_t m = 0; m < M; ++m) {
    const InputGuess& guess = guesses_[static_cast<std::size_t>(m)];
    const auto P = [&](std::ptrdiff_t r, std::ptrdiff_t c) -> double& { return wide_covariance_[(c * a + r) * M + m]; };
    for (int j = 0; j < nu_; ++j) {
      if (!guess.is_missing(j)) continue;
      wide_mean_[(n_ + j) * M + m] = guess.mean(j);
      for (int k = 0; k < nu_; ++k)
        if (guess.is_missing(k)) P(n_ + j, n_ + k) = guess.covariance()(j, k);
      for (int r = 0; r < n_; ++r) P(r, n_ + j) = P(n_ + j, r) = guess.with_state()(r, j);
      for (int p = 0; p < np_; ++p) {
        const Process& process = processes_[static_cast<std::size_t>(p)];
        for (int r = process.first; factors_->is_held(p) && r < process.first + process.count; ++r)
          P(r, n_ + j) = P(n_ + j, r) = 0.0;
      }
    }
  }
}

/// At the interval's end, with what was measured on the way.
void PriorBank::Filters::take_guesses() noexcept {
  if (!guesses_.front().is_any_missing()) return;
  const std::ptrdiff_t a = wide_count(), M = lanes_;
  for (std::ptrdiff_t m = 0; m < M; ++m) {
    InputGuess& guess = guesses_[static_cast<std::size_t>(m)];
    const auto P = [&](std::ptrdiff_t r, std::ptrdiff_t c) { return wide_covariance_[(c * a + r) * M + m]; };
    for (int j = 0; j < nu_; ++j) {
      if (!guess.is_missing(j)) continue;
      const std::ptrdiff_t row = n_ + j;
      guess.set(j, wide_mean_[row * M + m]);
      for (int k = 0; k < nu_; ++k)
        if (guess.is_missing(k)) guess.set_covariance(j, k, P(row, n_ + k));
      for (std::ptrdiff_t r = 0; r < n_; ++r) {
        double sum = 0.0;
        for (std::ptrdiff_t k = 0; k < a; ++k) sum += transition_[(k * n_ + r) * M + m] * P(k, row);
        guess.set_with_state(r, j, sum);
      }
    }
    view_member(static_cast<int>(m));
    if (release_angles(model_->description().states, full_covariance_, guess))
      for (int c = 0; c < n_; ++c)
        for (int r = 0; r < n_; ++r) covariance_[(c * n_ + r) * M + m] = full_covariance_(r, c);
    guess.predicted(full_mean_, full_covariance_);
  }
}

/// What the outputs of the interval's end have told.
void PriorBank::Filters::update_guesses() noexcept {
  if (!guesses_.front().is_predicted()) return;
  for (int m = 0; m < lanes_; ++m) {
    view_member(m);
    guesses_[static_cast<std::size_t>(m)].updated(full_mean_, full_covariance_);
  }
}

}  // namespace rhec
