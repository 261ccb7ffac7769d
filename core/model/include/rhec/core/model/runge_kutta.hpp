#pragma once

#include "rhec/core/model/dual.hpp"

namespace rhec::kernels {

/// out = a + b * factor, without the temporary copies of numbers with many derivatives.
template <class Scalar, class Lane>
inline void add_scaled(const Scalar& a, const Scalar& b, const Lane& factor, Scalar& out) {
  const auto sum = [&factor](const Lane& s, const Lane& t) { return s + t * factor; };
  if constexpr (Differentiable<Scalar>) {
    Scalar::assign_linear(out, sum, a, b);
  } else {
    out = sum(a, b);
  }
}

/// Advances x by `duration` with `substeps` steps of the classical Runge-Kutta method for dx/dt = f(x, u, p); p runs
/// linearly from `p` to `p_end` (null: constant). Scalar is a Lane, or a number over Lane with derivatives.
template <class Formula, class Scalar, class Lane>
inline void runge_kutta(const Formula& formula, Scalar* x, const Scalar* u, const Scalar* p, const Scalar* p_end,
                        const Lane& duration, int substeps) {
  constexpr int nx = Formula::state_count, np = Formula::parameter_count;
  const Lane h = duration * Lane(1.0 / substeps);
  const Lane half = h * Lane(0.5), third = h * Lane(1.0 / 3.0), sixth = h * Lane(1.0 / 6.0);
  Scalar p_now[room_for(np)];
  for_each_index<np>([&](auto j) { p_now[j] = p[j]; });
  const auto move_parameters_to = [&](double step) {
    if (!p_end) return;
    const Lane fraction(step / substeps);
    for_each_index<np>([&](auto j) { p_now[j] = p[j] + (p_end[j] - p[j]) * fraction; });
  };
  const auto take_step = [&](int step) {
    Scalar rate[nx], inner[nx], next[nx];
    move_parameters_to(step);
    formula.dynamics(x, u, p_now, rate);
    for_each_index<nx>([&](auto j) {
      add_scaled(x[j], rate[j], sixth, next[j]);
      add_scaled(x[j], rate[j], half, inner[j]);
    });
    move_parameters_to(step + 0.5);
    formula.dynamics(inner, u, p_now, rate);
    for_each_index<nx>([&](auto j) {
      add_scaled(next[j], rate[j], third, next[j]);
      add_scaled(x[j], rate[j], half, inner[j]);
    });
    formula.dynamics(inner, u, p_now, rate);
    for_each_index<nx>([&](auto j) {
      add_scaled(next[j], rate[j], third, next[j]);
      add_scaled(x[j], rate[j], h, inner[j]);
    });
    move_parameters_to(step + 1.0);
    formula.dynamics(inner, u, p_now, rate);
    for_each_index<nx>([&](auto j) { add_scaled(next[j], rate[j], sixth, x[j]); });
  };
  for (int step = 0; step < substeps; ++step) take_step(step);
}

}  // namespace rhec::kernels
