// How a PriorBank uses measurements between two nodes, and where it linearises an interval with outputs of motion.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "look_ahead.hpp"
#include "prior_bank_views.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"

namespace rhec {

/// Within an interval, what is unknown are the state at its start, the input's noise and that of the processes: a
/// measurement at a later time tells of all of them. The vector [x; z; u; q] takes such measurements in one after the
/// other, and only then moves to the interval's end.
void PriorBank::predict(const MeasuredInterval& interval, const double* end_outputs) noexcept {
  const bool is_ahead = rhec::looks_ahead(setup_.motion_outputs, interval, static_cast<std::size_t>(ny_), end_outputs);
  if (interval.between == 0 && !is_ahead) return predict(interval.inputs, interval.duration);
  RHEC_ASSERT(!wide_mean_.empty(), "a bank that was set up for measurements between nodes");
  begin_step(interval.inputs, interval.duration);
  widen();
  for (int k = 0; k < interval.between; ++k)
    take_between(interval.times[k], interval.times[k] / interval.duration,
                 interval.outputs + static_cast<std::ptrdiff_t>(k) * ny_);
  linearise_wide(interval.duration, is_ahead ? end_outputs : nullptr);
  if (interval.between > 0) {
    narrow();
  } else {
    take_step_from_point();
  }
}

/// Adds inputs and noise of the processes, which are not correlated with anything yet.
void PriorBank::widen() noexcept {
  const std::ptrdiff_t a = wide_count(), M = lanes_;
  std::copy(mean_.begin(), mean_.end(), wide_mean_.begin());
  std::fill(wide_mean_.begin() + n_ * M, wide_mean_.end(), 0.0);
  std::fill(wide_covariance_.begin(), wide_covariance_.end(), 0.0);
  const auto P = [&](std::ptrdiff_t r, std::ptrdiff_t c) { return wide_covariance_.begin() + (c * a + r) * M; };
  for (std::ptrdiff_t c = 0; c < n_; ++c)
    for (std::ptrdiff_t r = 0; r < n_; ++r) std::copy_n(covariance_.begin() + (c * n_ + r) * M, M, P(r, c));
  for (std::ptrdiff_t j = 0; j < nu_; ++j) {
    std::fill_n(wide_mean_.begin() + (n_ + j) * M, M, input_[j]);
    std::fill_n(P(n_ + j, n_ + j), M, variances_[j]);
  }
  for (const Process& process : processes_) {
    const std::ptrdiff_t first = n_ + nu_ + process.first - nx_;
    for (std::ptrdiff_t c = 0; c < process.count; ++c)
      for (std::ptrdiff_t r = 0; r < process.count; ++r)
        std::copy_n(process.Q.begin() + (c * process.count + r) * M, M, P(first + r, first + c));
  }
}

/// Gradient of an output by the wide vector, where it was integrated and observed last.
void PriorBank::write_wide_gradient(int output, double share) noexcept {
  const int a = wide_count(), columns = nx_ + nu_ + 2 * np_;
  double* const gradient = wide_gradient_.data() + static_cast<std::ptrdiff_t>(output) * a * lanes_;
  std::fill_n(gradient, static_cast<std::ptrdiff_t>(a) * lanes_, 0.0);
  for (int m = 0; m < lanes_; ++m) {
    const double *J = jacobian_rows_.data() + static_cast<std::ptrdiff_t>(m) * nx_ * columns,
                 *C = gradient_rows_.data() + static_cast<std::ptrdiff_t>(m) * nx_ * ny_;
    const auto by = [&](int column) {
      double sum = 0.0;
      for (int r = 0; r < nx_; ++r) sum += C[r * ny_ + output] * J[column * nx_ + r];
      return sum;
    };
    const auto g = [&](int entry) -> double& { return gradient[static_cast<std::ptrdiff_t>(entry) * lanes_ + m]; };
    for (int c = 0; c < nx_; ++c) g(c) = by(c);
    for (int c = 0; c < nu_; ++c) g(n_ + c) = by(nx_ + c);
    for (int p = 0; p < np_; ++p) {
      const Process& process = processes_[p];
      const double start = by(nx_ + nu_ + p), end = by(nx_ + nu_ + np_ + p);
      if (process.ramp[m] == 0.0) {
        g(process.first) = start + end;
        continue;
      }
      g(process.first) = start + (1.0 - share) * end;
      for (int k = 0; k < process.count; ++k)
        g(process.first + k) += share * end * process.F[(k * process.count) * lanes_ + m];
      g(n_ + nu_ + process.first - nx_) = share * end;
    }
  }
}

/// Next states and Jacobians at the interval's end at the mean or, where outputs y are given, where those of motion put
/// what is unknown of it: Gauss-Newton steps of every member, until no point moves by much.
void PriorBank::linearise_wide(double seconds, const double* y) noexcept {
  constexpr double little = least_look_ahead_step * least_look_ahead_step;
  const int a = wide_count();
  point_ = wide_mean_;
  for (int step = 0; step <= most_look_ahead_steps; ++step) {
    integrate_members(point_.data(), true, seconds, 1.0);
    if (!y || step == most_look_ahead_steps) return;
    observe_members(next_rows_.data());
    int taken = 0;
    for (const int j : setup_.motion_outputs) {
      if (std::isnan(y[j])) continue;
      write_wide_gradient(j, 1.0);
      views_->outputs[taken++] = {.predicted = predicted_.data() + static_cast<std::ptrdiff_t>(j) * lanes_,
                                  .gradient = wide_gradient_.data() + static_cast<std::ptrdiff_t>(j) * a * lanes_,
                                  .variance = output_variances_.data() + static_cast<std::ptrdiff_t>(j) * lanes_,
                                  .measured = y[j],
                                  .period = model_->description().outputs[j].is_angle ? 2.0 * std::numbers::pi : 0.0};
    }
    next_point_ = point_;
    bank_kernels().move_point({lanes_, a, a, wide_mean_.data(), wide_covariance_.data(), wide_work_.data()},
                              views_->outputs.data(), taken, setup_.gate, next_point_.data(), moved_.data());
    if (*std::max_element(moved_.begin(), moved_.begin() + members_) <= little) return;
    std::swap(point_, next_point_);
  }
}

/// Takes in outputs at a time within the interval.
void PriorBank::take_between(double seconds, double share, const double* y) noexcept {
  const int a = wide_count();
  integrate_members(wide_mean_.data(), true, seconds, share);
  observe_members(next_rows_.data());
  for (int j = 0; j < ny_; ++j)
    if (!std::isnan(y[j])) write_wide_gradient(j, share);
  if (setup_.adapts_noise) wide_before_ = wide_mean_;
  between_log_likelihood_ +=
      take_outputs({.view = {lanes_, a, a, wide_mean_.data(), wide_covariance_.data(), wide_work_.data()},
                    .gradient = wide_gradient_.data(),
                    .before = wide_before_.data(),
                    .before_entry = lanes_,
                    .before_lane = 1},
                   y, nullptr);
}

/// Of an interval without measurements between its nodes, linearised about `point_`: as `take_step` from the mean.
void PriorBank::take_step_from_point() noexcept {
  const std::ptrdiff_t M = lanes_;
  const auto off = [&](std::ptrdiff_t entry, std::ptrdiff_t m) {
    return wide_mean_[entry * M + m] - point_[entry * M + m];
  };
  const auto add = [&](int column, std::ptrdiff_t m, double change) {
    for (std::ptrdiff_t r = 0; r < nx_; ++r) next_[r * M + m] += jacobian_[(column * nx_ + r) * M + m] * change;
  };
  for (std::ptrdiff_t m = 0; m < M; ++m) {
    for (int c = 0; c < nx_; ++c) add(c, m, off(c, m));
    for (int j = 0; j < nu_; ++j) add(nx_ + j, m, off(n_ + j, m));
    for (int j = 0; j < np_; ++j) {
      const Process& process = processes_[j];
      double end = off(process.first, m);
      add(nx_ + nu_ + j, m, end);
      if (process.ramp[m] != 0.0) {
        end = off(n_ + nu_ + process.first - nx_, m);
        for (std::ptrdiff_t k = 0; k < process.count; ++k)
          end += process.F[k * process.count * M + m] * off(process.first + k, m);
      }
      add(nx_ + nu_ + np_ + j, m, end);
    }
  }
  take_linearised_step();
}

/// Moves to the interval's end, linearised about `point_`: z+ = F z + q, and x as integrated from there.
void PriorBank::narrow() noexcept {
  const std::ptrdiff_t a = wide_count(), M = lanes_;
  std::fill(transition_.begin(), transition_.end(), 0.0);
  const auto T = [&](std::ptrdiff_t r, std::ptrdiff_t c) { return transition_.data() + (c * n_ + r) * M; };
  const auto J = [&](std::ptrdiff_t r, std::ptrdiff_t c) { return jacobian_.data() + (c * nx_ + r) * M; };
  AlignedDoubles& next = wide_before_;  // of the end
  std::copy(next_.begin(), next_.end(), next.begin());
  for (std::ptrdiff_t r = 0; r < nx_; ++r) {
    for (std::ptrdiff_t c = 0; c < nx_; ++c) std::copy_n(J(r, c), M, T(r, c));
    for (std::ptrdiff_t c = 0; c < nu_; ++c) std::copy_n(J(r, nx_ + c), M, T(r, n_ + c));
  }
  for (std::ptrdiff_t p = 0; p < np_; ++p) {
    const Process& process = processes_[p];
    const std::ptrdiff_t first = process.first, noise = n_ + nu_ + first - nx_, count = process.count;
    for (std::ptrdiff_t m = 0; m < M; ++m) {
      for (std::ptrdiff_t r = 0; r < nx_; ++r) {
        const double start = J(r, nx_ + nu_ + p)[m], end = J(r, nx_ + nu_ + np_ + p)[m];
        if (process.ramp[m] == 0.0) {
          T(r, first)[m] = start + end;
          continue;
        }
        T(r, first)[m] = start;
        for (std::ptrdiff_t k = 0; k < count; ++k) T(r, first + k)[m] += end * process.F[k * count * M + m];
        T(r, noise)[m] = end;
      }
      for (std::ptrdiff_t r = 0; r < count; ++r) {
        double value = wide_mean_[(noise + r) * M + m];
        for (std::ptrdiff_t k = 0; k < count; ++k) {
          const double F = process.F[(k * count + r) * M + m];
          T(first + r, first + k)[m] = F;
          value += F * wide_mean_[(first + k) * M + m];
        }
        T(first + r, noise + r)[m] = 1.0;
        next[(first + r) * M + m] = value;
      }
    }
  }
  for (std::ptrdiff_t c = 0; c < a; ++c)
    for (std::ptrdiff_t r = 0; r < nx_; ++r)
      for (std::ptrdiff_t m = 0; m < M; ++m)
        next[r * M + m] += T(r, c)[m] * (wide_mean_[c * M + m] - point_[c * M + m]);
  const BankView view{lanes_, nx_, n_, mean_.data(), covariance_.data(), work_.data()},
      wide{lanes_,           static_cast<int>(a), static_cast<int>(a), wide_mean_.data(), wide_covariance_.data(),
           wide_work_.data()};
  bank_kernels().narrow(view, wide, transition_.data(), next.data());
  if (setup_.map) add_offsets();
}

}  // namespace rhec
