#include "rhec/core/horizon/shift.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

namespace rhec {
namespace {

/// A multiplier indicates an active bound: it is dropped if there is no such bound.
double multiplier_of(double multiplier, double lower, double upper) noexcept {
  return std::isfinite(multiplier > 0.0 ? upper : lower) ? multiplier : 0.0;
}

double clipped(double value, double lower, double upper) noexcept { return std::min(std::max(value, lower), upper); }

}  // namespace

GuessShifter::GuessShifter(const HorizonProblem& like)
    : nx_(like.model().state_count()),
      nu_(like.model().input_count()),
      lifted_(like.structure().lifted_count()),
      free_count_(nu_ - (lifted_ - like.model().parameter_count())),
      kept_(like.capacity()),
      controls_(static_cast<std::size_t>(like.capacity().intervals) * lifted_, -1),
      shares_(like.capacity().intervals),
      scratch_(like.scratch_size()) {}

void GuessShifter::take(const HorizonProblem& problem, const Iterate& iterate) noexcept {
  const std::ptrdiff_t entries = static_cast<std::ptrdiff_t>(problem.intervals() + 1) * kept_.capacity().row();
  std::copy_n(iterate.row(0), entries, kept_.row(0));
  std::copy_n(iterate.costate(0), entries, kept_.costate(0));
  std::copy_n(iterate.bound_row(0), entries, kept_.bound_row(0));
  if (const int limits = kept_.capacity().limit_row(); limits > 0)
    std::copy_n(iterate.limit_bound(0), static_cast<std::ptrdiff_t>(problem.intervals() + 1) * limits,
                kept_.limit_bound(0));
  take_structure(problem);
}

void GuessShifter::take(const HorizonProblem& problem, Iterate&& iterate) noexcept {
  std::swap(kept_, iterate);
  take_structure(problem);
}

void GuessShifter::take_structure(const HorizonProblem& problem) noexcept {
  intervals_ = problem.intervals();
  any_start_ = problem.structure().any_start();
  if (!any_start_) {
    std::fill_n(controls_.data(), intervals_ * lifted_, -1);
    return;
  }
  for (int i = 0, k = 0; i < intervals_; ++i)
    for (int c = 0; c < lifted_; ++c) controls_[k++] = problem.structure().control_of_lifted(i, c);
}

bool GuessShifter::apply(int steps, HorizonProblem& to, Iterate& guess) noexcept {
  if (intervals_ == 0 || steps < 0 || steps > intervals_ || to.intervals() > kept_.capacity().intervals) return false;
  move_rows(steps, to, guess);
  if (to.capacity().limits > 0) move_limits(steps, to, guess);
  const bool reaches_end = to.intervals() >= intervals_ - steps;
  for (int c = 0; c < lifted_; ++c) {
    if (reaches_end && is_one_block(c, to) && kept_.costate(intervals_)[nx_ + c] == 0.0) {
      extend_lifted(c, steps, to, guess);
    } else {
      move_lifted(c, steps, to, guess);
    }
    move_lifted_bounds(c, steps, to, guess);
  }
  add_intervals(steps, to, guess);
  return true;
}

/// Moves what does not depend on blocks: states, costates, free inputs, and the multipliers of their bounds.
void GuessShifter::move_rows(int steps, const HorizonProblem& to, Iterate& guess) const noexcept {
  const int N = to.intervals(), ns = kept_.capacity().states, row = kept_.capacity().row();
  const int moved = std::min(N, intervals_ - steps);
  const std::ptrdiff_t rest = static_cast<std::ptrdiff_t>(N - moved) * row;
  // Blocks may start elsewhere now, and the last node has no controls.
  const auto adopt = [&](int first, int count, int used) {
    const GuessView from{.rows = count,
                         .stride = row,
                         .vehicle_states = nx_,
                         .states = ns,
                         .used = used,
                         .values = kept_.row(first + steps),
                         .multipliers = kept_.bound_row(first + steps),
                         .lower = to.state_lower(first),
                         .upper = to.state_upper(first)};
    transcription_kernels().adopt(from, guess.row(first), guess.bound_row(first));
  };
  adopt(0, moved, ns + free_count_);
  adopt(moved, 1, ns);
  std::fill_n(guess.row(moved) + row, rest, 0.0);
  std::fill_n(guess.bound_row(moved) + row, rest, 0.0);
  std::copy_n(kept_.costate(steps), static_cast<std::ptrdiff_t>(moved + 1) * row, guess.costate(0));
  // Beyond the kept horizon an estimator gets zero costates (no residuals), a controller the last ones.
  const bool given = to.initial_state() != nullptr;
  for (int i = moved + 1; i <= N; ++i)
    for (int j = 0; j < row; ++j) guess.costate(i)[j] = given ? kept_.costate(intervals_)[j] : 0.0;
  for (int j = 0; !given && j < ns; ++j) guess.costate(0)[j] = 0.0;
}

/// The multipliers of limits. Stages have other limits at the ends of the horizon: those that were not there get zero.
void GuessShifter::move_limits(int steps, const HorizonProblem& to, Iterate& guess) const noexcept {
  const bool given = to.initial_state() != nullptr;
  for (int i = 0; i <= to.intervals(); ++i) {
    double* const multipliers = guess.limit_bound(i);
    std::fill_n(multipliers, kept_.capacity().limit_row(), 0.0);
    if (i + steps > intervals_) continue;
    const double* const before = kept_.limit_bound(i + steps);
    const auto is_zero = [](double multiplier) { return multiplier == 0.0; };
    if (std::all_of(before, before + kept_.capacity().limits, is_zero)) continue;
    const TermFunctions::Rows *const rows = to.terms().rows(i, to.intervals(), given), *const kept = to.terms().rows(
                                                                                           i + steps, intervals_,
                                                                                           given);
    if (!rows) continue;
    const double *lower = to.limit_lower(i), *upper = to.limit_upper(i);
    for (int r = 0; kept && r < rows->limits; ++r) {
      const int from = rows->first_limit + r - kept->first_limit;
      if (from < 0 || from >= kept->limits || before[from] == 0.0) continue;
      multipliers[r] = multiplier_of(before[from], lower[r], upper[r]);
    }
  }
}

bool GuessShifter::is_one_block(int lifted, const HorizonProblem& to) const noexcept {
  bool starts = false;
  for (int i = 0; any_start_ && i < intervals_; ++i) starts |= kept_control(i, lifted) >= 0;
  for (int i = 0; to.structure().any_start() && i < to.intervals(); ++i)
    starts |= to.structure().starts_block(i, lifted);
  return !starts;
}

double GuessShifter::gradient(int i, int lifted) const noexcept {
  if (i >= intervals_) return 0.0;
  const int control = kept_control(i, lifted);
  const double next = kept_.costate(i + 1)[nx_ + lifted];
  // If the value is carried, interval i adds the change of the costates; if it is decided here, the gradient follows
  // from stationarity.
  return control >= 0 ? -next - kept_.control_bound(i)[control] : kept_.costate(i)[nx_ + lifted] - next;
}

/// For a lifted variable with one block in both horizons and zero costate at the end: its rows are moved like those of
/// the vehicle's states.
void GuessShifter::extend_lifted(int lifted, int steps, const HorizonProblem& to, Iterate& guess) const noexcept {
  const int N = to.intervals(), at = nx_ + lifted;
  const double value = kept_.state(std::min(steps, intervals_ - 1))[at];
  for (int i = 0; i <= N; ++i) guess.state(i)[at] = value;
  for (int i = std::min(N, intervals_ - steps); i <= N; ++i) guess.costate(i)[at] = 0.0;
}

/// The values of a lifted variable and their costates.
void GuessShifter::move_lifted(int lifted, int steps, const HorizonProblem& to, Iterate& guess) const noexcept {
  const int N = to.intervals(), at = nx_ + lifted;
  const auto value_on = [&](int interval) {
    const int kept = std::min(interval + steps, intervals_ - 1), control = kept_control(kept, lifted);
    return control >= 0 ? kept_.control(kept)[control] : kept_.state(kept)[at];
  };
  // If a block starts at interval 0, node 0 has the value before it: the start of a ramp, or a value that is not used.
  if (!to.structure().starts_block(0, lifted)) {
    guess.state(0)[at] = value_on(0);
  } else {
    guess.state(0)[at] = to.initial_state() ? to.initial_state()[at] : kept_.state(steps)[at];
  }
  for (int i = 0; i < N; ++i) {
    double value = guess.state(i)[at];
    if (const int control = to.structure().control_of_lifted(i, lifted); control >= 0) {
      value = clipped(value_on(i), to.control_lower(i)[control], to.control_upper(i)[control]);
      guess.control(i)[control] = value;
    }
    guess.state(i + 1)[at] = value;
  }
  double costate = guess.costate(N)[at] = 0.0;
  for (int i = N - 1; i >= 0; --i) {
    costate = to.structure().starts_block(i, lifted) ? 0.0 : costate + gradient(i + steps, lifted);
    guess.costate(i)[at] = costate;
  }
  if (!to.initial_state()) guess.costate(0)[at] = 0.0;
}

/// Bound multipliers of a lifted variable: each interval has its share of its block's multiplier, so that splitting or
/// joining blocks keeps the sum.
void GuessShifter::move_lifted_bounds(int lifted, int steps, const HorizonProblem& to, Iterate& guess) noexcept {
  const auto bound_at = [&](int first) {
    const int control = kept_control(first, lifted);
    if (control >= 0) return kept_.control_bound(first)[control];
    return first == 0 ? kept_.state_bound(0)[nx_ + lifted] : 0.0;
  };
  bool any = bound_at(0) != 0.0;
  for (int i = 1; any_start_ && i < intervals_; ++i) any |= bound_at(i) != 0.0;
  if (!any) return;
  for (int first = 0; first < intervals_;) {
    int end = first + 1;
    while (end < intervals_ && kept_control(end, lifted) < 0) ++end;
    std::fill(shares_.begin() + first, shares_.begin() + end, bound_at(first) / (end - first));
    first = end;
  }
  const int N = to.intervals();
  for (int first = 0; first < N;) {
    const int control = to.structure().control_of_lifted(first, lifted);
    double sum = 0.0;
    int i = first;
    do {
      if (i + steps < intervals_) sum += shares_[i + steps];
      ++i;
    } while (i < N && !to.structure().starts_block(i, lifted));
    if (control >= 0) {
      guess.control_bound(first)[control] =
          multiplier_of(sum, to.control_lower(first)[control], to.control_upper(first)[control]);
    } else {  // decided at node 0
      const int at = nx_ + lifted;
      guess.state_bound(0)[at] = multiplier_of(sum, to.state_lower(0)[at], to.state_upper(0)[at]);
    }
    first = i;
  }
}

/// Fills the end beyond the kept horizon: inputs as measured, or the last ones; states by integration.
void GuessShifter::add_intervals(int steps, HorizonProblem& to, Iterate& guess) noexcept {
  for (int i = intervals_ - steps; i < to.intervals(); ++i) {
    double* w = guess.control(i);
    const double* known = to.known_inputs(i) ? to.known_inputs(i) : to.inputs_behind();
    for (int j = 0; j < free_count_; ++j) {
      const double measured = known ? known[j] : std::nan("");
      w[j] = clipped(std::isnan(measured) ? kept_.control(intervals_ - 1)[j] : measured, to.control_lower(i)[j],
                     to.control_upper(i)[j]);
    }
    to.simulate_new_interval(i, guess, scratch_);
  }
}

}  // namespace rhec
