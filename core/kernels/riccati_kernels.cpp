// Compiled once per instruction set RHEC_SET; its table is riccati_kernels_<RHEC_SET>.
#include "rhec/core/kernels/riccati_kernels.hpp"

#include "rhec/core/kernels/lane_sums.hpp"
#include "rhec/core/kernels/lanes.hpp"
#include "rhec/core/kernels/reflection.hpp"

namespace rhec {
namespace kernels {
namespace {

/// Calls function(first), function(first + step), ... with compile-time constants; no loop remains.
template <int first, int step, class Function, int... k>
RHEC_ALWAYS_INLINE inline void each_constant(const Function& function, Constants<k...> /*numbers*/) {
  (function(Constant<first + step * k>()), ...);
}

/// Compile-time knowledge about a stage: the length of a row in multiples of eight, the numbers of states and controls
/// (unknown: 0), the number of carried states (identity rows of AB), and the stride of the QP's rows (unknown: 0). If
/// `is_written_out`, loops are unrolled.
template <int eights, int state_count, int control_count, bool is_written_out = true, int carried_count = 0,
          int known_stride = 0>
struct CompiledShape {
  static constexpr int known_states = state_count, known_controls = control_count, known_carried = carried_count;
  static constexpr bool is_known = state_count > 0;
  static constexpr bool has_pair = is_known && control_count == 2;
  static constexpr int most_columns = eights * 8;
  /// Rows of a known length need no registers for their padding, which stays zero in memory.
  static constexpr int registers =
      is_known ? (state_count + control_count + lane_count - 1) / lane_count : most_columns / lane_count;
  static constexpr int state_registers = is_known ? (state_count + lane_count - 1) / lane_count : registers;
  static constexpr int most_states = is_known ? state_count : (most_columns < 64 ? most_columns : 64);
  using R = Row<registers>;
  /// Next state and control together fit into one register, which then holds the whole step.
  static constexpr bool is_compact = is_known && registers == 1;
  int states, next_states, offset, columns;
  int moved;  ///< number of next states that are not merely carried; the other rows of AB are rows of the identity

  CompiledShape(const RiccatiView& view, int i)
      : states(is_known ? state_count : view.state_counts[i]),
        next_states(is_known ? state_count : view.state_counts[i + 1]),
        offset(is_known ? state_count : view.states),
        columns(offset + (is_known ? control_count : view.control_counts[i])),
        moved(next_states - (is_known && !has_checks ? carried_count : view.identity_counts[i])) {}

  static long stride_of(const RiccatiView& view) { return known_stride > 0 ? known_stride : view.stride; }
  /// Allocated numbers of states and controls.
  static long room_for_states(const RiccatiView& view) { return is_known ? state_count : view.states; }
  static long room_for_controls(const RiccatiView& view) {
    return is_known && state_count + control_count == known_stride ? control_count : view.controls;
  }

  /// A shape with this many states and no controls.
  explicit CompiledShape(int count)
      : states(is_known ? state_count : count), next_states(states), offset(states), columns(states), moved(states) {}

  template <class Function>
  RHEC_ALWAYS_INLINE void each_state(const Function& function) const {
    each<0, state_count>(0, states, function);
  }
  template <class Function>
  RHEC_ALWAYS_INLINE void each_next_state(const Function& function) const {
    each<0, state_count>(0, next_states, function);
  }
  template <class Function>
  RHEC_ALWAYS_INLINE void each_moved(const Function& function) const {
    each<0, state_count - carried_count>(0, moved, function);
  }
  template <class Function>
  RHEC_ALWAYS_INLINE void each_carried(const Function& function) const {
    each<state_count - carried_count, carried_count>(moved, next_states, function);
  }
  template <class Function>
  RHEC_ALWAYS_INLINE void each_control(const Function& function) const {
    each<state_count, control_count>(offset, columns, function);
  }
  /// Visits the controls before control k.
  template <class Control, class Function>
  RHEC_ALWAYS_INLINE void each_control_before(Control k, const Function& function) const {
    if constexpr (is_straight)
      each<state_count, k - state_count>(offset, k, function);
    else
      each<0, 0>(offset, k, function);
  }
  template <class Function>
  RHEC_ALWAYS_INLINE void each_control_back(const Function& function) const {
    if constexpr (is_straight)
      each_constant<state_count + control_count - 1, -1>(function, make_constants<control_count>());
    else
      for (int k = columns - 1; k >= offset; --k) function(k);
  }

 private:
  static constexpr bool is_straight = is_known && is_written_out;
  /// Calls function(first), ..., function(end - 1); if unrolled, `known_count` times from `known_first`.
  template <int known_first, int known_count, class Function>
  RHEC_ALWAYS_INLINE static void each(int first, int end, const Function& function) {
    if constexpr (is_straight)
      each_constant<known_first, 1>(function, make_constants<known_count>());
    else
      for (int k = first; k < end; ++k) function(k);
  }
};

/// The shape that the compiler gets. For unrolled ones with checks it takes minutes for each instruction set: there,
/// loops remain, and the numbers of carried states and the stride are read from the QP. Sources, indices and memory are
/// the same.
template <int eights, int state_count, int control_count, bool is_written_out = true, int carried_count = 0,
          int known_stride = 0>
using Shape = CompiledShape<eights, state_count, control_count, is_written_out && !has_checks,
                            has_checks ? 0 : carried_count, has_checks ? 0 : known_stride>;

inline double bound_of(const RiccatiView& view, int i, int k) {
  const long at = static_cast<long>(i) * view.stride + k;
  return (view.sides[at] < 0 ? view.lower : view.upper)[at];
}

/// Pointers to the rows of a stage.
template <class Stage>
struct Memory {
  using R = typename Stage::R;
  long stride;
  const double *AB, *H, *h, *b, *P_next, *p_next;
  double *P, *U, *V, *closed, *T, *inverse, *drift, *g, *p;
  const std::int8_t* sides;

  Memory(const RiccatiView& view, int i) : stride(Stage::stride_of(view)) {
    const long at = i * stride, states = at * Stage::room_for_states(view),
               controls = at * Stage::room_for_controls(view);
    AB = view.AB + states;
    H = view.H + states + controls;
    h = view.h + at;
    b = view.b + at;
    P = view.P + states;
    P_next = P + Stage::room_for_states(view) * stride;
    p = view.p + at;
    p_next = p + stride;
    U = view.U + controls;
    V = view.V + controls;
    closed = view.closed + static_cast<long>(i) * 64;
    T = view.T + static_cast<long>(i) * 64;
    inverse = view.inverse + i * Stage::room_for_controls(view);
    drift = view.drift + at;
    g = view.g + at;
    sides = view.sides + at;
  }
  RHEC_ALWAYS_INLINE R row(const double* rows, int r) const { return R::from(rows + r * stride); }
};

/// Rows of P [A B].
template <class Stage>
RHEC_ALWAYS_INLINE inline void multiply_rows(const Stage& stage, const Memory<Stage>& at, typename Stage::R* W) {
  using R = typename Stage::R;
  stage.each_next_state([&](auto j) RHEC_ALWAYS_INLINE {
    // For moved states P is read from its lower triangle only, and for the carried ones beside them from its upper
    // triangle, so that it stays symmetric.
    R sums[2] = {at.row(at.P_next, j).between(stage.moved, stage.next_states), R{}};
    stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE {
      const bool is_above = l < j || j >= stage.moved;
      sums[l % R::chains].add(at.row(at.AB, l), is_above ? at.P_next[l * at.stride + j] : at.P_next[j * at.stride + l]);
    });
    W[j] = sums[0];
    if (R::chains > 1) W[j].add(sums[1]);
  });
}

/// Rows of H + [A B]'W. The rows of the controls come first, since the elimination depends on them.
template <class Stage>
RHEC_ALWAYS_INLINE inline void form_rows(const RiccatiView& view, int i, const Stage& stage, const Memory<Stage>& at,
                                         const typename Stage::R* W, typename Stage::R* X) {
  using R = typename Stage::R;
  const auto form = [&](auto k) RHEC_ALWAYS_INLINE {
    R sums[2] = {at.row(at.H, k), R{}};
    stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE { sums[l % R::chains].add(W[l], at.AB[l * at.stride + k]); });
    if (k >= stage.moved && k < stage.next_states) sums[1].add(W[k]);
    if (R::chains > 1 || stage.moved < stage.next_states) sums[0].add(sums[1]);
    X[k] = sums[0];
  };
  stage.each_control_back(form);
  stage.each_state(form);
  if (view.diagonal) {
    const auto add = [&](auto k)
                         RHEC_ALWAYS_INLINE { X[k] = X[k].with(k, X[k].entry(k) + view.diagonal[i * at.stride + k]); };
    stage.each_control(add);
    stage.each_state(add);
  }
}

/// Stores what solutions need of a stage so that dependencies between stages stay short: rows of the closed loop for
/// gradients, columns of the dynamics and of the policy for steps. (Steps by the closed loop would be faster still, but
/// with a strong policy the next states would not match the dynamics at the computed state and control.)
template <class Stage>
RHEC_ALWAYS_INLINE inline void close_loop(const Stage& stage, const Memory<Stage>& at, const typename Stage::R* policy,
                                          bool for_steps) {
  stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE {
    const double* AB = at.AB + l * at.stride;
    Lanes row = load(AB);
    stage.each_control([&](auto k) RHEC_ALWAYS_INLINE { row -= policy[k].part[0] * AB[k]; });
    store(row, at.closed + l * 8);
  });
  if (!for_steps) return;
  Lanes columns[8] = {};
  stage.each_state([&](auto l) RHEC_ALWAYS_INLINE { columns[l] = at.row(at.AB, l).part[0]; });
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE { columns[k] = -policy[k].part[0]; });
  transpose(columns);
  for (int k = 0; k < stage.columns; ++k) store(columns[k], at.T + k * 8);
}

