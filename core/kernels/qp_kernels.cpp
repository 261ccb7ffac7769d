// Compiled once per instruction set RHEC_SET; its table is qp_kernels_<RHEC_SET>.
#include "rhec/core/kernels/qp_kernels.hpp"

#include "rhec/core/kernels/lanes.hpp"

namespace rhec {
namespace kernels {
namespace {

/// The number of registers of a row that a stage uses.
inline int parts_of(const QpView& view, int stage) {
  const int controls = stage < view.intervals ? view.control_counts[stage] : 0;
  return (view.states + controls + lane_count - 1) / lane_count;
}

/// For rows with a known number of used registers and states (0: unknown) and a known stride, and AB with at least
/// `known_moved` rows that are not rows of the identity.
template <int known_parts, int known_states, int known_moved, int known_stride = known_parts* lane_count>
KktParts kkt_of(const QpView& view) {
  const long stride = known_stride > 0 ? known_stride : view.stride;
  const int states = known_states > 0 ? known_states : view.states,
            state_parts = (states + lane_count - 1) / lane_count;
  Lanes stationarity{}, defect{}, complementarity{}, highest_lower{}, lowest_upper{};
  Lanes gradients{}, bounds{}, costates{}, rest{};  // rest stays 0 as long as everything is finite
  for (int i = view.first; i <= view.last; ++i) {
    const double* row_AB = view.AB + i * states * stride;
    const double* next_costate = view.costates + (i + 1) * stride;
    const bool is_last = i == view.intervals;
    const int next_states = is_last ? 0 : known_states > 0 ? known_states : view.state_counts[i + 1];
    const int moved = next_states - (is_last ? 0 : view.identity_counts[i]);
    const int parts = known_parts > 0 ? known_parts : parts_of(view, i);
    const int used = states + (is_last ? 0 : view.control_counts[i]);
    for (int v = 0; v < parts; ++v) {
      const long at = i * stride + v * lane_count;
      const Lanes gradient = load(view.h + at), bound = first_of(load(view.bounds + at), v, used);
      Lanes sums[2] = {gradient + bound, Lanes{}};
      const auto add = [&](int l) RHEC_ALWAYS_INLINE {
        sums[l % 2] += load(row_AB + l * stride + v * lane_count) * next_costate[l];
      };
      for (int l = 0; l < known_moved && !is_last; ++l) add(l);
      for (int l = known_moved; l < moved; ++l) add(l);
      // The last rows of AB are rows of the identity.
      if (v < state_parts && moved < next_states)
        sums[0] += between(load(next_costate + v * lane_count), v, moved, next_states);
      Lanes sum = sums[0] + sums[1];
      if (v < state_parts) {
        const Lanes costate = first_of(load(view.costates + at), v, states);
        sum -= costate;
        costates = larger(costates, absolute(costate));
        if (i == 0 && !view.initial_state_is_given) stationarity = larger(stationarity, absolute(costate));
      }
      stationarity = larger(stationarity, absolute(sum));
      rest += 0.0 * sum;
      const Lanes pull = absolute(bound), lower = load(view.lower + at), upper = load(view.upper + at);
      gradients = larger(gradients, absolute(gradient));
      bounds = larger(bounds, pull);
      highest_lower = larger(highest_lower, lower);
      lowest_upper = smaller(lowest_upper, upper);
      // The complementarity of a multiplier at a bound that does not exist is the multiplier itself.
      const Lanes gap = absolute(bound > 0.0 ? upper : lower);
      complementarity = larger(complementarity, pull * smaller(all(1.0), gap));
    }
    if (is_last) break;
    for (int v = 0; v < state_parts; ++v) {
      const Lanes b = load(view.b + i * stride + v * lane_count);
      defect = larger(defect, absolute(b));
      rest += 0.0 * b;
    }
  }
  return {largest_of(stationarity) + sum_of(rest), largest_of(defect), largest_of(larger(highest_lower, -lowest_upper)),
          largest_of(complementarity), largest_of(larger(larger(gradients, bounds), costates))};
}

/// Whether all stages have all states, with at most `most_carried` identity rows.
inline bool is_full(const QpView& view, int most_carried) {
  const int end = view.last < view.intervals ? view.last + 1 : view.last;
  for (int i = view.first; i <= end; ++i)
    if (view.state_counts[i] != view.states || view.identity_counts[i] > most_carried) return false;
  return true;
}

/// With a known number of states, if all stages have it.
template <int known_states, int most_carried>
KktParts kkt_of_states(const QpView& view) {
  if (is_full(view, most_carried)) {
    // Two controls beside the states of a row that is longer than both.
    constexpr int used = (known_states + 2 + lane_count - 1) / lane_count;
    if (known_states > 6 && view.stride == 16 && view.controls == 2)
      return kkt_of<used, known_states, known_states - most_carried, 16>(view);
    if (view.stride == lane_count) return kkt_of<1, known_states, known_states - most_carried>(view);
    if (view.stride == 2 * lane_count) return kkt_of<2, known_states, known_states - most_carried>(view);
  }
  return kkt_of<0, 0, 0>(view);
}

/// Selects one of the sizes for which the recursion is compiled.
KktParts kkt(const QpView& view) {
  switch (view.states) {
    case 5:
      return kkt_of_states<5, 2>(view);
    case 6:
      return kkt_of_states<6, 2>(view);
    case 7:
      return kkt_of_states<7, 3>(view);
    case 8:
      return kkt_of_states<8, 3>(view);
    default:
      return kkt_of<0, 0, 0>(view);
  }
}

/// For rows that fit into one register, or rows of any length.
template <bool is_one_part>
StepParts check_step_of(const QpView& view, double tolerance) {
  const long stride = is_one_part ? lane_count : view.stride;
  const int state_parts = is_one_part ? 1 : (view.states + lane_count - 1) / lane_count;
  Lanes excess = all(-1.0), costates{}, rest{}, unordered{};  // the last two stay 0 as long as everything is finite
  for (int i = 0; i <= view.intervals; ++i) {
    const int parts = is_one_part ? 1 : parts_of(view, i);
    for (int v = 0; v < parts; ++v) {
      const long at = i * stride + v * lane_count;
      const Lanes z = load(view.values + at), lower = load(view.lower + at), upper = load(view.upper + at);
      rest += 0.0 * z;
      unordered = (lower == lower) & (upper == upper) ? unordered : all(1.0);
      Lanes below = lower - tolerance * (1.0 + absolute(lower)) - z;
      Lanes above = z - tolerance * (1.0 + absolute(upper)) - upper;
      if (i == 0 && view.initial_state_is_given) {
        const LaneMask controls = lane_numbers >= static_cast<long long>(view.states - v * lane_count);
        below = controls ? below : all(-1.0);
        above = controls ? above : all(-1.0);
      }
      excess = larger(excess, larger(below, above));
    }
    for (int v = 0; v < state_parts; ++v) {
      const Lanes costate = first_of(load(view.costates + i * stride + v * lane_count), v, view.states);
      costates = larger(costates, absolute(costate));
      rest += 0.0 * costate;
    }
  }
  return {sum_of(rest) + sum_of(unordered) == 0.0, largest_of(excess) > 0.0, largest_of(costates)};
}

StepParts check_step(const QpView& view, double tolerance) {
  return view.stride == lane_count ? check_step_of<true>(view, tolerance) : check_step_of<false>(view, tolerance);
}

/// Whether there is nothing to mark: all multipliers are zero and no bounds coincide.
template <bool is_one_part>
inline bool is_unmarked(const QpView& view) {
  const long stride = is_one_part ? lane_count : view.stride;
  Lanes found{};
  for (int i = 0; i <= view.intervals; ++i) {
    const int parts = is_one_part ? 1 : parts_of(view, i);
    for (int v = 0; v < parts; ++v) {
      const long at = i * stride + v * lane_count;
      const Lanes lower = load(view.lower + at), gap = load(view.upper + at) - lower;
      const Lanes least = smaller(1e-14 * (1.0 + absolute(lower)), all(1e300));
      found = (load(view.bounds + at) == 0.0) & (gap > least) ? found : all(1.0);
    }
  }
  return sum_of(found) == 0.0;
}

bool mark_bounds(const QpView& view, double tolerance, unsigned char* marks) {
  const long stride = view.stride;
  if (stride == lane_count ? is_unmarked<true>(view) : is_unmarked<false>(view)) {
    for (int i = 0; i <= view.intervals; ++i) marks[i] = 0;
    return false;
  }
  Lanes crossed{};
  for (int i = 0; i <= view.intervals; ++i) {
    const int parts = parts_of(view, i);
    Lanes marked{};
    for (int v = 0; v < parts; ++v) {
      const long at = i * stride + v * lane_count;
      const Lanes lower = load(view.lower + at), upper = load(view.upper + at), size = 1.0 + absolute(lower);
      const Lanes one = all(1.0), none{};
      Lanes is_crossed = lower - upper <= tolerance * size ? none : one;
      Lanes is_marked = load(view.bounds + at) != 0.0 ? one : none;
      is_marked = upper - lower <= smaller(1e-14 * size, all(1e300)) ? one : is_marked;
      if (i == 0 && view.initial_state_is_given) {
        const LaneMask controls = lane_numbers >= static_cast<long long>(view.states - v * lane_count);
        is_crossed = controls ? is_crossed : none;
        is_marked = controls ? is_marked : none;
      }
      crossed += is_crossed;
      marked += is_marked;
    }
    marks[i] = sum_of(marked) != 0.0;
  }
  return largest_of(crossed) > 0.0;
}

ViolationParts find_violations(const double* values, const double* least, const double* most, long count,
                               double* violations) {
  Lanes largest{}, counts{};
  for (long k = 0; k < count; k += lane_count) {
    const Lanes value = load(values + k), violation = larger(load(least + k) - value, value - load(most + k));
    store(violation, violations + k);
    largest = larger(largest, violation);
    counts += violation > 0.0 ? all(1.0) : Lanes{};
  }
  return {largest_of(largest), static_cast<int>(sum_of(counts))};
}

void widen_bounds(const double* lower, const double* upper, double tolerance, long count, double* least, double* most) {
  for (long k = 0; k < count; k += lane_count) {
    const Lanes from = load(lower + k), to = load(upper + k);
    store(from - tolerance * (1.0 + absolute(from)), least + k);
    store(to + tolerance * (1.0 + absolute(to)), most + k);
  }
}

void add(const double* from, double* to, long count) {
  for (long k = 0; k < count; k += lane_count) store(load(from + k) + load(to + k), to + k);
}

}  // namespace
}  // namespace kernels

#define RHEC_JOIN(a, b) a##b
#define RHEC_TABLE(name, set) RHEC_JOIN(name, set)
extern const QpKernels RHEC_TABLE(qp_kernels_, RHEC_SET);
constinit const QpKernels RHEC_TABLE(qp_kernels_, RHEC_SET) = {&kernels::kkt,          &kernels::check_step,
                                                               &kernels::mark_bounds,  &kernels::find_violations,
                                                               &kernels::widen_bounds, &kernels::add};

}  // namespace rhec
