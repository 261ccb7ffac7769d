#include "horizon_linearisation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "interval_dynamics.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

namespace rhec {
namespace {

/// If more intervals than this are not in the cache, all are evaluated anew.
constexpr int most_unknown = 8;

}  // namespace

HorizonLinearisation::HorizonLinearisation(const HorizonProblem& problem) : Linearisation(problem), problem_(problem) {
  const HorizonStructure& structure = problem.structure();
  const Capacity& capacity = structure.capacity();
  const auto nodes = static_cast<std::size_t>(capacity.intervals) + 1;
  rows_.assign(nodes * qp_.stride(), 0.0);
  costates_.assign((nodes + 1) * qp_.stride(), 0.0);
  curvature_behind_.assign(static_cast<std::size_t>(capacity.states + capacity.controls) * qp_.stride(), 0.0);
  if (problem.terms().functions()) without_terms_.assign(nodes * curvature_behind_.size(), 0.0);
  durations_.assign(nodes, 0.0);
  data_.assign(nodes * problem.model().data_count(), 0.0);
  starts_.assign(nodes * structure.lifted_count(), 0);
  for (auto* marks : {&same_, &same_costate_}) marks->assign(nodes, 0);
}

IntervalDynamics HorizonLinearisation::dynamics() const noexcept {
  return {*problem_.model_, problem_.structure_, problem_.durations_.data(), problem_.data_.data(), problem_.substeps_};
}

double* HorizonLinearisation::row(AlignedDoubles& rows, int stage) const noexcept {
  return rows.data() + static_cast<std::ptrdiff_t>(stage) * qp_.stride();
}
const double* HorizonLinearisation::row(const AlignedDoubles& rows, int stage) const noexcept {
  return rows.data() + static_cast<std::ptrdiff_t>(stage) * qp_.stride();
}
std::uint8_t* HorizonLinearisation::starts(int interval) noexcept {
  return starts_.data() + static_cast<std::ptrdiff_t>(interval) * problem_.structure_.lifted_count();
}

void HorizonLinearisation::forget() noexcept {
  known_intervals_ = -1;
  is_extended_ = has_curvature_ = false;
}

double HorizonLinearisation::linearise(const Iterate& iterate, Hessian hessian) noexcept {
  const CostParts parts = hessian == Hessian::none ? CostParts::vectors : CostParts::all;
  linearise_stages(iterate, hessian, LimitParts::all);
  const double total = write_cost(all_stages(problem_), iterate, hessian, parts);
  return total + add_terms(iterate, hessian, parts);
}

double HorizonLinearisation::linearise_for_residual(const Iterate& iterate, Hessian next) noexcept {
  if (next != Hessian::exact || !problem_.keeps_curvature()) return linearise(iterate, Hessian::none);
  // The gradients of limits without multipliers are no part of the residual, and `refresh` writes them anew.
  const bool needs_slopes = !problem_.has_late_bounds() || problem_.terms().any_pulls(problem_.structure(), iterate);
  linearise_stages(iterate, Hessian::exact, needs_slopes ? LimitParts::all : LimitParts::values);
  const double total = write_cost(all_stages(problem_), iterate, Hessian::exact, CostParts::all);
  // The next sample has other data for the terms, and so another Hessian of theirs.
  keep_curvature();
  return total + add_terms(iterate, Hessian::none, CostParts::vectors);
}

void HorizonLinearisation::prepare(const Iterate& iterate, Hessian hessian) noexcept {
  const bool has_moved = move_along(iterate, hessian);
  if (!has_moved) linearise_stages(iterate, hessian, LimitParts::all);
  if (!has_moved || hessian != Hessian::exact) write_cost(all_stages(problem_), iterate, hessian, CostParts::matrices);
  add_terms(iterate, hessian, CostParts::matrices);
}

void HorizonLinearisation::refresh(const Iterate& iterate) noexcept {
  if (problem_.has_late_bounds()) {
    problem_.write_bounds(iterate, all_stages(problem_), qp_, scratch_);
    has_slopes_ = true;
  }
  write_cost(all_stages(problem_), iterate, Hessian::none, CostParts::vectors);
  add_terms(iterate, Hessian::none, CostParts::vectors);
}

/// Adds what terms cost to a QP that has all other costs. Returns these costs, if vectors are wanted.
double HorizonLinearisation::add_terms(const Iterate& iterate, Hessian hessian, CostParts parts) noexcept {
  if (!problem_.terms().functions()) return 0.0;
  if (parts != CostParts::vectors) keep_curvature();
  return problem_.add_terms(all_stages(problem_), iterate, hessian, parts, qp_, scratch_);
}

/// Keeps a Hessian to which terms are about to be added: theirs depends on data and on the multipliers of limits.
void HorizonLinearisation::keep_curvature() noexcept {
  if (!has_curvature_ || without_terms_.empty()) return;
  std::copy_n(qp_.H(0), (known_intervals_ + 1) * std::ssize(curvature_behind_), without_terms_.data());
}

bool HorizonLinearisation::is_at(const Iterate& iterate) const noexcept {
  // The last row also holds inputs of the interval behind the horizon.
  const std::size_t entries = static_cast<std::size_t>(problem_.intervals()) * qp_.stride() + qp_.capacity().states;
  return has_structure() && std::memcmp(rows_.data(), iterate.row(0), entries * sizeof(double)) == 0;
}

/// Whether the QP was made for the present blocks.
bool HorizonLinearisation::has_structure() const noexcept {
  const HorizonStructure& structure = problem_.structure_;
  const int N = structure.intervals();
  const std::ptrdiff_t count = static_cast<std::ptrdiff_t>(N) * structure.lifted_count();
  return known_intervals_ == N && std::equal(starts_.data(), starts_.data() + count, structure.block_starts(0));
}

/// Whether AB already has the rows of lifted variables for the present structure.
bool HorizonLinearisation::has_lifted_rows() const noexcept {
  return problem_.structure_.is_direct() && !problem_.structure_.any_ramp() && has_structure();
}

/// Evaluates sizes, dynamics with their curvature, and bounds anew.
void HorizonLinearisation::linearise_stages(const Iterate& iterate, Hessian hessian, LimitParts limits) noexcept {
  const int N = problem_.intervals();
  const StageRange all{0, N};
  IntervalDynamics::Options options{.hessian = hessian, .has_lifted_rows = has_lifted_rows()};
  const IntervalDynamics dynamics = this->dynamics();
  if (!options.has_lifted_rows) dynamics.write_sizes(all, problem_.initial_state() != nullptr, qp_);
  forget();
  remember(iterate, 0);
  has_curvature_ = hessian == Hessian::exact && problem_.keeps_curvature() && N > 0;
  const IntervalDynamics::Extension extension{rows_.data(), costates_.data(), durations_.data(), data_.data(),
                                              curvature_behind_.data()};
  if (has_curvature_) {
    extend_horizon();
    options.extension = &extension;
  }
  if (N > 0) dynamics.linearise({0, N - 1}, iterate, options, qp_, scratch_.data());
  problem_.write_own_bounds(iterate, all, qp_);
  problem_.write_limits(iterate, all, limits, qp_, scratch_);
  has_slopes_ = limits == LimitParts::all;
}

/// Records that AB and b belong to this iterate; its rows before `first` are already in the cache.
void HorizonLinearisation::remember(const Iterate& iterate, int first) noexcept {
  const int N = problem_.intervals();
  known_intervals_ = N;
  std::copy_n(iterate.row(first), static_cast<std::ptrdiff_t>(N + 1 - first) * qp_.stride(), row(rows_, first));
  if (problem_.keeps_curvature())
    std::copy_n(iterate.costate(0), static_cast<std::ptrdiff_t>(N + 1) * qp_.stride(), costates_.data());
  std::copy_n(problem_.durations_.data(), N, durations_.data());
  std::copy_n(problem_.data_.data(), problem_.at_data(N), data_.data());
  std::copy_n(problem_.structure_.block_starts(0), static_cast<std::ptrdiff_t>(N) * problem_.structure_.lifted_count(),
              starts_.data());
}

/// Extends the cache by one interval behind the horizon, with the inputs that a guess goes on with.
void HorizonLinearisation::extend_horizon() noexcept {
  const int N = known_intervals_, states = qp_.capacity().states, lifted = problem_.structure_.lifted_count();
  std::copy_n(row(rows_, N - 1) + states, qp_.capacity().controls, row(rows_, N) + states);
  if (const double* behind = problem_.inputs_behind())
    for (int j = 0; j < problem_.nu(); ++j)
      if (!std::isnan(behind[j])) row(rows_, N)[states + j] = behind[j];
  std::copy_n(row(costates_, N), qp_.stride(), row(costates_, N + 1));
  durations_[N] = durations_[N - 1];
  const auto data_count = problem_.at_data(1);
  std::copy_n(data_.data() + (N - 1) * data_count, data_count, data_.data() + N * data_count);
  std::fill_n(starts(N), lifted, std::uint8_t{0});
  is_extended_ = true;
}

/// By how many intervals the horizon has moved: the first cached node that matches the first node.
int HorizonLinearisation::find_steps(const Iterate& iterate) const noexcept {
  const std::size_t bytes = problem_.nx() * sizeof(double);
  int steps = 0;
  while (steps < known_intervals_ && std::memcmp(iterate.state(0), row(rows_, steps), bytes) != 0) ++steps;
  return steps;
}

/// Marks the rows that match the cached ones of `steps` intervals later, and moves those rows. Returns the number of
/// intervals that can be known.
int HorizonLinearisation::match(const Iterate& iterate, int steps, bool is_exact) noexcept {
  const int N = problem_.intervals(), end = known_intervals_ - steps, states = qp_.capacity().states;
  const int count = std::min(N, is_extended_ ? end + 1 : end);
  std::fill_n(same_.data(), N + 1, std::uint8_t{0});
  transcription_kernels().match(iterate.row(0), row(rows_, steps), rows_.data(), count, qp_.stride(), states,
                                same_.data());
  if (count <= end)
    same_[count] = std::memcmp(iterate.state(count), row(rows_, count + steps), states * sizeof(double)) == 0;
  if (is_exact)
    transcription_kernels().match(iterate.costate(1), row(costates_, steps + 1), row(costates_, 1), count, qp_.stride(),
                                  problem_.nx(), same_costate_.data());
  return count;
}

/// Whether intervals from `interval` on have the durations and data of the cached ones `steps` later.
bool HorizonLinearisation::has_same_data(int interval, int steps, int count) const noexcept {
  const auto same = [](const double* now, const double* cached, std::ptrdiff_t entries) {
    for (std::ptrdiff_t k = 0; k < entries; ++k)
      if (now[k] != cached[k]) return false;
    return true;
  };
  return same(problem_.durations_.data() + interval, durations_.data() + interval + steps, count) &&
         same(problem_.data_.data() + problem_.at_data(interval), data_.data() + problem_.at_data(interval + steps),
              problem_.at_data(count));
}

bool HorizonLinearisation::is_known(int interval, int steps, int count, bool is_exact) const noexcept {
  if (interval >= count || same_[interval] != 2) return false;
  // For the interval behind the horizon, the next state is not cached.
  const bool is_behind = interval == known_intervals_ - steps;
  if (!is_behind && same_[interval + 1] == 0) return false;
  if (is_exact && same_costate_[interval] == 0) return false;
  if (!has_same_data(interval, steps, 1)) return false;
  const int lifted = problem_.structure_.lifted_count();
  const std::uint8_t* known = starts_.data() + static_cast<std::ptrdiff_t>(interval + steps) * lifted;
  return std::equal(known, known + lifted, problem_.structure_.block_starts(interval));
}

/// As `linearise_stages`, but from the cache: only unknown intervals are evaluated. The exact Hessian is then complete
/// but for terms. Returns false and does nothing if too many intervals are unknown.
bool HorizonLinearisation::move_along(const Iterate& iterate, Hessian hessian) noexcept {
  const HorizonStructure& structure = problem_.structure_;
  const bool is_exact = hessian == Hessian::exact;
  const int N = structure.intervals();
  if (known_intervals_ < 0 || (is_exact && !has_curvature_) || !structure.is_direct() || structure.any_ramp())
    return false;
  if (!is_exact && !problem_.has_late_bounds() && is_at(iterate) && has_same_data(0, 0, N)) return true;  // unchanged

  const int steps = find_steps(iterate), end = known_intervals_ - steps, count = match(iterate, steps, is_exact);
  std::array<int, most_unknown> unknown;
  int unknown_count = 0;
  for (int i = 0; i < N; ++i) {
    if (is_known(i, steps, count, is_exact)) continue;
    if (unknown_count == most_unknown) return false;
    unknown[unknown_count++] = i;
  }
  const bool was_behind = end < N && is_known(end, steps, count, is_exact);
  const std::ptrdiff_t curvature_size = static_cast<std::ptrdiff_t>(curvature_behind_.size());
  if (is_exact && !without_terms_.empty())
    std::copy_n(without_terms_.data(), (known_intervals_ + 1) * curvature_size, qp_.H(0));
  if (steps > 0) qp_.drop_first(steps);
  // The last node remains the last one.
  if (steps > 0 && is_exact) std::copy_n(qp_.H(end), curvature_size, qp_.H(known_intervals_));
  // Known stages already have their sizes.
  const IntervalDynamics dynamics = this->dynamics();
  const auto write_sizes = [&](int stage) {
    dynamics.write_sizes({stage, stage}, problem_.initial_state() != nullptr, qp_);
  };
  write_sizes(N);
  for (int k = 0; k < unknown_count; ++k) write_sizes(unknown[k]);
  if (was_behind) {
    write_sizes(end);
    dynamics.complete({end, end}, iterate, false, qp_);
    if (is_exact) {
      std::copy(curvature_behind_.begin(), curvature_behind_.end(), qp_.H(end));
      write_cost({end, end}, iterate, hessian, CostParts::matrices);
    }
  }
  evaluate_unknown(iterate, hessian, unknown.data(), unknown_count);
  if (is_exact && N != known_intervals_) write_cost({N, N}, iterate, hessian, CostParts::matrices);
  if (problem_.has_late_bounds()) {
    problem_.write_own_bounds(iterate, all_stages(problem_), qp_);
    write_new_limits(iterate, end, unknown.data(), unknown_count);
  } else {
    problem_.write_bounds(iterate, all_stages(problem_), qp_, scratch_);
  }
  move_nodes(steps);
  remember(iterate, count);
  is_extended_ = false;
  has_curvature_ = is_exact;
  return true;
}

void HorizonLinearisation::evaluate_unknown(const Iterate& iterate, Hessian hessian, const int* unknown,
                                            int count) noexcept {
  const bool is_exact = hessian == Hessian::exact;
  for (int k = 0; k < count;) {
    StageRange together{unknown[k], unknown[k]};
    while (++k < count && unknown[k] == together.last + 1) ++together.last;
    if (!is_exact && together.first == together.last && has_simulated(together.first, iterate)) {
      take_simulated(together.first, iterate);
      continue;
    }
    dynamics().linearise(together, iterate, {.hessian = hessian}, qp_, scratch_.data());
    if (is_exact) write_cost(together, iterate, hessian, CostParts::matrices);
  }
}

/// Limits of the stages that have none of the last horizon's, which ended at node `end`. Those of the others move
/// along, with data that held for the same time; `refresh` writes all of them once the newest data are known.
void HorizonLinearisation::write_new_limits(const Iterate& iterate, int end, const int* unknown, int count) noexcept {
  const int N = problem_.intervals();
  const HorizonTerms& terms = problem_.terms();
  if (!terms.has_limits()) return;
  // Without multipliers no limit is likely to be active.
  const bool is_open = !terms.any_pulls(problem_.structure_, iterate);
  const auto write = [&](int first, int last) {
    if (is_open)
      terms.write_open_limits(problem_.horizon_of_terms(), {first, last}, qp_);
    else
      problem_.write_limits(iterate, {first, last}, LimitParts::all, qp_, scratch_);
  };
  if (!is_open && !has_slopes_) {
    write(0, N);
    return;
  }
  const int first_kept = 1, last_kept = std::min(end, N) - 1;  // the first and the last node have rows of their own
  write(0, std::min(first_kept - 1, N));
  // Stages that follow each other are evaluated together, which takes as long as one of them does.
  int first_new = std::max(last_kept + 1, first_kept);
  int others = count;
  while (others > 0 && unknown[others - 1] >= first_kept && unknown[others - 1] >= first_new - 1) {
    first_new = std::min(first_new, unknown[others - 1]);
    --others;
  }
  for (int k = 0; k < others; ++k)
    if (unknown[k] >= first_kept) write(unknown[k], unknown[k]);
  if (first_new <= N) write(first_new, N);
}

/// Whether the problem has simulated this interval from the same numbers.
bool HorizonLinearisation::has_simulated(int interval, const Iterate& iterate) noexcept {
  const HorizonProblem::SimulatedInterval& simulated = problem_.simulated_;
  if (simulated.duration != problem_.durations_[interval]) return false;
  double* const z = scratch_.data();
  dynamics().gather_rows(iterate, {interval, interval}, z);
  return std::equal(z, z + problem_.nx() + problem_.np() + problem_.nu(), simulated.z.begin());
}

void HorizonLinearisation::take_simulated(int interval, const Iterate& iterate) noexcept {
  const HorizonProblem::SimulatedInterval& simulated = problem_.simulated_;
  const int nx = problem_.nx(), row_length = IntervalDynamics::row_length(problem_.structure_);
  const IntervalDynamics dynamics = this->dynamics();
  std::copy_n(simulated.next.data(), nx, qp_.b(interval));
  for (int r = 0; r < nx; ++r)
    std::copy_n(simulated.jacobian.data() + r * row_length, padded(nx + problem_.np() + problem_.nu()),
                qp_.AB(interval) + r * qp_.stride());
  dynamics.complete({interval, interval}, iterate, false, qp_);
  if (problem_.structure_.control_count(interval) > problem_.nu())
    dynamics.place_starts(interval, Hessian::gauss_newton, qp_);
}

}  // namespace rhec