/// Eliminates the controls from X, one by one. U gets their coupling to the state and to the controls before them; X
/// keeps their policies. False if they have no minimiser.
template <class Stage>
RHEC_ALWAYS_INLINE inline bool eliminate_controls(const Stage& stage, const Memory<Stage>& at, bool any_fixed,
                                                  double tolerance, typename Stage::R* X) {
  using R = typename Stage::R;
  double diagonal[Stage::most_columns];
  bool is_definite = true;
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE { diagonal[k] = X[k].entry(k); });
  if (any_fixed)
    stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
      if (at.sides[k] != 0) X[k].to(at.U + (k - stage.offset) * at.stride);
    });
  stage.each_control_back([&](auto k) RHEC_ALWAYS_INLINE {
    const int control = k - stage.offset;
    if (any_fixed && at.sides[k] != 0) {
      at.inverse[control] = 0.0;
      X[k] = R{};
      return;
    }
    const double pivot = X[k].entry(k);
    is_definite = is_definite && pivot > tolerance * diagonal[k] && pivot > 0.0;
    const double reciprocal = 1.0 / pivot;
    R row = X[k].first(k);
    if (any_fixed)
      stage.each_control_before(k, [&](auto f) RHEC_ALWAYS_INLINE {
        if (at.sides[f] != 0) row.part[f / lane_count][f % lane_count] = 0.0;
      });
    row.to(at.U + control * at.stride);
    at.inverse[control] = reciprocal;
    R scaled{};
    scaled.add(row, reciprocal);
    const auto eliminate = [&](auto j) RHEC_ALWAYS_INLINE { X[j].add(row, -scaled.splat(j)); };
    stage.each_control_before(k, eliminate);
    stage.each_state(eliminate);
    X[k] = scaled;
  });
  // From a policy in terms of the state and the controls before, to a policy in terms of the state alone.
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
    R policy = X[k].first(stage.states);
    stage.each_control_before(k, [&](auto j) RHEC_ALWAYS_INLINE { policy.add(X[j], -X[k].splat(j)); });
    X[k] = policy;
  });
  return is_definite;
}

/// The same for two free controls at once: the dependency chain has only one division.
template <class Stage>
RHEC_ALWAYS_INLINE inline bool eliminate_pair(const Stage& stage, const Memory<Stage>& at, double tolerance,
                                              typename Stage::R* X) {
  using R = typename Stage::R;
  constexpr Constant<Stage::most_states> first;
  constexpr Constant<Stage::most_states + 1> second;
  const double a = X[first].entry(first), b = X[second].entry(first), c = X[second].entry(second);
  const double determinant = a * c - b * b, inverse = 1.0 / determinant, inverse_of_second = 1.0 / c;
  R of_first = X[first].first(first), of_second = X[second].first(first), policies[2] = {};
  policies[0].add(of_first, c);
  policies[0].add(of_second, -b);
  policies[1].add(of_second, a);
  policies[1].add(of_first, -b);
  for (R& policy : policies)
    for (Lanes& part : policy.part) part *= inverse;
  stage.each_state([&](auto j) RHEC_ALWAYS_INLINE {
    X[j].add(policies[0], -of_first.splat(j));
    X[j].add(policies[1], -of_second.splat(j));
  });
  X[second].first(second).to(at.U + at.stride);
  of_first.add(of_second, -b * inverse_of_second);
  of_first.to(at.U);
  at.inverse[0] = c * inverse;
  at.inverse[1] = inverse_of_second;
  X[first] = policies[0];
  X[second] = policies[1];
  return c > 0.0 && determinant > 0.0 && determinant > tolerance * (a * c);
}

/// Makes the reduced Hessian of two free controls convex, in X and in the QP's H.
template <class Stage>
RHEC_ALWAYS_INLINE inline void reflect_pair(const RiccatiView& view, const Memory<Stage>& at, double tolerance,
                                            typename Stage::R* X) {
  constexpr Constant<Stage::most_states> first;
  constexpr Constant<Stage::most_states + 1> second;
  const double a = X[first].entry(first), b = X[second].entry(first), c = X[second].entry(second);
  const double determinant = a * c - b * b;
  if (c > 0.0 && determinant > 0.0 && determinant > tolerance * (a * c)) return;
  const auto size = [](double x) RHEC_ALWAYS_INLINE { return x < 0.0 ? -x : x; };
  const double half = 0.5 * (a - c), largest = size(half) < size(b) ? size(b) : size(half);
  const double x = half / largest, y = b / largest;
  const double radius = largest > 0.0 ? largest * __builtin_sqrt(x * x + y * y) : 0.0;
  const PairMatrix now = reflect({a, b, c}, radius);
  double* const of_first = view.own_H + (at.H - view.H) + first * at.stride;
  double* const of_second = of_first + at.stride;
  of_first[first] += now.first - a;
  of_first[second] += now.beside - b;
  of_second[first] += now.beside - b;
  of_second[second] += now.second - c;
  X[first] = X[first].with(first, now.first).with(second, now.beside);
  X[second] = X[second].with(first, now.beside).with(second, now.second);
  *view.is_reflected = true;
}

/// Stores the Hessian of the stage's value function, and what the dynamics' offsets add to the gradient of the next
/// one's.
template <class Stage>
RHEC_ALWAYS_INLINE inline void store_value(const RiccatiView& view, const Stage& stage, const Memory<Stage>& at,
                                           const typename Stage::R* X) {
  using R = typename Stage::R;
  stage.each_state([&](auto j) RHEC_ALWAYS_INLINE { X[j].first(stage.states).to(at.P + j * at.stride); });
  if (view.for_steps) {
    R drift{};
    stage.each_next_state([&](auto l) RHEC_ALWAYS_INLINE { drift.add(at.row(at.P_next, l), at.b[l]); });
    drift.to(at.drift);
  }
}

template <class Stage>
RHEC_ALWAYS_INLINE inline bool factor_stage(const RiccatiView& view, int i, double tolerance) {
  using R = typename Stage::R;
  const Stage stage(view, i);
  const Memory<Stage> at(view, i);
  R W[Stage::most_states], X[Stage::most_columns];
  multiply_rows(stage, at, W);
  form_rows(view, i, stage, at, W, X);
  bool any_fixed = false;
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE { any_fixed |= at.sides[k] != 0; });
  view.fixes[i] = any_fixed;
  const auto eliminate = [&]() RHEC_ALWAYS_INLINE {
    if constexpr (Stage::has_pair) {
      if (view.own_H && !any_fixed) reflect_pair(view, at, tolerance, X);
      if (!any_fixed) return eliminate_pair(stage, at, tolerance, X);
    }
    return eliminate_controls(stage, at, any_fixed, tolerance, X);
  };
  if (!eliminate()) return false;
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE { X[k].to(at.V + (k - stage.offset) * at.stride); });
  store_value(view, stage, at, X);
  if constexpr (Stage::is_compact) close_loop(stage, at, X, view.for_steps);
  return true;
}

/// What factorisations of any size do with rows in memory, for rows of `width` numbers. One function each: rows of
/// controls and of states have widths of their own, and whole stages compiled for every pair of them would be many.
/// Rows are summed up two at a time, for the processor's pipelines; an odd last one is summed up twice.
template <int width>
struct GeneralRows {
  using R = Row<width / lane_count>;

  /// Row r of `sums`: that of `starts`, plus the sum over l of factors[l * step + r] times row l of `rows`.
  [[gnu::noinline]] static void add_products(int count, int terms, const double* rows, long row_stride,
                                             const double* factors, long step, const double* starts, double* sums,
                                             long sum_stride) {
    for (int r = 0; r < count; r += 2) {
      const int other = r + 1 < count ? r + 1 : r;
      R first = R::from(starts + r * step), second = R::from(starts + other * step);
      for (int l = 0; l < terms; ++l) {
        const R row = R::from(rows + l * row_stride);
        first.add(row, factors[l * step + r]);
        second.add(row, factors[l * step + other]);
      }
      first.to(sums + r * sum_stride);
      second.to(sums + other * sum_stride);
    }
  }

  /// Rows of P [A B]: of the first `moved` rows of AB, and of the identity for the other states. P is read from its
  /// upper triangle only, so that it stays symmetric.
  [[gnu::noinline]] static void multiply(int states, int moved, const double* P, const double* AB, long stride,
                                         double* products) {
    for (int j = 0; j < states; j += 2) {
      const int other = j + 1 < states ? j + 1 : j;
      R first = R::from(P + j * stride).between(moved, states),
        second = R::from(P + other * stride).between(moved, states);
      const auto entry = [&](int l, int column) RHEC_ALWAYS_INLINE {
        return l < column ? P[l * stride + column] : P[column * stride + l];
      };
      for (int l = 0; l < moved; ++l) {
        const R row = R::from(AB + l * stride);
        first.add(row, entry(l, j));
        second.add(row, entry(l, other));
      }
      first.to(products + j * width);
      second.to(products + other * width);
    }
  }

  /// Subtracts factors[j] times `row` from row j of `rows`.
  [[gnu::noinline]] static void eliminate(int count, const double* row, const double* factors, double* rows,
                                          long stride) {
    const R eliminated = R::from(row);
    for (int j = 0; j < count; ++j) {
      R left = R::from(rows + j * stride);
      left.add(eliminated, -factors[j]);
      left.to(rows + j * stride);
    }
  }

