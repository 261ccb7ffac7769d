#include "rhec/core/shift.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/rhc_problem.hpp"
#include "rhec/core/rhe_problem.hpp"

namespace rhec {
namespace {

/// A multiplier claims a bound to be active: it is dropped where there is no such bound.
double multiplier_of(double multiplier, double lower, double upper) noexcept {
  return std::isfinite(multiplier > 0.0 ? upper : lower) ? multiplier : 0.0;
}

double clipped(double value, double lower, double upper) noexcept { return std::min(std::max(value, lower), upper); }

}  // namespace

GuessShifter::GuessShifter(const HorizonProblem& like)
    : max_intervals_(like.capacity().intervals),
      nx_(like.model().state_count()),
      nu_(like.model().input_count()),
      np_(like.model().parameter_count()),
      channels_(like.channel_count()) {
  const auto* rhc = dynamic_cast<const RhcProblem*>(&like);
  for (int j = 0; j < nu_; ++j) {
    const bool blocked =
        rhc && std::count(rhc->setup().blocked_inputs.begin(), rhc->setup().blocked_inputs.end(), j) > 0;
    if (!blocked) free_inputs_.push_back(j);
  }
  const auto intervals = static_cast<std::size_t>(max_intervals_), nodes = intervals + 1;
  states_.resize(nodes * (nx_ + channels_));
  costates_.resize(nodes * nx_);
  state_bounds_.resize(nodes * nx_);
  inputs_.resize(intervals * nu_);
  parameters_.resize(intervals * np_);
  free_bounds_.resize(intervals * free_inputs_.size());
  channel_bounds_.resize(intervals * channels_);
  channel_gradients_.resize(intervals * channels_);
  next_inputs_.resize(intervals * nu_);
  next_parameters_.resize(intervals * np_);
  u_.resize(nu_);
  p_.resize(np_);
}

int GuessShifter::control_of(const HorizonProblem& problem, int interval, int channel) const noexcept {
  if (!problem.begins(interval, channel)) return -1;
  int control = static_cast<int>(free_inputs_.size());
  for (int before = 0; before < channel; ++before) control += problem.begins(interval, before) ? 1 : 0;
  return control;
}

void GuessShifter::take(const HorizonProblem& problem, const Iterate& point) noexcept {
  intervals_ = problem.intervals();
  const int free_count = static_cast<int>(free_inputs_.size());
  for (int i = 0; i <= intervals_; ++i) {
    std::copy_n(point.state(i), nx_ + channels_, row(states_, i, nx_ + channels_));
    std::copy_n(point.costate(i), nx_, row(costates_, i, nx_));
    std::copy_n(point.state_bound(i), nx_, row(state_bounds_, i, nx_));
    if (i == intervals_) break;
    problem.inputs_on(point, i, row(inputs_, i, nu_));
    problem.parameters_on(point, i, row(parameters_, i, np_));
    std::copy_n(point.control_bound(i), free_count, row(free_bounds_, i, free_count));
  }
  for (int c = 0; c < channels_; ++c) take_channel(problem, point, c);
}

void GuessShifter::take_channel(const HorizonProblem& problem, const Iterate& point, int channel) noexcept {
  const auto costate = [&](int node) { return point.costate(node)[nx_ + channel]; };
  for (int first = 0; first < intervals_;) {
    const int control = control_of(problem, first, channel);
    const double bound = control >= 0 ? point.control_bound(first)[control]
                         : first == 0 ? point.state_bound(0)[nx_ + channel]
                                      : 0.0;
    int end = first + 1;
    while (end < intervals_ && !problem.begins(end, channel)) ++end;
    for (int i = first; i < end; ++i) {
      // Shares, so that blocks that are split or joined keep the sum.
      channel_bounds_[i * channels_ + channel] = bound / (end - first);
      // Where the value is carried, the costates' change is what interval i adds; where it is decided, stationarity
      // says it.
      channel_gradients_[i * channels_ + channel] =
          i == first && control >= 0 ? -costate(i + 1) - bound : costate(i) - costate(i + 1);
    }
    first = end;
  }
}

bool GuessShifter::apply(int steps, const HorizonProblem& to, Iterate& guess) noexcept {
  if (intervals_ == 0 || steps < 0 || steps > intervals_ || to.intervals() > max_intervals_) return false;
  move_decisions(steps, to, guess);
  move_states(steps, to, guess);
  move_costates(steps, to, guess);
  move_bounds(steps, to, guess);
  return true;
}

void GuessShifter::move_decisions(int steps, const HorizonProblem& to, Iterate& guess) noexcept {
  const auto* rhe = dynamic_cast<const RheProblem*>(&to);
  for (int i = 0; i < to.intervals(); ++i) {
    const int kept = std::min(i + steps, intervals_ - 1);
    double *u = row(next_inputs_, i, nu_), *p = row(next_parameters_, i, np_);
    std::copy_n(row(inputs_, kept, nu_), nu_, u);
    std::copy_n(row(parameters_, kept, np_), np_, p);
    if (!rhe || i + steps < intervals_) continue;
    for (int j = 0; j < nu_; ++j)
      if (const double measured = rhe->measured_input(i)[j]; !std::isnan(measured)) u[j] = measured;
  }
  for (int i = 0; i < to.intervals(); ++i) std::fill_n(guess.control(i), guess.capacity().controls, 0.0);
  to.set_decisions(guess, next_inputs_.data(), next_parameters_.data());
  // Where a block starts at once, node 0 has the value before it: that of a ramp's beginning, or one that nobody uses.
  for (int c = 0; c < channels_; ++c) {
    if (!to.begins(0, c)) continue;
    const double* given = to.initial_state();
    guess.state(0)[nx_ + c] = given ? given[nx_ + c] : row(states_, steps, nx_ + channels_)[nx_ + c];
  }
  for (int i = 0; i < to.intervals(); ++i) {
    double* w = guess.control(i);
    for (int j = 0; j < to.control_count(i); ++j) w[j] = clipped(w[j], to.control_lower(i)[j], to.control_upper(i)[j]);
    for (int c = 0; c < channels_; ++c) {
      const int control = control_of(to, i, c);
      guess.state(i + 1)[nx_ + c] = control >= 0 ? w[control] : guess.state(i)[nx_ + c];
    }
  }
}

void GuessShifter::move_states(int steps, const HorizonProblem& to, Iterate& guess) noexcept {
  for (int i = 0; i <= to.intervals(); ++i) {
    if (i + steps <= intervals_) {
      std::copy_n(row(states_, i + steps, nx_ + channels_), nx_, guess.state(i));
      continue;
    }
    const double seconds = to.duration(i - 1);
    to.inputs_on(guess, i - 1, u_.data());
    to.parameters_on(guess, i - 1, p_.data());
    Model::Intervals request;
    request.count = 1;
    request.states = guess.state(i - 1);
    request.inputs = u_.data();
    request.parameters = p_.data();
    request.durations = &seconds;
    request.substeps = to.substeps();
    request.next_states = guess.state(i);
    to.model().integrate(request);
  }
}

void GuessShifter::move_costates(int steps, const HorizonProblem& to, Iterate& guess) const noexcept {
  const int N = to.intervals();
  const bool given = to.initial_state() != nullptr;
  for (int i = 0; i <= N; ++i) {
    // Beyond what was kept an estimator expects to be right, and a controller to be off as it was at the end.
    if (i + steps <= intervals_) {
      std::copy_n(row(costates_, i + steps, nx_), nx_, guess.costate(i));
    } else if (given) {
      std::copy_n(row(costates_, intervals_, nx_), nx_, guess.costate(i));
    } else {
      std::fill_n(guess.costate(i), nx_, 0.0);
    }
  }
  for (int c = 0; c < channels_; ++c) {
    guess.costate(N)[nx_ + c] = 0.0;
    for (int i = N - 1; i >= 0; --i) {
      const double gradient = i + steps < intervals_ ? channel_gradients_[(i + steps) * channels_ + c] : 0.0;
      guess.costate(i)[nx_ + c] = to.begins(i, c) ? 0.0 : guess.costate(i + 1)[nx_ + c] + gradient;
    }
  }
  if (!given) std::fill_n(guess.costate(0), nx_ + channels_, 0.0);
}

void GuessShifter::move_bounds(int steps, const HorizonProblem& to, Iterate& guess) const noexcept {
  const int N = to.intervals(), free_count = static_cast<int>(free_inputs_.size());
  for (int i = 0; i <= N; ++i) {
    double* bound = guess.state_bound(i);
    std::fill_n(bound, guess.capacity().states, 0.0);
    if (i + steps <= intervals_)
      for (int j = 0; j < nx_; ++j)
        bound[j] = multiplier_of(row(state_bounds_, i + steps, nx_)[j], to.state_lower(i)[j], to.state_upper(i)[j]);
    if (i == N) break;
    bound = guess.control_bound(i);
    std::fill_n(bound, guess.capacity().controls, 0.0);
    if (i + steps < intervals_)
      for (int j = 0; j < free_count; ++j)
        bound[j] =
            multiplier_of(row(free_bounds_, i + steps, free_count)[j], to.control_lower(i)[j], to.control_upper(i)[j]);
  }
  for (int c = 0; c < channels_; ++c) {
    for (int first = 0; first < N;) {
      const int control = control_of(to, first, c);
      double sum = 0.0;
      int i = first;
      do {
        if (i + steps < intervals_) sum += channel_bounds_[(i + steps) * channels_ + c];
        ++i;
      } while (i < N && !to.begins(i, c));
      if (control >= 0) {
        guess.control_bound(first)[control] =
            multiplier_of(sum, to.control_lower(first)[control], to.control_upper(first)[control]);
      } else {  // decided at node 0
        guess.state_bound(0)[nx_ + c] = multiplier_of(sum, to.state_lower(0)[nx_ + c], to.state_upper(0)[nx_ + c]);
      }
      first = i;
    }
  }
}

}  // namespace rhec
