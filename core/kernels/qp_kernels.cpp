// Compiled once per instruction set RHEC_SET; its table is qp_kernels_<RHEC_SET>.
#include "rhec/core/kernels/qp_kernels.hpp"

#include "rhec/core/kernels/lane_sums.hpp"
#include "rhec/core/kernels/lanes.hpp"

namespace rhec {
namespace kernels {
namespace {

/// The number of registers of a row of eight.
constexpr int parts_of_eight = 8 / lane_count;

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
    // Process noise of one to four states beside them.
    constexpr int used_with_noise = (known_states + 6 + lane_count - 1) / lane_count;
    if (known_states <= 6 && view.stride == 16 && view.controls <= 6)
      return kkt_of<used_with_noise, known_states, known_states - most_carried, 16>(view);
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

/// For rows of a known number of registers, or of any length (0).
template <int known_parts>
StepParts check_step_of(const QpView& view, double tolerance) {
  const long stride = known_parts > 0 ? known_parts * lane_count : view.stride;
  const int state_parts = known_parts == 1 ? 1 : (view.states + lane_count - 1) / lane_count;
  Lanes excess = all(-1.0), costates{}, rest{}, unordered{};  // the last two stay 0 as long as everything is finite
  for (int i = 0; i <= view.intervals; ++i) {
    const int parts = known_parts > 0 ? known_parts : parts_of(view, i);
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
  return view.stride == 8 ? check_step_of<parts_of_eight>(view, tolerance) : check_step_of<0>(view, tolerance);
}

/// Whether there is nothing to mark: all multipliers are zero and no bounds coincide.
template <int known_parts>
inline bool is_unmarked(const QpView& view) {
  const long stride = known_parts > 0 ? known_parts * lane_count : view.stride;
  Lanes found{};
  for (int i = 0; i <= view.intervals; ++i) {
    const int parts = known_parts > 0 ? known_parts : parts_of(view, i);
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
  if (stride == 8 ? is_unmarked<parts_of_eight>(view) : is_unmarked<0>(view)) {
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

void largest_of_eight(const double* values, long count, double* largest) {
  for (long k = 0; k < count; k += 8) {
    Lanes most = load(values + k);
    for (long v = lane_count; v < 8; v += lane_count) most = larger(most, load(values + k + v));
    largest[k / 8] = largest_of(most);
  }
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

constexpr double no_bound = __builtin_inf();

bool limits_are_sound(const LimitView& view, double tolerance) {
  Lanes rest{};
  LaneMask wrong{};
  const long slot = static_cast<long>(view.limits) * view.stride;
  for (int i = 0; i <= view.intervals; ++i) {
    const double *sides = view.sides + 4L * i * view.row, *G = view.G + i * slot;
    for (int r = 0; r < view.counts[i]; r += lane_count) {
      const Lanes lower = load(sides + r), upper = load(sides + view.row + r);
      const Lanes linear = load(sides + 2L * view.row + r), quadratic = load(sides + 3L * view.row + r);
      const LaneMask fits = (lower < no_bound) & (upper > -no_bound) & (linear >= 0.0) &
                            (lower - upper <= tolerance * (1.0 + absolute(lower)));
      const LaneMask is_used = lane_numbers < static_cast<long long>(view.counts[i] - r);
      wrong |= is_used & ~(fits & ((linear + quadratic > 0.0) | (linear == no_bound)));
    }
    for (long k = 0; k < static_cast<long>(view.counts[i]) * view.stride; k += lane_count) rest += 0.0 * load(G + k);
  }
  return sum_of(rest) + sum_of(wrong ? all(1.0) : Lanes{}) == 0.0;
}

/// For rows of a known number of registers, or of any length (0).
template <int known_parts>
bool limit_values_of(const LimitView& view, const double* z, double tolerance, double* values) {
  const long stride = known_parts > 0 ? known_parts * lane_count : view.stride;
  const long parts = known_parts > 0 ? known_parts : stride / lane_count;
  LaneMask violated{};
  for (int i = 0; i <= view.intervals; ++i, z += stride) {
    const double *G = view.G + i * view.limits * stride, *lower = view.sides + 4L * i * view.row,
                 *upper = lower + view.row;
    const int count = view.counts[i];
    for (int first = 0; first < view.row; first += 8, values += 8) {
      for (int r = 0; r < 8; r += lane_count) store(Lanes{}, values + r);
      if (first >= count) continue;
      Lanes products[8] = {};
      for (int r = 0; r < 8 && first + r < count; ++r, G += stride) {
        products[r] = load(G) * load(z);
        for (long v = 1; v < parts; ++v) products[r] += load(G + v * lane_count) * load(z + v * lane_count);
      }
      add_sums_of(products, values);
      // Entries without a limit are zero, and so are their bounds.
      for (int r = 0; r < 8; r += lane_count) {
        const Lanes value = load(values + r), least = load(lower + first + r), most = load(upper + first + r);
        violated |=
            (value < least - tolerance * (1.0 + absolute(least))) | (value > most + tolerance * (1.0 + absolute(most)));
      }
    }
  }
  return sum_of(violated ? all(1.0) : Lanes{}) != 0.0;
}

bool limit_values(const LimitView& view, const double* z, double tolerance, double* values) {
  return view.stride == 8 ? limit_values_of<parts_of_eight>(view, z, tolerance, values)
                          : limit_values_of<0>(view, z, tolerance, values);
}

/// The columns of G that are not zero in all stages, which has few of them: most limits depend on the same variables.
/// Returns their number.
int find_columns(const LimitView& view, int used, short* columns) {
  const long stride = view.stride, slot = view.limits * stride;
  int count = 0;
  for (int first = 0; first < used; first += lane_count) {
    LaneMask any{};
    for (int i = 0; i <= view.intervals; ++i) {
      const double* G = view.G + i * slot + first;
      for (int r = 0; r < view.counts[i]; ++r, G += stride) any |= load(G) != 0.0;
    }
    for (int j = 0; j < lane_count && first + j < used; ++j)
      if (any[j] != 0) columns[count++] = static_cast<short>(first + j);
  }
  return count;
}

/// For limits that depend on a known number of states alone, `columns`, and on no control.
template <int known_columns>
void limit_sensitivities_of(const LimitView& view, const short* columns, const double* steps, double* values) {
  constexpr int size = 8;
  using Steps = Row<size / lane_count>;
  const long stride = view.stride;
  int at[known_columns];
  for (int k = 0; k < known_columns; ++k) at[k] = columns[k];
  for (int i = 0; i <= view.intervals; ++i, steps += stride * size) {
    const double* row = view.G + i * view.limits * stride;
    const double* const end = values + static_cast<long>(view.row) * size;
    const double* const used_end = values + static_cast<long>(view.counts[i]) * size;
    Steps of_column[known_columns];
    for (int k = 0; k < known_columns; ++k) of_column[k] = Steps::from(steps + at[k] * size);
    for (; values < used_end; values += size, row += stride) {
      Steps sum{};
      for (int k = 0; k < known_columns; ++k) sum.add(of_column[k], row[at[k]]);
      sum.to(values);
    }
    for (; values < end; values += size) Steps{}.to(values);
  }
}

void limit_sensitivities(const LimitView& view, const int* control_counts, int states, const std::int8_t* held,
                         const double* steps, double* values) {
  constexpr int size = 8, max_columns = 128;  // twice the most states or controls of a stage
  using Steps = Row<size / lane_count>;
  const long stride = view.stride;
  short columns[max_columns];
  const int most = states + view.controls < max_columns ? states + view.controls : max_columns;
  const int column_count = find_columns(view, most, columns);
  int state_columns = 0;
  while (state_columns < column_count && columns[state_columns] < states) ++state_columns;
  // Most limits are those of a place: of two states, or of three with a heading.
  if (state_columns == column_count && column_count == 2)
    return limit_sensitivities_of<2>(view, columns, steps, values);
  if (state_columns == column_count && column_count == 3)
    return limit_sensitivities_of<3>(view, columns, steps, values);
  for (int i = 0; i <= view.intervals; ++i, held += stride, steps += stride * size) {
    const double* G = view.G + i * view.limits * stride;
    const int used = states + (i < view.intervals ? control_counts[i] : 0);
    for (int r = 0; r < view.counts[i]; ++r, G += stride, values += size) {
      Steps sum{};
      for (int k = 0; k < state_columns; ++k) sum.add(Steps::from(steps + columns[k] * size), G[columns[k]]);
      for (int k = state_columns; k < column_count && columns[k] < used; ++k)
        if (held[columns[k]] == 0) sum.add(Steps::from(steps + columns[k] * size), G[columns[k]]);
      sum.to(values);
    }
    for (int r = view.counts[i]; r < view.row; ++r, values += size) Steps{}.to(values);
  }
}

}  // namespace
}  // namespace kernels

#define RHEC_JOIN(a, b) a##b
#define RHEC_TABLE(name, set) RHEC_JOIN(name, set)
extern const QpKernels RHEC_TABLE(qp_kernels_, RHEC_SET);
constinit const QpKernels RHEC_TABLE(qp_kernels_, RHEC_SET) = {&kernels::kkt,
                                                               &kernels::check_step,
                                                               &kernels::mark_bounds,
                                                               &kernels::find_violations,
                                                               &kernels::largest_of_eight,
                                                               &kernels::widen_bounds,
                                                               &kernels::add,
                                                               &kernels::limits_are_sound,
                                                               &kernels::limit_values,
                                                               &kernels::limit_sensitivities};

}  // namespace rhec