  /// Adds to `sum`, or subtracts from it (a sign of -1), what factors[j] times row j of `rows` sum up to.
  [[gnu::noinline]] static void accumulate(double sign, int count, const double* rows, long stride,
                                           const double* factors, double* sum) {
    R total = R::from(sum);
    for (int j = 0; j < count; ++j) total.add(R::from(rows + j * stride), sign * factors[j]);
    total.to(sum);
  }
};

/// Of a QP's stages: states or controls, and both.
constexpr int most_rows = 64, most_columns = 2 * most_rows;

/// The functions of one width, to be chosen at run time.
struct RowFunctions {
  int width;
  decltype(&GeneralRows<8>::add_products) add_products;
  decltype(&GeneralRows<8>::multiply) multiply;
  decltype(&GeneralRows<8>::eliminate) eliminate;
  decltype(&GeneralRows<8>::accumulate) accumulate;
};

template <int width>
constexpr RowFunctions row_functions = {width, &GeneralRows<width>::add_products, &GeneralRows<width>::multiply,
                                        &GeneralRows<width>::eliminate, &GeneralRows<width>::accumulate};

/// The least compiled width for so many columns.
inline const RowFunctions& row_functions_for(int columns) {
  if (columns <= 8) return row_functions<8>;
  if (columns <= 16) return row_functions<16>;
  if (columns <= 24) return row_functions<24>;
  if (columns <= 32) return row_functions<32>;
  if (columns <= 64) return row_functions<64>;
  return row_functions<128>;
}

inline void add_to_diagonal(const RiccatiView& view, int i, int k, double* row) {
  if (view.diagonal) row[k] += view.diagonal[static_cast<long>(i) * view.stride + k];
}

/// Writes the first `count` numbers of a row of `width`, the others as zero. Both rows may be the same.
inline void copy_first(int count, int width, const double* row, double* to) {
  for (int v = 0; v < width / lane_count; ++v)
    store(first_of(load(row + v * lane_count), v, count), to + v * lane_count);
}

inline int most_states(const RiccatiView& view, int i) {
  return view.state_counts[i] > view.state_counts[i + 1] ? view.state_counts[i] : view.state_counts[i + 1];
}

/// The same for any sizes, with rows in memory: those of controls have all columns. Those of states are only needed up
/// to the states: their columns of controls are the rows of these.
bool factor_general(const RiccatiView& view, int i, double tolerance) {
  const long stride = view.stride;
  const int offset = view.states, controls = view.control_counts[i], columns = offset + controls;
  const int states = view.state_counts[i], next_states = view.state_counts[i + 1];
  const int moved = next_states - view.identity_counts[i];
  const RowFunctions& all_columns = row_functions_for(columns);
  const RowFunctions& of_state = row_functions_for(most_states(view, i));
  const int width = all_columns.width, state_width = of_state.width;
  const Memory<Shape<1, 0, 0>> at(view, i);

  alignas(64) double W[most_rows * most_columns];  // rows of P [A B]
  all_columns.multiply(next_states, moved, at.P_next, at.AB, stride, W);
  // Rows of H + [A B]'P[A B].
  alignas(64) double of_controls[most_rows * most_columns], of_states[most_rows * most_rows], diagonal[most_rows];
  bool any_fixed = false;
  all_columns.add_products(controls, moved, W, width, at.AB + offset, stride, at.H + offset * stride, of_controls,
                           width);
  for (int c = 0; c < controls; ++c) {
    double* const row = of_controls + c * width;
    add_to_diagonal(view, i, offset + c, row);
    diagonal[c] = row[offset + c];
    if (at.sides[offset + c] == 0) continue;
    any_fixed = true;
    copy_first(width, width, row, at.U + c * stride);
  }
  view.fixes[i] = any_fixed;
  of_state.add_products(states, moved, W, width, at.AB, stride, at.H, of_states, state_width);
  for (int k = 0; k < states; ++k) {
    double* const row = of_states + k * state_width;
    if (k >= moved && k < next_states)
      for (int j = 0; j < state_width; ++j) row[j] += W[k * width + j];
    add_to_diagonal(view, i, k, row);
  }
  // Controls are eliminated one by one: see eliminate_controls.
  alignas(64) double policies[most_rows * most_rows], scaled[most_columns];
  bool is_definite = true;
  for (int c = controls - 1; c >= 0; --c) {
    const int k = offset + c;
    double *const row = of_controls + c * width, *const policy = policies + c * state_width;
    if (at.sides[k] != 0) {
      at.inverse[c] = 0.0;
      for (int j = 0; j < state_width; ++j) policy[j] = 0.0;
      continue;
    }
    const double pivot = row[k];
    is_definite = is_definite && pivot > tolerance * diagonal[c] && pivot > 0.0;
    const double reciprocal = 1.0 / pivot;
    copy_first(k, width, row, row);
    for (int f = offset; any_fixed && f < k; ++f)
      if (at.sides[f] != 0) row[f] = 0.0;
    copy_first(width, width, row, at.U + c * stride);
    at.inverse[c] = reciprocal;
    for (int j = 0; j < width; ++j) scaled[j] = row[j] * reciprocal;
    all_columns.eliminate(c, row, scaled + offset, of_controls, width);
    of_state.eliminate(states, row, scaled, of_states, state_width);
    copy_first(width, width, scaled, row);
    copy_first(states, state_width, scaled, policy);
  }
  if (!is_definite) return false;
  const auto store_states = [&](const double* row, double* to) {
    copy_first(states, state_width, row, to);
    for (int v = state_width; v < width; v += lane_count) kernels::store(Lanes{}, to + v);
  };
  // From a policy in terms of the state and the controls before, to a policy in terms of the state alone.
  for (int c = 0; c < controls; ++c) {
    double* const policy = policies + c * state_width;
    if (at.sides[offset + c] == 0)
      of_state.accumulate(-1.0, c, policies, state_width, of_controls + c * width + offset, policy);
    store_states(policy, at.V + c * stride);
  }
  for (int j = 0; j < states; ++j) store_states(of_states + j * state_width, at.P + j * stride);
  if (view.for_steps) {
    for (int v = 0; v < width; v += lane_count) kernels::store(Lanes{}, at.drift + v);
    all_columns.accumulate(1.0, next_states, at.P_next, stride, at.b, at.drift);
  }
  return true;
}

/// Controls behind the first two of a stage, of rows with sixteen columns at most.
constexpr int most_further_controls = 9;

/// What factor_stage does, for a stage with more controls than the two of its shape, as process noise adds them. The
/// matrix is symmetric: of the further controls only the rows are formed, of all others only the columns of the shape.
/// A further row is that of its coupling to the shape's columns, with `own` for its coupling to itself and to further
/// controls before it. The order of elimination, and so what is stored, are those of eliminate_controls.
template <class Stage, int known_further>
RHEC_ALWAYS_INLINE inline bool factor_further_stage(const RiccatiView& view, int i, double tolerance) {
  using R = typename Stage::R;
  constexpr Constant<Stage::most_states> first;
  constexpr Constant<Stage::most_states + 1> second;
  const Stage stage(view, i);
  const Memory<Stage> at(view, i);
  const int further = known_further > 0 ? known_further : view.control_counts[i] - 2;
  bool any_fixed = false;
  for (int k = stage.offset; k < stage.columns + further; ++k) any_fixed |= at.sides[k] != 0;
  if (any_fixed) return factor_general(view, i, tolerance);
  view.fixes[i] = 0;
  constexpr int room = known_further > 0 ? known_further : most_further_controls;
  R W[Stage::most_states], X[Stage::most_columns], coupling[room];
  double own[room][room], diagonal[room];
  multiply_rows(stage, at, W);
  for (int c = 0; c < further; ++c) {
    const int k = stage.columns + c;
    R push{}, sum = at.row(at.H, k);  // P times its column of B, and its row
    stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE {
      const double entry = at.AB[l * at.stride + k];
      push.add(at.row(at.P_next, l), entry);
      sum.add(W[l], entry);
    });
    coupling[c] = sum.first(stage.columns);
    for (int before = 0; before <= c; ++before) {
      double of_both = at.H[k * at.stride + stage.columns + before];
      stage.each_moved(
          [&](auto l) RHEC_ALWAYS_INLINE { of_both += push.entry(l) * at.AB[l * at.stride + stage.columns + before]; });
      own[c][before] = of_both;
    }
    if (view.diagonal) own[c][c] += view.diagonal[i * at.stride + k];
    diagonal[c] = own[c][c];
  }
  form_rows(view, i, stage, at, W, X);
  const double whole_first = X[first].entry(first), whole_second = X[second].entry(second);
  bool is_definite = true;
  for (int c = further - 1; c >= 0; --c) {
    const double pivot = own[c][c], inverse = 1.0 / pivot;
    is_definite = is_definite && pivot > tolerance * diagonal[c] && pivot > 0.0;
    at.inverse[2 + c] = inverse;
    R scaled{};
    scaled.add(coupling[c], inverse);
    for (int before = 0; before < c; ++before) {
      const double factor = own[c][before] * inverse;
      coupling[before].add(coupling[c], -factor);
      for (int j = 0; j <= before; ++j) own[before][j] -= factor * own[c][j];
    }
    const auto eliminate = [&](auto j) RHEC_ALWAYS_INLINE { X[j].add(coupling[c], -scaled.splat(j)); };
    stage.each_control(eliminate);
    stage.each_state(eliminate);
    double* const U = at.U + (2 + c) * at.stride;
    coupling[c].to(U);
    for (int before = 0; before < c; ++before) U[stage.columns + before] = own[c][before];
  }
  const double a = X[first].entry(first), b = X[second].entry(first), c = X[second].entry(second);
  is_definite = is_definite && c > tolerance * whole_second && a * c - b * b > tolerance * (whole_first * c);
  if (!eliminate_pair(stage, at, tolerance, X) || !is_definite) return false;
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE { X[k].to(at.V + (k - stage.offset) * at.stride); });
  R policies[room];
  for (int k = 0; k < further; ++k) {
    R policy = coupling[k].first(stage.states);
    policy.add(X[first], -coupling[k].splat(first));
    policy.add(X[second], -coupling[k].splat(second));
    for (int before = 0; before < k; ++before) policy.add(policies[before], -own[k][before]);
    policies[k] = R{};
    policies[k].add(policy, at.inverse[2 + k]);
    policies[k].to(at.V + (2 + k) * at.stride);
  }
  store_value(view, stage, at, X);
  return true;
}

