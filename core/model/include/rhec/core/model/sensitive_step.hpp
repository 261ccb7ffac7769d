#pragma once

#include "rhec/core/model/stage_derivatives.hpp"
#include "rhec/core/model/step_pattern.hpp"

namespace rhec::kernels {

/// One step of the classical Runge-Kutta method with its sensitivities to z = [x; p; u]. Only f is differentiated,
/// along the directions that it depends on; the chain rule carries the derivatives through the step. With the stages
/// f_k = f(x_k, p, u), x_{k+1} = x + c_{k+1} h f_k:
///
///     dx_{k+1}/dz = dx/dz + c_{k+1} h (df_k/d(x, p, u)) S_k,      S_k = d(x_k, p, u)/dz
///
/// In sum_r weights_r F_r the weight of f_k is  mu_4 = h/6 weights,  mu_k = b_k h weights + c_{k+1} h (df_{k+1}/dx)'
/// mu_{k+1}, and the Hessian of the sum is  sum_k S_k' (sum_r mu_{k,r} d2f_r/d(x, p, u)2) S_k. Entries that are zero by
/// the formula's pattern are not computed.
template <class Formula, class Lane, bool with_hessian>
class SensitiveStep {
 public:
  using Pattern = StepPattern<Formula>;
  static constexpr int nx = Pattern::nx, np = Pattern::np, nu = Pattern::nu, nz = Pattern::nz;
  static constexpr bool has_hessian = with_hessian;

  Lane z[nz], h, weights[nx];  ///< to be set; the weights are used for the Hessian only
  Lane next[nx], jacobian[nx][nz], hessian[with_hessian ? nz : 1][with_hessian ? nz : 1];

  /// Takes independent steps together, so that the processor can overlap their instructions.
  static void take(const Formula& formula, int count, SensitiveStep* steps) {
    for_indices<4>([&](auto k) RHEC_INLINE {
      for (int i = 0; i < count; ++i) steps[i].template evaluate<k>(formula);
    });
    for (int i = 0; i < count; ++i) steps[i].finish();
  }

 private:
  void finish() {
    for_indices<nx>([&](auto r) RHEC_INLINE {
      next[r] = z[r] +
                h * (Lane(1.0 / 6.0) * (rates_[0][r] + rates_[3][r]) + Lane(1.0 / 3.0) * (rates_[1][r] + rates_[2][r]));
      for_indices<nz>([&](auto j) RHEC_INLINE {
        Lane sum(0.0);
        if constexpr (!with_hessian && (Pattern::rates_depend(r) >> j & 1) != 0) sum = jacobian[r][j];
        for_indices<4>([&](auto k) RHEC_INLINE {
          if constexpr (with_hessian && Pattern::template rate_depends<k>(r, j))
            sum = sum + Lane(share[k]) * slopes_[k][r][j];
        });
        jacobian[r][j] = h * sum + Lane(r == j ? 1.0 : 0.0);
      });
    });
    if constexpr (with_hessian) bend();
  }

  static constexpr double reach[4] = {0.0, 0.5, 0.5, 1.0}, share[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};

  /// Where the derivatives of f_k are stored. Without a Hessian they are not needed after the next stage, and their
  /// part of the Jacobian is added at once: a small working set leaves the cache to other data.
  static constexpr int slot(int k) { return with_hessian ? k : k % 2; }
  static constexpr int slots = with_hessian ? 4 : 2;
  /// Adds the contribution of one derivative of f_k.
  template <int k, int r, int j>
  RHEC_INLINE void add_share(const Lane& slope) {
    if constexpr (with_hessian || Pattern::is_argument(r)) slopes_[slot(k)][r][j] = slope;
    if constexpr (!with_hessian) {
      if constexpr (k > 0 && Pattern::template rate_depends<k - (k > 0)>(r, j))
        jacobian[r][j] = jacobian[r][j] + Lane(share[k]) * slope;
      else
        jacobian[r][j] = Lane(share[k]) * slope;
    }
  }

  /// dx_k/dz where it can be non-zero: computed once, since every row of the products below needs it.
  template <int k>
  RHEC_INLINE void set_sensitivities(Lane (&S)[nx][nz]) const {
    if constexpr (k > 0)
      for_indices<nx>([&](auto a) RHEC_INLINE {
        for_indices<nz>([&](auto j) RHEC_INLINE {
          if constexpr (Pattern::is_argument(a) && Pattern::template argument_depends<k>(a, j)) {
            S[a][j] = Lane(a == j ? 1.0 : 0.0);
            if constexpr (Pattern::template rate_depends<k - 1>(a, j))
              S[a][j] = S[a][j] + h * Lane(reach[k]) * slopes_[slot(k - 1)][a][j];
          }
        });
      });
  }
  /// d(argument a of f_k)/dz_j, where it can be non-zero.
  template <int k, int a, int j>
  RHEC_INLINE static Lane sensitivity(const Lane (&S)[nx][nz]) {
    if constexpr (a >= nx || k == 0)
      return Lane(1.0);
    else
      return S[a][j];
  }

