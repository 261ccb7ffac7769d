#pragma once

#include <xsimd/xsimd.hpp>

#include "floor_kernels.hpp"

// The dynamics of an interval with derivatives written out, for several stages at once, one in each lane of a register.
namespace rhec::bench::floor {

using Lanes = xsimd::batch<double>;
constexpr int width = static_cast<int>(Lanes::size);

#if defined(__AVX512F__)
inline void transpose(__m512d (&r)[8]) {
  __m512d t[8], s[8];
  for (int i = 0; i < 8; i += 2) {
    t[i] = _mm512_unpacklo_pd(r[i], r[i + 1]);
    t[i + 1] = _mm512_unpackhi_pd(r[i], r[i + 1]);
  }
  for (int i = 0; i < 8; i += 4) {
    for (int j = 0; j < 2; ++j) {
      s[i + j] = _mm512_shuffle_f64x2(t[i + j], t[i + j + 2], 0x88);
      s[i + j + 2] = _mm512_shuffle_f64x2(t[i + j], t[i + j + 2], 0xdd);
    }
  }
  for (int j = 0; j < 4; ++j) {
    r[j] = _mm512_shuffle_f64x2(s[j], s[j + 4], 0x88);
    r[j + 4] = _mm512_shuffle_f64x2(s[j], s[j + 4], 0xdd);
  }
}
#endif

inline void load_columns(const Row* from, Lanes (&columns)[8]) {
#if defined(__AVX512F__)
  if constexpr (width == 8) {
    __m512d r[8];
    for (int i = 0; i < 8; ++i) r[i] = _mm512_load_pd(from[i].at);
    transpose(r);
    for (int i = 0; i < 8; ++i) columns[i] = Lanes(r[i]);
    return;
  }
#endif
  alignas(64) double side_by_side[8][width];
  for (int c = 0; c < 8; ++c)
    for (int lane = 0; lane < width; ++lane) side_by_side[c][lane] = from[lane].at[c];
  for (int c = 0; c < 8; ++c) columns[c] = Lanes::load_aligned(side_by_side[c]);
}

/// Row `lane` of the columns goes to to[lane * stride].
inline void store_rows(const Lanes (&columns)[8], Row* to, int stride) {
#if defined(__AVX512F__)
  if constexpr (width == 8) {
    __m512d r[8];
    for (int i = 0; i < 8; ++i) r[i] = columns[i];
    transpose(r);
    for (int i = 0; i < 8; ++i) _mm512_store_pd(to[i * stride].at, r[i]);
    return;
  }
#endif
  alignas(64) double side_by_side[8][width];
  for (int c = 0; c < 8; ++c) columns[c].store_aligned(side_by_side[c]);
  for (int lane = 0; lane < width; ++lane)
    for (int c = 0; c < 8; ++c) to[lane * stride].at[c] = side_by_side[c][lane];
}

/// beta' = v T(delta) at one of the three distinct steering angles of a Runge-Kutta step, with its derivatives.
struct TurnRate {
  Lanes rate, tangent, slope, bend;  ///< v T; T and its derivatives with respect to mu delta
  Lanes steering;

  TurnRate(const Lanes& speed, const Lanes& mu, const Lanes& angle, double one_over_wheelbase) : steering(angle) {
    const Lanes t = xsimd::tan(mu * angle);
    tangent = t * one_over_wheelbase;
    slope = xsimd::fma(t, t, Lanes(1.0)) * one_over_wheelbase;
    bend = 2.0 * t * slope;
    rate = speed * tangent;
  }
};

/// A Runge-Kutta step of the bicycle. The rates of the heading and of the steering angle do not depend on the heading.
struct Passage {
  Lanes x, y, beta, delta, kappa, mu, u1, u2, v;
  TurnRate k1, k2, k4;  // the third equals the second
  Lanes sine[4], cosine[4];
  double h;

  Passage(const Lanes (&z)[8], const Vehicle& vehicle)
      : x(z[0]),
        y(z[1]),
        beta(z[2]),
        delta(z[3]),
        kappa(z[4]),
        mu(z[5]),
        u1(z[6]),
        u2(z[7]),
        v(kappa * u1),
        k1(v, mu, delta, 1.0 / vehicle.wheelbase),
        k2(v, mu, delta + 0.5 * vehicle.step * u2, 1.0 / vehicle.wheelbase),
        k4(v, mu, delta + vehicle.step * u2, 1.0 / vehicle.wheelbase),
        h(vehicle.step) {
    const Lanes angles[4] = {beta, beta + 0.5 * h * k1.rate, beta + 0.5 * h * k2.rate, beta + h * k2.rate};
    for (int i = 0; i < 4; ++i) {
      const auto [s, c] = xsimd::sincos(angles[i]);
      sine[i] = s;
      cosine[i] = c;
    }
  }

  Lanes sine_sum() const { return sine[0] + 2.0 * (sine[1] + sine[2]) + sine[3]; }
  Lanes cosine_sum() const { return cosine[0] + 2.0 * (cosine[1] + cosine[2]) + cosine[3]; }

  void end(Lanes (&next)[8]) const {
    next[0] = x + h / 6.0 * v * cosine_sum();
    next[1] = y + h / 6.0 * v * sine_sum();
    next[2] = beta + h / 6.0 * (k1.rate + 4.0 * k2.rate + k4.rate);
    next[3] = delta + h * u2;
    next[4] = kappa;
    next[5] = mu;
    next[6] = next[7] = Lanes(0.0);
  }

