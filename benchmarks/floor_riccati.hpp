#pragma once

#include "floor_kernels.hpp"
#include "floor_passage.hpp"

// A Riccati recursion, stage by stage, for numbers of states and intervals known at compile time.
namespace rhec::bench::floor {

#if defined(__AVX512F__)
constexpr int part_size = 8;
#elif defined(__AVX__)
constexpr int part_size = 4;
#else
constexpr int part_size = 2;
#endif
typedef double Part __attribute__((vector_size(8 * part_size), may_alias));
constexpr int parts = 8 / part_size;

/// Eight numbers in as many registers as that takes.
struct Eight {
  Part part[parts] = {};

  Eight() = default;
  Eight(double a, double b, double c, double d, double e, double f, double g, double h) {
    const double values[8] = {a, b, c, d, e, f, g, h};
    for (int k = 0; k < 8; ++k) part[k / part_size][k % part_size] = values[k];
  }
  static Eight of(const Row& row) {
    Eight value;
    for (int i = 0; i < parts; ++i) value.part[i] = reinterpret_cast<const Part*>(row.at)[i];
    return value;
  }
  double operator[](int k) const { return part[k / part_size][k % part_size]; }
  Eight& operator+=(const Eight& other) { return *this = *this + other; }
  template <class Operation>
  static Eight each(const Operation& operation) {
    Eight value;
    for (int i = 0; i < parts; ++i) value.part[i] = operation(i);
    return value;
  }
  friend Eight operator+(const Eight& a, const Eight& b) {
    return each([&](int i) { return a.part[i] + b.part[i]; });
  }
  friend Eight operator-(const Eight& a, const Eight& b) {
    return each([&](int i) { return a.part[i] - b.part[i]; });
  }
  friend Eight operator*(const Eight& a, const Eight& b) {
    return each([&](int i) { return a.part[i] * b.part[i]; });
  }
  friend Eight operator*(double factor, const Eight& a) {
    return each([&](int i) { return factor * a.part[i]; });
  }
};
inline Eight load(const Row& row) { return Eight::of(row); }
inline void store(Row& row, const Eight& value) {
  for (int i = 0; i < parts; ++i) reinterpret_cast<Part*>(row.at)[i] = value.part[i];
}

inline void transpose(Eight (&rows_of)[8]) {
#if defined(__AVX512F__)
  __m512d columns[8];
  for (int r = 0; r < 8; ++r) columns[r] = reinterpret_cast<__m512d&>(rows_of[r].part[0]);
  transpose(columns);
  for (int r = 0; r < 8; ++r) rows_of[r].part[0] = reinterpret_cast<Part&>(columns[r]);
#else
  Row by_row[8], by_column[8];
  for (int r = 0; r < 8; ++r) store(by_row[r], rows_of[r]);
  for (int r = 0; r < 8; ++r)
    for (int k = 0; k < 8; ++k) by_column[k].at[r] = by_row[r].at[k];
  for (int r = 0; r < 8; ++r) rows_of[r] = load(by_column[r]);
#endif
}

/// The backward sweep for `states` states, and two inputs in lanes 6 and 7.
template <int N, int states>
inline void backward(Workspace& work) {
  for (int r = 0; r < states; ++r) store(work.cost_to_go[N][r], load(work.hessian[N][r]));
  store(work.cost_to_go_gradient[N], load(work.gradient[N]));
  for (int i = N - 1; i >= 0; --i) {
    const Row* P = work.cost_to_go[i + 1];
    const Row* AB = work.dynamics[i];
    Eight ab[states], m[states];
    for (int k = 0; k < states; ++k) ab[k] = load(AB[k]);
    for (int r = 0; r < states; ++r) {
      m[r] = P[r].at[0] * ab[0];
      for (int k = 1; k < states; ++k) m[r] += P[r].at[k] * ab[k];
    }
    Eight t = load(work.cost_to_go_gradient[i + 1]);
    for (int k = 0; k < states; ++k) t += work.defect[i].at[k] * load(P[k]);
    Eight h6 = load(work.hessian[i][6]), h7 = load(work.hessian[i][7]);
    for (int k = 0; k < states; ++k) {
      h6 += AB[k].at[6] * m[k];
      h7 += AB[k].at[7] * m[k];
    }
    Eight gradient = load(work.gradient[i]);
    for (int k = 0; k < states; ++k) gradient += t[k] * ab[k];
    const double a = h6[6], b = h6[7], c = h7[7], one_over = 1.0 / (a * c - b * b);
    const Eight only_states = {1, 1, 1, 1, 1, 1, 0, 0}, unit6 = {0, 0, 0, 0, 0, 0, 1, 0},
                unit7 = {0, 0, 0, 0, 0, 0, 0, 1};
    const double ai = a * one_over, bi = b * one_over, ci = c * one_over;
    const Eight k6 = (bi * h7 - ci * h6) * only_states, k7 = (bi * h6 - ai * h7) * only_states;
    const double o6 = bi * gradient[7] - ci * gradient[6], o7 = bi * gradient[6] - ai * gradient[7];
    for (int r = 0; r < states; ++r) {
      Eight h = load(work.hessian[i][r]);
      for (int k = 0; k < states; ++k) h += AB[k].at[r] * m[k];
      store(work.cost_to_go[i][r], h + h6[r] * k6 + h7[r] * k7);
    }
    store(work.cost_to_go_gradient[i], gradient + o6 * h6 + o7 * h7);
    // [A + B K, B; K, 1], whose columns propagate a step.
    Eight closed[8];
    for (int r = 0; r < states; ++r) closed[r] = ab[r] + AB[r].at[6] * k6 + AB[r].at[7] * k7;
    closed[6] = k6 + unit6;
    closed[7] = k7 + unit7;
    transpose(closed);
    for (int r = 0; r < states; ++r) store(work.policy[i][r], closed[r]);
    store(work.policy_offset[i], load(work.defect[i]) + o6 * closed[6] + o7 * closed[7]);
  }
}

template <int N, int states>
inline void forward(Workspace& work, Eight step) {
  for (int i = 0; i <= N; ++i) {
    Eight costate = load(work.cost_to_go_gradient[i]);
    for (int k = 0; k < states; ++k) costate += step[k] * load(work.cost_to_go[i][k]);
    store(work.costates[i], costate);
    if (i == N) {
      store(work.step[i], step);
      break;
    }
    Eight even = load(work.policy_offset[i]), odd = Eight{};
    for (int k = 0; k < states; k += 2) {
      even += step[k] * load(work.policy[i][k]);
      odd += step[k + 1] * load(work.policy[i][k + 1]);
    }
    const Eight next = even + odd;  // states of the next node, inputs of this one
    const Eight only_inputs = {0, 0, 0, 0, 0, 0, 1, 1}, only_states = {1, 1, 1, 1, 1, 1, 0, 0};
    store(work.step[i], step * only_states + next * only_inputs);
    step = next;
  }
}

/// The step of a free initial state, -P^-1 p, by elimination.
inline Eight free_initial_step(const Workspace& work) {
  Eight row[6];
  double right[6], one_over[6], step[8] = {};
  for (int r = 0; r < 6; ++r) {
    row[r] = load(work.cost_to_go[0][r]);
    right[r] = -work.cost_to_go_gradient[0].at[r];
  }
  for (int k = 0; k < 6; ++k) {
    one_over[k] = 1.0 / row[k][k];
    for (int r = k + 1; r < 6; ++r) {
      const double factor = row[k][r] * one_over[k];
      row[r] = row[r] - factor * row[k];
      right[r] -= factor * right[k];
    }
  }
  for (int k = 5; k >= 0; --k) {
    double sum = right[k];
    for (int c = k + 1; c < 6; ++c) sum -= row[k][c] * step[c];
    step[k] = sum * one_over[k];
  }
  return Eight{step[0], step[1], step[2], step[3], step[4], step[5], 0.0, 0.0};
}

}  // namespace rhec::bench::floor
