#include "floor_kernels.hpp"

#include <cstring>
#include <xsimd/xsimd.hpp>

namespace rhec::bench::floor {
namespace {

// --- Stages side by side, one in each lane ---------------------------------------------------------------------------

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

/// beta' = v T(delta) at one of the three steering angles of a Runge-Kutta step, with its derivatives.
struct TurnRate {
  Lanes rate, tangent, slope, bend;  ///< v T; T and its derivatives by mu delta
  Lanes steering;

  TurnRate(const Lanes& speed, const Lanes& mu, const Lanes& angle, double one_over_wheelbase) : steering(angle) {
    const Lanes t = xsimd::tan(mu * angle);
    tangent = t * one_over_wheelbase;
    slope = xsimd::fma(t, t, Lanes(1.0)) * one_over_wheelbase;
    bend = 2.0 * t * slope;
    rate = speed * tangent;
  }
};

/// A Runge-Kutta step of the bicycle: only its heading's and its steering's rates do not depend on where it is.
struct Passage {
  Lanes x, y, beta, delta, kappa, mu, u1, u2, v;
  TurnRate k1, k2, k4;  // the third is the second
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

  /// Column of the first three rows for a variable that the speed and the turn rates depend on.
  void column(const Lanes& speed, const Lanes& a1, const Lanes& a2, const Lanes& a4, Lanes (&rows_of)[3][8],
              int at) const {
    const Lanes o2 = h * a1, o3 = h * a2, o4 = h * a2;  // of twice the second and third angle, and of the fourth
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

  /// Adds the curvature of costate' F by beta, delta, u1 and u2 to rows of the Hessian.
  void curvature(const Lanes (&costate)[8], Lanes& bb, Lanes& bd, Lanes& bu, Lanes& bw, Lanes& dd, Lanes& du, Lanes& dw,
                 Lanes& uu, Lanes& uw, Lanes& ww) const {
    const double weight[4] = {1.0, 2.0, 2.0, 1.0};
    Lanes g[4], slope[4];
    for (int i = 0; i < 4; ++i) {
      g[i] = weight[i] * (costate[0] * cosine[i] + costate[1] * sine[i]);
      slope[i] = weight[i] * (costate[1] * cosine[i] - costate[0] * sine[i]);
    }
    // First and second derivatives of the turn rates by delta (d), u1 (u) and u2 (w).
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
    Lanes sum(0.0), sum_slope(0.0), e_d(0.0), e_u(0.0), e_w(0.0), e_bd(0.0), e_bu(0.0), e_bw(0.0);
    Lanes e_dd(0.0), e_du(0.0), e_dw(0.0), e_uu(0.0), e_uw(0.0), e_ww(0.0);
    sum = g[0] + g[1] + g[2] + g[3];
    sum_slope = slope[0] + slope[1] + slope[2] + slope[3];
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
    bb = -hv * sum;
    bd = hv * e_bd;
    bu = hk * sum_slope + hv * e_bu;
    bw = hv * e_bw;
    dd = hv * e_dd + hb * (r1.dd + 4.0 * r2.dd + r4.dd);
    du = hk * e_d + hv * e_du + hb * (r1.du + 4.0 * r2.du + r4.du);
    dw = hv * e_dw + hb * (r1.dw + 4.0 * r2.dw + r4.dw);
    uu = 2.0 * hk * e_u + hv * e_uu;
    uw = hk * e_w + hv * e_uw + hb * (r1.uw + 4.0 * r2.uw + r4.uw);
    ww = hv * e_ww + hb * (r1.ww + 4.0 * r2.ww + r4.ww);
  }
};

// --- Single stages, a row of eight numbers in a register -------------------------------------------------------------

#if defined(__AVX512F__)
constexpr int part_size = 8;
#elif defined(__AVX__)
constexpr int part_size = 4;
#else
constexpr int part_size = 2;
#endif
typedef double Part __attribute__((vector_size(8 * part_size), may_alias));
constexpr int parts = 8 / part_size;

/// Eight numbers in as many registers as the machine needs.
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

inline void write_dynamics(const Lanes (&rows_of)[3][8], Workspace& work, int first) {
  for (int r = 0; r < 3; ++r) store_rows(rows_of[r], &work.dynamics[first][r], 8);
}

/// rows of the next states -> defects
template <int N>
inline void subtract_next(const Row* point, Workspace& work) {
  const Eight states = {1, 1, 1, 1, 1, 1, 0, 0};
  for (int i = 0; i < N; ++i) store(work.defect[i], load(work.defect[i]) - states * load(point[i + 1]));
}

template <int states>
constexpr int row_of(int index) {
  return index < states ? index : 6 + index - states;
}

/// The backward sweep for `states` states and two inputs, in lanes 6 and 7.
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
    // [A + B K, B; K, 1], whose columns carry a step on.
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

/// -P^-1 p by elimination.
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

void clear(Workspace& work, double h) {
  std::memset(static_cast<void*>(&work), 0, sizeof(work));
  for (auto& stage : work.dynamics) {
    for (int r = 3; r < 6; ++r) stage[r].at[r] = 1.0;
    stage[3].at[7] = h;
  }
}

}  // namespace

void prepare_constants(const Estimation& problem, Workspace& work) {
  clear(work, problem.vehicle.step);
  for (auto& stage : work.hessian) {
    stage[0].at[0] = problem.output_weights.at[0];
    stage[1].at[1] = problem.output_weights.at[1];
    stage[3].at[3] = problem.output_weights.at[2];
    stage[6].at[6] = problem.input_weights.at[0];
    stage[7].at[7] = problem.input_weights.at[1];
  }
}

void prepare_constants(const Control& problem, Workspace& work) {
  clear(work, problem.vehicle.step);
  for (auto& stage : work.hessian)
    for (int r = 0; r < 2; ++r) stage[r].at[r] = problem.stage_weights.at[r];
}

template <int N>
[[gnu::flatten]] void linearise(const Estimation& problem, Workspace& work) {
  const double d = problem.vehicle.gps_offset;
  const double wx = problem.output_weights.at[0], wy = problem.output_weights.at[1], wd = problem.output_weights.at[2];
  for (int first = 0; first <= N; first += width) {
    Lanes z[8], y[8], rows_of[3][8], next[8];
    load_columns(problem.point + first, z);
    load_columns(problem.measured + first, y);
    const Passage passage(z, problem.vehicle);
    passage.jacobian(rows_of, true);
    write_dynamics(rows_of, work, first);
    passage.end(next);
    store_rows(next, work.defect + first, 1);

    const Lanes s = d * passage.sine[0], c = d * passage.cosine[0];
    const Lanes ex = wx * (z[0] - c - y[0]), ey = wy * (z[1] - s - y[1]);
    const Lanes of_x = wx * s, of_y = -wy * c, zero(0.0);
    alignas(64) double x_beta[width], y_beta[width];
    of_x.store_aligned(x_beta);
    of_y.store_aligned(y_beta);
    for (int lane = 0; lane < width; ++lane) {
      work.hessian[first + lane][0].at[2] = x_beta[lane];
      work.hessian[first + lane][1].at[2] = y_beta[lane];
    }
    const Lanes beta_row[8] = {of_x, of_y, of_x * s - of_y * c, zero, zero, zero, zero, zero};
    store_rows(beta_row, &work.hessian[first][2], 8);
    const Lanes gradient[8] = {ex,
                               ey,
                               s * ex - c * ey,
                               wd * (z[3] - y[2]),
                               zero,
                               zero,
                               problem.input_weights.at[0] * (z[6] - y[3]),
                               problem.input_weights.at[1] * (z[7] - y[4])};
    store_rows(gradient, work.gradient + first, 1);
  }
  subtract_next<N>(problem.point, work);
  // The arrival cost.
  const Eight error = load(problem.point[0]) - load(problem.arrival_mean);
  Eight gradient = load(work.gradient[0]);
  Row* first = work.hessian[0];
  const double x_beta = first[0].at[2], y_beta = first[1].at[2];
  const Eight beta_row = load(first[2]);
  for (int r = 0; r < 6; ++r) {
    const Eight information = load(problem.arrival_information[r]);
    gradient += error[r] * information;
    store(first[r], r == 2 ? information + beta_row : information);
  }
  first[0].at[0] += wx;
  first[0].at[2] += x_beta;
  first[1].at[1] += wy;
  first[1].at[2] += y_beta;
  first[3].at[3] += wd;
  store(work.gradient[0], gradient);
}

template <int N>
[[gnu::flatten]] void linearise(const Control& problem, Workspace& work) {
  const Eight w = load(problem.stage_weights);
  for (int first = 0; first < N; first += width) {
    Lanes z[8], costate[8], rows_of[3][8], next[8];
    load_columns(problem.point + first, z);
    load_columns(problem.costates + first + 1, costate);
    const Passage passage(z, problem.vehicle);
    passage.jacobian(rows_of, false);
    write_dynamics(rows_of, work, first);
    passage.end(next);
    store_rows(next, work.defect + first, 1);
    Lanes bb, bd, bu, bw, dd, du, dw, uu, uw, ww;
    passage.curvature(costate, bb, bd, bu, bw, dd, du, dw, uu, uw, ww);
    const Lanes zero(0.0);
    const double* weights = problem.stage_weights.at;
    const Lanes beta[8] = {zero, zero, bb + weights[2], bd, zero, zero, bu, bw};
    const Lanes delta[8] = {zero, zero, bd, dd + weights[3], zero, zero, du, dw};
    const Lanes speed[8] = {zero, zero, bu, du, zero, zero, uu + weights[6], uw};
    const Lanes rate[8] = {zero, zero, bw, dw, zero, zero, uw, ww + weights[7]};
    store_rows(beta, &work.hessian[first][2], 8);
    store_rows(delta, &work.hessian[first][3], 8);
    store_rows(speed, &work.hessian[first][6], 8);
    store_rows(rate, &work.hessian[first][7], 8);
  }
  for (int i = 0; i < N; ++i) store(work.gradient[i], w * (load(problem.point[i]) - load(problem.reference[i])));
  const Eight terminal = load(problem.terminal_weights);
  store(work.gradient[N], terminal * (load(problem.point[N]) - load(problem.reference[N])));
  for (int r = 0; r < 4; ++r) {
    work.hessian[N][r] = Row{};
    work.hessian[N][r].at[r] = problem.terminal_weights.at[r];
  }
  subtract_next<N>(problem.point, work);
}

template <int N>
[[gnu::flatten]] void solve(const Estimation&, Workspace& work) {
  backward<N, 6>(work);
  forward<N, 6>(work, free_initial_step(work));
}

template <int N>
[[gnu::flatten]] void solve(const Control& problem, Workspace& work) {
  backward<N, 4>(work);
  const Eight only_states = {1, 1, 1, 1, 0, 0, 0, 0};
  forward<N, 4>(work, (load(problem.initial_state) - load(problem.point[0])) * only_states);
}

template void linearise<14>(const Estimation&, Workspace&);
template void linearise<15>(const Estimation&, Workspace&);
template void linearise<15>(const Control&, Workspace&);
template void solve<14>(const Estimation&, Workspace&);
template void solve<15>(const Estimation&, Workspace&);
template void solve<15>(const Control&, Workspace&);

}  // namespace rhec::bench::floor