/// Calls `function` with the least compiled width of rows for so many states.
template <class Function>
inline auto with_width_of_states(int states, const Function& function) {
  if (states <= 8) return function.template operator()<8>();
  if (states <= 16) return function.template operator()<16>();
  if (states <= 24) return function.template operator()<24>();
  if (states <= 32) return function.template operator()<32>();
  return function.template operator()<64>();
}

/// The controls at state step zero, given the gradient's entries: eliminated from last to first, then computed from
/// first to last.
template <class Stage, class Gradient>
RHEC_ALWAYS_INLINE inline void solve_controls(const RiccatiView& view, int i, const Stage& stage,
                                              const Memory<Stage>& at, const Gradient& gradient) {
  double own[Stage::most_columns];
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE { own[k] = gradient(k); });
  stage.each_control_back([&](auto k) RHEC_ALWAYS_INLINE {
    const double* U = at.U + (k - stage.offset) * at.stride;
    own[k] *= at.inverse[k - stage.offset];
    stage.each_control_before(k, [&](auto j) RHEC_ALWAYS_INLINE { own[j] -= U[j] * own[k]; });
  });
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
    const double* U = at.U + (k - stage.offset) * at.stride;
    double sum = own[k];
    stage.each_control_before(k,
                              [&](auto j) RHEC_ALWAYS_INLINE { sum -= U[j] * at.inverse[k - stage.offset] * own[j]; });
    own[k] = sum;
    at.p[k] = -sum;
  });
  if (view.fixes[i])
    for (int k = stage.offset; k < stage.columns; ++k)
      if (at.sides[k] != 0) at.p[k] = bound_of(view, i, k);
}

/// Replaces p of the next node by p of this one. It stays in registers, since a value just written to memory takes a
/// while to be readable.
template <class Stage>
RHEC_ALWAYS_INLINE inline void solve_stage_backward(const RiccatiView& view, int i, typename Stage::R& p) {
  using R = typename Stage::R;
  const Stage stage(view, i);
  const Memory<Stage> at(view, i);
  const auto subtract_policy = [&](R& sum, const R& gradient) RHEC_ALWAYS_INLINE {
    stage.each_control([&](auto k) RHEC_ALWAYS_INLINE { sum.add(at.row(at.V, k - stage.offset), -gradient.splat(k)); });
  };
  R costate = p;
  costate.add(R::from(at.drift));
  R gradient;  // with respect to the state (closed-loop in the first case) and the controls
  if (Stage::is_compact && !view.fixes[i]) {
    const R h = R::from(at.h);
    R sums[2] = {h, costate.between(stage.moved, stage.next_states)};
    subtract_policy(sums[0], h);
    stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE { sums[l % 2].add(R::from(at.closed + l * 8), costate.splat(l)); });
    gradient = sums[0];
    gradient.add(sums[1]);
    p = gradient;
  } else {
    R sums[2] = {R::from(at.h), costate.between(stage.moved, stage.next_states)};
    stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE { sums[l % R::chains].add(at.row(at.AB, l), costate.splat(l)); });
    gradient = sums[0];
    if (R::chains > 1 || stage.moved < stage.next_states) gradient.add(sums[1]);
    if (view.fixes[i]) {
      gradient.to(at.g);
      stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
        if (at.sides[k] != 0) gradient.add(at.row(at.U, k - stage.offset), bound_of(view, i, k));
      });
    }
    p = gradient;
    subtract_policy(p, gradient);
  }
  p.to(at.p);
  solve_controls(view, i, stage, at, [&](auto k) RHEC_ALWAYS_INLINE { return gradient.entry(k); });
}

/// What solve_stage_backward does, for any sizes, with p in memory.
void solve_backward_general(const RiccatiView& view, int i) {
  using Stage = Shape<most_columns / 8, 0, 0>;
  const Stage stage(view, i);
  const Memory<Stage> at(view, i);
  const int controls = stage.columns - stage.offset;
  const RowFunctions& rows = row_functions_for(stage.columns);
  alignas(64) double costate[most_columns], gradient[most_columns];
  for (int j = 0; j < rows.width; ++j) {
    costate[j] = at.p_next[j] + at.drift[j];
    gradient[j] = at.h[j];
  }
  rows.accumulate(1.0, stage.moved, at.AB, at.stride, costate, gradient);
  for (int j = stage.moved; j < stage.next_states; ++j) gradient[j] += costate[j];
  if (view.fixes[i]) {
    copy_first(rows.width, rows.width, gradient, at.g);
    for (int k = stage.offset; k < stage.columns; ++k) {
      if (at.sides[k] == 0) continue;
      const double bound = bound_of(view, i, k);
      rows.accumulate(1.0, 1, at.U + (k - stage.offset) * at.stride, at.stride, &bound, gradient);
    }
  }
  copy_first(rows.width, rows.width, gradient, at.p);
  rows.accumulate(-1.0, controls, at.V, at.stride, gradient + stage.offset, at.p);
  solve_controls(view, i, stage, at, [&](int k) RHEC_ALWAYS_INLINE { return gradient[k]; });
}

/// Multipliers of the active bounds of a stage's controls.
template <class Stage>
inline void write_multipliers(const RiccatiView& view, int i, const Stage& stage, const Memory<Stage>& at) {
  const double* z = view.values + i * at.stride;
  double* bounds = view.bounds + i * at.stride;
  for (int k = stage.offset; k < stage.columns; ++k) {
    if (at.sides[k] == 0) continue;
    const double* row = at.U + (k - stage.offset) * at.stride;
    double sum = at.g[k];
    for (int j = 0; j < stage.states; ++j) sum += row[j] * z[j];
    for (int j = stage.offset; j < stage.columns; ++j) sum += row[j] * z[j];
    bounds[k] = -sum;
  }
}

/// Replaces the step s of the state by that of the next node.
template <class Stage>
RHEC_ALWAYS_INLINE inline void solve_stage_forward(const RiccatiView& view, int i, double* s) {
  using R = typename Stage::R;
  const Stage stage(view, i);
  const Memory<Stage> at(view, i);
  double *z = view.values + i * at.stride, *next = z + at.stride;
  double w[Stage::most_columns], reached[Stage::most_states];
  // Two independent partial sums.
  const auto dot = [&](const double* row) RHEC_ALWAYS_INLINE {
    double sums[2] = {0.0, 0.0};
    stage.each_state([&](auto j) RHEC_ALWAYS_INLINE { sums[j % 2] += row[j] * s[j]; });
    return sums[0] + sums[1];
  };
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
    w[k] = at.p[k] - dot(at.V + (k - stage.offset) * at.stride);
    z[k] = w[k];
  });
  stage.each_next_state([&](auto l) RHEC_ALWAYS_INLINE {
    const double* AB = at.AB + l * at.stride;
    double sum = at.b[l] + dot(AB);
    stage.each_control([&](auto k) RHEC_ALWAYS_INLINE { sum += AB[k] * w[k]; });
    reached[l] = next[l] = sum;
  });
  double* const costates = view.costates + (i + 1) * at.stride;
  if constexpr (Stage::is_known) {
    R sums[2] = {R::from(at.p_next).first(stage.next_states), R{}};
    stage.each_next_state([&](auto l)
                              RHEC_ALWAYS_INLINE { sums[l % R::chains].add(at.row(at.P_next, l), reached[l]); });
    if (R::chains > 1) sums[0].add(sums[1]);
    sums[0].to(costates);
  } else {
    const RowFunctions& rows = row_functions_for(stage.columns);
    copy_first(stage.next_states, rows.width, at.p_next, costates);
    rows.accumulate(1.0, stage.next_states, at.P_next, at.stride, reached, costates);
  }
  stage.each_next_state([&](auto l) RHEC_ALWAYS_INLINE { s[l] = reached[l]; });
  if (view.fixes[i]) write_multipliers(view, i, stage, at);
}

