#pragma once

#include "rhec/core/model/dual.hpp"
#include "rhec/core/model/step_pattern.hpp"

namespace rhec::kernels {

/// The rates f at one argument [x; p; u] with their derivatives: `first` df/d(x, p, u) and, with a Hessian, `second`
/// d2f/d(x, p, u)2, each as the entries that can be non-zero (StepPattern). One function for all stages of a
/// Runge-Kutta step: the formula is most of what the compiler reads, and of what the processor's instruction cache
/// holds.
template <class Formula, class Lane, bool with_hessian>
struct StageDerivatives {
  using Pattern = StepPattern<Formula>;
  static constexpr int nx = Pattern::nx, np = Pattern::np, nu = Pattern::nu, nz = Pattern::nz;
  using Number = SecondOrder<Lane, Pattern::pattern.directions, with_hessian ? Pattern::pattern.curved : 0>;

  [[gnu::flatten, gnu::noinline]] static void evaluate(const Formula& formula, const Lane* argument, Lane* rates,
                                                       Lane* first, [[maybe_unused]] Lane* second) {
    Number x[nx], p[room_for(np)], u[room_for(nu)];
    const auto set = [&]<int a>(std::integral_constant<int, a>, Number& number) RHEC_INLINE {
      if constexpr (Pattern::pattern.direction_of[a] >= 0)
        number = Number::template variable<Pattern::pattern.direction_of[a]>(argument[a]);
      else
        number = Number(argument[a]);
    };
    for_indices<nx>([&](auto r) RHEC_INLINE { set(r, x[r]); });
    for_indices<np>([&](auto j) RHEC_INLINE { set(std::integral_constant<int, nx + j>(), p[j]); });
    for_indices<nu>([&](auto j) RHEC_INLINE { set(std::integral_constant<int, nx + np + j>(), u[j]); });
    // Only entries that can be non-zero are kept, so that the compiler drops what only leads to the others.
    Number f[nx];
    formula.dynamics(static_cast<const Number*>(x), static_cast<const Number*>(u), static_cast<const Number*>(p), f);
    for_indices<nx>([&](auto r) RHEC_INLINE {
      rates[r] = f[r].value;
      for_indices<nz>([&](auto a) RHEC_INLINE {
        if constexpr (Pattern::pattern.first[r] >> a & 1)
          first[Pattern::first_place(r, a)] = f[r].d[Pattern::pattern.direction_of[a]];
        for_indices<a + 1>([&](auto b) RHEC_INLINE {
          if constexpr (with_hessian && Pattern::bends(r, a, b))
            second[Pattern::second_place(r, a, b)] = f[r].dd[Pattern::pair_of_directions(a, b)];
        });
      });
    });
  }
};

}  // namespace rhec::kernels