  template <int k>
  void evaluate(const Formula& formula) {
    Lane argument[nz];
    for_indices<nz>([&](auto a) RHEC_INLINE {
      argument[a] = z[a];
      if constexpr (k > 0 && a < nx) argument[a] = argument[a] + h * Lane(reach[k]) * rates_[k - 1][a];
    });
    StageDerivatives<Formula, Lane, with_hessian>::evaluate(formula, argument, rates_[k], first_[slot(k)],
                                                            second_[with_hessian ? k : 0]);
    Lane S[nx][nz];
    set_sensitivities<k>(S);
    for_indices<nx>([&](auto r) RHEC_INLINE {
      for_indices<nz>([&](auto j) RHEC_INLINE {
        if constexpr (Pattern::template rate_depends<k>(r, j)) {
          Lane sum(0.0);
          for_indices<nz>([&](auto a) RHEC_INLINE {
            if constexpr ((Pattern::pattern.first[r] >> a & 1) && Pattern::template argument_depends<k>(a, j))
              sum = sum + first_[slot(k)][Pattern::first_place(r, a)] * sensitivity<k, a, j>(S);
          });
          add_share<k, r, j>(sum);
        }
      });
    });
  }

  void bend() {
    for (auto& row : hessian)
      for (Lane& entry : row) entry = Lane(0.0);
    Lane mu[nx];
    for_indices<4>([&](auto backwards) RHEC_INLINE {
      constexpr int k = 3 - backwards;
      Lane now[nx];
      for_indices<nx>([&](auto c) RHEC_INLINE {
        now[c] = h * Lane(share[k]) * weights[c];
        if constexpr (k < 3) {
          Lane pulled(0.0);
          for_indices<nx>([&](auto r) RHEC_INLINE {
            if constexpr (Pattern::pattern.first[r] >> c & 1)
              pulled = pulled + first_[slot(k + 1)][Pattern::first_place(r, c)] * mu[r];
          });
          now[c] = now[c] + h * Lane(reach[k + 1]) * pulled;
        }
      });
      for_indices<nx>([&](auto r) RHEC_INLINE { mu[r] = now[r]; });
      add_curvature<k>(mu);
    });
    for (int i = 0; i < nz; ++i)
      for (int j = 0; j < i; ++j) hessian[j][i] = hessian[i][j];
  }

  /// Adds S_k' (sum_r mu_r d2f_r) S_k to the lower triangle.
  template <int k>
  void add_curvature(const Lane* mu) {
    Lane S[nx][nz];
    set_sensitivities<k>(S);
    for_indices<nz>([&](auto b) RHEC_INLINE {
      if constexpr (Pattern::pattern.second[b] != 0) {
        Lane second[nz];
        for_indices<nz>([&](auto a) RHEC_INLINE {
          if constexpr (Pattern::curves(b, a)) {
            Lane sum(0.0);
            for_indices<nx>([&](auto r) RHEC_INLINE {
              if constexpr (Pattern::bends(r, a, b)) sum = sum + mu[r] * second_[k][Pattern::second_place(r, a, b)];
            });
            second[a] = sum;
          }
        });
        for_indices<nz>([&](auto j) RHEC_INLINE {
          // (d2f S)_{b, j}
          if constexpr (any_curves<k>(b, j)) {
            Lane product(0.0);
            for_indices<nz>([&](auto a) RHEC_INLINE {
              if constexpr (Pattern::curves(b, a) && Pattern::template argument_depends<k>(a, j))
                product = product + second[a] * sensitivity<k, a, j>(S);
            });
            for_indices<nz>([&](auto i) RHEC_INLINE {
              if constexpr (i >= j && Pattern::template argument_depends<k>(b, i))
                hessian[i][j] = hessian[i][j] + sensitivity<k, b, i>(S) * product;
            });
          }
        });
      }
    });
  }
  template <int k>
  static constexpr bool any_curves(int b, int j) {
    for (int a = 0; a < nz; ++a)
      if (Pattern::curves(b, a) && Pattern::template argument_depends<k>(a, j)) return true;
    return false;
  }

  static constexpr int first_count = Pattern::first_place(nx, 0);
  static constexpr int second_count = with_hessian ? Pattern::second_place(nx, 0, 0) : 0;
  Lane rates_[4][nx];                                          ///< f_k
  Lane first_[slots][room_for(first_count)];                   ///< df_k/d(x, p, u)
  Lane second_[with_hessian ? 4 : 1][room_for(second_count)];  ///< d2f_k/d(x, p, u)2, each pair once
  Lane slopes_[slots][nx][nz];                                 ///< df_k/dz
};

}  // namespace rhec::kernels