  /// Column of the Jacobian's first three rows for a variable that affects the speed or the turn rates.
  void column(const Lanes& speed, const Lanes& a1, const Lanes& a2, const Lanes& a4, Lanes (&rows_of)[3][8],
              int at) const {
    const Lanes o2 = h * a1, o3 = h * a2, o4 = h * a2;  // of twice the second and third heading, and of the fourth
    rows_of[0][at] = h / 6.0 * (speed * cosine_sum() - v * (sine[1] * o2 + sine[2] * o3 + sine[3] * o4));
    rows_of[1][at] = h / 6.0 * (speed * sine_sum() + v * (cosine[1] * o2 + cosine[2] * o3 + cosine[3] * o4));
    rows_of[2][at] = h / 6.0 * (a1 + 4.0 * a2 + a4);
  }

  void jacobian(Lanes (&rows_of)[3][8], bool parameters) const {
    const Lanes zero(0.0), one(1.0);
    for (auto& row : rows_of) row[0] = row[1] = row[4] = row[5] = zero;
    rows_of[0][0] = rows_of[1][1] = rows_of[2][2] = one;
    rows_of[0][2] = -h / 6.0 * v * sine_sum();
    rows_of[1][2] = h / 6.0 * v * cosine_sum();
    const Lanes s1 = v * k1.slope, s2 = v * k2.slope, s4 = v * k4.slope;
    column(zero, mu * s1, mu * s2, mu * s4, rows_of, 3);
    column(kappa, kappa * k1.tangent, kappa * k2.tangent, kappa * k4.tangent, rows_of, 6);
    column(zero, zero, 0.5 * h * mu * s2, h * mu * s4, rows_of, 7);
    if (!parameters) return;
    column(u1, u1 * k1.tangent, u1 * k2.tangent, u1 * k4.tangent, rows_of, 4);
    column(zero, k1.steering * s1, k2.steering * s2, k4.steering * s4, rows_of, 5);
  }

  /// Second derivatives of costate' F with respect to beta (b), delta (d), u1 (u) and u2 (w).
  struct Curvature {
    Lanes bb, bd, bu, bw, dd, du, dw, uu, uw, ww;
  };
  Curvature curvature(const Lanes (&costate)[8]) const {
    const double weight[4] = {1.0, 2.0, 2.0, 1.0};
    Lanes g[4], slope[4];
    for (int i = 0; i < 4; ++i) {
      g[i] = weight[i] * (costate[0] * cosine[i] + costate[1] * sine[i]);
      slope[i] = weight[i] * (costate[1] * cosine[i] - costate[0] * sine[i]);
    }
    // First and second derivatives of the turn rates with respect to delta (d), u1 (u) and u2 (w).
    struct Rate {
      Lanes d, u, w, dd, du, dw, uw, ww;
    };
    const auto rate = [&](const TurnRate& k, double time) {
      const Lanes first = mu * k.slope, second = mu * mu * k.bend;
      const Lanes vs = v * first, vc = v * second, ks = kappa * first;
      return Rate{vs, kappa * k.tangent, time * vs, vc, ks, time * vc, time * ks, time * time * vc};
    };
    const Rate r1 = rate(k1, 0.0), r2 = rate(k2, 0.5 * h), r4 = rate(k4, h);
    const double c[4] = {0.0, 0.5 * h, 0.5 * h, h};
    const Rate* of[4] = {&r1, &r1, &r2, &r2};
    Lanes e_d(0.0), e_u(0.0), e_w(0.0), e_bd(0.0), e_bu(0.0), e_bw(0.0);
    Lanes e_dd(0.0), e_du(0.0), e_dw(0.0), e_uu(0.0), e_uw(0.0), e_ww(0.0);
    const Lanes sum = g[0] + g[1] + g[2] + g[3];
    const Lanes sum_slope = slope[0] + slope[1] + slope[2] + slope[3];
    for (int i = 1; i < 4; ++i) {
      const Rate& r = *of[i];
      const Lanes d = c[i] * r.d, u = c[i] * r.u, w = c[i] * r.w;
      const Lanes first = c[i] * slope[i];
      e_d += slope[i] * d;
      e_u += slope[i] * u;
      e_w += slope[i] * w;
      e_bd -= g[i] * d;
      e_bu -= g[i] * u;
      e_bw -= g[i] * w;
      e_dd += first * r.dd - g[i] * d * d;
      e_du += first * r.du - g[i] * d * u;
      e_dw += first * r.dw - g[i] * d * w;
      e_uu -= g[i] * u * u;
      e_uw += first * r.uw - g[i] * u * w;
      e_ww += first * r.ww - g[i] * w * w;
    }
    const Lanes hv = h / 6.0 * v, hk = h / 6.0 * kappa, hb = h / 6.0 * costate[2];
    return {.bb = -hv * sum,
            .bd = hv * e_bd,
            .bu = hk * sum_slope + hv * e_bu,
            .bw = hv * e_bw,
            .dd = hv * e_dd + hb * (r1.dd + 4.0 * r2.dd + r4.dd),
            .du = hk * e_d + hv * e_du + hb * (r1.du + 4.0 * r2.du + r4.du),
            .dw = hv * e_dw + hb * (r1.dw + 4.0 * r2.dw + r4.dw),
            .uu = 2.0 * hk * e_u + hv * e_uu,
            .uw = hk * e_w + hv * e_uw + hb * (r1.uw + 4.0 * r2.uw + r4.uw),
            .ww = hv * e_ww + hb * (r1.ww + 4.0 * r2.ww + r4.ww)};
  }
};

}  // namespace rhec::bench::floor