/// The same in one register: [next state; control] is a sum of columns. Carried states are kept in a register of their
/// own, so that they add no latency.
template <class Stage>
RHEC_ALWAYS_INLINE inline void solve_stage_forward(const RiccatiView& view, int i, Row<1>& carried, Row<1>& s) {
  const Stage stage(view, i);
  const Memory<Stage> at(view, i);
  const LaneMask is_state = lane_numbers < static_cast<long long>(stage.states);
  Lanes sums[2] = {is_state ? load(at.b) : load(at.p), Lanes{}};
  stage.each_carried([&](auto j) RHEC_ALWAYS_INLINE { sums[1] += load(at.T + j * 8) * carried.splat(j); });
  stage.each_moved([&](auto j) RHEC_ALWAYS_INLINE { sums[j % 2] += load(at.T + j * 8) * s.splat(j); });
  Row<1> next{{sums[0] + sums[1]}};
  double* z = view.values + i * at.stride;
  store(is_state ? s.part[0] : next.part[0], z);
  const Row<1> reached = next;
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE { next.part[0] += load(at.T + k * 8) * reached.splat(k); });
  s.part[0] = is_state ? next.part[0] : Lanes{};
  carried.part[0] += load(at.b);
  store(s.part[0], z + at.stride);
  Lanes costates[2] = {Row<1>::from(at.p_next).first(stage.states).part[0], Lanes{}};
  stage.each_state([&](auto l) RHEC_ALWAYS_INLINE { costates[l % 2] += at.row(at.P_next, l).part[0] * s.splat(l); });
  store(costates[0] + costates[1], view.costates + (i + 1) * at.stride);
  if (view.fixes[i]) write_multipliers(view, i, stage, at);
}

/// One entry of the rows of a batch of sensitivities.
using Batch = Row<response_batch / lane_count>;

/// A register of every entry of a batch: with the entries of all registers at once, those of a stage would not fit into
/// the processor's. `gradients` begins at this register. If carried states keep their values, they take no part.
template <class Stage, bool keeps_carried>
RHEC_ALWAYS_INLINE inline void sensitivities_stage_backward(const Stage& stage, const Memory<Stage>& at,
                                                            bool has_gradient, bool has_next, double* own) {
  const double* next = own + at.stride * response_batch;
  Lanes costates[Stage::most_states], gradient[Stage::most_columns];
  const auto each_state = [&](const auto& function) RHEC_ALWAYS_INLINE {
    if constexpr (keeps_carried)
      stage.each_moved(function);
    else
      stage.each_state(function);
  };
  const auto take = [&](auto l)
                        RHEC_ALWAYS_INLINE { costates[l] = has_next ? load(next + l * response_batch) : Lanes{}; };
  if constexpr (keeps_carried)
    stage.each_moved(take);
  else
    stage.each_next_state(take);
  const auto form = [&](auto k) RHEC_ALWAYS_INLINE {
    Lanes sum = has_gradient ? load(own + k * response_batch) : Lanes{};
    stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE { sum += costates[l] * at.AB[l * at.stride + k]; });
    if (!keeps_carried && k >= stage.moved && k < stage.next_states) sum += costates[k];
    gradient[k] = sum;
  };
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
    form(k);
    store(gradient[k], own + k * response_batch);
  });
  each_state(form);
  stage.each_control_back([&](auto k) RHEC_ALWAYS_INLINE {
    if (at.sides[k] != 0) return;
    const double* column = at.U + (k - stage.offset) * at.stride;
    const Lanes of_control = gradient[k] * -at.inverse[k - stage.offset];
    const auto add = [&](auto j) RHEC_ALWAYS_INLINE { gradient[j] += of_control * column[j]; };
    stage.each_control_before(k, add);
    each_state(add);
    store(gradient[k], own + k * response_batch);
  });
  each_state([&](auto k) RHEC_ALWAYS_INLINE { store(gradient[k], own + k * response_batch); });
}

/// The same forwards. Behind the last stage with a gradient, the gradients of value functions and controls are zero.
/// `costates` (null: none) are those of the next node.
template <class Stage, bool keeps_carried>
RHEC_ALWAYS_INLINE inline void sensitivities_stage_forward(const Stage& stage, const Memory<Stage>& at,
                                                           bool has_gradient, bool has_next, double* own,
                                                           double* costates) {
  double* next = own + at.stride * response_batch;
  Lanes z[Stage::most_columns];
  const auto each_state = [&](const auto& function) RHEC_ALWAYS_INLINE {
    if constexpr (keeps_carried)
      stage.each_moved(function);
    else
      stage.each_state(function);
  };
  each_state([&](auto j) RHEC_ALWAYS_INLINE { z[j] = load(own + j * response_batch); });
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
    z[k] = Lanes{};
    if (at.sides[k] != 0) return;
    const double* column = at.U + (k - stage.offset) * at.stride;
    Lanes sum = has_gradient ? load(own + k * response_batch) : Lanes{};
    const auto add = [&](auto j) RHEC_ALWAYS_INLINE { sum += z[j] * column[j]; };
    each_state(add);
    stage.each_control_before(k, add);
    z[k] = sum * -at.inverse[k - stage.offset];
  });
  const auto next_state = [&](auto l) RHEC_ALWAYS_INLINE {
    Lanes sum{};
    const auto add = [&](auto j) RHEC_ALWAYS_INLINE { sum += z[j] * at.AB[l * at.stride + j]; };
    each_state(add);
    stage.each_control(add);
    return sum;
  };
  if (!keeps_carried && costates) {
    Lanes reached[Stage::most_states];
    stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE { reached[l] = next_state(l); });
    stage.each_carried([&](auto l) RHEC_ALWAYS_INLINE { reached[l] = z[l]; });
    stage.each_next_state([&](auto l) RHEC_ALWAYS_INLINE {
      Lanes sum = has_next ? load(next + l * response_batch) : Lanes{};
      stage.each_next_state([&](auto j) RHEC_ALWAYS_INLINE { sum += reached[j] * at.P_next[l * at.stride + j]; });
      store(sum, costates + l * response_batch);
    });
    stage.each_next_state([&](auto l) RHEC_ALWAYS_INLINE { store(reached[l], next + l * response_batch); });
  } else {
    stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE { store(next_state(l), next + l * response_batch); });
    stage.each_carried([&](auto l)
                           RHEC_ALWAYS_INLINE { store(keeps_carried ? Lanes{} : z[l], next + l * response_batch); });
  }
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
    Lanes answer = z[k];
    if (at.sides[k] != 0) {
      // The sensitivity of a fixed control is that of its multiplier.
      const double* column = at.U + (k - stage.offset) * at.stride;
      Lanes sum = has_gradient ? load(own + k * response_batch) : Lanes{};
      const auto add = [&](auto j) RHEC_ALWAYS_INLINE { sum += z[j] * column[j]; };
      each_state(add);
      stage.each_control(add);
      answer = -sum;
    }
    store(answer, own + k * response_batch);
  });
}

/// Calls `function` with the type of a stage's shape: one of the sizes for which kernels are compiled, or a general
/// one. The compiled sizes are those of estimators and controllers with two inputs: vehicles with three to five states
/// plus parameters, between the starts of blocks, where the parameters are carried; that of a controller with the rate
/// of one input; and the most common ones where blocks start. The row length has no other effect: a QP gives the same
/// bits with another capacity. General shapes differ by the rows' length only if it `counts`. Those with process noise
/// are many and large, and unrolled only if `noise_is_written_out`.
template <bool is_written_out, bool length_counts = true, bool noise_is_written_out = is_written_out, class Function>
inline auto with_shape(const RiccatiView& view, int i, const Function& function) {
  const int states = view.states, controls = view.control_counts[i], carried = view.identity_counts[i];
  const bool is_full = view.state_counts[i] == states && view.state_counts[i + 1] == states;
  if (is_full && view.stride == 8 && controls == 2) {
    if (states == 5 && carried == 2) return function.template operator()<Shape<1, 5, 2, true, 2, 8>>();
    if (states == 6 && carried == 2) return function.template operator()<Shape<1, 6, 2, true, 2, 8>>();
    if (states == 6) return function.template operator()<Shape<1, 6, 2, true, 0, 8>>();
  }
  if (is_full && view.stride == 16) {
    if (controls == 2) {
      if (states == 5 && carried == 2) return function.template operator()<Shape<1, 5, 2, true, 2, 16>>();
      if (states == 6 && carried == 2) return function.template operator()<Shape<1, 6, 2, true, 2, 16>>();
      if (states == 6) return function.template operator()<Shape<1, 6, 2, true, 0, 16>>();
      if (states == 7 && carried == 2) return function.template operator()<Shape<2, 7, 2, is_written_out, 2, 16>>();
      if (states == 7 && carried == 3) return function.template operator()<Shape<2, 7, 2, is_written_out, 3, 16>>();
      if (states == 8 && carried == 3) return function.template operator()<Shape<2, 8, 2, is_written_out, 3, 16>>();
      if (states == 8 && carried == 4) return function.template operator()<Shape<2, 8, 2, is_written_out, 4, 16>>();
    }
    // Process noise: of one, two or four states, as inputs, beside two inputs of the vehicle.
    if (states == 6 && carried == 2) {
      if (controls == 3) return function.template operator()<Shape<2, 6, 3, noise_is_written_out, 2, 16>>();
      if (controls == 4) return function.template operator()<Shape<2, 6, 4, noise_is_written_out, 2, 16>>();
      if (controls == 6) return function.template operator()<Shape<2, 6, 6, noise_is_written_out, 2, 16>>();
    }
    if (states == 6 && controls == 3)
      return function.template operator()<Shape<2, 6, 3, noise_is_written_out, 0, 16>>();
    if (states == 6 && controls == 4)
      return function.template operator()<Shape<2, 6, 4, noise_is_written_out, 0, 16>>();
  }
  if constexpr (!length_counts) return function.template operator()<Shape<16, 0, 0>>();
  const int columns = states + controls;
  if (columns <= 8) return function.template operator()<Shape<1, 0, 0>>();
  if (columns <= 16) return function.template operator()<Shape<2, 0, 0>>();
  if (columns <= 24) return function.template operator()<Shape<3, 0, 0>>();  // rows are not longer than that here
  if (columns <= 32) return function.template operator()<Shape<4, 0, 0>>();
  if (columns <= 64) return function.template operator()<Shape<8, 0, 0>>();
  return function.template operator()<Shape<16, 0, 0>>();
}

