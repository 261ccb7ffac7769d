#include "rhec/core/ocp/start_search.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/base/infinity.hpp"

namespace rhec {
namespace {

// Steps relative to the scale of a component. Of those that violate nothing the shortest is taken.
constexpr double lengths[] = {0.01, 0.03, 0.1, 0.3, 1.0};
// A move helps if it leaves less than this share of the violation.
constexpr double less = 0.99;
constexpr int most_trials = 1000;
// How often a solve begins again, each time at a point that violates less than this share of the least so far.
constexpr int most_starts = 3;
constexpr double clearly_less = 0.9;
// How many intervals before the worst node a local pattern begins at.
constexpr int local_intervals = 8;
constexpr int patterns = 6;

/// The patterns of a component over the intervals, by the node that violates most: all, those before it, there and
/// back again and again there (which moves a node and neither the course nor the end), and the last two close to it;
/// the interval before and the one behind it.
double share_of(int pattern, int interval, int node) noexcept {
  const int near = std::min(node, local_intervals);
  const auto there_and_back = [&](int length) {
    const int ahead = std::abs(2 * (interval - node) + 1);
    return ahead > 2 * length ? 0.0 : ahead > length ? 1.0 : -1.0;
  };
  switch (pattern) {
    case 0:
      return 1.0;
    case 1:
      return interval < node ? 1.0 : 0.0;
    case 2:
      return there_and_back(node);
    case 3:
      return interval < node && interval >= node - near ? 1.0 : 0.0;
    case 4:
      return there_and_back(near);
    default:
      return interval == node || interval == node - 1 ? 1.0 : 0.0;
  }
}

}  // namespace

/// Of controls, then of states, by a pattern.
struct StartSearch::Move {
  int component = -1, pattern = 0;
  double length = 0.0, violation = 0.0;  ///< the latter after it
};

void StartSearch::setup(const Ocp& ocp) {
  const Capacity capacity = ocp.capacity();
  best_ = trial_ = Iterate(capacity);
  limits_.assign((static_cast<std::size_t>(capacity.intervals) + 1) * capacity.limit_row(), 0.0);
  control_scales_.assign(capacity.controls, 0.0);
  state_scales_.assign(capacity.states, 0.0);
}

void StartSearch::begin() noexcept {
  starts_ = 0;
  least_ = infinity;
}

bool StartSearch::take_start() noexcept { return ++starts_ <= most_starts; }

bool StartSearch::find_other(const Ocp& ocp, const Iterate& guess, const Iterate& last, Clock::time_point deadline,
                             std::span<double> scratch, Iterate& to) noexcept {
  if (ocp.capacity().limits == 0 || !take_start()) return false;
  for (const Iterate* from : {&guess, &last}) least_ = std::min(least_, violation(ocp, *from, scratch));
  return find(ocp, last, clearly_less * least_, deadline, scratch, to) ||
         find(ocp, guess, clearly_less * least_, deadline, scratch, to);
}

/// Of `trial_`, which is simulated.
double StartSearch::violation_of_trial(const Ocp& ocp, std::span<double> scratch) noexcept {
  roll_out(ocp, trial_, scratch);
  if (!limits_.empty()) ocp.evaluate_limits(trial_, limits_.data(), scratch);
  double sum = 0.0, worst = -1.0;
  for (int i = 0; i <= ocp.intervals(); ++i) {
    double here = 0.0;  // not finite where a value is not: hence the zeros that are multiplied
    for (int j = 0; j < ocp.state_count(i); ++j) {
      const double value = trial_.state(i)[j];
      here += std::max({0.0 * value, ocp.state_lower(i)[j] - value, value - ocp.state_upper(i)[j]});
    }
    if (!limits_.empty()) {
      const LimitCosts costs =
          limit_costs(ocp, i, limits_.data() + static_cast<std::ptrdiff_t>(i) * ocp.capacity().limit_row());
      here += costs.violation + 0.0 * costs.slack;
    }
    if (!std::isfinite(here)) return infinity;
    sum += here;
    if (here > worst) {
      worst = here;
      trial_worst_node_ = i;
    }
  }
  return sum;
}

double StartSearch::violation(const Ocp& ocp, const Iterate& of, std::span<double> scratch) noexcept {
  trial_ = of;
  return violation_of_trial(ocp, scratch);
}

/// Half of the distance between bounds, or where there are none, the largest value that a component has.
void StartSearch::set_scales(const Ocp& ocp) noexcept {
  const auto scale = [](double& of, double value, double lower, double upper) {
    const double range = 0.5 * (upper - lower);
    of = std::max(of, std::isfinite(range) ? range : std::abs(value));
  };
  std::fill(control_scales_.begin(), control_scales_.end(), 0.0);
  std::fill(state_scales_.begin(), state_scales_.end(), 0.0);
  for (int i = 0; i < ocp.intervals(); ++i)
    for (int j = 0; j < ocp.control_count(i); ++j)
      scale(control_scales_[j], best_.control(i)[j], ocp.control_lower(i)[j], ocp.control_upper(i)[j]);
  for (int j = 0; !ocp.initial_state() && j < ocp.state_count(0); ++j)
    scale(state_scales_[j], best_.state(0)[j], ocp.state_lower(0)[j], ocp.state_upper(0)[j]);
  for (auto* scales : {&control_scales_, &state_scales_})
    for (double& each : *scales)
      if (each == 0.0) each = 1.0;
}

/// Makes `trial_` from `best_`.
void StartSearch::move(const Ocp& ocp, const Move& by) noexcept {
  trial_ = best_;
  const int controls = static_cast<int>(control_scales_.size());
  if (by.component >= controls) {
    const int j = by.component - controls;
    if (j < ocp.state_count(0)) trial_.state(0)[j] += by.length * state_scales_[j];
    return;
  }
  for (int i = 0; i < ocp.intervals(); ++i)
    if (by.component < ocp.control_count(i))
      trial_.control(i)[by.component] +=
          by.length * control_scales_[by.component] * share_of(by.pattern, i, worst_node_);
}

bool StartSearch::find(const Ocp& ocp, const Iterate& around, double least, Clock::time_point deadline,
                       std::span<double> scratch, Iterate& to) noexcept {
  double violation = this->violation(ocp, around, scratch);
  if (!std::isfinite(violation)) return false;
  best_ = trial_;
  worst_node_ = trial_worst_node_;
  set_scales(ocp);
  const int controls = static_cast<int>(control_scales_.size());
  const int components = controls + (ocp.initial_state() ? 0 : ocp.state_count(0));
  int trials = 0;
  const auto shortest_best_move = [&] {
    Move best{.violation = less * violation};
    for (const double length : lengths)
      for (int component = 0; component < components; ++component)
        for (int pattern = 0; pattern < (component < controls ? patterns : 1); ++pattern)
          for (const double signed_length : {length, -length}) {
            if (best.violation == 0.0 || ++trials > most_trials || is_past(deadline)) return best;
            Move one{component, pattern, signed_length};
            move(ocp, one);
            one.violation = violation_of_trial(ocp, scratch);
            if (one.violation < best.violation) best = one;
          }
    return best;
  };
  while (violation > 0.0) {
    const Move best = shortest_best_move();
    if (best.component < 0) break;
    move(ocp, best);
    violation = violation_of_trial(ocp, scratch);
    std::swap(best_, trial_);
    worst_node_ = trial_worst_node_;
  }
  if (!(violation < least)) return false;
  to = best_;
  to.clear_multipliers();
  return true;
}

}  // namespace rhec
