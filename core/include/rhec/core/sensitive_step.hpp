#pragma once

#include "rhec/core/pattern.hpp"

namespace rhec::kernels {

/// One step of the classical Runge-Kutta method with its derivatives by z = [x; p; u]. Derivatives are taken of f
/// alone, along the directions that f depends on, and carried through the step by the chain rule. With the stages f_k =
/// f(x_k, p, u), x_{k+1} = x + c_{k+1} h f_k:
///
///     dx_{k+1}/dz = dx/dz + c_{k+1} h (df_k/d(x, p, u)) S_k,      S_k = d(x_k, p, u)/dz
///
/// In sum_r weights_r F_r the weight of f_k is  mu_4 = h/6 weights,  mu_k = b_k h weights + c_{k+1} h (df_{k+1}/dx)'
/// mu_{k+1}, and the sum's Hessian is  sum_k S_k' (sum_r mu_{k,r} d2f_r/d(x, p, u)2) S_k. What the formula's pattern
/// says to be zero is not computed.
template <class Formula, class Lane, bool with_hessian>
class SensitiveStep {
 public:
  static constexpr int nx = Formula::state_count, np = Formula::parameter_count, nu = Formula::input_count;
  static constexpr int nz = nx + np + nu;

  Lane next[nx], jacobian[nx][nz], hessian[with_hessian ? nz : 1][with_hessian ? nz : 1];

  void take(const Formula& formula, const Lane* z, const Lane& h, const Lane* weights) {
    for_indices<4>([&](auto k) RHEC_INLINE { evaluate<k>(formula, z, h); });
    for_indices<nx>([&](auto r) RHEC_INLINE {
      next[r] = z[r] + h * (Lane(1.0 / 6.0) * (f_[0][r].value + f_[3][r].value) +
                            Lane(1.0 / 3.0) * (f_[1][r].value + f_[2][r].value));
      for_indices<nz>([&](auto j) RHEC_INLINE {
        Lane sum(0.0);
        for_indices<4>([&](auto k) RHEC_INLINE {
          if constexpr (rate_depends<k>(r, j)) sum = sum + Lane(share[k]) * slopes_[k][r][j];
        });
        jacobian[r][j] = h * sum + Lane(r == j ? 1.0 : 0.0);
      });
    });
    if constexpr (with_hessian) bend(h, weights);
  }