// Whole matrices of long rows fit only into the widest registers; unrolled for others, they are spilled to memory.
constexpr bool matrices_fit = lane_count == 8;

/// Whether stage j can be processed in the same loop as stage i.
inline bool is_alike(const RiccatiView& view, int i, int j) {
  return view.special[j] == 0 && view.control_counts[j] == view.control_counts[i] &&
         view.identity_counts[j] == view.identity_counts[i] && view.state_counts[j] == view.state_counts[i] &&
         view.state_counts[j + 1] == view.state_counts[i + 1];
}

/// Whether stages of six states, two of them carried, that have so many controls beside the first two are factorised as
/// whole shapes: unrolled in the widest registers, these have fewer dependent operations.
constexpr bool is_factored_whole(int further) { return matrices_fit && (further == 2 || further == 4); }

/// Calls `function` with the type of the shape that a full stage has with the first two of its controls, and with the
/// number of the others if that is compiled in (otherwise 0). False if there are no others, or the shape is not one of
/// the compiled ones.
template <class Function>
inline bool with_further_controls(const RiccatiView& view, int i, const Function& function) {
  const int states = view.states, carried = view.identity_counts[i], further = view.control_counts[i] - 2;
  if (further <= 0 || view.stride != 16 || view.state_counts[i] != states || view.state_counts[i + 1] != states)
    return false;
  if (states == 6 && carried == 2) {
    if (is_factored_whole(further)) return false;
    if (further == 1) return function.template operator()<Shape<1, 6, 2, true, 2, 16>, 1>(), true;
    return function.template operator()<Shape<1, 6, 2, true, 2, 16>, 0>(), true;
  }
  if (states == 5 && carried == 2) return function.template operator()<Shape<1, 5, 2, true, 2, 16>, 0>(), true;
  if (states == 7 && carried == 2) return function.template operator()<Shape<2, 7, 2, matrices_fit, 2, 16>, 0>(), true;
  if (states == 7 && carried == 3) return function.template operator()<Shape<2, 7, 2, matrices_fit, 3, 16>, 0>(), true;
  if (states == 8 && carried == 3) return function.template operator()<Shape<2, 8, 2, matrices_fit, 3, 16>, 0>(), true;
  if (states == 8 && carried == 4) return function.template operator()<Shape<2, 8, 2, matrices_fit, 4, 16>, 0>(), true;
  return false;
}

int factor(const RiccatiView& view, int first, double tolerance) {
  for (int i = first; i >= 0;) {
    if (view.special[i]) return i;
    bool done = false;
    const bool has_further = with_further_controls(view, i, [&]<class Stage, int further>() {
      const int alike = i;
      do
        if (!factor_further_stage<Stage, further>(view, i, tolerance)) return;
      while (--i >= 0 && is_alike(view, alike, i));
      done = true;
    });
    if (!has_further)
      done = with_shape<matrices_fit>(view, i, [&]<class Stage>() {
        // with_further_controls has taken full stages of these shapes.
        constexpr bool is_taken = Stage::known_states == 6 && Stage::known_carried == 2 && Stage::known_controls > 2 &&
                                  !is_factored_whole(Stage::known_controls - 2);
        if constexpr (is_taken || (!Stage::is_known && Stage::most_columns > 8))
          return factor_general(view, i, tolerance) && (--i, true);
        const int alike = i;
        do
          if (!factor_stage<Stage>(view, i, tolerance)) return false;
        while (--i >= 0 && is_alike(view, alike, i));
        return true;
      });
    if (!done) return i;
  }
  return -1;
}

int solve_backward(const RiccatiView& view, int first) {
  for (int i = first; i >= 0;) {
    if (view.special[i]) return i;
    with_shape<true>(view, i, [&]<class Stage>() {
      if constexpr (!Stage::is_known && Stage::most_columns > 8) {
        solve_backward_general(view, i--);
        return;
      }
      const int alike = i;
      auto p = Stage::R::from(view.p + static_cast<long>(i + 1) * view.stride);
      do solve_stage_backward<Stage>(view, i, p);
      while (--i >= 0 && is_alike(view, alike, i));
    });
  }
  return -1;
}

int solve_forward(const RiccatiView& view, int first) {
  for (int i = first; i < view.intervals;) {
    if (view.special[i]) return i;
    with_shape<true, false>(view, i, [&]<class Stage>() {
      const int alike = i;
      const double* first_state = view.values + static_cast<long>(i) * view.stride;
      if constexpr (Stage::is_compact) {
        Row<1> s = Row<1>::from(first_state), carried = s;
        do solve_stage_forward<Stage>(view, i, carried, s);
        while (++i < view.intervals && is_alike(view, alike, i));
      } else {
        double s[Stage::most_states];
        for (int j = 0; j < view.state_counts[i]; ++j) s[j] = first_state[j];
        do solve_stage_forward<Stage>(view, i, s);
        while (++i < view.intervals && is_alike(view, alike, i));
      }
    });
  }
  return view.intervals;
}

/// Calls function(first) for each register of a batch's entries.
template <class Function>
RHEC_ALWAYS_INLINE inline void each_register(const Function& function) {
  for (int first = 0; first < response_batch; first += lane_count) function(first);
}

// Bounds are seldom active where there is process noise, and then for few stages: the loops of its shapes stay loops.
template <bool keeps_carried>
void sensitivities_backward_of(const RiccatiView& view, int last, const unsigned char* has_gradient,
                               double* gradients) {
  for (int i = last < view.intervals ? last : view.intervals - 1; i >= 0;)
    with_shape<true, false, false>(view, i, [&]<class Stage>() {
      const int alike = i;
      do {
        const Stage stage(view, i);
        const Memory<Stage> at(view, i);
        double* own = gradients + i * at.stride * response_batch;
        each_register([&](int first) RHEC_ALWAYS_INLINE {
          sensitivities_stage_backward<Stage, keeps_carried>(stage, at, has_gradient[i] != 0, i < last, own + first);
        });
      } while (--i >= 0 && is_alike(view, alike, i));
    });
}

void sensitivities_backward(const RiccatiView& view, int last, const unsigned char* has_gradient, double* gradients) {
  if (view.keeps_carried)
    sensitivities_backward_of<true>(view, last, has_gradient, gradients);
  else
    sensitivities_backward_of<false>(view, last, has_gradient, gradients);
}

template <bool keeps_carried>
void sensitivities_forward_of(const RiccatiView& view, int last, double* sensitivities, double* costates) {
  for (int i = 0; i < view.intervals;)
    with_shape<true, false, false>(view, i, [&]<class Stage>() {
      const int alike = i;
      do {
        const Stage stage(view, i);
        const Memory<Stage> at(view, i);
        const long row = at.stride * response_batch;
        double* own = sensitivities + i * row;
        double* of_next = costates ? costates + (i + 1) * row : nullptr;
        each_register([&](int first) RHEC_ALWAYS_INLINE {
          sensitivities_stage_forward<Stage, keeps_carried>(stage, at, i <= last, i < last, own + first,
                                                            of_next ? of_next + first : nullptr);
        });
      } while (++i < view.intervals && is_alike(view, alike, i));
    });
}

void sensitivities_forward(const RiccatiView& view, int last, double* sensitivities, double* costates) {
  if (view.keeps_carried)
    sensitivities_forward_of<true>(view, last, sensitivities, nullptr);
  else
    sensitivities_forward_of<false>(view, last, sensitivities, costates);
}

void combine(const double* batch, const double* weights, double* sums, long count) {
  static_assert(response_batch == 8);
  const Batch weight = Batch::from(weights);
  for (long k = 0; k < count; k += 8, batch += 8 * response_batch) {
    Lanes of_entry[8];
    for (int j = 0; j < 8; ++j) {
      const Batch entry = Batch::from(batch + j * response_batch);
      of_entry[j] = entry.part[0] * weight.part[0];
      for (int v = 1; v < response_batch / lane_count; ++v) of_entry[j] += entry.part[v] * weight.part[v];
    }
    add_sums_of(of_entry, sums + k);
  }
}

/// The weighted sums of `number` batches at once.
template <int number>
RHEC_ALWAYS_INLINE inline void combine_few(const double* const* batches, const double* const* weights, double* sums,
                                           long count) {
  Batch weight[number];
  for (int b = 0; b < number; ++b) weight[b] = Batch::from(weights[b]);
  for (long k = 0; k < count; k += 8) {
    Lanes of_entry[8];
    for (int j = 0; j < 8; ++j) {
      of_entry[j] = Lanes{};
      for (int b = 0; b < number; ++b) {
        const Batch entry = Batch::from(batches[b] + (k + j) * response_batch);
        for (int v = 0; v < response_batch / lane_count; ++v) of_entry[j] += entry.part[v] * weight[b].part[v];
      }
    }
    add_sums_of(of_entry, sums + k);
  }
}

// As many at once as there are registers for their weights.
void combine_batches(const double* const* batches, const double* const* weights, int number, double* sums, long count) {
  for (; number >= 3; number -= 3, batches += 3, weights += 3) combine_few<3>(batches, weights, sums, count);
  if (number == 2) combine_few<2>(batches, weights, sums, count);
  if (number == 1) combine_few<1>(batches, weights, sums, count);
}

/// The part of a row that holds states.
template <class Stage>
using StateRow = Row<Stage::state_registers>;

