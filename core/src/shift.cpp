#include "rhec/core/shift.hpp"

#include <algorithm>
#include <cmath>

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
    : nx_(like.model().state_count()),
      nu_(like.model().input_count()),
      channels_(like.channel_count()),
      free_count_(nu_ - (channels_ - like.model().parameter_count())),
      kept_(like.capacity()),
      controls_(static_cast<std::size_t>(like.capacity().intervals) * channels_, -1),
      shares_(like.capacity().intervals),
      u_(nu_),
      p_(like.model().parameter_count()) {}

void GuessShifter::take(const HorizonProblem& problem, const Iterate& point) noexcept {
  intervals_ = problem.intervals();
  const std::ptrdiff_t entries = static_cast<std::ptrdiff_t>(intervals_ + 1) * kept_.capacity().row();
  std::copy_n(point.row(0), entries, kept_.row(0));
  std::copy_n(point.costate(0), entries, kept_.costate(0));
  std::copy_n(point.bound_row(0), entries, kept_.bound_row(0));
  for (int i = 0, k = 0; i < intervals_; ++i)
    for (int c = 0; c < channels_; ++c) controls_[k++] = problem.control_of_channel(i, c);
}

bool GuessShifter::apply(int steps, const HorizonProblem& to, Iterate& guess) noexcept {
  if (intervals_ == 0 || steps < 0 || steps > intervals_ || to.intervals() > kept_.capacity().intervals) return false;
  move_rows(steps, to, guess);
  for (int c = 0; c < channels_; ++c) {
    move_channel(c, steps, to, guess);
    move_channel_bounds(c, steps, to, guess);
  }
  add_intervals(steps, to, guess);
  return true;
}

/// What does not depend on blocks: states, costates, free inputs, and the multipliers of their bounds.
void GuessShifter::move_rows(int steps, const HorizonProblem& to, Iterate& guess) const noexcept {
  const int N = to.intervals(), ns = kept_.capacity().states, row = kept_.capacity().row();
  const int moved = std::min(N, intervals_ - steps), beyond = N - moved;
  const std::ptrdiff_t entries = static_cast<std::ptrdiff_t>(moved + 1) * row,
                       rest = static_cast<std::ptrdiff_t>(beyond) * row;
  std::copy_n(kept_.row(steps), entries, guess.row(0));
  std::copy_n(kept_.costate(steps), entries, guess.costate(0));
  std::copy_n(kept_.bound_row(steps), entries, guess.bound_row(0));
  std::fill_n(guess.row(moved) + row, rest, 0.0);
  std::fill_n(guess.bound_row(moved) + row, rest, 0.0);
  // Beyond what was kept an estimator expects to be right, and a controller to be off as it was at the end.
  const bool given = to.initial_state() != nullptr;
  for (int i = moved + 1; i <= N; ++i)
    for (int j = 0; j < row; ++j) guess.costate(i)[j] = given ? kept_.costate(intervals_)[j] : 0.0;
  for (int j = 0; !given && j < ns; ++j) guess.costate(0)[j] = 0.0;
  for (int i = 0; i <= N; ++i) {
    double *z = guess.row(i), *bound = guess.bound_row(i);
    const double *lower = to.state_lower(i), *upper = to.state_upper(i);
    // Blocks may start elsewhere now.
    const int used = i < moved ? ns + free_count_ : ns;
    for (int j = used; j < row; ++j) z[j] = bound[j] = 0.0;
    for (int j = nx_; j < ns; ++j) bound[j] = 0.0;
    for (int j = ns; j < used; ++j) z[j] = clipped(z[j], lower[j], upper[j]);
    for (int j = 0; j < used; ++j)
      if (bound[j] != 0.0) bound[j] = multiplier_of(bound[j], lower[j], upper[j]);
  }
}

double GuessShifter::gradient(int i, int channel) const noexcept {
  if (i >= intervals_) return 0.0;
  const int control = kept_control(i, channel);
  const double next = kept_.costate(i + 1)[nx_ + channel];
  // Where the value is carried, the costates' change is what interval i adds; where it is decided, stationarity says
  // it.
  return control >= 0 ? -next - kept_.control_bound(i)[control] : kept_.costate(i)[nx_ + channel] - next;
}

