// Compiled once for every instruction set RHEC_SET; its table is riccati_kernels_<RHEC_SET>.
#include "riccati_kernels.hpp"

#include "lanes.hpp"

namespace rhec {
namespace kernels {
namespace {

// A stage's row may be this long: 32 states and 32 controls.
constexpr int longest_row = 64;

/// What is known of a stage when its kernel is compiled: how many times eight entries a row has, and how many states
/// and controls (unknown: 0).
template <int eights, int state_count, int control_count>
struct Shape {
  static constexpr int most_columns = eights * 8;
  static constexpr int registers = most_columns / lane_count;
  static constexpr int most_states = state_count > 0 ? state_count : (most_columns < 32 ? most_columns : 32);
  int states, next_states, offset, controls;

  Shape(const RiccatiView& view, int i)
      : states(state_count > 0 ? state_count : view.state_counts[i]),
        next_states(state_count > 0 ? state_count : view.state_counts[i + 1]),
        offset(state_count > 0 ? state_count : view.states),
        controls(control_count > 0 ? control_count : view.control_counts[i]) {}
  int columns() const { return offset + controls; }
};

template <int registers>
struct Row {
  Lanes part[registers];
  static Row from(const double* memory) {
    Row row;
    for (int v = 0; v < registers; ++v) row.part[v] = load(memory + v * lane_count);
    return row;
  }
  void to(double* memory) const {
    for (int v = 0; v < registers; ++v) store(part[v], memory + v * lane_count);
  }
  void add(const Row& other, double factor) {
    for (int v = 0; v < registers; ++v) part[v] += other.part[v] * factor;
  }
  Row first(int count) const {
    Row row;
    for (int v = 0; v < registers; ++v) row.part[v] = first_of(part[v], v, count);
    return row;
  }
};

/// Columns of H + F'PF; those of the controls first, since what follows waits for them.
template <class Stage>
inline void form_columns(const RiccatiView& view, int i, const Stage& stage, Row<Stage::registers>* X) {
  using R = Row<Stage::registers>;
  const long stride = view.stride;
  const double* F = view.F + i * view.states * stride;
  const double* H = view.H + i * (view.states + view.controls) * stride;
  const double* P = view.P + (i + 1) * view.states * stride;
  R W[Stage::most_states];  // rows of P F
  for (int j = 0; j < stage.next_states; ++j) {
    R sum{};
    // P is read from its lower triangle alone, so that it stays symmetric.
    for (int l = 0; l < j; ++l) sum.add(R::from(F + l * stride), P[l * stride + j]);
    for (int l = j; l < stage.next_states; ++l) sum.add(R::from(F + l * stride), P[j * stride + l]);
    W[j] = sum;
  }
  const auto form = [&](int k) {
    R column = R::from(H + k * stride);
    for (int l = 0; l < stage.next_states; ++l) column.add(W[l], F[l * stride + k]);
    X[k] = column;
  };
  for (int k = stage.columns() - 1; k >= stage.offset; --k) form(k);
  for (int k = 0; k < stage.states; ++k) form(k);
  if (!view.diagonal) return;
  const double* extra = view.diagonal + i * stride;
  const auto add = [&](int k) { X[k].part[k / lane_count][k % lane_count] += extra[k]; };
  for (int k = 0; k < stage.states; ++k) add(k);
  for (int k = stage.offset; k < stage.columns(); ++k) add(k);
}

template <class Stage>
inline bool factor_stage(const RiccatiView& view, int i, double tolerance) {
  using R = Row<Stage::registers>;
  const Stage stage(view, i);
  const long stride = view.stride;
  const std::int8_t* sides = view.sides + i * stride;
  double* U = view.U + i * view.controls * stride;
  double* inverse = view.inverse + i * view.controls;
  double* P = view.P + i * view.states * stride;
  const double* P_next = view.P + (i + 1) * view.states * stride;
  const double* b = view.b + i * stride;
  R drift{};
  for (int l = 0; l < stage.next_states; ++l) drift.add(R::from(P_next + l * stride), b[l]);
  drift.to(view.drift + i * stride);

  R X[Stage::most_columns];
  form_columns(view, i, stage, X);
  double diagonal[Stage::most_columns];
  bool any_fixed = false;
  for (int k = stage.offset; k < stage.columns(); ++k) {
    diagonal[k] = X[k].part[k / lane_count][k % lane_count];
    if (sides[k] == 0) continue;
    any_fixed = true;
    X[k].to(U + (k - stage.offset) * stride);
    inverse[k - stage.offset] = 0.0;
  }
  for (int k = stage.columns() - 1; k >= stage.offset; --k) {
    if (sides[k] != 0) continue;
    const double pivot = X[k].part[k / lane_count][k % lane_count];
    if (!(pivot > tolerance * diagonal[k] && pivot > 0.0)) return false;
    const double reciprocal = 1.0 / pivot;
    R column = X[k].first(k);
    if (any_fixed)
      for (int f = stage.offset; f < k; ++f)
        if (sides[f] != 0) column.part[f / lane_count][f % lane_count] = 0.0;
    column.to(U + (k - stage.offset) * stride);
    inverse[k - stage.offset] = reciprocal;
    double factors[Stage::most_columns];
    R scaled{};
    scaled.add(column, -reciprocal);
    scaled.to(factors);
    for (int j = stage.offset; j < k; ++j) X[j].add(column, factors[j]);
    for (int j = 0; j < stage.states; ++j) X[j].add(column, factors[j]);
  }
  for (int j = 0; j < stage.states; ++j) X[j].first(stage.states).to(P + j * stride);
  return true;
}

template <class Stage>
inline void solve_stage_backward(const RiccatiView& view, int i) {
  using R = Row<Stage::registers>;
  const Stage stage(view, i);
  const long stride = view.stride;
  const double* F = view.F + i * view.states * stride;
  const double* U = view.U + i * view.controls * stride;
  const double* inverse = view.inverse + i * view.controls;
  const std::int8_t* sides = view.sides + i * stride;
  double costate[Stage::most_columns];
  R sum = R::from(view.p + (i + 1) * stride);
  sum.add(R::from(view.drift + i * stride), 1.0);
  sum.to(costate);
  // In two halves, which do not wait for each other.
  R gradient = R::from(view.h + i * stride), other{};
  for (int l = 0; l + 1 < stage.next_states; l += 2) {
    gradient.add(R::from(F + l * stride), costate[l]);
    other.add(R::from(F + (l + 1) * stride), costate[l + 1]);
  }
  if (stage.next_states % 2 != 0) {
    const int l = stage.next_states - 1;
    gradient.add(R::from(F + l * stride), costate[l]);
  }
  gradient.add(other, 1.0);
  gradient.to(view.g + i * stride);
  double* p = view.p + i * stride;
  for (int k = stage.offset; k < stage.columns(); ++k) {
    if (sides[k] == 0) continue;
    const double bound = (sides[k] < 0 ? view.lower : view.upper)[i * stride + k];
    gradient.add(R::from(U + (k - stage.offset) * stride), bound);
  }
  for (int k = stage.columns() - 1; k >= stage.offset; --k) {
    if (sides[k] != 0) continue;
    const double of_control = gradient.part[k / lane_count][k % lane_count];
    gradient.add(R::from(U + (k - stage.offset) * stride), -of_control * inverse[k - stage.offset]);
  }
  gradient.to(p);
  for (int k = stage.offset; k < stage.columns(); ++k)
    if (sides[k] != 0) p[k] = (sides[k] < 0 ? view.lower : view.upper)[i * stride + k];
}

template <class Stage>
inline void solve_stage_forward(const RiccatiView& view, int i) {
  using R = Row<Stage::registers>;
  const Stage stage(view, i);
  const long stride = view.stride;
  const double* F = view.F + i * view.states * stride;
  const double* U = view.U + i * view.controls * stride;
  const double* inverse = view.inverse + i * view.controls;
  const double *p = view.p + i * stride, *b = view.b + i * stride;
  const std::int8_t* sides = view.sides + i * stride;
  double *z = view.values + i * stride, *next = view.values + (i + 1) * stride;
  double* bounds = view.bounds + i * stride;
  bool any_fixed = false;
  for (int k = stage.offset; k < stage.columns(); ++k) {
    if (sides[k] != 0) {
      z[k] = (sides[k] < 0 ? view.lower : view.upper)[i * stride + k];
      any_fixed = true;
      continue;
    }
    const double* column = U + (k - stage.offset) * stride;
    double sum = p[k];
    for (int j = 0; j < stage.states; ++j) sum += column[j] * z[j];
    for (int j = stage.offset; j < k; ++j) sum += column[j] * z[j];
    z[k] = -sum * inverse[k - stage.offset];
  }
  double next_state[Stage::most_states];
  for (int l = 0; l < stage.next_states; ++l) {
    double sum = b[l];
    for (int j = 0; j < stage.states; ++j) sum += F[l * stride + j] * z[j];
    for (int k = stage.offset; k < stage.columns(); ++k) sum += F[l * stride + k] * z[k];
    next_state[l] = next[l] = sum;
  }
  R costate = R::from(view.p + (i + 1) * stride).first(stage.next_states);
  const double* P_next = view.P + (i + 1) * view.states * stride;
  for (int l = 0; l < stage.next_states; ++l) costate.add(R::from(P_next + l * stride), next_state[l]);
  costate.to(view.costates + (i + 1) * stride);
  if (!any_fixed) return;
  for (int k = stage.offset; k < stage.columns(); ++k) {
    if (sides[k] == 0) continue;
    const double* column = U + (k - stage.offset) * stride;
    double sum = view.g[i * stride + k];
    for (int j = 0; j < stage.states; ++j) sum += column[j] * z[j];
    for (int j = stage.offset; j < stage.columns(); ++j) sum += column[j] * z[j];
    bounds[k] = -sum;
  }
}

/// One entry of the rows of a batch of responses.
using Batch = Row<response_batch / lane_count>;

/// What stands before the program's own vectors: 1 for the minimiser, which is the last of a batch, 0 for the others.
inline Batch minimiser_alone() {
  Batch unit{};
  unit.part[response_batch / lane_count - 1][lane_count - 1] = 1.0;
  return unit;
}

template <class Stage, bool with_minimiser>
inline void respond_stage_backward(const RiccatiView& view, int i, double* gradients) {
  const Stage stage(view, i);
  const long stride = view.stride;
  const double* F = view.F + i * view.states * stride;
  const double* U = view.U + i * view.controls * stride;
  const double* inverse = view.inverse + i * view.controls;
  const std::int8_t* sides = view.sides + i * stride;
  double* own = gradients + i * stride * response_batch;
  const double* next = own + stride * response_batch;
  const Batch unit = minimiser_alone();
  Batch costates[Stage::most_states], gradient[Stage::most_columns];
  for (int l = 0; l < stage.next_states; ++l) {
    costates[l] = Batch::from(next + l * response_batch);
    if (with_minimiser) costates[l].add(unit, view.drift[i * stride + l]);
  }
  const auto form = [&](int k) {
    gradient[k] = Batch::from(own + k * response_batch);
    if (with_minimiser) gradient[k].add(unit, view.h[i * stride + k]);
    for (int l = 0; l < stage.next_states; ++l) gradient[k].add(costates[l], F[l * stride + k]);
  };
  for (int k = stage.offset; k < stage.columns(); ++k) {
    form(k);
    gradient[k].to(own + k * response_batch);
  }
  for (int k = 0; k < stage.states; ++k) form(k);
  if (with_minimiser) {
    for (int f = stage.offset; f < stage.columns(); ++f) {
      if (sides[f] == 0) continue;
      const double* column = U + (f - stage.offset) * stride;
      const double bound = (sides[f] < 0 ? view.lower : view.upper)[i * stride + f];
      for (int k = stage.offset; k < stage.columns(); ++k)
        if (sides[k] == 0) gradient[k].add(unit, column[k] * bound);
      for (int k = 0; k < stage.states; ++k) gradient[k].add(unit, column[k] * bound);
    }
  }
  for (int k = stage.columns() - 1; k >= stage.offset; --k) {
    if (sides[k] != 0) continue;
    const double* column = U + (k - stage.offset) * stride;
    Batch of_control{};
    of_control.add(gradient[k], -inverse[k - stage.offset]);
    for (int j = stage.offset; j < k; ++j) gradient[j].add(of_control, column[j]);
    for (int j = 0; j < stage.states; ++j) gradient[j].add(of_control, column[j]);
    gradient[k].to(own + k * response_batch);
  }
  for (int k = 0; k < stage.states; ++k) gradient[k].to(own + k * response_batch);
}

template <class Stage, bool with_minimiser>
inline void respond_stage_forward(const RiccatiView& view, int i, double* responses, double* costates) {
  const Stage stage(view, i);
  const long stride = view.stride;
  const double* F = view.F + i * view.states * stride;
  const double* U = view.U + i * view.controls * stride;
  const double* inverse = view.inverse + i * view.controls;
  const std::int8_t* sides = view.sides + i * stride;
  double* own = responses + i * stride * response_batch;
  double* next = own + stride * response_batch;
  const Batch unit = minimiser_alone();
  Batch z[Stage::most_columns];
  for (int j = 0; j < stage.states; ++j) z[j] = Batch::from(own + j * response_batch);
  for (int k = stage.offset; k < stage.columns(); ++k) {
    z[k] = {};
    if (sides[k] != 0) {
      if (with_minimiser) z[k].add(unit, (sides[k] < 0 ? view.lower : view.upper)[i * stride + k]);
      continue;
    }
    const double* column = U + (k - stage.offset) * stride;
    Batch sum = Batch::from(own + k * response_batch);
    for (int j = 0; j < stage.states; ++j) sum.add(z[j], column[j]);
    for (int j = stage.offset; j < k; ++j) sum.add(z[j], column[j]);
    z[k].add(sum, -inverse[k - stage.offset]);
  }
  Batch next_state[Stage::most_states];
  for (int l = 0; l < stage.next_states; ++l) {
    Batch sum{};
    if (with_minimiser) sum.add(unit, view.b[i * stride + l]);
    for (int j = 0; j < stage.states; ++j) sum.add(z[j], F[l * stride + j]);
    for (int k = stage.offset; k < stage.columns(); ++k) sum.add(z[k], F[l * stride + k]);
    next_state[l] = sum;
  }
  if (with_minimiser) {
    const double* P_next = view.P + (i + 1) * view.states * stride;
    for (int l = 0; l < stage.next_states; ++l) {
      Batch sum = Batch::from(next + l * response_batch);
      for (int j = 0; j < stage.next_states; ++j) sum.add(next_state[j], P_next[l * stride + j]);
      sum.to(costates + ((i + 1) * stride + l) * response_batch);
    }
  }
  for (int l = 0; l < stage.next_states; ++l) next_state[l].to(next + l * response_batch);
  for (int k = stage.offset; k < stage.columns(); ++k) {
    Batch answer = z[k];
    if (sides[k] != 0) {
      // What a fixed control answers with is its multiplier.
      const double* column = U + (k - stage.offset) * stride;
      Batch sum = Batch::from(own + k * response_batch);
      for (int j = 0; j < stage.states; ++j) sum.add(z[j], column[j]);
      for (int j = stage.offset; j < stage.columns(); ++j) sum.add(z[j], column[j]);
      answer = {};
      answer.add(sum, -1.0);
    }
    answer.to(own + k * response_batch);
  }
}

/// Calls `function` with the type of a stage's shape: one of the sizes that kernels are compiled for, or any.
template <class Function>
inline auto with_shape(const RiccatiView& view, int i, const Function& function) {
  const int states = view.states, controls = view.control_counts[i];
  const bool is_full = view.state_counts[i] == states && view.state_counts[i + 1] == states;
  if (is_full && states == 6) {
    if (controls == 2) return function.template operator()<Shape<1, 6, 2>>();
    if (controls == 3) return function.template operator()<Shape<2, 6, 3>>();
    if (controls == 4) return function.template operator()<Shape<2, 6, 4>>();
  }
  const int columns = states + controls;
  if (columns <= 8) return function.template operator()<Shape<1, 0, 0>>();
  if (columns <= 16) return function.template operator()<Shape<2, 0, 0>>();
  if (columns <= 32) return function.template operator()<Shape<4, 0, 0>>();
  return function.template operator()<Shape<8, 0, 0>>();
}

int factor(const RiccatiView& view, int first, double tolerance) {
  for (int i = first; i >= 0; --i) {
    if (view.special[i]) return i;
    const bool done = with_shape(view, i, [&]<class Stage>() { return factor_stage<Stage>(view, i, tolerance); });
    if (!done) return i;
  }
  return -1;
}

int solve_backward(const RiccatiView& view, int first) {
  for (int i = first; i >= 0; --i) {
    if (view.special[i]) return i;
    with_shape(view, i, [&]<class Stage>() { solve_stage_backward<Stage>(view, i); });
  }
  return -1;
}

int solve_forward(const RiccatiView& view, int first) {
  for (int i = first; i < view.intervals; ++i) {
    if (view.special[i]) return i;
    with_shape(view, i, [&]<class Stage>() { solve_stage_forward<Stage>(view, i); });
  }
  return view.intervals;
}

void respond_backward(const RiccatiView& view, int last, double* gradients, bool with_minimiser) {
  for (int i = last < view.intervals ? last : view.intervals - 1; i >= 0; --i) {
    with_shape(view, i, [&]<class Stage>() {
      if (with_minimiser) {
        respond_stage_backward<Stage, true>(view, i, gradients);
      } else {
        respond_stage_backward<Stage, false>(view, i, gradients);
      }
    });
  }
}

void respond_forward(const RiccatiView& view, double* responses, double* costates) {
  for (int i = 0; i < view.intervals; ++i) {
    with_shape(view, i, [&]<class Stage>() {
      if (costates) {
        respond_stage_forward<Stage, true>(view, i, responses, costates);
      } else {
        respond_stage_forward<Stage, false>(view, i, responses, costates);
      }
    });
  }
}

void combine(const double* batch, const double* weights, double* sums, long count) {
  const Batch weight = Batch::from(weights);
  for (long k = 0; k < count; ++k) {
    const Batch entry = Batch::from(batch + k * response_batch);
    Lanes sum = entry.part[0] * weight.part[0];
    for (int v = 1; v < response_batch / lane_count; ++v) sum += entry.part[v] * weight.part[v];
    sums[k] = sum_of(sum);
  }
}

void form(const RiccatiView& view, int i, double* out) {
  with_shape(view, i, [&]<class Stage>() {
    Row<Stage::registers> X[Stage::most_columns]{};
    const Stage stage(view, i);
    form_columns(view, i, stage, X);
    for (int k = 0; k < stage.columns(); ++k) X[k].to(out + static_cast<long>(k) * view.stride);
  });
}

}  // namespace
}  // namespace kernels

#define RHEC_JOIN(a, b) a##b
#define RHEC_TABLE(name, set) RHEC_JOIN(name, set)
extern const RiccatiKernels RHEC_TABLE(riccati_kernels_, RHEC_SET);
constinit const RiccatiKernels RHEC_TABLE(riccati_kernels_, RHEC_SET) = {
    &kernels::factor,          &kernels::solve_backward, &kernels::solve_forward, &kernels::respond_backward,
    &kernels::respond_forward, &kernels::combine,        &kernels::form};

}  // namespace rhec