/// Replaces Sigma of stage i by that of the next node: A Sigma A' + B cov(w | s) B', with A the closed-loop dynamics.
template <class Stage>
RHEC_ALWAYS_INLINE inline void carry_stage(const RiccatiView& view, int i, StateRow<Stage>* rows) {
  using R = StateRow<Stage>;
  static_assert(Stage::is_known);
  const Stage stage(view, i);
  const Memory<Stage> at(view, i);
  // The closed-loop dynamics in memory: loading a single entry from there costs no more than a whole register.
  alignas(64) double closed_rows[Stage::is_compact ? 1 : Stage::most_states * Stage::most_columns];
  const double* const closed = Stage::is_compact ? at.closed : closed_rows;
  constexpr int width = Stage::is_compact ? 8 : Stage::most_columns;
  if constexpr (!Stage::is_compact) {
    stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE {
      R row = R::from(at.AB + l * at.stride).first(stage.states);
      stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
        row.add(R::from(at.V + (k - stage.offset) * at.stride), -at.AB[l * at.stride + k]);
      });
      row.to(closed_rows + l * width);
    });
  }
  // The contribution of the controls, which does not depend on earlier stages.
  R next[Stage::most_states] = {};
  R effects[Stage::most_columns];  // columns of B
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
    effects[k] = R{};
    stage.each_next_state([&](auto l)
                              RHEC_ALWAYS_INLINE { effects[k] = effects[k].with(l, at.AB[l * at.stride + k]); });
  });
  // The conditional variance of a control given those before it also acts through the later ones.
  stage.each_control([&](auto k) RHEC_ALWAYS_INLINE {
    double moved[Stage::most_columns] = {};
    moved[k] = 1.0;
    R noise = effects[k];
    for (int j = k + 1; j < stage.columns; ++j) {
      for (int before = k; before < j; ++before)
        moved[j] -= at.U[(j - stage.offset) * at.stride + before] * at.inverse[j - stage.offset] * moved[before];
      noise.add(effects[j], moved[j]);
    }
    const double variance = 2.0 * at.inverse[k - stage.offset];
    stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE { next[l].add(noise, noise.splat(l) * variance); });
  });
  // `start` plus the sum of `terms`, each times its entry of row l of the dynamics.
  const auto combine_by = [&](auto l, const R* terms, const R& start) RHEC_ALWAYS_INLINE {
    R sums[2] = {start, R{}};
    stage.each_state([&](auto j) RHEC_ALWAYS_INLINE { sums[j % R::chains].add(terms[j], closed[l * width + j]); });
    if (R::chains > 1) sums[0].add(sums[1]);
    return sums[0];
  };
  R products[Stage::most_columns] = {};
  stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE { products[l] = combine_by(l, rows, R{}); });
  stage.each_carried([&](auto l) RHEC_ALWAYS_INLINE { products[l] = rows[l]; });
  // The products are needed by columns.
  constexpr bool is_one_register = Stage::state_registers == 1 && lane_count == 8;
  R columns[Stage::most_columns] = {};
  if constexpr (is_one_register) {
    Lanes lanes[8];
    for (int l = 0; l < 8; ++l) lanes[l] = products[l].part[0];
    transpose(lanes);
    for (int j = 0; j < 8; ++j) columns[j].part[0] = lanes[j];
  } else {
    double transposed[Stage::most_states][Stage::most_columns] = {};
    for (int l = 0; l < stage.next_states; ++l)
      for (int j = 0; j < stage.states; ++j) transposed[j][l] = products[l].entry(j);
    for (int j = 0; j < stage.states; ++j) columns[j] = R::from(transposed[j]);
  }
  stage.each_moved([&](auto l) RHEC_ALWAYS_INLINE { next[l] = combine_by(l, columns, next[l]); });
  stage.each_carried([&](auto l) RHEC_ALWAYS_INLINE { next[l] = columns[l]; });
  stage.each_next_state([&](auto l) RHEC_ALWAYS_INLINE { rows[l] = next[l].first(stage.next_states); });
}

/// Row r of `to`: the sum over k of factor(r, k) times row k of `from`, which has `width` entries. Two rows at a time,
/// for the processor's pipelines; an odd last one twice.
template <int width, class Factor>
RHEC_ALWAYS_INLINE inline void combine_rows(int count, int terms, const double* from, const Factor& factor, double* to,
                                            long step) {
  using R = Row<width / lane_count>;
  for (int r = 0; r < count; r += 2) {
    const int other = r + 1 < count ? r + 1 : r;
    R rows[2] = {};
    for (int k = 0; k < terms; ++k) {
      const R term = R::from(from + k * width);
      rows[0].add(term, factor(r, k));
      rows[1].add(term, factor(other, k));
    }
    rows[0].to(to + r * step);
    rows[1].to(to + other * step);
  }
}

/// What carry_stage does, for any sizes, with rows of `width` states in memory.
template <int width>
inline void carry_general_stage(const RiccatiView& view, int i, double* sigma) {
  using R = Row<width / lane_count>;
  constexpr int most_controls = 64;
  const long stride = view.stride;
  const int states = view.state_counts[i], next_states = view.state_counts[i + 1], controls = view.control_counts[i];
  const double *AB = view.AB + i * view.states * stride, *U = view.U + i * view.controls * stride,
               *inverse = view.inverse + i * view.controls;
  // Columns of A and B.
  alignas(64) double A[width * width], B[most_controls * width], scaled[most_controls * width], M[width * width];
  for (int j = 0; j < states; ++j) R{}.to(A + j * width);
  for (int k = 0; k < controls; ++k) R{}.to(B + k * width);
  for (int l = 0; l < next_states; ++l) {
    const double* const row = AB + l * stride;
    for (int j = 0; j < states; ++j) A[j * width + l] = row[j];
    for (int k = 0; k < controls; ++k) B[k * width + l] = row[view.states + k];
  }
  // What a control given those before it does, which acts through the later ones, too; and the closed loop.
  for (int k = controls - 1; k >= 0; --k) {
    R effect = R::from(B + k * width);
    for (int j = k + 1; j < controls; ++j) effect.add(R::from(scaled + j * width), -U[j * stride + view.states + k]);
    effect.to(B + k * width);
    R product{};
    product.add(effect, inverse[k]);
    product.to(scaled + k * width);
  }
  for (int j = 0; j < states; ++j) {
    R column = R::from(A + j * width);
    for (int k = 0; k < controls; ++k) column.add(R::from(scaled + k * width), -U[k * stride + j]);
    column.to(A + j * width);
  }
  // Sigma A'
  combine_rows<width>(
      states, states, A, [&](int j, int k) RHEC_ALWAYS_INLINE { return sigma[j * stride + k]; }, M, width);
  for (int l = 0; l < next_states; ++l) {
    R row{};
    for (int k = 0; k < controls; ++k) row.add(R::from(scaled + k * width), 2.0 * B[k * width + l]);
    for (int j = 0; j < states; ++j) row.add(R::from(M + j * width), A[j * width + l]);
    row.to(sigma + l * stride);
  }
}

inline void carry_general(const RiccatiView& view, int i, double* sigma) {
  with_width_of_states(most_states(view, i), [&]<int width>() { carry_general_stage<width>(view, i, sigma); });
}

int carry_covariance(const RiccatiView& view, int first, double* covariance, double* all) {
  for (int i = first; i < view.intervals;) {
    if (view.special[i]) return i;
    with_shape<matrices_fit>(view, i, [&]<class Stage>() {
      if constexpr (Stage::is_known) {
        const int alike = i, states = view.state_counts[i], next_states = view.state_counts[i + 1];
        StateRow<Stage> rows[Stage::most_states];
        for (int j = 0; j < states; ++j) rows[j] = StateRow<Stage>::from(covariance + j * view.stride);
        do carry_stage<Stage>(view, i, rows);
        while (++i < view.intervals && !all && next_states == states && is_alike(view, alike, i));
        for (int l = 0; l < next_states; ++l) rows[l].to(covariance + l * view.stride);
      } else {
        carry_general(view, i++, covariance);
      }
    });
    if (!all) continue;
    double* block = all + static_cast<long>(i) * view.states * view.states;
    for (int c = 0; c < view.states; ++c)
      for (int r = 0; r < view.states; ++r) block[c * view.states + r] = covariance[c * view.stride + r];
  }
  return view.intervals;
}

/// Sigma given what half of H, a matrix of n rows, says as well: with H / 2 = L D L', one measurement after the other,
/// with the gradient l and the variance 1 / d.
template <int width>
inline bool condition(const double* H, long stride, int n, double* sigma) {
  using R = Row<width / lane_count>;
  constexpr double zero_pivot = 1e-13;  // relative: what is left of a pivot by rounding
  // Mostly, few states are measured. Where the diagonal is zero, so is the row of a matrix that is positive
  // semidefinite.
  int count = 0, states[width];
  for (int r = 0; r < n; ++r)
    if (H[r * (stride + 1)] != 0.0) states[count++] = r;
  alignas(64) double G[width * width];
  double diagonal[width];
  for (int a = 0; a < count; ++a) {
    for (int b = 0; b < count; ++b) G[a * width + b] = 0.5 * H[states[a] * stride + states[b]];
    diagonal[a] = G[a * width + a];
  }
  for (int a = 0; a < count; ++a) {
    const double pivot = G[a * width + a];
    if (!(pivot > -zero_pivot * diagonal[a])) return false;
    if (!(pivot > zero_pivot * diagonal[a])) continue;
    const double reciprocal = 1.0 / pivot;
    R products{};
    for (int b = a; b < count; ++b) products.add(R::from(sigma + states[b] * stride), G[a * width + b] * reciprocal);
    alignas(64) double entries[width];
    products.to(entries);
    double variance = reciprocal;
    for (int b = a; b < count; ++b) variance += G[a * width + b] * reciprocal * entries[states[b]];
    R gain{};
    gain.add(products, -1.0 / variance);
    for (int r = 0; r < n; ++r) {
      R row = R::from(sigma + r * stride);
      row.add(gain, entries[r]);
      row.to(sigma + r * stride);
    }
    for (int r = a + 1; r < count; ++r)
      for (int c = r; c < count; ++c) G[r * width + c] -= G[a * width + r] * G[a * width + c] * reciprocal;
  }
  return true;
}