/// The values of a channel and their costates.
void GuessShifter::move_channel(int channel, int steps, const HorizonProblem& to, Iterate& guess) const noexcept {
  const int N = to.intervals(), at = nx_ + channel;
  const auto value_on = [&](int interval) {
    const int kept = std::min(interval + steps, intervals_ - 1), control = kept_control(kept, channel);
    return control >= 0 ? kept_.control(kept)[control] : kept_.state(kept)[at];
  };
  // Where a block starts at once, node 0 has the value before it: that of a ramp's beginning, or one that nobody uses.
  if (!to.begins(0, channel)) {
    guess.state(0)[at] = value_on(0);
  } else {
    guess.state(0)[at] = to.initial_state() ? to.initial_state()[at] : kept_.state(steps)[at];
  }
  for (int i = 0; i < N; ++i) {
    double value = guess.state(i)[at];
    if (const int control = to.control_of_channel(i, channel); control >= 0) {
      value = clipped(value_on(i), to.control_lower(i)[control], to.control_upper(i)[control]);
      guess.control(i)[control] = value;
    }
    guess.state(i + 1)[at] = value;
  }
  double costate = guess.costate(N)[at] = 0.0;
  for (int i = N - 1; i >= 0; --i) {
    costate = to.begins(i, channel) ? 0.0 : costate + gradient(i + steps, channel);
    guess.costate(i)[at] = costate;
  }
  if (!to.initial_state()) guess.costate(0)[at] = 0.0;
}

/// Multipliers of a channel's bounds: each interval has its share of its block's, so that blocks that are split or
/// joined keep the sum.
void GuessShifter::move_channel_bounds(int channel, int steps, const HorizonProblem& to, Iterate& guess) noexcept {
  const auto bound_at = [&](int first) {
    const int control = kept_control(first, channel);
    if (control >= 0) return kept_.control_bound(first)[control];
    return first == 0 ? kept_.state_bound(0)[nx_ + channel] : 0.0;
  };
  bool any = false;
  for (int i = 0; i < intervals_; ++i) any |= bound_at(i) != 0.0;
  if (!any) return;
  for (int first = 0; first < intervals_;) {
    int end = first + 1;
    while (end < intervals_ && kept_control(end, channel) < 0) ++end;
    std::fill(shares_.begin() + first, shares_.begin() + end, bound_at(first) / (end - first));
    first = end;
  }
  const int N = to.intervals();
  for (int first = 0; first < N;) {
    const int control = to.control_of_channel(first, channel);
    double sum = 0.0;
    int i = first;
    do {
      if (i + steps < intervals_) sum += shares_[i + steps];
      ++i;
    } while (i < N && !to.begins(i, channel));
    if (control >= 0) {
      guess.control_bound(first)[control] =
          multiplier_of(sum, to.control_lower(first)[control], to.control_upper(first)[control]);
    } else {  // decided at node 0
      const int at = nx_ + channel;
      guess.state_bound(0)[at] = multiplier_of(sum, to.state_lower(0)[at], to.state_upper(0)[at]);
    }
    first = i;
  }
}

/// What the kept horizon does not reach: inputs as measured, or as last; states by integration.
void GuessShifter::add_intervals(int steps, const HorizonProblem& to, Iterate& guess) noexcept {
  const auto* estimation = to.kind() == OcpKind::rhe ? static_cast<const RheProblem*>(&to) : nullptr;
  for (int i = intervals_ - steps; i < to.intervals(); ++i) {
    double* w = guess.control(i);
    for (int j = 0; j < free_count_; ++j) {
      const double measured = estimation ? estimation->measured_input(i)[j] : std::nan("");
      w[j] = clipped(std::isnan(measured) ? kept_.control(intervals_ - 1)[j] : measured, to.control_lower(i)[j],
                     to.control_upper(i)[j]);
    }
    const double seconds = to.duration(i);
    to.inputs_on(guess, i, u_.data());
    to.parameters_on(guess, i, p_.data());
    Model::Intervals request;
    request.count = 1;
    request.states = guess.state(i);
    request.inputs = u_.data();
    request.parameters = p_.data();
    request.durations = &seconds;
    request.substeps = to.substeps();
    request.next_states = guess.state(i + 1);
    to.model().integrate(request);
  }
}

}  // namespace rhec
