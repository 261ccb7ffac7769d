// How a PriorBank uses measurements between two nodes, and where it linearises an interval with outputs of motion.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "look_ahead.hpp"
#include "prior_bank_views.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/estimation/kalman_filter.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"

namespace rhec {
namespace {

/// Steps of the parameters to where an interval is linearised, with states and inputs held: one finds them, up to what
/// they change of each other's gradients.
constexpr int most_steps_of_slip = 2;

}  // namespace

/// Within an interval, what is unknown are the state at its start, the input's noise and that of the processes: a
/// measurement at a later time tells of all of them. The vector [x; z; u; q] takes such measurements in one after the
/// other, and only then moves to the interval's end.
void PriorBank::Filters::predict(const MeasuredInterval& measured, Measured end_outputs) noexcept {
  is_curved_ = false;
  std::ranges::fill(added_, 0.0);
  const bool has_motion = measures_motion(setup_.motion_outputs, measured, static_cast<std::size_t>(ny_), end_outputs);
  begin_step(measured);
  const bool is_any_missing = guesses_.front().is_any_missing();
  if (measured.between == 0 && !has_motion && !is_any_missing) {
    integrate_members(mean_.data(), false, measured.duration, 1.0);
    take_linearised_step();
    return keep_near_bounds();
  }
  RHEC_ASSERT(measured.between <= setup_.most_between, "a bank that was set up for measurements between nodes");
  widen();
  if (ahead_) ahead_->end_outputs = end_outputs;
  const MeasuredInterval interval = has_motion ? look_ahead(measured, end_outputs) : measured;
  for (int k = 0; k < interval.between; ++k) take_between(interval, k, has_motion);
  if (has_motion) {
    spread_variances();
  } else {
    point_ = wide_mean_;
    integrate_members(point_.data(), true, interval.duration, 1.0);
  }
  if (interval.between > 0 || is_any_missing) {
    narrow();
    take_guesses();
  } else {
    take_step_from_point();
  }
  keep_near_bounds();
}

int PriorBank::Filters::wide_count() const noexcept {
  return plain_count() + (ahead_ && !ahead_->mixture.curved().empty() ? Curvature::factors : 0);
}

/// Linearises the interval where its measurements put every member. All start where they put a filter on the mixture,
/// and have that filter's second-order terms.
MeasuredInterval PriorBank::Filters::look_ahead(const MeasuredInterval& measured, Measured end_outputs) noexcept {
  const std::ptrdiff_t M = lanes_;
  for (int j = 0; j < ny_; ++j) ahead_->mixture.set_output_variance(j, counted_[j]);
  for (int j = 0; j < np_; ++j) {
    const Process& process = processes_[j];
    ahead_->ramp_variances[j] = 0.0;
    for (int m = 0; m < members_; ++m) ahead_->ramp_variances[j] += weights_[m] * process.ramp[m] * process.Q[m];
  }
  moments(ahead_->mixture.mean, ahead_->mixture.covariance);
  const MeasuredInterval interval =
      ahead_->mixture.look_ahead(measured, input_.data(), ahead_->ramp_variances.data(), nullptr, end_outputs);
  is_curved_ = !ahead_->mixture.curved().empty();
  const Eigen::VectorXd& found = ahead_->mixture.point();
  point_ = wide_mean_;
  for (std::ptrdiff_t m = 0; m < M && found.allFinite(); ++m) {
    const auto at = [&](std::ptrdiff_t entry) -> double& { return point_[entry * M + m]; };
    for (int r = 0; r < nx_; ++r) at(r) = found[r];
    for (int j = 0; j < nu_; ++j) at(n_ + j) = found[nx_ + np_ + j];
    for (int j = 0; j < np_; ++j) {
      const Process& process = processes_[j];
      at(process.first) = found[nx_ + j];
      if (process.ramp[m] == 0.0) continue;
      double end = 0.0;
      for (int k = 0; k < process.count; ++k) end += process.F[k * process.count * M + m] * at(process.first + k);
      at(n_ + nu_ + process.first - nx_) = found[nx_ + j] + found[nx_ + np_ + nu_ + j] - end;
    }
  }
  // Where that tells little of slip, states and inputs stand where it tells what may be believed; parameters follow.
  const bool is_held =
      members_ > 1 && ahead_->excitation.find(interval, ahead_->mixture.summary().weights(), end_outputs,
                                              {ahead_->mixture.mean, ahead_->mixture.covariance, input_.data(),
                                               variances_.data(), counted_.data()},
                                              learnt_.data() + 2 * static_cast<std::ptrdiff_t>(ny_));
  const auto hold = [&] {
    const Eigen::VectorXd& target = ahead_->excitation.target();
    for (int r = 0; r < nx_; ++r) std::fill_n(point_.begin() + r * M, M, target[r]);
    for (int j = 0; j < nu_; ++j) std::fill_n(point_.begin() + (n_ + j) * M, M, target[nx_ + j]);
  };
  if (is_held) {
    point_ = wide_mean_;
    hold();
  }
  const int most_steps = is_held ? most_steps_of_slip : most_look_ahead_steps;
  for (int step = 0;; ++step) {
    linearise_about_point(interval, end_outputs);
    if (step == most_steps || !move_point(interval, end_outputs)) return interval;
    std::swap(point_, ahead_->next_point);
    if (is_held) hold();
  }
}

/// Outputs as expected at the means, linearised where they put the members. Those of motion that are curved have means
/// and variances of their second-order terms, as of a KalmanFilter, by the mixture's covariance.
void PriorBank::Filters::linearise_given(const double* y) noexcept {
  const std::ptrdiff_t M = lanes_;
  std::copy(mean_.begin(), mean_.end(), wide_mean_.begin());
  std::copy(mean_.begin(), mean_.end(), ahead_->trial_mean.begin());
  std::copy(covariance_.begin(), covariance_.end(), ahead_->trial_covariance.begin());
  moments(ahead_->mixture.mean, ahead_->mixture.covariance);
  const BankView trial{lanes_, nx_, n_, ahead_->trial_mean.data(), ahead_->trial_covariance.data(), wide_work_.data()};
  const int taken = view_outputs(gradient_.data(), nx_ * M, y);
  bank_kernels().update(trial, views_->outputs.data(), taken, setup_.gate, squares_.data(),
                        innovation_variances_.data());
  for (std::ptrdiff_t m = 0; m < M; ++m)
    for (int r = 0; r < nx_; ++r) states_[m * nx_ + r] = ahead_->trial_mean[r * M + m];
  // Scaled outputs stay linearised at the means.
  const auto exchange_rows = [&](auto exchange) {
    double* row = ahead_->kept_rows.data();
    for (const auto [output, state] : setup_.scaled_outputs) {
      const std::ptrdiff_t j = output;
      exchange(predicted_.data() + j * M, row, M);
      exchange(gradient_.data() + j * nx_ * M, row + M, nx_ * M);
      row += (1 + nx_) * M;
    }
  };
  exchange_rows([](double* own, double* kept, std::ptrdiff_t count) { std::copy_n(own, count, kept); });
  linearise_nodes();
  for (std::ptrdiff_t j = 0; j < ny_; ++j)
    for (std::ptrdiff_t c = 0; c < nx_; ++c)
      for (std::ptrdiff_t m = 0; m < M; ++m)
        predicted_[j * M + m] += gradient_[(j * nx_ + c) * M + m] * (mean_[c * M + m] - ahead_->trial_mean[c * M + m]);
  exchange_rows([](double* own, double* kept, std::ptrdiff_t count) { std::copy_n(kept, count, own); });
  bank_kernels().moments(trial, weights_.data(), full_mean_.data(), full_covariance_.data());
  Curvature& terms = ahead_->output_curvature;
  terms.observe(*model_, ahead_->curved_outputs, full_mean_.data());
  terms.find_factor([&](std::ptrdiff_t r, std::ptrdiff_t c) { return ahead_->mixture.covariance(r, c); });
  terms.find_means([&](std::ptrdiff_t r, std::ptrdiff_t c) { return full_covariance_(r, c); });
  for (std::size_t k = 0; k < ahead_->curved_outputs.size(); ++k) {
    const int row = static_cast<int>(k), j = ahead_->curved_outputs[k];
    added_[j] = terms.variance(row);
    for (std::ptrdiff_t m = 0; m < M; ++m) {
      predicted_[j * M + m] += terms.mean(row);
      output_variances_[j * M + m] += added_[j];
    }
  }
}

/// Adds inputs and noise of the processes, which are not correlated with anything yet.
void PriorBank::Filters::widen() noexcept {
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
  if (guesses_.front().is_any_missing()) widen_guesses();
  for (const Process& process : processes_) {
    const std::ptrdiff_t first = n_ + nu_ + process.first - nx_;
    for (std::ptrdiff_t c = 0; c < process.count; ++c)
      for (std::ptrdiff_t r = 0; r < process.count; ++r)
        std::copy_n(process.Q.begin() + (c * process.count + r) * M, M, P(first + r, first + c));
  }
  for (std::ptrdiff_t f = plain_count(); f < a; ++f) std::fill_n(P(f, f), M, 1.0);
}

/// Part of a factor of the second-order terms in a state, between the first measurement (0) and the end (1).
double PriorBank::Filters::curvature_factor(int state, int factor, double from_first) const noexcept {
  const Curvature& terms = ahead_->mixture.curvature();
  const double start = terms.factor(state, factor),
               end = terms.factor(state + static_cast<int>(ahead_->mixture.curved().size()), factor);
  return start + from_first * (end - start);
}

/// Adds the means of the second-order terms to where the members were integrated.
void PriorBank::Filters::add_curvature(double from_first) noexcept {
  if (!is_curved_) return;
  const Curvature& terms = ahead_->mixture.curvature();
  const std::vector<int>& curved = ahead_->mixture.curved();
  for (std::size_t k = 0; k < curved.size(); ++k) {
    const double start = terms.mean(static_cast<int>(k)), end = terms.mean(static_cast<int>(k + curved.size())),
                 mean = start + from_first * (end - start);
    for (int m = 0; m < lanes_; ++m) {
      next_rows_[m * nx_ + curved[k]] += mean;
      next_[curved[k] * lanes_ + m] += mean;
    }
  }
}

/// Gradient of an output by the wide vector, where it was integrated and observed last.
void PriorBank::Filters::write_wide_gradient(int output, double share, double from_first,
                                             double* gradient) const noexcept {
  const int columns = nx_ + nu_ + 2 * np_, noises = n_ + nu_;
  std::fill_n(gradient, static_cast<std::ptrdiff_t>(wide_count()) * lanes_, 0.0);
  for (int m = 0; m < lanes_; ++m) {
    const double *J = jacobian_rows_.data() + static_cast<std::ptrdiff_t>(m) * nx_ * columns,
                 *C = gradient_rows_.data() + static_cast<std::ptrdiff_t>(m) * nx_ * ny_;
    const auto g = [&](int entry) -> double& { return gradient[static_cast<std::ptrdiff_t>(entry) * lanes_ + m]; };
    // An output depends on few states.
    for (int r = 0; r < nx_; ++r) {
      const double by_state = C[r * ny_ + output];
      if (by_state == 0.0) continue;
      const auto by = [&](int column) { return by_state * J[column * nx_ + r]; };
      for (int c = 0; c < nx_; ++c) g(c) += by(c);
      for (int c = 0; c < nu_; ++c) g(n_ + c) += by(nx_ + c);
      for (int p = 0; p < np_; ++p) {
        const Process& process = processes_[p];
        const double start = by(nx_ + nu_ + p), end = by(nx_ + nu_ + np_ + p);
        if (process.ramp[m] == 0.0) {
          g(process.first) += start + end;
          continue;
        }
        g(process.first) += start + (1.0 - share) * end;
        for (int k = 0; k < process.count; ++k)
          g(process.first + k) += share * end * process.F[(k * process.count) * lanes_ + m];
        g(noises + process.first - nx_) += share * end;
      }
    }
    if (!is_curved_) continue;
    const std::vector<int>& curved = ahead_->mixture.curved();
    for (std::size_t k = 0; k < curved.size(); ++k) {
      const double by_state = C[curved[k] * ny_ + output];
      if (by_state == 0.0) continue;
      for (int f = 0; f < Curvature::factors; ++f)
        g(plain_count() + f) += by_state * curvature_factor(static_cast<int>(k), f, from_first);
    }
  }
}

/// Expected outputs and their gradients, of those that y has (n_y, NaN where missing), where the members were
/// integrated last: those of measurement number `which` of the interval.
void PriorBank::Filters::linearise_outputs(int which, const double* y, double share, double from_first) noexcept {
  const std::ptrdiff_t M = lanes_, first = static_cast<std::ptrdiff_t>(which) * ny_;
  observe_members(next_rows_.data());
  std::copy(predicted_.begin(), predicted_.end(), wide_predicted_.begin() + first * M);
  for (int j = 0; j < ny_; ++j)
    if (!std::isnan(y[j]))
      write_wide_gradient(j, share, from_first, wide_gradient_.data() + (first + j) * wide_count() * M);
}

/// All measurements between the nodes, outputs y at the end (null: none), and the end itself, about `point_`.
void PriorBank::Filters::linearise_about_point(const MeasuredInterval& interval, Measured end_outputs) noexcept {
  for (int k = 0; k < interval.between; ++k) {
    const double seconds = interval.times[k], first = interval.times[0],
                 from_first = (seconds - first) / (interval.duration - first);
    ahead_->shares[static_cast<std::size_t>(k)] = seconds / interval.duration;
    integrate_members(point_.data(), true, seconds, seconds / interval.duration);
    add_curvature(from_first);
    linearise_outputs(k, interval.outputs + static_cast<std::ptrdiff_t>(k) * ny_, seconds / interval.duration,
                      from_first);
  }
  integrate_members(point_.data(), true, interval.duration, 1.0);
  add_curvature(1.0);
  if (end_outputs) linearise_outputs(interval.between, end_outputs.values, 1.0, 1.0);
}

/// The outputs of measurement number `which` as expected at a mean of the wide vector, linearised about `point_`.
void PriorBank::Filters::expect_outputs(int which, const double* y, const double* mean) noexcept {
  const std::ptrdiff_t a = wide_count(), M = lanes_;
  for (std::ptrdiff_t j = 0; j < ny_; ++j) {
    if (std::isnan(y[j])) continue;
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(which) * ny_ + j;
    double* const expected = predicted_.data() + j * M;
    const double* const gradient = wide_gradient_.data() + row * a * M;
    std::copy_n(wide_predicted_.data() + row * M, M, expected);
    for (std::ptrdiff_t e = 0; e < a * M; e += M)
      for (std::ptrdiff_t m = 0; m < M; ++m) expected[m] += gradient[e + m] * (mean[e + m] - point_[e + m]);
  }
}

/// The next points of the members: the means given the measurements between the nodes and the outputs of motion at the
/// end, linearised about the points. False if no point moves by much.
bool PriorBank::Filters::move_point(const MeasuredInterval& interval, Measured end_outputs) noexcept {
  constexpr double little = least_look_ahead_step * least_look_ahead_step;
  const int a = wide_count();
  const std::ptrdiff_t M = lanes_, entries = a * M;
  BankView view{lanes_, a, a, wide_mean_.data(), wide_covariance_.data(), wide_work_.data()};
  if (interval.between > 0) {
    ahead_->trial_mean = wide_mean_;
    ahead_->trial_covariance = wide_covariance_;
    view.mean = ahead_->trial_mean.data();
    view.covariance = ahead_->trial_covariance.data();
  }
  for (int k = 0; k < interval.between; ++k) {
    const double* const y = interval.outputs + static_cast<std::ptrdiff_t>(k) * ny_;
    expect_outputs(k, y, ahead_->trial_mean.data());
    weigh_readings(k);
    const int taken = view_outputs(wide_gradient_.data() + static_cast<std::ptrdiff_t>(k) * ny_ * entries, entries, y);
    bank_kernels().update(view, views_->outputs.data(), taken, setup_.gate, squares_.data(),
                          innovation_variances_.data());
  }
  spread_variances(end_outputs.weights);
  views_->taken = 0;
  for (const std::ptrdiff_t j : setup_.motion_outputs) {
    if (!end_outputs || std::isnan(end_outputs[j])) continue;
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(interval.between) * ny_ + j;
    views_->add(model_->description().outputs[j], wide_predicted_.data() + row * M,
                wide_gradient_.data() + row * entries, output_variances_.data() + j * M, end_outputs[j]);
  }
  ahead_->next_point = point_;
  bank_kernels().move_point(view, views_->outputs.data(), views_->taken, plain_count(), setup_.gate,
                            ahead_->next_point.data(), ahead_->moved.data());
  std::copy(point_.begin() + static_cast<std::ptrdiff_t>(plain_count()) * lanes_, point_.end(),
            ahead_->next_point.begin() + static_cast<std::ptrdiff_t>(plain_count()) * lanes_);
  return *std::max_element(ahead_->moved.begin(), ahead_->moved.begin() + members_) > little;
}

/// How many measurements those of number `which` stand for.
const double* PriorBank::Filters::reading_weights(int which) const noexcept {
  return ahead_->mixture.summary().weights() + static_cast<std::ptrdiff_t>(which) * ny_;
}

/// Noise variances of the outputs of measurement number `which`, linearised before. How far slip is from its ramp
/// within the interval is common to readings that are close; as noise of each of them it would count for too little:
/// the mean of a Brownian bridge has the variance Q / 12, that of four values the quarter of Q / 6. So it counts twice.
void PriorBank::Filters::weigh_readings(int which) noexcept {
  const double* const weights = reading_weights(which);
  for (std::ptrdiff_t j = 0; j < ny_; ++j)
    std::fill_n(output_variances_.data() + j * lanes_, lanes_, counted_[j] / weights[j]);
  if (members_ == 1) return;
  const std::ptrdiff_t M = lanes_;
  const double share = ahead_->shares[static_cast<std::size_t>(which)];
  for (const std::ptrdiff_t j : setup_.motion_outputs) {
    const double* const gradient =
        wide_gradient_.data() + (static_cast<std::ptrdiff_t>(which) * ny_ + j) * wide_count() * M;
    for (const Process& process : processes_) {
      const double* const by_noise = gradient + (n_ + nu_ + process.first - nx_) * M;
      for (std::ptrdiff_t m = 0; m < M; ++m) {
        const double by_slip = by_noise[m] / share;
        output_variances_[j * M + m] += 2.0 * share * (1.0 - share) * process.off_course[m] * by_slip * by_slip;
      }
    }
  }
}

/// No law of slip knows an edge of the ground within an interval: beside a gyro it is an innovation of tens of standard
/// deviations, and linearised it would be laid on whatever is uncertain, heading and inputs too. So an innovation
/// counts as no more than three, with noise as large as that takes.
void PriorBank::Filters::LookAhead::bound_surprises(const BankView& view, const Views& views, const double* y,
                                                    const std::vector<int>& motion_outputs,
                                                    double* variances) noexcept {
  constexpr double most = 9.0;
  const std::ptrdiff_t M = view.members;
  bank_kernels().surprise(view, views.outputs.data(), views.taken, surprises.data());
  std::ptrdiff_t place = 0;
  for (std::ptrdiff_t j = 0; j < std::ssize(part); ++j) {
    if (std::isnan(y[j])) continue;
    const BankOutput& output = views.outputs[static_cast<std::size_t>(place)];
    const double* const square = surprises.data() + place * M;
    ++place;
    if (!std::ranges::binary_search(motion_outputs, static_cast<int>(j))) continue;
    for (std::ptrdiff_t m = 0; m < M; ++m) {
      if (!(square[m] > most)) continue;
      double innovation = output.measured - output.predicted[m];
      if (output.period > 0.0) innovation = std::remainder(innovation, output.period);
      variances[j * M + m] += innovation * innovation * (1.0 / most - 1.0 / square[m]);
    }
  }
}

/// Takes in the measurements at a time within the interval, linearised about the mean as it is by then or, as they have
/// been already, about `point_`.
///
/// Readings of an output of motion within one interval lie on a few metres of ground, where every field is smooth, and
/// tell of that together: of a law they say the same again and again. So the last of them weighs the members.
void PriorBank::Filters::take_between(const MeasuredInterval& interval, int which, bool about_point) noexcept {
  const std::ptrdiff_t a = wide_count(), M = lanes_;
  const auto [y, stated] = interval.measured(which, ny_);
  const double* const weights = about_point ? reading_weights(which) : stated;
  if (!about_point) {
    const double seconds = interval.times[which], share = seconds / interval.duration;
    integrate_members(wide_mean_.data(), true, seconds, share);
    linearise_outputs(which, y, share, 1.0);
    if (interval.weights) spread_variances(weights);
  }
  const auto take = [&](const double* taken, bool tells_laws) {
    if (about_point) {
      expect_outputs(which, taken, wide_mean_.data());
      weigh_readings(which);
    }
    if (setup_.adapts_noise) wide_before_ = wide_mean_;
    between_log_likelihood_ +=
        take_outputs({.view = {lanes_, static_cast<int>(a), static_cast<int>(a), wide_mean_.data(),
                               wide_covariance_.data(), wide_work_.data()},
                      .gradient = wide_gradient_.data() + static_cast<std::ptrdiff_t>(which) * ny_ * a * M,
                      .before = wide_before_.data(),
                      .before_entry = lanes_,
                      .before_lane = 1,
                      .weights = weights,
                      .tells_laws = tells_laws},
                     taken, nullptr);
  };
  if (!about_point || members_ == 1) {
    take(y, true);
    if (!about_point && weights && setup_.robust.empty()) spread_variances();
    return;
  }
  const auto is_repeated = [&](int j) {
    return is_of_motion(j) && LookAhead::is_measured_later(interval, which, ny_, j, ahead_->end_outputs);
  };
  for (const bool repeated : {false, true}) {
    bool any = false;
    for (int j = 0; j < ny_; ++j) {
      const bool chosen = !std::isnan(y[j]) && is_repeated(j) == repeated;
      ahead_->part[j] = chosen ? y[j] : std::numeric_limits<double>::quiet_NaN();
      any = any || chosen;
    }
    if (any) take(ahead_->part.data(), !repeated);
  }
}

/// Of an interval without measurements between its nodes, linearised about `point_`: as `take_step` from the mean.
void PriorBank::Filters::take_step_from_point() noexcept {
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
  // Second-order terms are noise, not correlated with anything yet.
  const std::vector<int>& curved = ahead_->mixture.curved();
  const int count = static_cast<int>(curved.size());
  for (int k = 0; k < count; ++k)
    for (int l = 0; l < count; ++l) {
      double added = 0.0;
      for (int f = 0; f < Curvature::factors; ++f) added += curvature_factor(k, f, 1.0) * curvature_factor(l, f, 1.0);
      double* const variance = covariance_.data() + (static_cast<std::ptrdiff_t>(curved[l]) * n_ + curved[k]) * M;
      for (std::ptrdiff_t m = 0; m < M && std::isfinite(added); ++m) variance[m] += added;
    }
}

/// Moves to the interval's end, linearised about `point_`: z+ = F z + q, and x as integrated from there.
void PriorBank::Filters::narrow() noexcept {
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
  for (std::size_t k = 0; is_curved_ && k < ahead_->mixture.curved().size(); ++k)
    for (int f = 0; f < Curvature::factors; ++f)
      std::fill_n(T(ahead_->mixture.curved()[k], plain_count() + f), M, curvature_factor(static_cast<int>(k), f, 1.0));
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
