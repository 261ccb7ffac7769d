#include "dual_active_set.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rhec/core/stage_checks.hpp"
#include "tolerances.hpp"

namespace rhec::gn_rti {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
// A bound whose gradient is, to this part of its own curvature, one of the others' depends on them.
constexpr double dependence = 1e-10;
// Active bounds are met to this part of the tolerance for violated ones before a solution is taken.
constexpr double exactness = 0.1;
// With more violated at once there is little hope to be done within the changes that are provided for.
constexpr int max_violated = 2 * DualActiveSet::max_columns;
// Solutions with a set that does not change any more, before rounding is to blame.
constexpr int max_refinements = 4;

/// In four sums, none of which waits for the others.
double dot(const double* a, const double* b, int count) noexcept {
  double sums[4] = {};
  int k = 0;
  for (; k + 4 <= count; k += 4)
    for (int j = 0; j < 4; ++j) sums[j] += a[k + j] * b[k + j];
  for (; k < count; ++k) sums[0] += a[k] * b[k];
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

}  // namespace

void DualActiveSet::Bounded::set_bounds(double new_lower, double new_upper) noexcept {
  lower = new_lower;
  upper = new_upper;
  is_equality = gn_rti::is_equality(lower, upper);
  // Infinite bounds have no tolerance: infinity - infinity is not a number.
  least = lower == -infinity ? lower : lower - bound_tolerance * (1.0 + std::abs(lower));
  most = upper == infinity ? upper : upper + bound_tolerance * (1.0 + std::abs(upper));
}

DualActiveSet::DualActiveSet(const Capacity& capacity)
    : held_(capacity), claimed_(capacity), batch_(capacity), policy_step_(capacity) {
  const auto nodes = static_cast<std::size_t>(capacity.intervals) + 1;
  const std::size_t most = nodes * (capacity.states + capacity.controls);
  width_ = static_cast<std::ptrdiff_t>(most);
  bounded_.reserve(most);
  for (auto* v : {&value_, &direction_}) v->assign(most, 0.0);
  responses_.assign(slots * most, 0.0);
  owner_.assign(slots, none);
  columns_.reserve(max_columns);
  multipliers_.assign(max_columns, 0.0);
  factor_.assign(static_cast<std::size_t>(max_columns) * max_columns, 0.0);
  h_.assign(nodes * capacity.row(), 0.0);
}

/// Which variables have bounds; what these are, `take_bounds` says.
void DualActiveSet::collect(const StageQp& qp, const ActiveSet* claimed) noexcept {
  is_collected_ = true;
  bounded_.clear();
  const auto look_at = [&](int stage, int place, bool is_control) {
    const double lower = qp.lower(stage)[place], upper = qp.upper(stage)[place];
    if (lower == -infinity && upper == infinity) return;
    const std::int8_t side = claimed ? claimed->row(stage)[place] : std::int8_t{0};
    Hold hold = Hold::free;
    if (side != 0 && std::isfinite(side < 0 ? lower : upper)) {
      if (is_control) {
        hold = Hold::held;
        held_.row(stage)[place] = side;
      } else if (column_count() < max_columns) {
        hold = Hold::column;
        columns_.push_back(static_cast<int>(bounded_.size()));
      }
    }
    Bounded& v = bounded_.emplace_back();
    v.entry = {stage, place};
    v.at = static_cast<std::ptrdiff_t>(stage) * qp.stride() + place;
    v.is_control = is_control;
    v.hold = hold;
    v.side = side;
    v.slot = none;
  };
  const int first_control = qp.capacity().states;
  for (int i = 0; i <= qp.intervals(); ++i) {
    if (i > 0 || !qp.initial_state_is_given)
      for (int j = 0; j < qp.states(i); ++j) look_at(i, j, false);
    for (int j = 0; j < qp.controls(i); ++j) look_at(i, first_control + j, true);
  }
}

/// The bounds as they are now; false where one that is active has gone.
bool DualActiveSet::take_bounds(const StageQp& qp) noexcept {
  bool are_there = true;
  for (Bounded& v : bounded_) {
    v.set_bounds(qp.lower(0)[v.at], qp.upper(0)[v.at]);
    are_there = are_there && (v.hold == Hold::free || std::isfinite(v.bound()));
  }
  return are_there;
}

void DualActiveSet::factor(const StageQp& qp, Riccati& riccati) noexcept {
  riccati.factor(qp, held_);
  ++factorisations_;
  is_convex_ = !riccati.was_convexified();
  in_batch_ = 0;
  std::fill(owner_.begin(), owner_.end(), none);
  for (Bounded& v : bounded_) v.slot = none;
}

void DualActiveSet::prepare(const StageQp& qp, Riccati& riccati, const ActiveSet* claimed) noexcept {
  factorisations_ = 0;
  is_collected_ = false;
  held_.clear();
  columns_.clear();
  bounded_.clear();
  if (claimed) collect(qp, claimed);
  factor(qp, riccati);
}

/// Factorises anew without the held bounds that have been released; columns of controls are held from now on, and those
/// that are left have no responses yet.
bool DualActiveSet::refactor(const StageQp& qp, Riccati& riccati) noexcept {
  held_.clear();
  int kept = 0;
  for (int k = 0; k < column_count(); ++k) {
    Bounded& v = bounded_[columns_[k]];
    if (v.is_control) {
      v.hold = Hold::held;
      value_[columns_[k]] = multipliers_[k];
    } else {
      columns_[kept] = columns_[k];
      multipliers_[kept++] = multipliers_[k];
    }
  }
  columns_.resize(kept);
  for (const Bounded& v : bounded_)
    if (v.hold == Hold::held) held_.row(v.entry.stage)[v.entry.place] = v.side;
  factor(qp, riccati);
  return is_convex_;
}

/// Of one batch; slots of bounds that are not active are taken where there is no other.
bool DualActiveSet::find_responses(const StageQp& qp, Riccati& riccati, const int* which, int count,
                                   bool with_minimiser) noexcept {
  Riccati::Entry gradients[Riccati::Responses::size] = {};
  for (int c = 0; c < count; ++c) gradients[c] = bounded_[which[c]].entry;
  if (!riccati.respond(qp, held_, gradients, count, with_minimiser, batch_)) return false;
  in_batch_ = with_minimiser ? count : 0;
  std::copy_n(which, in_batch_, of_batch_.begin());
  double* rows[Riccati::Responses::size];
  int slot = 0;
  for (int c = 0; c < count; ++c, ++slot) {
    while (owner_[slot] != none && (bounded_[owner_[slot]].hold == Hold::column ||
                                    std::find(which, which + count, owner_[slot]) != which + count))
      ++slot;
    if (owner_[slot] != none) bounded_[owner_[slot]].slot = none;
    owner_[slot] = which[c];
    bounded_[which[c]].slot = slot;
    rows[c] = responses_.data() + slot * width_;
  }
  const double* of_batch = batch_.values.data();
  for (std::size_t b = 0; b < bounded_.size(); ++b) {
    const double* values = of_batch + bounded_[b].at * Riccati::Responses::size;
    for (int c = 0; c < count; ++c) rows[c][b] = values[c];
  }
  return true;
}

bool DualActiveSet::find_responses_of_columns(const StageQp& qp, Riccati& riccati, int first) noexcept {
  constexpr int batch = Riccati::Responses::size;
  for (; first < column_count(); first += batch)
    if (!find_responses(qp, riccati, columns_.data() + first, std::min(batch, column_count() - first), false))
      return false;
  return true;
}

/// Of the bound that is to be added, and in the same time of those that may be next: the most violated ones, or nearest
/// to being so.
bool DualActiveSet::find_responses_of_next(const StageQp& qp, Riccati& riccati, int entering) noexcept {
  // Without columns so far, a solution may come of this batch alone.
  const bool with_minimiser = column_count() == 0;
  const std::size_t room = Riccati::Responses::size - (with_minimiser ? 1 : 0);
  std::array<std::pair<double, int>, Riccati::Responses::size> next;
  std::size_t count = 0;
  next[count++] = {infinity, entering};
  for (int b = 0; b < static_cast<int>(bounded_.size()); ++b) {
    const Bounded& v = bounded_[b];
    if (v.hold != Hold::free || v.slot != none || b == entering) continue;
    const double violation = v.violation(value_[b]);
    if (count == room && violation <= next[count - 1].first) continue;
    if (count < room) ++count;
    std::size_t at = count - 1;
    for (; next[at - 1].first < violation; --at) next[at] = next[at - 1];
    next[at] = {violation, b};
  }
  std::array<int, Riccati::Responses::size> which{};
  std::transform(next.begin(), next.begin() + count, which.begin(), [](const auto& entry) { return entry.second; });
  return find_responses(qp, riccati, which.data(), static_cast<int>(count), with_minimiser);
}

/// The row of the factor that a bound would add below `count` others; returns the square of its diagonal entry, or 0
/// where it depends on them.
double DualActiveSet::eliminate(int entering, int count, double* row) const noexcept {
  const double* own = responses(entering);
  double left = -own[entering];
  const double least = dependence * left;
  for (int k = 0; k < count; ++k) {
    const double* above = factor_row(k);
    row[k] = (-own[columns_[k]] - dot(above, row, k)) * above[k];
    left -= row[k] * row[k];
  }
  return left > least && least > 0.0 ? left : 0.0;
}

/// x := L'^-1 x.
void DualActiveSet::back_substitute(double* x) const noexcept {
  for (int k = column_count() - 1; k >= 0; --k) {
    const double* row = factor_row(k);
    x[k] *= row[k];
    for (int l = 0; l < k; ++l) x[l] -= row[l] * x[k];
  }
}

/// The Cholesky factor of S from row `first` on, with reciprocals on its diagonal. Columns that depend on those before
/// are left out, or make this fail.
bool DualActiveSet::factor_columns(int first, bool may_leave_out) noexcept {
  int kept = first;
  for (int k = first; k < column_count(); ++k) {
    double* row = factor_row(kept);
    const double square = eliminate(columns_[k], kept, row);
    if (square == 0.0) {
      if (!may_leave_out) return false;
      bounded_[columns_[k]].hold = Hold::free;
      continue;
    }
    row[kept] = 1.0 / std::sqrt(square);
    columns_[kept] = columns_[k];
    multipliers_[kept++] = multipliers_[k];
  }
  columns_.resize(kept);
  return true;
}

void DualActiveSet::drop_column(int k) noexcept {
  bounded_[columns_[k]].hold = Hold::free;
  columns_.erase(columns_.begin() + k);
  std::copy(multipliers_.begin() + k + 1, multipliers_.begin() + column_count() + 1, multipliers_.begin() + k);
  // What is left of a positive definite system is no less so.
  factor_columns(k, true);
}

/// The minimiser for the held bounds and the multipliers of the columns, from the last batch; false where that does not
/// have all columns.
bool DualActiveSet::combine_batch(const StageQp& qp, Riccati& riccati, Iterate& step) noexcept {
  if (column_count() == 0 || column_count() > in_batch_) return false;
  alignas(64) double weights[Riccati::Responses::size] = {};
  weights[Riccati::Responses::size - 1] = 1.0;
  for (int k = 0; k < column_count(); ++k) {
    const auto found = std::find(of_batch_.begin(), of_batch_.begin() + in_batch_, columns_[k]) - of_batch_.begin();
    if (found == in_batch_) return false;
    weights[found] = multipliers_[k];
  }
  riccati.combine(qp, held_, batch_, weights, step);
  has_policy_ = false;
  return true;
}

/// The same by the factorisation; false where there is none.
bool DualActiveSet::solve_with_multipliers(const StageQp& qp, Riccati& riccati, Iterate& step) noexcept {
  const double* h = nullptr;
  if (column_count() > 0) {
    std::copy_n(qp.h(0), static_cast<std::ptrdiff_t>(qp.intervals() + 1) * qp.stride(), h_.begin());
    for (int k = 0; k < column_count(); ++k) h_[bounded_[columns_[k]].at] += multipliers_[k];
    h = h_.data();
  }
  has_policy_ = true;
  return riccati.solve(qp, held_, step, h) == Riccati::Outcome::done;
}

/// After a factorisation: responses of all columns, and the values with the multipliers that meet their bounds, in the
/// time of a solution where one batch has room for all.
bool DualActiveSet::begin_with_columns(const StageQp& qp, Riccati& riccati) noexcept {
  constexpr int minimiser = Riccati::Responses::size - 1;
  const int first = std::min(column_count(), minimiser);
  if (!find_responses(qp, riccati, columns_.data(), first, true)) return false;
  for (std::size_t b = 0; b < bounded_.size(); ++b)
    value_[b] = batch_.values[bounded_[b].at * Riccati::Responses::size + minimiser];
  if (!find_responses_of_columns(qp, riccati, first)) return false;
  factor_columns(0, true);
  std::fill(multipliers_.begin(), multipliers_.end(), 0.0);
  return_to_bounds();
  return true;
}

void DualActiveSet::complete_policy(const StageQp& qp, Riccati& riccati) noexcept {
  if (!has_policy_) solve_with_multipliers(qp, riccati, policy_step_);
}

/// By how much the bound of a column is missed, relative to what a bound may be violated by.
double DualActiveSet::largest_miss() const noexcept {
  double largest = 0.0;
  for (const int b : columns_) {
    const double bound = bounded_[b].bound();
    largest = std::max(largest, std::abs(value_[b] - bound) / (bound_tolerance * (1.0 + std::abs(bound))));
  }
  return largest;
}

/// Moves the multipliers of the columns so that their bounds are met.
void DualActiveSet::return_to_bounds() noexcept {
  double change[max_columns];
  const int count = column_count();
  for (int k = 0; k < count; ++k) {
    const double* row = factor_row(k);
    change[k] = (value_[columns_[k]] - bounded_[columns_[k]].bound() - dot(row, change, k)) * row[k];
  }
  back_substitute(change);
  for (int k = 0; k < count; ++k) {
    const double* response = responses(columns_[k]);
    multipliers_[k] += change[k];
    for (std::size_t b = 0; b < bounded_.size(); ++b) value_[b] += change[k] * response[b];
  }
}

bool DualActiveSet::drop_wrong_columns() noexcept {
  bool any = false;
  for (int k = column_count() - 1; k >= 0; --k) {
    const Bounded& v = bounded_[columns_[k]];
    if (v.is_equality || v.side * multipliers_[k] >= -pull_tolerance_) continue;
    const double* response = responses(columns_[k]);
    for (std::size_t b = 0; b < bounded_.size(); ++b) value_[b] -= multipliers_[k] * response[b];
    drop_column(k);
    any = true;
    ++changes_;
  }
  return any;
}

bool DualActiveSet::release_wrong_held() noexcept {
  bool any = false;
  for (std::size_t b = 0; b < bounded_.size(); ++b) {
    Bounded& v = bounded_[b];
    if (v.hold != Hold::held || v.is_equality || v.side * value_[b] >= -pull_tolerance_) continue;
    v.hold = Hold::free;
    any = true;
    ++changes_;
  }
  return any;
}

/// Makes the set dual feasible; true where that takes another factorisation.
bool DualActiveSet::drop_wrong() noexcept {
  while (drop_wrong_columns()) return_to_bounds();
  return release_wrong_held();
}

int DualActiveSet::most_violated() const noexcept {
  int worst = none;
  double most = 0.0;
  for (std::size_t b = 0; b < bounded_.size(); ++b) {
    if (bounded_[b].hold != Hold::free) continue;
    const double violation = bounded_[b].violation(value_[b]);
    if (violation > most) most = violation, worst = static_cast<int>(b);
  }
  return worst;
}

int DualActiveSet::count_violated() const noexcept {
  int count = 0;
  for (std::size_t b = 0; b < bounded_.size(); ++b)
    count += bounded_[b].hold == Hold::free && bounded_[b].violation(value_[b]) > 0.0;
  return count;
}

/// All violated bounds of controls that have responses become columns at once: those are mostly right. Not so with
/// states, of which one bound often keeps a whole run.
bool DualActiveSet::add_controls_together(const StageQp& qp, Riccati& riccati, int worst) noexcept {
  if (bounded_[worst].slot == none && !find_responses_of_next(qp, riccati, worst)) return false;
  for (int b = 0; b < static_cast<int>(bounded_.size()) && column_count() < max_columns; ++b) {
    Bounded& v = bounded_[b];
    if (!v.is_control || v.hold != Hold::free || v.slot == none || !(v.violation(value_[b]) > 0.0)) continue;
    const int count = column_count();
    const double square = eliminate(b, count, factor_row(count));
    if (square == 0.0) continue;
    v.side = value_[b] < v.lower ? std::int8_t{-1} : std::int8_t{1};
    append_column(b, square, 0.0);
    ++changes_;
  }
  return_to_bounds();
  return true;
}

/// The row of the factor is there but for its diagonal.
void DualActiveSet::append_column(int which, double square, double multiplier) noexcept {
  const int count = column_count();
  bounded_[which].hold = Hold::column;
  columns_.push_back(which);
  multipliers_[count] = multiplier;
  factor_row(count)[count] = 1.0 / std::sqrt(square);
}

DualActiveSet::Outcome DualActiveSet::add(const StageQp& qp, Riccati& riccati, int entering,
                                          Clock::time_point deadline) noexcept {
  Bounded& v = bounded_[entering];
  v.side = value_[entering] < v.lower ? std::int8_t{-1} : std::int8_t{1};
  double multiplier = 0.0;
  for (;;) {
    if (++changes_ > max_changes) return Outcome::too_much;
    if (is_past(deadline)) return Outcome::out_of_time;
    if (v.slot == none && !find_responses_of_next(qp, riccati, entering)) return Outcome::too_much;
    // How values and multipliers change while that of the entering bound grows and the active ones stay met.
    const int count = column_count();
    double pull[max_columns], row[max_columns];
    const double square = eliminate(entering, count, row);
    std::copy_n(row, count, pull);
    back_substitute(pull);
    const std::size_t size = bounded_.size();
    const double* own = responses(entering);
    for (std::size_t b = 0; b < size; ++b) direction_[b] = v.side * own[b];
    for (int k = 0; k < count; ++k) {
      pull[k] *= v.side;
      const double* response = responses(columns_[k]);
      for (std::size_t b = 0; b < size; ++b) direction_[b] -= pull[k] * response[b];
    }
    // Until its bound is met, or a multiplier has gone.
    double length = square > 0.0 ? v.side * (value_[entering] - v.bound()) / square : infinity;
    int blocking_column = none, blocking_held = none;
    for (int k = 0; k < count; ++k) {
      const Bounded& other = bounded_[columns_[k]];
      const double loss = other.side * pull[k];
      if (other.is_equality || !(loss > 0.0)) continue;
      const double until = std::max(other.side * multipliers_[k], 0.0) / loss;
      if (until < length) length = until, blocking_column = k;
    }
    for (std::size_t b = 0; b < size; ++b) {
      const Bounded& other = bounded_[b];
      if (other.hold != Hold::held || other.is_equality) continue;
      const double loss = -other.side * direction_[b];
      if (!(loss > 0.0)) continue;
      const double until = std::max(other.side * value_[b], 0.0) / loss;
      if (until < length) length = until, blocking_held = static_cast<int>(b);
    }
    if (length == infinity) return Outcome::no_solution;
    multiplier += v.side * length;
    for (int k = 0; k < count; ++k) multipliers_[k] -= length * pull[k];
    for (std::size_t b = 0; b < size; ++b) value_[b] += length * direction_[b];
    if (blocking_held != none) {
      bounded_[blocking_held].hold = Hold::free;
      value_[blocking_held] = bounded_[blocking_held].bound();
      if (!refactor(qp, riccati)) return Outcome::not_convex;
      if (!find_responses_of_columns(qp, riccati, 0) || !factor_columns(0, false)) return Outcome::too_much;
    } else if (blocking_column != none) {
      drop_column(blocking_column);
    } else {
      if (count == max_columns) return Outcome::too_much;
      value_[entering] = v.bound();
      std::copy_n(row, count, factor_row(count));
      append_column(entering, square, multiplier);
      return Outcome::solved;
    }
  }
}

/// Where the present multipliers lead: after a factorisation with columns to values alone, otherwise to a step.
DualActiveSet::Found DualActiveSet::find_values(const StageQp& qp, Riccati& riccati, Iterate& step) noexcept {
  if (column_count() > 0 && bounded_[columns_[0]].slot == none)
    return begin_with_columns(qp, riccati) ? Found::values : Found::nothing;
  if (!combine_batch(qp, riccati, step) && !solve_with_multipliers(qp, riccati, step)) return Found::nothing;
  const StepCheck check = check_step(qp, step, bound_tolerance);
  if (!check.is_finite) return Found::nothing;
  pull_tolerance_ = multiplier_tolerance * (1.0 + check.largest_costate);
  if (!is_collected_) {
    if (!check.violates) return Found::step;
    collect(qp, nullptr);
    take_bounds(qp);
  }
  for (std::size_t b = 0; b < bounded_.size(); ++b) {
    const Bounded& v = bounded_[b];
    value_[b] = (v.hold == Hold::held ? step.bound_row(0) : step.row(0))[v.at];
  }
  if (largest_miss() <= exactness) return check.violates ? Found::values : Found::step;
  return_to_bounds();
  return Found::values;
}

DualActiveSet::Outcome DualActiveSet::solve(const StageQp& qp, Riccati& riccati, ActiveSet& active, Iterate& step,
                                            Clock::time_point deadline) noexcept {
  if (!take_bounds(qp)) {
    claimed_ = active;
    prepare(qp, riccati, &claimed_);
    take_bounds(qp);
  }
  changes_ = 0;
  pull_tolerance_ = multiplier_tolerance;
  bool may_add_together = true;
  for (int refinements = 0; refinements < max_refinements; ++refinements) {
    if (!is_convex_) return Outcome::not_convex;
    const int changes_before = changes_;
    const Found found = find_values(qp, riccati, step);
    if (found == Found::nothing) return Outcome::too_much;
    if (count_violated() > max_violated) return Outcome::too_much;
    bool needs_factor = drop_wrong();
    int worst = most_violated();
    if (!needs_factor && may_add_together && worst != none) {
      may_add_together = false;
      if (!add_controls_together(qp, riccati, worst)) return Outcome::too_much;
      needs_factor = drop_wrong();
      worst = most_violated();
    }
    if (needs_factor) {
      if (changes_ > max_changes) return Outcome::too_much;
      if (is_past(deadline)) return Outcome::out_of_time;
      if (!refactor(qp, riccati)) return Outcome::not_convex;
    }
    for (; !needs_factor && worst != none; worst = most_violated())
      if (const Outcome outcome = add(qp, riccati, worst, deadline); outcome != Outcome::solved) return outcome;
    if (needs_factor || changes_ > changes_before) {
      refinements = 0;
    } else if (found == Found::step) {
      write(active, step);
      return Outcome::solved;
    }
  }
  return Outcome::too_much;
}

void DualActiveSet::write(ActiveSet& active, Iterate& step) const noexcept {
  active.clear();
  for (const Bounded& v : bounded_)
    if (v.hold != Hold::free) active.row(v.entry.stage)[v.entry.place] = v.side;
  for (int k = 0; k < column_count(); ++k) step.bound_row(0)[bounded_[columns_[k]].at] = multipliers_[k];
}

}  // namespace rhec::gn_rti
