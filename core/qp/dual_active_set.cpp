#include "rhec/core/qp/dual_active_set.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/qp/stage_checks.hpp"
#include "sensitivity_sums.hpp"
#include "tolerances.hpp"

namespace rhec {
namespace {

// A solution is accepted if active bounds are met to within this fraction of the tolerance for violations. Of QPs that
// were convexified, whose columns are nearly dependent, rounding leaves a tenth or two.
constexpr double exactness = 0.5;
// With more violated bounds, the allowed number of changes is unlikely to suffice.
constexpr int violated_for_each_column = 2;
// So many of a batch of sensitivities are for bounds that are likely to be active, the others for those that are
// violated.
constexpr int most_foreseen = 6;
// Claims that all become columns with limits: two batches, where a wrong one that is held takes a factorisation and a
// batch more.
constexpr int few_claims = 2 * Riccati::Sensitivities::size;
// Places that a batch keeps for bounds that enter when columns of controls are chosen.
constexpr int few_entering = 3;
// Number of solutions with an unchanged active set before rounding errors are assumed, and how many of them are
// combined from sensitivities.
constexpr int max_refinements = 4, max_combined = 2;
// With limits the interior-point method, which comes next, takes as long as some hundred of them. Before, columns of
// controls are held.
constexpr int max_refinements_with_limits = 8, refinements_before_holding = 3;
// A miss of which a refinement leaves more than this share is rounding.
constexpr double less = 0.5;
// Where each QP has to be cheap, a miss that is corrected by sensitivities alone.
constexpr double small_miss = 100.0;
// With limits, what refinement may leave of the misses: where rounding prevents more, the interior-point method gets no
// further either, and takes a hundred times as long.
constexpr double rounding = 10.0;

}  // namespace

DualActiveSet::DualActiveSet(const Capacity& capacity)
    : states_(capacity.states),
      stride_(capacity.row()),
      limit_row_(capacity.limit_row()),
      most_columns_(capacity.limits > 0 ? max_columns_with_limits : max_columns),
      batch_count_(most_columns_ / batch_size + 1),
      most_changes_(capacity.limits > 0 ? max_changes_with_limits : max_changes),
      has_limits_(capacity.limits > 0),
      held_(capacity),
      claimed_(capacity),
      policy_step_(capacity) {
  const std::size_t stages = static_cast<std::size_t>(capacity.intervals) + 1;
  const std::size_t most = stages * (capacity.row() + capacity.limit_row());
  if (has_limits_) {
    for (auto* v : {&own_lower_, &own_upper_}) v->assign(most, 0.0);
    rows_.assign(stages * capacity.limits * stride_, 0.0);
    for (auto* v : {&linear_, &softness_}) v->assign(stages * capacity.limit_row(), 0.0);
    relaxed_.assign(most, 0);
    saturated_.reserve(stages * capacity.limits);
  }
  for (auto* v : {&value_, &violation_, &least_, &most_, &h_}) v->assign(most, 0.0);
  largest_.assign(most / 8 + 1, 0.0);
  hold_.assign(most, Hold::free);
  side_.assign(most, 0);
  number_.assign(most, none);
  held_places_.reserve(most);
  batches_.resize(batch_count_);
  for (Batch& batch : batches_) batch.sensitivities = Riccati::Sensitivities(capacity);
  for (auto* places : {&columns_, &base_places_}) places->reserve(most_columns_);
  for (auto* v : {&multipliers_, &base_multipliers_}) v->assign(most_columns_, 0.0);
  factor_.assign(static_cast<std::size_t>(most_columns_) * most_columns_, 0.0);
}

bool DualActiveSet::is_equality_bound(int place) const noexcept {
  return is_equality(lower_[place], upper_[place]) && !is_soft(place);
}

/// Makes a bound inactive. Its widened bounds are set by `take_bounds`, or here.
void DualActiveSet::let_go(int place) noexcept {
  hold_[place] = Hold::free;
  if (has_limits_) relaxed_[place] = 0;
  if (!has_bounds_) return;
  least_[place] = lower_[place] - bound_tolerance * (1.0 + std::abs(lower_[place]));
  most_[place] = upper_[place] + bound_tolerance * (1.0 + std::abs(upper_[place]));
}

void DualActiveSet::take_claims(const StageQp& qp, const ActiveSet& claimed) noexcept {
  claimed.for_each([&](int stage, int j, std::int8_t side) {
    if (stage > qp.intervals() || !std::isfinite((side < 0 ? qp.lower(stage) : qp.upper(stage))[j])) return;
    const bool is_given = stage == 0 && qp.initial_state_is_given;
    if (j < states_ ? is_given || j >= qp.states(stage) : j >= states_ + qp.controls(stage)) return;
    const int place = stage * stride_ + j;
    if (j >= states_) {
      hold_[place] = Hold::held;
      held_.row(stage)[j] = side;
      held_places_.push_back(place);
    } else if (column_count() < most_columns_) {
      hold_[place] = Hold::column;
      multipliers_[column_count()] = 0.0;
      columns_.push_back(place);
    }
    side_[place] = side;
  });
  if (has_limits_) take_limit_claims(qp, claimed);
}

/// Reads the present bounds; false if an active one no longer exists.
bool DualActiveSet::take_bounds(const StageQp& qp) noexcept {
  has_bounds_ = true;
  lower_ = qp.lower(0);
  upper_ = qp.upper(0);
  bool are_there = !has_limits_ || take_limits(qp);
  widen_bounds(lower_, upper_, bound_tolerance, all_places_, least_.data(), most_.data());
  const auto leave_out = [&](int place) {
    least_[place] = -infinity;
    most_[place] = infinity;
  };
  for (const auto* places : {&held_places_, &columns_}) {
    for (const int place : *places) {
      leave_out(place);
      are_there = are_there && std::isfinite(bound(place));
    }
  }
  for (int j = 0; qp.initial_state_is_given && j < states_; ++j) leave_out(j);
  for (int i = 0; has_limits_ && i <= qp.intervals(); ++i)
    for (int r = qp.limits(i); r < limit_row_; ++r) leave_out(limit_place(i, r));
  for (const int place : saturated_) saturate(place);
  return are_there;
}

void DualActiveSet::factor(const StageQp& qp, Riccati& riccati) noexcept {
  if (has_limits_) {
    is_convex_ = riccati.factor_if_convex(qp, held_);
  } else {
    riccati.factor(qp, held_);
    is_convex_ = !riccati.was_convexified();
  }
  ++factorisations_;
  forget_factorisation();
}

void DualActiveSet::forget_factorisation() noexcept {
  has_base_ = false;
  for (Batch& batch : batches_) {
    for (int c = 0; c < batch.count; ++c) number_[batch.of[c]] = none;
    batch.count = 0;
  }
}

/// Makes columns of the held claims: of all, or of those at the ends of sequences.
void DualActiveSet::loosen_claims(const StageQp& qp, const ActiveSet& claimed, bool all) noexcept {
  std::erase_if(held_places_, [&](int place) {
    const int stage = place / stride_, j = place % stride_;
    const auto goes_on = [&](int other) {
      return other < 0 || other >= qp.intervals() || claimed.row(other)[j] == side_[place];
    };
    if (!all && (column_count() == most_foreseen || (goes_on(stage - 1) && goes_on(stage + 1)))) return false;
    held_.row(stage)[j] = 0;
    hold_[place] = Hold::column;
    multipliers_[column_count()] = 0.0;
    columns_.push_back(place);
    return true;
  });
}

/// Holds the columns from the given one on.
void DualActiveSet::hold_claims(int first) noexcept {
  for (int k = first; k < column_count(); ++k) {
    const int place = columns_[k];
    hold_[place] = Hold::held;
    held_places_.push_back(place);
    held_.row(place / stride_)[place % stride_] = side_[place];
  }
  columns_.resize(first);
}

void DualActiveSet::prepare(const StageQp& qp, Riccati& riccati, const ActiveSet* claimed, bool is_factored) noexcept {
  factorisations_ = 0;
  has_bounds_ = false;
  for (const auto* places : {&held_places_, &columns_, &saturated_})
    for (const int place : *places) let_go(place);
  held_.clear();
  held_places_.clear();
  columns_.clear();
  saturated_.clear();
  places_ = (qp.intervals() + 1) * stride_;
  all_places_ = places_ + (qp.intervals() + 1) * limit_row_;
  if (claimed) take_claims(qp, *claimed);
  // Where sensitivities are needed anyway, held bounds become columns as far as two batches have room for them: a
  // column is dropped without another factorisation. If there are more, or the QP is convex only with some of them
  // held, then the ends of a sequence of active bounds, which are dropped more often than those between.
  const int first_end = column_count(), claims = first_end + static_cast<int>(held_places_.size());
  const bool may_loosen = has_limits_ && first_end > 0 && first_end < batch_size && !held_places_.empty();
  const bool are_few = claims <= few_claims;
  if (may_loosen) loosen_claims(qp, *claimed, are_few);
  if (is_factored && held_places_.empty()) {
    is_convex_ = true;
    forget_factorisation();
  } else {
    factor(qp, riccati);
  }
  if (!is_convex_ && may_loosen && are_few && claims > batch_size) {
    hold_claims(first_end);
    loosen_claims(qp, *claimed, false);
    factor(qp, riccati);
  }
  needs_all_held_ = !is_convex_ && column_count() > first_end;
  if (needs_all_held_) {
    hold_claims(first_end);
    factor(qp, riccati);
  }
  if (has_limits_) keep_rows(qp);
  if (!claimed || !is_convex_) return;
  // Where rows change with the newest data, their sensitivities are not worth finding before.
  const auto is_of_row = [this](int place) { return is_limit(place); };
  if (rows_change_ && std::any_of(columns_.begin(), columns_.end(), is_of_row)) return;
  if (!take_bounds(qp)) return;
  // Claims are mostly those of the last sample, and in control further bounds are likely to follow: those to which the
  // last trajectory came closest.
  if (qp.initial_state_is_given && column_count() < batch_size) {
    std::fill_n(value_.data(), all_places_, 0.0);
    find_violations();
    find_sensitivities_of_next(qp, riccati, columns_.data(), column_count(), -infinity);
  } else {
    find_sensitivities_of_columns(qp, riccati, false);
  }
  has_bounds_ = false;
}

/// Factorises anew without the released bounds. Columns of controls are held from now on, but for those that are likely
/// to be released next (for which `violation_` is smallest), as far as they get their sensitivities together with the
/// columns that remain. These have no sensitivities yet.
bool DualActiveSet::refactor(const StageQp& qp, Riccati& riccati) noexcept {
  held_.clear();
  int kept = 0;
  for (int k = 0; k < column_count(); ++k) {
    const int place = columns_[k];
    if (is_control(place)) {
      hold_[place] = Hold::held;
      held_places_.push_back(place);
      value_[place] = multipliers_[k];
    } else {
      columns_[kept] = place;
      multipliers_[kept++] = multipliers_[k];
    }
  }
  columns_.resize(kept);
  const int used = (kept + few_entering) % batch_size, room = used > 0 ? batch_size - used : 0;
  const auto is_sooner = [this](int a, int b) { return violation_[a] < violation_[b]; };
  if (has_limits_ && room > 0 && kept + room <= most_columns_)
    std::sort(held_places_.begin(), held_places_.end(), is_sooner);
  int loose = 0;
  for (const int place : held_places_) {
    if (!has_limits_ || loose == room || kept + room > most_columns_ || !(violation_[place] < infinity) ||
        is_equality_bound(place))
      break;
    hold_[place] = Hold::column;
    multipliers_[column_count()] = value_[place];
    columns_.push_back(place);
    value_[place] = bound(place);
    ++loose;
  }
  held_places_.erase(held_places_.begin(), held_places_.begin() + loose);
  for (const auto* places : {&held_places_, &columns_})
    for (const int place : *places) violation_[place] = -infinity;
  for (const int place : held_places_) held_.row(place / stride_)[place % stride_] = side_[place];
  factor(qp, riccati);
  if (is_convex_ || loose == 0) return is_convex_;
  for (int k = kept; k < column_count(); ++k) {
    const int place = columns_[k];
    hold_[place] = Hold::held;
    held_places_.push_back(place);
    value_[place] = multipliers_[k];
    held_.row(place / stride_)[place % stride_] = side_[place];
  }
  columns_.resize(kept);
  factor(qp, riccati);
  return is_convex_;
}

/// Updates a step from the multipliers with which it was found to the present ones; false if some have no
/// sensitivities.
bool DualActiveSet::combine(const StageQp& qp, Riccati& riccati, Iterate& step) noexcept {
  if (has_limits_ || !has_base_) return false;
  const auto has_sensitivities = [this](int place) { return number_[place] != none; };
  if (!std::all_of(columns_.begin(), columns_.end(), has_sensitivities) ||
      !std::all_of(base_places_.begin(), base_places_.end(), has_sensitivities))
    return false;
  Weights weights{};
  for (int k = 0; k < column_count(); ++k) weight_of(columns_[k], weights) += multipliers_[k];
  for (std::size_t k = 0; k < base_places_.size(); ++k) weight_of(base_places_[k], weights) -= base_multipliers_[k];
  for_each_weighted(weights,
                    [&](int k) { riccati.combine(qp, held_, batches_[k].sensitivities, weights[k].data(), step); });
  has_policy_ = false;
  return true;
}

/// The minimiser for the held bounds and the multipliers of the columns, from the factorisation; false if there is
/// none.
bool DualActiveSet::solve_with_multipliers(const StageQp& qp, Riccati& riccati, Iterate& step) noexcept {
  const double* h = nullptr;
  if (column_count() > 0 || !saturated_.empty()) {
    std::copy_n(qp.h(0), places_, h_.begin());
    for (int k = 0; k < column_count(); ++k)
      if (!is_limit(columns_[k])) h_[columns_[k]] += multipliers_[k];
    if (has_limits_) add_limit_gradients(qp);
    h = h_.data();
  }
  has_policy_ = true;
  return riccati.solve(qp, held_, step, h) == Riccati::Outcome::done;
}

void DualActiveSet::complete_policy(const StageQp& qp, Riccati& riccati) noexcept {
  if (!has_policy_) solve_with_multipliers(qp, riccati, policy_step_);
}

/// The largest distance of a column from its bound, relative to the tolerance for violations.
double DualActiveSet::largest_miss() const noexcept {
  double largest = 0.0;
  for (int k = 0; k < column_count(); ++k) {
    const int place = columns_[k];
    largest = std::max(largest, std::abs(value_[place] - target(place, multipliers_[k])) /
                                    (bound_tolerance * (1.0 + std::abs(bound(place)))));
  }
  return largest;
}

/// Drops a column and changes the multipliers of the others so that their bounds stay met: along the column of the
/// inverse of S that belongs to it, until its own multiplier is zero.
void DualActiveSet::release_column(int k, Weights& weights) noexcept {
  const int count = column_count();
  double direction[max_columns_with_limits];
  std::fill_n(direction, k, 0.0);
  direction[k] = factor_row(k)[k];
  for (int l = k + 1; l < count; ++l) {
    const double* row = factor_row(l);
    direction[l] = -dot(row + k, direction + k, l - k) * row[l];
  }
  back_substitute(direction);
  const double length = multipliers_[k] / direction[k];
  for (int l = 0; l < count; ++l) {
    const double change = -length * direction[l];
    weight_of(columns_[l], weights) += change;
    multipliers_[l] += change;
  }
  drop_column(k);
}

/// How far a column's multiplier is out of its range.
double DualActiveSet::excess_of(int place, double multiplier) const noexcept {
  if (is_equality_bound(place)) return 0.0;
  const double size = side_[place] * multiplier;
  if (!has_limits_ || !is_soft(place)) return -size;
  return relaxed_[place] != 0 ? linear(place) - size : std::max(-size, size - linear(place));
}

/// Corrects the column that is most wrong, and the multipliers of the others, until none is: where one was the reason
/// for others, these stay. Values of all places follow at the end, also of changes that are pending.
void DualActiveSet::drop_wrong_columns(const Riccati& riccati) noexcept {
  const int first_count = column_count(), changes_before = changes_;
  int first_columns[max_columns_with_limits];
  double first_values[max_columns_with_limits];
  for (int k = 0; k < first_count; ++k) {
    first_columns[k] = columns_[k];
    first_values[k] = value_[columns_[k]];
    if (has_pending_) value_[columns_[k]] = target(columns_[k], multipliers_[k]);
  }
  Weights& weights = pending_;
  // By how much the objective would change, about.
  const auto find_worst = [&] {
    int worst = none;
    double largest = 0.0;
    for (int k = 0; k < column_count(); ++k) {
      const int place = columns_[k];
      const double excess = excess_of(place, multipliers_[k]);
      if (excess <= pull_tolerance_) continue;
      const double gain = excess * excess * -sensitivity(place, place);
      if (worst == none || gain > largest) worst = k, largest = gain;
    }
    return worst;
  };
  for (int worst = find_worst(); worst != none; worst = find_worst()) {
    const int place = columns_[worst];
    if (has_limits_ && !is_soft(place)) {
      release_column(worst, weights);
      ++changes_;
      continue;
    }
    Weights weight{};
    if (has_limits_) {
      if (!correct_soft_column(worst, weight)) break;
    } else {
      weight_of(place, weight) = -multipliers_[worst];
      drop_column(worst);
    }
    ++changes_;
    const double change = weight_of(place, weight);
    weight_of(place, weights) += change;
    for (const int column : columns_) value_[column] += change * sensitivity(place, column);
    double changes[max_columns_with_limits];
    const int count = column_count();
    for (int k = 0; k < count; ++k) {
      const double* row = factor_row(k);
      changes[k] = (value_[columns_[k]] - target(columns_[k], multipliers_[k]) - dot(row, changes, k)) * row[k];
    }
    back_substitute(changes);
    for (int k = 0; k < count; ++k) {
      multipliers_[k] += changes[k];
      weight_of(columns_[k], weights) += changes[k];
      value_[columns_[k]] = target(columns_[k], multipliers_[k]);
    }
  }
  if (changes_ == changes_before && !has_pending_) return;
  for (int k = 0; k < first_count; ++k) value_[first_columns[k]] = first_values[k];
  has_pending_ = true;
  write_pending(riccati);
}

bool DualActiveSet::release_wrong_held() noexcept {
  return std::erase_if(held_places_, [this](int place) {
           if (side_[place] * value_[place] >= -pull_tolerance_ || is_equality_bound(place)) return false;
           let_go(place);
           ++changes_;
           return true;
         }) > 0;
}

/// Makes the active set dual feasible; true if this needs another factorisation.
bool DualActiveSet::drop_wrong(const Riccati& riccati) noexcept {
  drop_wrong_columns(riccati);
  return release_wrong_held();
}

/// Violations of the bounds that are not active.
DualActiveSet::Violations DualActiveSet::find_violations() noexcept {
  const auto [largest, count] =
      rhec::find_violations(value_.data(), least_.data(), most_.data(), all_places_, violation_.data());
  if (count == 0) return {};
  const auto worst = std::find(violation_.begin(), violation_.begin() + all_places_, largest);
  return {static_cast<int>(worst - violation_.begin()), count};
}

/// Makes columns of all violated bounds of controls that have sensitivities: most of these will be active. This does
/// not hold for states, where a single active bound often prevents a series of violations.
bool DualActiveSet::add_controls_together(const StageQp& qp, Riccati& riccati, int worst) noexcept {
  if (number_[worst] == none && !find_sensitivities_of_next(qp, riccati, &worst, 1, -infinity)) return false;
  for (const Batch& batch : batches_) {
    for (int c = 0; c < batch.count && column_count() < most_columns_; ++c) {
      const int place = batch.of[c];
      if (!is_control(place) || hold_[place] != Hold::free || number_[place] == none || !(violation_[place] > 0.0))
        continue;
      const int count = column_count();
      const double square = eliminate(place, count, factor_row(count));
      if (square == 0.0) continue;
      side_[place] = value_[place] < lower_[place] ? std::int8_t{-1} : std::int8_t{1};
      append_column(place, square, 0.0);
      ++changes_;
    }
  }
  return_to_bounds();
  if (!has_limits_) write_pending(riccati);
  return true;
}

/// The row of the factor is complete except for its diagonal.
void DualActiveSet::append_column(int place, double square, double multiplier) noexcept {
  const int count = column_count();
  hold_[place] = Hold::column;
  least_[place] = -infinity;
  most_[place] = infinity;
  columns_.push_back(place);
  multipliers_[count] = multiplier;
  factor_row(count)[count] = 1.0 / std::sqrt(square);
}

/// Adds a violated bound and, with limits, those of the bounds with sensitivities that are violated then.
DualActiveSet::Outcome DualActiveSet::add(const StageQp& qp, Riccati& riccati, int entering,
                                          Clock::time_point deadline) noexcept {
  // Values change with the multipliers, but only few of them are needed before the entering bound is met.
  Weights changes{}, direction;
  bool has_changes = false;
  int used = 0;         // batches from there on are empty
  GatheredPlaces near;  // bounds with sensitivities, then held ones, with limits
  int others = 0;       // those with sensitivities
  int entering_at = 0;  // of them
  bool is_gathered = false, are_held_gathered = false;
  const auto count_used = [&] {
    used = batch_count_;
    while (used > 0 && batches_[used - 1].count == 0) --used;
    is_gathered = are_held_gathered = false;
  };
  count_used();
  const auto sum_at = [&](const Weights& weights, int place) {
    double sum = 0.0;
    for (int k = 0; k < used; ++k)
      if (batches_[k].count > 0) sum += dot(weights[k].data(), sensitivities_at(k, place), batch_size);
    return sum;
  };
  const auto value_of = [&](int place) { return has_changes ? value_[place] + sum_at(changes, place) : value_[place]; };
  const auto write_values = [&] {
    if (has_changes) add_sensitivities(riccati, changes, value_);
    has_changes = false;
    changes = {};
  };
  // The multiplier grows towards the violated side; that of a saturated limit which is no longer violated shrinks.
  bool was_saturated = false, is_capped = false;
  int side = 0;
  double multiplier = 0.0;
  const auto enter = [&](double value) {
    was_saturated = hold_[entering] == Hold::saturated;
    is_capped = has_limits_ && is_soft(entering);
    side = was_saturated ? -side_[entering] : value < lower_[entering] ? -1 : 1;
    multiplier = 0.0;
    if (was_saturated) {
      std::erase(saturated_, entering);
      multiplier = side_[entering] * linear(entering);
    } else {
      side_[entering] = static_cast<std::int8_t>(side);
      if (is_capped && linear(entering) == 0.0) relaxed_[entering] = 1;
    }
  };
  const auto gather = [&] {
    if (!has_limits_ || is_gathered || used > GatheredPlaces::most_batches) return;
    near.clear();
    for (int k = 0; k < used; ++k)
      for (int c = 0; c < batches_[k].count; ++c)
        if (const int place = batches_[k].of[c]; number_[place] == k * batch_size + c) near.add(place);
    others = near.count();
    entering_at = 0;
    while (near.place(entering_at) != entering) ++entering_at;
    are_held_gathered = others + static_cast<int>(held_places_.size()) <= GatheredPlaces::most;
    if (are_held_gathered)
      for (const int place : held_places_) near.add(place);
    for (int k = 0; k < used; ++k) near.add_batch(batches_[k].count > 0 ? sensitivities_at(k, 0) : nullptr);
    near.begin(value_.data(), has_changes ? &changes : nullptr);
    is_gathered = true;
  };
  // With limits, the next one is looked for among the bounds that have sensitivities, where most are, before all values
  // are written.
  const auto enter_next = [&] {
    if (!is_gathered) return false;
    double largest = 0.0;
    for (int k = 0; k < others; ++k) {
      const int place = near.place(k);
      const double violation = std::max(least_[place] - near.value(k), near.value(k) - most_[place]);
      if (!(violation > 0.0)) continue;
      const double gain = violation * violation / -sensitivity(place, place);
      if (gain > largest) largest = gain, entering = place, entering_at = k;
    }
    if (largest > 0.0) enter(near.value(entering_at));
    return largest > 0.0;
  };
  enter(value_[entering]);
  for (;;) {
    if (++changes_ > most_changes_) return Outcome::too_much;
    if (is_past(deadline)) return Outcome::out_of_time;
    if (number_[entering] == none) {
      if (!find_sensitivities_of_next(qp, riccati, &entering, 1, -infinity)) return Outcome::too_much;
      count_used();
    }
    gather();
    // Change of values and multipliers while the entering multiplier grows and the active bounds stay met.
    const int count = column_count();
    double pull[max_columns_with_limits], row[max_columns_with_limits];
    const double square = eliminate(entering, count, row);
    std::copy_n(row, count, pull);
    back_substitute(pull);
    for (int k = 0; k < count; ++k) pull[k] *= side;
    // Until the entering bound is met, or a multiplier reaches zero.
    const double entering_value = is_gathered ? near.value(entering_at) : value_of(entering);
    double length = square > 0.0 ? side * (entering_value - target(entering, multiplier)) / square : infinity;
    int blocking_column = none, blocking_held = none;
    bool reaches_end = false, grows = false;
    if (is_capped && relaxed_[entering] == 0) {
      const double until = was_saturated ? std::abs(multiplier) : linear(entering) - std::abs(multiplier);
      if (until < length) length = until, reaches_end = true;
    }
    for (int k = 0; k < count; ++k) {
      const int other = columns_[k];
      const double loss = side_[other] * pull[k];
      if (has_limits_ && is_soft(other)) {
        const double size = side_[other] * multipliers_[k], end = linear(other);
        double until = infinity;
        if (loss > 0.0) until = std::max(relaxed_[other] != 0 ? size - end : size, 0.0) / loss;
        if (loss < 0.0 && relaxed_[other] == 0) until = std::max(end - size, 0.0) / -loss;
        if (until < length) length = until, blocking_column = k, grows = loss < 0.0;
        continue;
      }
      violation_[other] = infinity;
      if (!(loss > 0.0) || is_equality_bound(other)) continue;
      const double until = std::max(side_[other] * multipliers_[k], 0.0) / loss;
      violation_[other] = until;
      if (until < length) length = until, blocking_column = k, grows = false;
    }
    std::fill_n(direction.begin(), used, Weights::value_type{});
    weight_of(entering, direction) = side;
    for (int k = 0; k < count; ++k) weight_of(columns_[k], direction) -= pull[k];
    if (is_gathered) near.turn(direction);
    for (int k = 0; k < static_cast<int>(held_places_.size()); ++k) {
      const int other = held_places_[k];
      const double loss = -side_[other] * (are_held_gathered ? near.rate(others + k) : sum_at(direction, other));
      violation_[other] = infinity;
      if (!(loss > 0.0) || is_equality_bound(other)) continue;
      const double value = are_held_gathered ? near.value(others + k) : value_of(other);
      const double until = std::max(side_[other] * value, 0.0) / loss;
      violation_[other] = until;
      if (until < length) length = until, blocking_held = other;
    }
    if (length == infinity) return Outcome::no_solution;
    multiplier += side * length;
    for (int k = 0; k < count; ++k) multipliers_[k] -= length * pull[k];
    has_changes = true;
    for (int k = 0; k < used; ++k)
      for (int c = 0; c < batch_size; ++c) changes[k][c] += length * direction[k][c];
    if (is_gathered) near.advance(length);
    if (blocking_held != none) {
      write_values();
      std::erase(held_places_, blocking_held);
      let_go(blocking_held);
      value_[blocking_held] = bound(blocking_held);
      if (!refactor(qp, riccati)) return Outcome::not_convex;
      find_violations();
      if (!find_sensitivities_of_columns(qp, riccati, has_limits_) || !factor_columns(0, false))
        return Outcome::too_much;
      count_used();
    } else if (blocking_column != none) {
      if (!pass_end(blocking_column, grows)) return Outcome::too_much;
    } else if (reaches_end) {
      if (was_saturated || softness(entering) == 0.0) {
        if (was_saturated) {
          let_go(entering);
        } else {
          saturated_.push_back(entering);
          saturate(entering);
        }
        if (enter_next()) continue;
        write_values();
        return Outcome::solved;
      }
      relaxed_[entering] = 1;
      multiplier = side * linear(entering);
    } else {
      if (count == most_columns_) return Outcome::too_much;
      std::copy_n(row, count, factor_row(count));
      append_column(entering, square, multiplier);
      const int met = entering;
      const double value = target(entering, multiplier);
      if (enter_next()) continue;
      write_values();
      value_[met] = value;
      if (has_limits_ && largest_miss() > exactness) {
        return_to_bounds();
        write_pending(riccati);
      }
      return Outcome::solved;
    }
  }
}

/// The columns from the given one on, and with limits also what follows one stage behind an active bound: where a
/// horizon moves along, that was active in the last sample. Leaves room for a few others. Returns their number.
int DualActiveSet::list_with_next(int first, int* places) const noexcept {
  int count = column_count() - first;
  std::copy_n(columns_.data() + first, count, places);
  const auto add_next = [&](int place) {
    const int next = place + (is_limit(place) ? limit_row_ : stride_);
    const bool is_there = is_limit(place) ? next < all_places_ : next < places_;
    if (count >= most_foreseen || !is_there || hold_[next] != Hold::free || !(violation_[next] > -infinity)) return;
    if (number_[next] == none && std::find(places, places + count, next) == places + count) places[count++] = next;
  };
  if (!has_limits_) return count;
  for (const int place : held_places_) add_next(place);
  for (const int place : columns_) add_next(place);
  return count;
}

/// Finds the values at the present multipliers.
DualActiveSet::Found DualActiveSet::find_values(const StageQp& qp, Riccati& riccati, bool may_combine,
                                                Iterate& step) noexcept {
  // A few claims without multipliers get their sensitivities together with those of the bounds that are violated then.
  const bool lacks_sensitivities = column_count() > 0 && number_[columns_[0]] == none;
  const bool may_wait = lacks_sensitivities && !has_base_ && changes_ == 0 &&
                        (has_limits_ ? column_count() % batch_size != 0 : column_count() < batch_size);
  // After a change, the violations are known.
  if (lacks_sensitivities && !may_wait && !find_sensitivities_of_columns(qp, riccati, has_limits_ && changes_ > 0))
    return Found::nothing;
  if (!has_base_ && !may_wait) factor_columns(0, true);
  if (!(may_combine && combine(qp, riccati, step)) && !solve_with_multipliers(qp, riccati, step)) return Found::nothing;
  has_base_ = true;
  base_places_ = columns_;
  std::copy_n(multipliers_.begin(), column_count(), base_multipliers_.begin());
  const StepCheck check = check_step(qp, step, bound_tolerance);
  if (!check.is_finite) return Found::nothing;
  pull_tolerance_ = multiplier_tolerance * (1.0 + check.largest_costate);
  const bool violates_limits = has_limits_ && find_limit_values(qp, step);
  if (columns_.empty() && held_places_.empty() && saturated_.empty() && !check.violates && !violates_limits)
    return Found::solution;
  if (!has_bounds_) take_bounds(qp);
  std::copy_n(step.row(0), places_, value_.begin());
  for (const int place : held_places_) value_[place] = step.bound_row(0)[place];
  if (may_wait) {
    find_violations();
    std::array<int, batch_size> first{};
    const int whole = column_count() / batch_size * batch_size;
    for (int k = 0; k < whole; k += batch_size)
      if (!find_sensitivities(qp, riccati, columns_.data() + k, batch_size)) return Found::nothing;
    const int count = list_with_next(whole, first.data());
    if (!find_sensitivities_of_next(qp, riccati, first.data(), count, -infinity)) return Found::nothing;
    factor_columns(0, true);
    // `base_places_` may have columns that are left out now; their multipliers are zero.
    base_places_ = columns_;
    std::copy_n(multipliers_.begin(), column_count(), base_multipliers_.begin());
  }
  miss_ = largest_miss();
  if (miss_ <= exactness) return check.violates ? Found::values : Found::step;
  return_to_bounds();
  if (!has_limits_) write_pending(riccati);
  return Found::values;
}

DualActiveSet::Outcome DualActiveSet::solve(const StageQp& qp, Riccati& riccati, ActiveSet& active, Iterate& step,
                                            Clock::time_point deadline) noexcept {
  if (!is_convex_) return Outcome::not_convex;
  const bool has_claims = !columns_.empty() || !held_places_.empty() || !saturated_.empty();
  if (has_claims && !take_bounds(qp)) {
    claimed_ = active;
    prepare(qp, riccati, &claimed_);
    take_bounds(qp);
  }
  if (has_limits_) compare_rows(qp);
  changes_ = 0;
  pull_tolerance_ = multiplier_tolerance;
  bool may_add_together = true;
  // Whether there are columns of controls, which the next factorisation then holds.
  const auto holds_no_column = [this] {
    for (const auto* places : {&held_places_, &columns_})
      for (const int place : *places) violation_[place] = infinity;
    return std::any_of(columns_.begin(), columns_.end(), [this](int place) { return is_control(place); });
  };
  // What was found of the active set is a guess for the QP in the place of one that is not convex.
  const auto give_up_not_convex = [&] {
    if (has_limits_ && changes_ > 0) write(qp, active, step);
    return Outcome::not_convex;
  };
  // Of the violated bounds that have sensitivities the one whose addition raises the dual objective most, about; if
  // none has, the one that is violated most.
  const auto choose = [this](int most_violated) {
    int chosen = most_violated;
    double largest = 0.0;
    for (int k = 0; has_limits_ && k < batch_count_; ++k) {
      for (int c = 0; c < batches_[k].count; ++c) {
        const int place = batches_[k].of[c];
        const double violation = violation_[place];
        if (!(violation > 0.0) || number_[place] != k * batch_size + c) continue;
        const double gain = violation * violation / -sensitivity(place, place);
        if (gain > largest) largest = gain, chosen = place;
      }
    }
    return chosen;
  };
  const int most_refinements = has_limits_ ? max_refinements_with_limits : max_refinements;
  double last_miss = infinity;  // of the same active set
  for (int refinements = 0; refinements < most_refinements; ++refinements) {
    if (!is_convex_) return give_up_not_convex();
    const int changes_before = changes_;
    const auto active_count = [this] { return static_cast<int>(held_places_.size()) + column_count(); };
    const int claims = active_count();
    const Found found = find_values(qp, riccati, refinements < max_combined, step);
    if (found == Found::nothing) return Outcome::too_much;
    if (found == Found::solution) {
      write(qp, active, step);
      return Outcome::solved;
    }
    bool needs_factor = drop_wrong(riccati);
    if (has_limits_ && needs_factor && changes_before == 0 && 2 * active_count() < claims) {
      // The claims are mostly wrong: those that are held would only be released one after the other.
      std::erase_if(held_places_, [this](int place) {
        if (is_equality_bound(place)) return false;
        let_go(place);
        ++changes_;
        return true;
      });
    }
    Violations violations = find_violations();
    if (violations.count > violated_for_each_column * most_columns_) return Outcome::too_much;
    if (!needs_factor && may_add_together && violations.worst != none) {
      may_add_together = false;
      // Where a limit comes first, most of the controls would be released again.
      if (!(has_limits_ && is_limit(choose(violations.worst))) && !add_controls_together(qp, riccati, violations.worst))
        return Outcome::too_much;
      needs_factor = drop_wrong(riccati);
      violations = find_violations();
    }
    if (needs_factor) {
      if (changes_ > most_changes_) return Outcome::too_much;
      if (is_past(deadline)) return Outcome::out_of_time;
      const bool have_sensitivities = has_limits_ && !columns_.empty();
      for (const int place : held_places_)
        violation_[place] = have_sensitivities ? side_[place] * value_[place] : infinity;
      for (int k = 0; k < column_count(); ++k)
        violation_[columns_[k]] = have_sensitivities ? side_[columns_[k]] * multipliers_[k] : infinity;
      if (!refactor(qp, riccati)) return give_up_not_convex();
    }
    for (; !needs_factor && violations.worst != none; violations = find_violations())
      if (const Outcome outcome = add(qp, riccati, choose(violations.worst), deadline); outcome != Outcome::solved)
        return outcome == Outcome::not_convex ? give_up_not_convex() : outcome;
    if (needs_factor || changes_ > changes_before) {
      refinements = 0;
    } else if (found == Found::step) {
      write(qp, active, step);
      return Outcome::solved;
    } else if (is_cheap_ && miss_ <= small_miss && return_to_base(step)) {
      write_values(step);
      write(qp, active, step);
      return Outcome::solved;
    } else if (has_limits_ && (refinements == refinements_before_holding || miss_ > less * last_miss)) {
      // Rounding: the columns of controls are nearly dependent. Held, they are exact.
      if (holds_no_column()) {
        if (is_past(deadline)) return Outcome::out_of_time;
        if (!refactor(qp, riccati)) return give_up_not_convex();
      }
      last_miss = infinity;
      continue;
    }
    last_miss = needs_factor || changes_ > changes_before ? infinity : miss_;
  }
  if (!has_limits_) return Outcome::too_much;
  // The active set is right, and what is left of the misses is rounding.
  std::copy_n(step.row(0), places_, value_.begin());
  find_limit_values(qp, step);
  const Violations violations = find_violations();
  const auto is_rounding = [this](int place) {
    return violation_[place] <= rounding * bound_tolerance * (1.0 + std::abs(value_[place]));
  };
  if (largest_miss() > rounding || (violations.worst != none && !is_rounding(violations.worst)))
    return Outcome::too_much;
  write(qp, active, step);
  return Outcome::solved;
}

/// Gives the columns the multipliers with which the step was found; false if one of these, or of a held bound, has a
/// sign or size that its bound does not allow.
bool DualActiveSet::return_to_base(const Iterate& step) noexcept {
  const int count = column_count();
  for (int k = 0; k < count; ++k)
    if (excess_of(columns_[k], base_multipliers_[k]) > pull_tolerance_) return false;
  for (const int place : held_places_)
    if (side_[place] * step.bound_row(0)[place] < -pull_tolerance_ && !is_equality_bound(place)) return false;
  std::copy_n(base_multipliers_.begin(), count, multipliers_.begin());
  return true;
}

/// Writes states and controls, which sensitivities have corrected since the step was found. Costates have none, and go
/// with the multipliers before: together these miss stationarity by the Hessian times the correction, which is small.
/// The corrections of multipliers are not where columns are nearly dependent.
void DualActiveSet::write_values(Iterate& step) const noexcept {
  std::copy_n(value_.begin(), places_, step.row(0));
  for (const int place : held_places_) step.row(0)[place] = bound(place);
}

void DualActiveSet::write(const StageQp& qp, ActiveSet& active, Iterate& step) const noexcept {
  active.clear();
  if (has_limits_) write_limits(qp, active, step);
  for (const auto* places : {&held_places_, &columns_})
    for (const int place : *places)
      if (!is_limit(place)) active.row(place / stride_)[place % stride_] = side_[place];
  for (int k = 0; k < column_count(); ++k)
    if (!is_limit(columns_[k])) step.bound_row(0)[columns_[k]] = multipliers_[k];
}

}  // namespace rhec