 private:
  static constexpr DynamicsPattern<Formula> pattern{};
  static constexpr double reach[4] = {0.0, 0.5, 0.5, 1.0}, share[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
  using Number = SecondOrder<Lane, pattern.directions, with_hessian ? pattern.curved : 0>;

  /// Which entries of z the rates f_k can depend on, as bits.
  static constexpr auto find_dependence() {
    std::array<std::array<std::uint64_t, nx>, 4> depends{};
    for (int k = 0; k < 4; ++k)
      for (int r = 0; r < nx; ++r)
        for (int a = 0; a < nz; ++a)
          if (pattern.first[r] >> a & 1)
            depends[k][r] |= std::uint64_t{1} << a | (k > 0 && a < nx ? depends[k - 1][a] : 0);
    return depends;
  }
  static constexpr std::array<std::array<std::uint64_t, nx>, 4> dependence = find_dependence();
  template <int k>
  static constexpr bool rate_depends(int r, int j) {
    return (dependence[k][r] >> j & 1) != 0;
  }
  /// The same for argument a of f_k.
  template <int k>
  static constexpr bool argument_depends(int a, int j) {
    if (a == j) return true;
    if constexpr (k > 0) return a < nx && rate_depends<k - 1>(a, j);
    return false;
  }
  static constexpr bool curves(int a, int b) { return (pattern.second[a] >> b & 1) != 0; }

  /// d(argument a of f_k)/dz_j, where it can be other than zero.
  template <int k, int a, int j>
  RHEC_INLINE Lane sensitivity(const Lane& h) const {
    if constexpr (a >= nx || k == 0) {
      return Lane(1.0);
    } else {
      Lane value(a == j ? 1.0 : 0.0);
      if constexpr (rate_depends<k - 1>(a, j)) value = value + h * Lane(reach[k]) * slopes_[k - 1][a][j];
      return value;
    }
  }

  template <int k>
  [[gnu::flatten]] void evaluate(const Formula& formula, const Lane* z, const Lane& h) {
    Number x[nx], p[np > 0 ? np : 1], u[nu > 0 ? nu : 1];
    const auto set = [&]<int a>(std::integral_constant<int, a>, Number& number, const Lane& value) RHEC_INLINE {
      if constexpr (pattern.direction_of[a] >= 0)
        number = Number::template variable<pattern.direction_of[a]>(value);
      else
        number = Number(value);
    };
    for_indices<nx>([&](auto r) RHEC_INLINE {
      Lane value = z[r];
      if constexpr (k > 0) value = value + h * Lane(reach[k]) * f_[k - 1][r].value;
      set(r, x[r], value);
    });
    for_indices<np>([&](auto j) RHEC_INLINE { set(std::integral_constant<int, nx + j>(), p[j], z[nx + j]); });
    for_indices<nu>([&](auto j) RHEC_INLINE { set(std::integral_constant<int, nx + np + j>(), u[j], z[nx + np + j]); });
    formula.dynamics(static_cast<const Number*>(x), static_cast<const Number*>(u), static_cast<const Number*>(p),
                     f_[k]);
    for_indices<nx>([&](auto r) RHEC_INLINE {
      for_indices<nz>([&](auto j) RHEC_INLINE {
        if constexpr (rate_depends<k>(r, j)) {
          Lane sum(0.0);
          for_indices<nz>([&](auto a) RHEC_INLINE {
            if constexpr ((pattern.first[r] >> a & 1) && argument_depends<k>(a, j))
              sum = sum + f_[k][r].d[pattern.direction_of[a]] * sensitivity<k, a, j>(h);
          });
          slopes_[k][r][j] = sum;
        }
      });
    });
  }

  void bend(const Lane& h, const Lane* weights) {
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
            if constexpr (pattern.first[r] >> c & 1) pulled = pulled + f_[k + 1][r].d[pattern.direction_of[c]] * mu[r];
          });
          now[c] = now[c] + h * Lane(reach[k + 1]) * pulled;
        }
      });
      for_indices<nx>([&](auto r) RHEC_INLINE { mu[r] = now[r]; });
      add_curvature<k>(mu, h);
    });
    for (int i = 0; i < nz; ++i)
      for (int j = 0; j < i; ++j) hessian[j][i] = hessian[i][j];
  }

  /// Adds S_k' (sum_r mu_r d2f_r) S_k to the lower triangle.
  template <int k>
  void add_curvature(const Lane* mu, const Lane& h) {
    for_indices<nz>([&](auto b) RHEC_INLINE {
      if constexpr (pattern.second[b] != 0) {
        Lane second[nz];
        for_indices<nz>([&](auto a) RHEC_INLINE {
          if constexpr (curves(b, a)) {
            constexpr int i =
                pattern.direction_of[b] > pattern.direction_of[a] ? pattern.direction_of[b] : pattern.direction_of[a];
            constexpr int j = pattern.direction_of[b] + pattern.direction_of[a] - i;
            Lane sum(0.0);
            for_indices<nx>([&](auto r) RHEC_INLINE {
              if constexpr ((pattern.first[r] >> b & 1) && (pattern.first[r] >> a & 1))
                sum = sum + mu[r] * f_[k][r].dd[i * (i + 1) / 2 + j];
            });
            second[a] = sum;
          }
        });
        for_indices<nz>([&](auto j) RHEC_INLINE {
          // (d2f S)_{b, j}
          if constexpr (any_curves<k>(b, j)) {
            Lane product(0.0);
            for_indices<nz>([&](auto a) RHEC_INLINE {
              if constexpr (curves(b, a) && argument_depends<k>(a, j))
                product = product + second[a] * sensitivity<k, a, j>(h);
            });
            for_indices<nz>([&](auto i) RHEC_INLINE {
              if constexpr (i >= j && argument_depends<k>(b, i))
                hessian[i][j] = hessian[i][j] + sensitivity<k, b, i>(h) * product;
            });
          }
        });
      }
    });
  }
  template <int k>
  static constexpr bool any_curves(int b, int j) {
    for (int a = 0; a < nz; ++a)
      if (curves(b, a) && argument_depends<k>(a, j)) return true;
    return false;
  }

  Number f_[4][nx];
  Lane slopes_[4][nx][nz];  ///< df_k/dz
};

}  // namespace rhec::kernels
