// How a program of a moving horizon is made of the one that it was before.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <utility>

#include "kernels/kernels.hpp"
#include "kernels/program_kernels.hpp"
#include "recollection.hpp"
#include "rhec/core/horizon_problem.hpp"
#include "rhec/core/padded.hpp"

namespace rhec {

void Recollection::forget() noexcept {
  intervals = -1;
  looks_ahead = has_curvature = false;
  std::fill(observed.begin(), observed.end(), std::uint8_t{0});
}

void Recollection::move_outputs(int steps) noexcept {
  if (output_size == 0) return;
  const int kept = intervals + 1 - steps;
  for (auto* marks : {&observed, &is_clean}) {
    std::copy_n(marks->begin() + steps, kept, marks->begin());
    std::fill(marks->begin() + kept, marks->end(), std::uint8_t{0});
  }
  for (int i = 0; i < kept; ++i)
    if (same[i] == 0) observed[i] = 0;
  if (steps == 0) return;
  const int slots = 2 * static_cast<int>(observed.size());
  if (first + steps + static_cast<int>(observed.size()) <= slots) {
    first += steps;
    return;
  }
  const int from = first + steps;
  first = 0;
  std::copy_n(outputs.data() + from * output_size, kept * output_size, outputs.data());
  std::copy_n(output_jacobians.data() + from * output_jacobian_size, kept * output_jacobian_size,
              output_jacobians.data());
}

void HorizonProblem::foresee_interval(int i, Iterate& point) noexcept {
  gather_rows(point, {i, i}, foreseen_.z.data());
  // With a ramp, derivatives are by both its ends: `prepare` makes no use of those.
  foreseen_.duration = any_ramp_ ? 0.0 : durations_[i];
  model_->integrate_rows({.count = 1,
                          .z = foreseen_.z.data(),
                          .z_step = row_,
                          .ramp = any_ramp_,
                          .durations = &durations_[i],
                          .substeps = substeps_,
                          .next_states = foreseen_.next.data(),
                          .next_step = row_,
                          .jacobians = foreseen_.jacobian.data(),
                          .jacobian_step = nx_ * row_,
                          .jacobian_row = row_,
                          .scratch = foreseen_.scratch.data()});
  std::copy_n(foreseen_.next.data(), nx_, point.state(i + 1));
  carry_channels(i, point);
}

void HorizonProblem::remember_in(StageQp& qp) const {
  const auto nodes = static_cast<std::size_t>(capacity_.intervals) + 1;
  Recollection known;
  known.model = model_;
  known.rows.assign(nodes * stride_, 0.0);
  known.costates.assign((nodes + 1) * stride_, 0.0);
  known.ahead.assign(static_cast<std::size_t>(capacity_.states + capacity_.controls) * stride_, 0.0);
  known.durations.assign(nodes, 0.0);
  known.begins.assign(nodes * channels_, 0);
  for (auto* marks : {&known.observed, &known.same, &known.same_costate, &known.is_clean}) marks->assign(nodes, 0);
  qp.memory = std::move(known);
}

namespace {

/// In a program or a constant one.
template <class Program>
auto* find_recollection(Program& qp, const std::shared_ptr<const Model>& model, const Capacity& capacity) noexcept {
  auto* known = std::any_cast<Recollection>(&qp.memory);
  return known && known->model == model && qp.capacity() == capacity ? known : nullptr;
}

}  // namespace

Recollection* HorizonProblem::recollection_in(StageQp& qp) const noexcept {
  Recollection* known = find_recollection(qp, model_, capacity_);
  if (known && known->of != identity_) {
    known->forget();
    std::fill(known->is_clean.begin(), known->is_clean.end(), std::uint8_t{0});
    known->of = identity_;
  }
  return known;
}

const Recollection* HorizonProblem::recollection_in(const StageQp& qp) const noexcept {
  const Recollection* known = find_recollection(qp, model_, capacity_);
  return known && known->of == identity_ ? known : nullptr;
}

bool HorizonProblem::is_made_at(const Iterate& point, const StageQp& qp) const noexcept {
  const Recollection* known = recollection_in(qp);
  // Behind the last state there may be inputs of an interval that was looked at ahead.
  const std::size_t bytes = (static_cast<std::size_t>(intervals_) * stride_ + capacity_.states) * sizeof(double);
  return known && is_of_structure(qp, *known) && std::memcmp(known->rows.data(), point.row(0), bytes) == 0;
}

/// Whether a program was made of this structure, and nobody has written to it since.
bool HorizonProblem::is_of_structure(const StageQp& qp, const Recollection& known) const noexcept {
  return known.changes == qp.changes() && known.intervals == intervals_ && qp.intervals() == intervals_ &&
         std::memcmp(known.begins.data(), begins_.data(), static_cast<std::size_t>(intervals_) * channels_) == 0;
}

/// Whether a program has what this structure asks for of F's rows of channels.
bool HorizonProblem::has_structure(const StageQp& qp, const Recollection& known) const noexcept {
  return is_direct() && !any_ramp_ && is_of_structure(qp, known);
}

/// That F and b were made at this point, whose first rows are known.
void HorizonProblem::remember(const Iterate& point, int first, const StageQp& qp, Recollection& known) const noexcept {
  known.changes = qp.changes();
  known.substeps = substeps_;
  known.intervals = intervals_;
  const std::ptrdiff_t entries = static_cast<std::ptrdiff_t>(intervals_ + 1 - first) * stride_;
  std::copy_n(point.row(first), entries, row(known.rows, first, stride_));
  if (keeps_curvature())
    std::copy_n(point.costate(0), static_cast<std::ptrdiff_t>(intervals_ + 1) * stride_, known.costates.data());
  std::copy_n(durations_.data(), intervals_, known.durations.data());
  std::copy_n(begins_.data(), static_cast<std::ptrdiff_t>(intervals_) * channels_, known.begins.data());
}

void HorizonProblem::take_foreseen(int i, const Iterate& point, StageQp& qp) const noexcept {
  std::copy_n(foreseen_.next.data(), nx_, qp.b(i));
  for (int r = 0; r < nx_; ++r)
    std::copy_n(foreseen_.jacobian.data() + r * row_, padded(nx_ + np_ + nu_), qp.F(i) + r * stride_);
  complete_dynamics({i, i}, point, false, qp);
  if (control_counts_[i] > nu_) place_started_channels(i, Hessian::gauss_newton, qp);
}

/// What is remembered goes on for one interval: with the last inputs, as a controller's plan is moved on.
void HorizonProblem::look_ahead(Recollection& known) const noexcept {
  const double* last = row(known.rows, intervals_ - 1, stride_);
  std::copy_n(last + capacity_.states, capacity_.controls, row(known.rows, intervals_, stride_) + capacity_.states);
  std::copy_n(row(known.costates, intervals_, stride_), stride_, row(known.costates, intervals_ + 1, stride_));
  known.durations[intervals_] = durations_[intervals_ - 1];
  std::fill_n(row(known.begins, intervals_, channels_), channels_, std::uint8_t{0});
  known.looks_ahead = true;
}

/// Does what `fill_stages` does, from a linearisation that may have been some stages earlier; only intervals that it
/// does not know are evaluated. The exact Hessian is complete afterwards, costs and all. False, with nothing done,
/// where most is not known.
bool HorizonProblem::move_along(const Iterate& point, Hessian hessian, StageQp& qp, Recollection& known,
                                std::span<double> scratch) const noexcept {
  constexpr int most_unknown = 8;
  const bool is_exact = hessian == Hessian::exact;
  if (known.changes != qp.changes() || (is_exact && !known.has_curvature)) return false;
  if (known.substeps != substeps_ || !is_direct() || any_ramp_ || qp.intervals() != known.intervals) return false;
  // As it was made.
  if (!is_exact && !has_late_bounds() && is_made_at(point, qp) && has_structure(qp, known) &&
      std::equal(durations_.begin(), durations_.begin() + intervals_, known.durations.begin()))
    return true;
  const auto is_state_at = [&](int node, int known_node, int size) {
    return std::memcmp(point.state(node), row(known.rows, known_node, stride_), size * sizeof(double)) == 0;
  };
  int steps = 0;
  while (steps < known.intervals && !is_state_at(0, steps, nx_)) ++steps;
  const int end = known.intervals - steps, count = std::min(intervals_, known.looks_ahead ? end + 1 : end);
  std::uint8_t* same = known.same.data();
  std::fill_n(same, intervals_ + 1, 0);
  program_kernels().match(point.row(0), row(known.rows, steps, stride_), known.rows.data(), count, stride_,
                          capacity_.states, same);
  if (count <= end) same[count] = is_state_at(count, count + steps, capacity_.states);
  std::uint8_t* same_costate = known.same_costate.data();
  if (is_exact)
    program_kernels().match(point.costate(1), row(known.costates, steps + 1, stride_), row(known.costates, 1, stride_),
                            count, stride_, nx_, same_costate);
  // Of the interval ahead, nobody has seen the next state.
  const auto is_known = [&](int i) {
    if (i >= count || same[i] != 2 || (i != end && same[i + 1] == 0) || (is_exact && same_costate[i] == 0))
      return false;
    if (durations_[i] != known.durations[i + steps]) return false;
    const std::uint8_t *begins = row(begins_, i, channels_), *known_begins = row(known.begins, i + steps, channels_);
    for (int c = 0; c < channels_; ++c)
      if (begins[c] != known_begins[c]) return false;
    return true;
  };

  std::array<int, most_unknown> unknown;
  int unknown_count = 0;
  for (int i = 0; i < intervals_; ++i) {
    if (is_known(i)) continue;
    if (unknown_count == most_unknown) return false;
    unknown[unknown_count++] = i;
  }
  const bool was_ahead = end < intervals_ && is_known(end);
  if (steps > 0) qp.drop_first(steps);
  // The last node stays the last one.
  if (steps > 0 && is_exact) std::copy_n(qp.H(end), known.ahead.size(), qp.H(known.intervals));
  // Stages that are known have their sizes.
  fill_sizes({intervals_, intervals_}, qp);
  for (int k = 0; k < unknown_count; ++k) fill_sizes({unknown[k], unknown[k]}, qp);
  if (was_ahead) fill_sizes({end, end}, qp);
  if (was_ahead) complete_dynamics({end, end}, point, false, qp);
  if (was_ahead && is_exact) {
    std::copy(known.ahead.begin(), known.ahead.end(), qp.H(end));
    add_cost({end, end}, point, hessian, Parts::matrices, qp, scratch);
  }
  for (int k = 0; k < unknown_count;) {
    StageRange together{unknown[k], unknown[k]};
    while (++k < unknown_count && unknown[k] == together.last + 1) ++together.last;
    if (!is_exact && together.first == together.last && has_foreseen(together.first, point, scratch.data())) {
      take_foreseen(together.first, point, qp);
      continue;
    }
    linearise_dynamics(together, point, {hessian, false, nullptr}, qp, scratch);
    if (is_exact) add_cost(together, point, hessian, Parts::matrices, qp, scratch);
  }
  if (is_exact && intervals_ != known.intervals)
    add_cost({intervals_, intervals_}, point, hessian, Parts::matrices, qp, scratch);
  fill_bounds(point, {0, intervals_}, qp);
  known.move_outputs(steps);
  remember(point, count, qp, known);
  known.looks_ahead = false;
  known.has_curvature = is_exact;
  return true;
}

/// Whether this is the interval that was foreseen; `room` is for a row.
bool HorizonProblem::has_foreseen(int i, const Iterate& point, double* room) const noexcept {
  if (foreseen_.duration != durations_[i]) return false;
  gather_rows(point, {i, i}, room);
  return std::equal(room, room + nx_ + np_ + nu_, foreseen_.z.begin());
}

}  // namespace rhec