/// Sigma of the next node: A Sigma A' + B cov(w) B', of controls that are not coupled to anything.
template <int width>
inline bool predict_covariance(const RiccatiView& view, int i, double* sigma) {
  using R = Row<width / lane_count>;
  const long stride = view.stride;
  const int states = view.state_counts[i], next_states = view.state_counts[i + 1], controls = view.control_counts[i];
  const double* const AB = view.AB + i * view.states * stride;
  const double* const H = view.H + i * (view.states + view.controls) * stride;
  alignas(64) double A[width * width], M[width * width], variances[64];
  for (int k = 0; k < controls; ++k) {
    const double* const row = H + (view.states + k) * stride;
    Lanes sum{};
    for (long j = 0; j < stride; j += lane_count) sum += absolute(load(row + j));
    const double own = row[view.states + k];
    if (!(own > 0.0) || sum_of(sum) != own) return false;  // nothing is added to it in a row of zeros
    variances[k] = 2.0 / own;
  }
  for (int j = 0; j < states; ++j) R{}.to(A + j * width);
  for (int l = 0; l < next_states; ++l)
    for (int j = 0; j < states; ++j) A[j * width + l] = AB[l * stride + j];
  // Sigma A', then A times that.
  combine_rows<width>(
      states, states, A, [&](int j, int k) RHEC_ALWAYS_INLINE { return sigma[j * stride + k]; }, M, width);
  combine_rows<width>(
      next_states, states, M, [&](int l, int j) RHEC_ALWAYS_INLINE { return A[j * width + l]; }, sigma, stride);
  for (int k = 0; k < controls; ++k) {
    alignas(64) double effects[width] = {};
    bool any = false;
    for (int l = 0; l < next_states; ++l) {
      effects[l] = AB[l * stride + view.states + k];
      any |= effects[l] != 0.0;
    }
    if (!any) continue;
    const R effect = R::from(effects);
    for (int l = 0; l < next_states; ++l) {
      if (effects[l] == 0.0) continue;
      R row = R::from(sigma + l * stride);
      row.add(effect, effects[l] * variances[k]);
      row.to(sigma + l * stride);
    }
  }
  return true;
}

template <int width>
inline bool filter_covariance_of(const RiccatiView& view, double* sigma) {
  for (int i = 0; i < view.intervals; ++i) {
    if (!predict_covariance<width>(view, i, sigma)) return false;
    const double* const H = view.H + static_cast<long>(i + 1) * (view.states + view.controls) * view.stride;
    if (!condition<width>(H, view.stride, view.state_counts[i + 1], sigma)) return false;
  }
  return true;
}

bool filter_covariance(const RiccatiView& view, double* sigma) {
  return with_width_of_states(view.states, [&]<int width>() { return filter_covariance_of<width>(view, sigma); });
}

/// What form_rows does, for any sizes.
void form_general(const RiccatiView& view, int i, double* out) {
  const long stride = view.stride;
  const int offset = view.states, controls = view.control_counts[i], states = view.state_counts[i];
  const int next_states = view.state_counts[i + 1], moved = next_states - view.identity_counts[i];
  const RowFunctions& rows = row_functions_for(offset + controls);
  const Memory<Shape<1, 0, 0>> at(view, i);
  alignas(64) double W[most_rows * most_columns];
  rows.multiply(next_states, moved, at.P_next, at.AB, stride, W);
  rows.add_products(states, moved, W, rows.width, at.AB, stride, at.H, out, stride);
  rows.add_products(controls, moved, W, rows.width, at.AB + offset, stride, at.H + offset * stride,
                    out + offset * stride, stride);
  for (int k = 0; k < offset + controls; ++k) {
    double* const row = out + k * stride;
    if (k >= states && k < offset) continue;
    if (k >= moved && k < next_states)
      for (int j = 0; j < rows.width; ++j) row[j] += W[k * rows.width + j];
    add_to_diagonal(view, i, k, row);
  }
}

void form(const RiccatiView& view, int i, double* out) {
  with_shape<matrices_fit, true, false>(view, i, [&]<class Stage>() {
    if constexpr (Stage::is_known) {
      typename Stage::R W[Stage::most_states], X[Stage::most_columns]{};
      const Stage stage(view, i);
      const Memory<Stage> at(view, i);
      multiply_rows(stage, at, W);
      form_rows(view, i, stage, at, W, X);
      for (int k = 0; k < stage.columns; ++k) X[k].to(out + static_cast<long>(k) * view.stride);
    } else {
      form_general(view, i, out);
    }
  });
}

template <class Stage>
RHEC_ALWAYS_INLINE inline bool invert_rows(const Stage& stage, const double* matrix, long stride, double tolerance,
                                           double* inverse) {
  using R = typename Stage::R;
  R rows[Stage::most_states];
  double least[Stage::most_states];
  stage.each_state([&](auto j) RHEC_ALWAYS_INLINE {
    rows[j] = R::from(matrix + j * stride).first(stage.states);
    least[j] = tolerance * rows[j].entry(j);
  });
  bool is_definite = true;
  stage.each_state([&](auto k) RHEC_ALWAYS_INLINE {
    const double pivot = rows[k].entry(k);
    is_definite = is_definite && pivot > least[k] && pivot > 0.0;
    R scaled{};
    scaled.add(rows[k].with(k, 1.0), 1.0 / pivot);
    stage.each_state([&](auto j) RHEC_ALWAYS_INLINE {
      if (j == k) return;
      const double factor = rows[j].entry(k);
      rows[j] = rows[j].with(k, 0.0);
      rows[j].add(scaled, -factor);
    });
    rows[k] = scaled;
  });
  if (!is_definite) return false;
  stage.each_state([&](auto j) RHEC_ALWAYS_INLINE { rows[j].to(inverse + j * stride); });
  return true;
}

template <class Stage>
RHEC_ALWAYS_INLINE inline void solve_rows(const Stage& stage, const double* matrix, const double* inverse, long stride,
                                          const double* p, double* x) {
  using R = typename Stage::R;
  const auto product = [&](const double* rows, const R& factors, R start) RHEC_ALWAYS_INLINE {
    R sums[2] = {start, R{}};
    stage.each_state([&](auto j)
                         RHEC_ALWAYS_INLINE { sums[j % R::chains].add(R::from(rows + j * stride), factors.splat(j)); });
    if (R::chains > 1) sums[0].add(sums[1]);
    return sums[0];
  };
  const R right = R::from(p).first(stage.states), first = product(inverse, right, R{});
  R rest{};  // matrix x + p = p - matrix first
  rest.add(product(matrix, first, R{}), -1.0);
  rest.add(right);
  R solution{};
  solution.add(product(inverse, rest, first), -1.0);
  solution.first(stage.states).to(x);
}

/// Calls `function` with a shape of `count` states, for any stride; false if there are too many.
template <class Function>
inline bool with_states(int count, const Function& function) {
  if (count == 5) return function.template operator()<Shape<1, 5, 0>>();
  if (count == 6) return function.template operator()<Shape<1, 6, 0>>();
  if (count == 7) return function.template operator()<Shape<1, 7, 0>>();
  if (count == 8) return function.template operator()<Shape<1, 8, 0>>();
  if (count <= 8) return function.template operator()<Shape<1, 0, 0>>();
  if (count <= 16) return function.template operator()<Shape<2, 0, 0>>();
  return false;
}

bool invert(const double* matrix, int count, int stride, double tolerance, double* inverse) {
  return with_states(count,
                     [&]<class Stage>() { return invert_rows(Stage(count), matrix, stride, tolerance, inverse); });
}

void answer(const double* inverse, int count, int stride, double* batch) {
  Batch gradients[64];
  for (int j = 0; j < count; ++j) gradients[j] = Batch::from(batch + j * response_batch);
  for (int j = 0; j < count; ++j) {
    Batch sum{};
    for (int k = 0; k < count; ++k) sum.add(gradients[k], -inverse[j * stride + k]);
    sum.to(batch + j * response_batch);
  }
}

void solve(const double* matrix, const double* inverse, int count, int stride, const double* p, double* x) {
  with_states(count, [&]<class Stage>() {
    solve_rows(Stage(count), matrix, inverse, stride, p, x);
    return true;
  });
}

}  // namespace
}  // namespace kernels

#define RHEC_JOIN(a, b) a##b
#define RHEC_TABLE(name, set) RHEC_JOIN(name, set)
extern const RiccatiKernels RHEC_TABLE(riccati_kernels_, RHEC_SET);
constinit const RiccatiKernels RHEC_TABLE(riccati_kernels_, RHEC_SET) = {&kernels::factor,
                                                                         &kernels::solve_backward,
                                                                         &kernels::solve_forward,
                                                                         &kernels::sensitivities_backward,
                                                                         &kernels::sensitivities_forward,
                                                                         &kernels::combine,
                                                                         &kernels::combine_batches,
                                                                         &kernels::carry_covariance,
                                                                         &kernels::filter_covariance,
                                                                         &kernels::form,
                                                                         &kernels::invert,
                                                                         &kernels::answer,
                                                                         &kernels::solve};

}  // namespace rhec
