// Compiled once per instruction set RHEC_SET; its table is bank_kernels_<RHEC_SET>.
#include "rhec/core/kernels/bank_kernels.hpp"

#include "rhec/core/kernels/lanes.hpp"

namespace rhec {
namespace kernels {
namespace {

/// Entries of some members: those that fit in one register, from number `member` on.
class Entries {
 public:
  Entries(double* memory, int members, int member) : memory_(memory + member), step_(members) {}
  Lanes operator[](long entry) const { return load(memory_ + entry * step_); }
  void set(long entry, const Lanes& value) const { store(value, memory_ + entry * step_); }
  void add(long entry, const Lanes& value) const { set(entry, (*this)[entry] + value); }

 private:
  double* memory_;
  long step_;
};
class ConstEntries {
 public:
  ConstEntries(const double* memory, int members, int member) : memory_(memory + member), step_(members) {}
  Lanes operator[](long entry) const { return load(memory_ + entry * step_); }

 private:
  const double* memory_;
  long step_;
};

/// Copies the first `count` entries of those members whose numbers are all finite.
inline void commit(const Entries& from, long count, const Entries& to, const Lanes& zeros) {
  const LaneMask is_finite = zeros == 0.0;
  for (long e = 0; e < count; ++e) {
    const Lanes before = to[e], after = from[e];
    to.set(e, is_finite ? after : before);
  }
}

void moments(const BankView& bank, const double* weights, double* mean, double* covariance) {
  const int n = bank.states, M = bank.members;
  for (int r = 0; r < n; ++r) {
    Lanes sum{};
    for (int m = 0; m < M; m += lane_count) sum += load(weights + m) * load(bank.mean + static_cast<long>(r) * M + m);
    mean[r] = sum_of(sum);
  }
  // Deviations from the mean, weighted and not.
  double* const deviation = bank.work;
  for (int r = 0; r < n; ++r)
    for (int m = 0; m < M; m += lane_count)
      store(load(bank.mean + static_cast<long>(r) * M + m) - mean[r], deviation + static_cast<long>(r) * M + m);
  for (int c = 0; c < n; ++c) {
    for (int r = c; r < n; ++r) {
      Lanes sum{};
      const double *P = bank.covariance + (static_cast<long>(c) * n + r) * M, *a = deviation + static_cast<long>(r) * M,
                   *b = deviation + static_cast<long>(c) * M;
      for (int m = 0; m < M; m += lane_count) sum += load(weights + m) * (load(P + m) + load(a + m) * load(b + m));
      covariance[c * n + r] = covariance[r * n + c] = sum_of(sum);
    }
  }
}

void mix(const BankView& bank, const double* weights, const double* keep, const double* take) {
  const int n = bank.states, M = bank.members;
  double* const average = bank.work + 2 * static_cast<long>(n) * n * M;
  double* const spread = bank.work + static_cast<long>(n) * n * M;
  moments(bank, weights, average, spread);
  for (int m = 0; m < M; m += lane_count) {
    const Entries mean(bank.mean, M, m), P(bank.covariance, M, m), away(bank.work, M, m);
    const Lanes own = load(keep + m), other = load(take + m);
    for (int r = 0; r < n; ++r) {
      const Lanes from = mean[r], distance = all(average[r]) - from;
      away.set(r, distance);
      mean.set(r, from + other * distance);
    }
    const Lanes both = own * other;
    for (int c = 0; c < n; ++c) {
      const Lanes across = both * away[c];
      for (int r = c; r < n; ++r) {
        const Lanes mixed = own * P[c * n + r] + other * spread[c * n + r] + across * away[r];
        P.set(c * n + r, mixed);
        P.set(r * n + c, mixed);
      }
    }
  }
}

void predict(const BankView& bank, const BankStep& step) {
  const int n = bank.states, nx = bank.vehicle_states, nu = step.inputs, np = step.processes, M = bank.members;
  for (int m = 0; m < M; m += lane_count) {
    const Entries mean(bank.mean, M, m), P(bank.covariance, M, m), W(bank.work, M, m);
    const Entries next(bank.work + static_cast<long>(n) * n * M, M, m);
    const Entries next_mean(bank.work + 2 * static_cast<long>(n) * n * M, M, m);
    const ConstEntries J(step.jacobian, M, m), x(step.next_states, M, m);
    const auto by_state = [&](int r, int c) { return J[static_cast<long>(c) * nx + r]; };
    const auto by_input = [&](int r, int c) { return J[static_cast<long>(nx + c) * nx + r]; };
    const auto by_start = [&](int r, int j) { return J[static_cast<long>(nx + nu + j) * nx + r]; };
    const auto by_end = [&](int r, int j) { return J[static_cast<long>(nx + nu + np + j) * nx + r]; };
    // W = A P, the transition A = [F_x, F_p; 0, F].
    for (int c = 0; c < n; ++c) {
      const long column = static_cast<long>(c) * n;
      for (int r = 0; r < nx; ++r) {
        Lanes sum{};
        for (int k = 0; k < nx; ++k) sum += by_state(r, k) * P[column + k];
        W.set(column + r, sum);
      }
      for (int j = 0; j < np; ++j) {
        const BankProcess& process = step.process[j];
        const ConstEntries F(process.F, M, m), ramp(process.ramp, M, m);
        const int count = process.count;
        for (int r = 0; r < count; ++r) {
          Lanes sum{};
          for (int k = 0; k < count; ++k) sum += F[k * count + r] * P[column + process.first + k];
          W.set(column + process.first + r, sum);
        }
        // The vehicle feels where the parameter starts and where it ends: at the next value, or where it was.
        const Lanes start = P[column + process.first],
                    end = ramp[0] * W[column + process.first] + (1.0 - ramp[0]) * start;
        for (int r = 0; r < nx; ++r) W.add(column + r, by_start(r, j) * start + by_end(r, j) * end);
      }
    }
    // W A', lower half.
    for (int c = 0; c < nx; ++c) {
      for (int r = c; r < n; ++r) {
        Lanes sum{};
        for (int k = 0; k < nx; ++k) sum += by_state(c, k) * W[static_cast<long>(k) * n + r];
        next.set(static_cast<long>(c) * n + r, sum);
      }
    }
    for (int j = 0; j < np; ++j) {
      const BankProcess& process = step.process[j];
      const ConstEntries F(process.F, M, m), ramp(process.ramp, M, m);
      const int count = process.count, first = process.first;
      for (int r = 0; r < n; ++r) {
        const Lanes start = W[static_cast<long>(first) * n + r];
        Lanes end = start;
        // The value (c = 0) in every row, since the vehicle feels it; else the lower half alone.
        for (int c = 0; c < count && (c == 0 || first + c <= r); ++c) {
          Lanes sum{};
          for (int k = 0; k < count; ++k) sum += F[k * count + c] * W[static_cast<long>(first + k) * n + r];
          if (c == 0) end = ramp[0] * sum + (1.0 - ramp[0]) * start;
          if (r >= first + c) next.set(static_cast<long>(first + c) * n + r, sum);
        }
        for (int c = 0; c < nx && c <= r; ++c)
          next.add(static_cast<long>(c) * n + r, by_start(c, j) * start + by_end(c, j) * end);
      }
    }
    // Noise of the inputs.
    for (int j = 0; j < nu; ++j) {
      for (int c = 0; c < nx; ++c) {
        const Lanes scaled = by_input(c, j) * step.input_variances[j];
        for (int r = c; r < nx; ++r) next.add(static_cast<long>(c) * n + r, scaled * by_input(r, j));
      }
    }
    // Noise of the processes, which on a ramp enters the vehicle through the value at the end.
    for (int j = 0; j < np; ++j) {
      const BankProcess& process = step.process[j];
      const ConstEntries Q(process.Q, M, m), ramp(process.ramp, M, m);
      const int count = process.count, first = process.first;
      for (int c = 0; c < count; ++c) {
        for (int r = c; r < count; ++r) next.add(static_cast<long>(first + c) * n + first + r, Q[c * count + r]);
        for (int r = 0; r < nx; ++r) {
          // Rows of z, columns of x: the lower half.
          next.add(static_cast<long>(r) * n + first + c, ramp[0] * by_end(r, j) * Q[c]);
        }
      }
      for (int c = 0; c < nx; ++c) {
        const Lanes scaled = ramp[0] * by_end(c, j) * Q[0];
        for (int r = c; r < nx; ++r) next.add(static_cast<long>(c) * n + r, scaled * by_end(r, j));
      }
    }
    for (int r = 0; r < nx; ++r) next_mean.set(r, x[r]);
    for (int j = 0; j < np; ++j) {
      const BankProcess& process = step.process[j];
      const ConstEntries F(process.F, M, m);
      for (int r = 0; r < process.count; ++r) {
        Lanes sum{};
        for (int k = 0; k < process.count; ++k) sum += F[k * process.count + r] * mean[process.first + k];
        next_mean.set(process.first + r, sum);
      }
    }
    Lanes zeros{};
    for (int r = 0; r < n; ++r) zeros += 0.0 * next_mean[r];
    for (int c = 0; c < n; ++c) {
      for (int r = c; r < n; ++r) {
        const Lanes value = next[static_cast<long>(c) * n + r];
        zeros += 0.0 * value;
        next.set(static_cast<long>(r) * n + c, value);
      }
    }
    commit(next_mean, n, mean, zeros);
    commit(next, static_cast<long>(n) * n, P, zeros);
  }
}

void narrow(const BankView& bank, const BankView& wide, const double* transition, const double* next_mean) {
  const int n = bank.states, a = wide.states, M = bank.members;
  for (int m = 0; m < M; m += lane_count) {
    const Entries mean(bank.mean, M, m), P(bank.covariance, M, m), W(wide.work, M, m), next(bank.work, M, m);
    const ConstEntries T(transition, M, m), P_wide(wide.covariance, M, m), given(next_mean, M, m);
    const Entries new_mean(bank.work + static_cast<long>(n) * n * M, M, m);
    // W = T P, then W T', lower half.
    for (int c = 0; c < a; ++c) {
      for (int r = 0; r < n; ++r) {
        Lanes sum{};
        for (int k = 0; k < a; ++k) sum += T[static_cast<long>(k) * n + r] * P_wide[static_cast<long>(c) * a + k];
        W.set(static_cast<long>(c) * n + r, sum);
      }
    }
    Lanes zeros{};
    for (int c = 0; c < n; ++c) {
      new_mean.set(c, given[c]);
      zeros += 0.0 * given[c];
      for (int r = c; r < n; ++r) {
        Lanes sum{};
        for (int k = 0; k < a; ++k) sum += W[static_cast<long>(k) * n + r] * T[static_cast<long>(k) * n + c];
        zeros += 0.0 * sum;
        next.set(static_cast<long>(c) * n + r, sum);
        next.set(static_cast<long>(r) * n + c, sum);
      }
    }
    commit(new_mean, n, mean, zeros);
    commit(next, static_cast<long>(n) * n, P, zeros);
  }
}

/// Measured minus predicted; of an angle, to the nearest multiple of the period.
inline Lanes innovation_of(const BankOutput& output, int m) {
  Lanes innovation = output.measured - load(output.predicted + m);
  if (output.period > 0.0) {
    // Adding and subtracting 1.5 2^52 rounds to an integer.
    constexpr double to_integer = 6755399441055744.0;
    const Lanes turns = innovation * (1.0 / output.period);
    innovation -= ((turns + to_integer) - to_integer) * output.period;
  }
  return innovation;
}

void move_point(const BankView& bank, const BankOutput* outputs, int count, int judged, double gate, double* point,
                double* moved) {
  const int n = bank.states, nx = bank.vehicle_states, M = bank.members;
  for (int m = 0; m < M; m += lane_count) {
    const Entries mean(bank.mean, M, m), P(bank.covariance, M, m), at(point, M, m);
    const Entries image(bank.work, M, m), S(bank.work + static_cast<long>(count) * n * M, M, m),
        nu(bank.work + (static_cast<long>(count) * n + static_cast<long>(count) * count) * M, M, m);
    for (int j = 0; j < count; ++j) {
      const ConstEntries h(outputs[j].gradient, M, m);
      Lanes innovation = innovation_of(outputs[j], m);
      for (int c = 0; c < nx; ++c) innovation -= h[c] * (mean[c] - at[c]);
      for (int r = 0; r < n; ++r) {
        Lanes sum{};
        for (int c = 0; c < nx; ++c) sum += P[static_cast<long>(c) * n + r] * h[c];
        image.set(static_cast<long>(j) * n + r, sum);
      }
      for (int k = 0; k <= j; ++k) {
        const ConstEntries other(outputs[k].gradient, M, m);
        Lanes sum{};
        for (int c = 0; c < nx; ++c) sum += other[c] * image[static_cast<long>(j) * n + c];
        if (k == j) sum = larger(sum + load(outputs[j].variance + m), innovation * innovation * (1.0 / gate));
        S.set(static_cast<long>(k) * count + j, sum);
      }
      nu.set(j, innovation);
    }
    // S^-1 nu by S = L D L', in place: below the diagonal L D.
    for (int c = 0; c < count; ++c) {
      const long column = static_cast<long>(c) * count;
      for (int k = c + 1; k < count; ++k) {
        const Lanes factor = S[column + k] / S[column + c];
        for (int r = k; r < count; ++r) S.add(static_cast<long>(k) * count + r, -factor * S[column + r]);
        nu.add(k, -factor * nu[c]);
      }
    }
    for (int c = count - 1; c >= 0; --c) {
      const long column = static_cast<long>(c) * count;
      Lanes value = nu[c];
      for (int r = c + 1; r < count; ++r) value -= S[column + r] * nu[r];
      nu.set(c, value / S[column + c]);
    }
    Lanes zeros{};
    for (int j = 0; j < count; ++j) zeros += 0.0 * nu[j];
    const LaneMask is_finite = zeros == 0.0;
    Lanes farthest{};
    for (int r = 0; r < n; ++r) {
      Lanes change{};
      for (int j = 0; j < count; ++j) change += image[static_cast<long>(j) * n + r] * nu[j];
      const Lanes next = mean[r] + (is_finite ? change : Lanes{}), step = next - at[r],
                  variance = P[static_cast<long>(r) * n + r];
      if (r < judged) farthest = larger(farthest, variance > 0.0 ? step * step / variance : Lanes{});
      at.set(r, next);
    }
    store(farthest, moved + m);
  }
}

void surprise(const BankView& bank, const BankOutput* outputs, int count, double* squares) {
  const int n = bank.states, nx = bank.vehicle_states, M = bank.members;
  for (int m = 0; m < M; m += lane_count) {
    const Entries P(bank.covariance, M, m);
    for (int j = 0; j < count; ++j) {
      const ConstEntries h(outputs[j].gradient, M, m);
      const Lanes innovation = innovation_of(outputs[j], m);
      Lanes total = load(outputs[j].variance + m);
      for (int c = 0; c < nx; ++c) {
        Lanes sum{};
        for (int r = 0; r < nx; ++r) sum += P[static_cast<long>(c) * n + r] * h[r];
        total += sum * h[c];
      }
      store(innovation * innovation / total, squares + static_cast<long>(j) * M + m);
    }
  }
}

void update(const BankView& bank, const BankOutput* outputs, int count, double gate, double* squares,
            double* variances) {
  const int n = bank.states, nx = bank.vehicle_states, M = bank.members;
  for (int m = 0; m < M; m += lane_count) {
    const Entries mean(bank.mean, M, m), P(bank.covariance, M, m), next(bank.work, M, m);
    const Entries image(bank.work + 2 * static_cast<long>(n) * n * M, M, m),
        gain(bank.work + (2 * static_cast<long>(n) * n + n) * M, M, m),
        correction(bank.work + (2 * static_cast<long>(n) * n + 2 * n) * M, M, m);
    for (int r = 0; r < n; ++r) correction.set(r, Lanes{});
    for (int j = 0; j < count; ++j) {
      const BankOutput& output = outputs[j];
      const ConstEntries h(output.gradient, M, m);
      Lanes innovation = innovation_of(output, m);
      const Lanes variance = load(output.variance + m);
      Lanes total = variance;
      for (int r = 0; r < n; ++r) {
        Lanes sum{};
        for (int c = 0; c < nx; ++c) sum += P[static_cast<long>(c) * n + r] * h[c];
        image.set(r, sum);
      }
      for (int c = 0; c < nx; ++c) {
        innovation -= h[c] * correction[c];
        total += h[c] * image[c];
      }
      const Lanes inverse = 1.0 / total;
      for (int r = 0; r < n; ++r) gain.set(r, image[r] * inverse);
      // Joseph's form (I - k h') P (I - k h')' + k R k', multiplied out with b = P h and s = h' b + R:
      // P - k b' - b k' + s k k', which a rounding error of k changes in second order only. The lower half.
      Lanes zeros = 0.0 * innovation;
      for (int c = 0; c < n; ++c) {
        const Lanes by_gain = gain[c], rest = image[c] - total * by_gain;
        for (int r = c; r < n; ++r) {
          const long lower = static_cast<long>(c) * n + r;
          const Lanes value = P[lower] - image[r] * by_gain - gain[r] * rest;
          zeros += 0.0 * value;
          next.set(lower, value);
        }
      }
      const LaneMask is_finite = zeros == 0.0;
      for (int c = 0; c < n; ++c) {
        for (int r = c; r < n; ++r) {
          const long lower = static_cast<long>(c) * n + r, upper = static_cast<long>(r) * n + c;
          const Lanes before = P[lower], after = next[lower], value = is_finite ? after : before;
          P.set(lower, value);
          P.set(upper, value);
        }
      }
      for (int r = 0; r < n; ++r) correction.add(r, is_finite ? gain[r] * innovation : Lanes{});
      const Lanes square = is_finite ? smaller(innovation * innovation / total, all(gate)) : all(gate);
      store(load(squares + m) + square, squares + m);
      store(is_finite ? total : all(1.0), variances + static_cast<long>(j) * M + m);
    }
    for (int r = 0; r < n; ++r) mean.add(r, correction[r]);
  }
}

}  // namespace
}  // namespace kernels

#define RHEC_JOIN(a, b) a##b
#define RHEC_TABLE(name, set) RHEC_JOIN(name, set)
extern const BankKernels RHEC_TABLE(bank_kernels_, RHEC_SET);
constinit const BankKernels RHEC_TABLE(bank_kernels_, RHEC_SET) = {
    &kernels::mix,        &kernels::predict,  &kernels::update, &kernels::narrow,
    &kernels::move_point, &kernels::surprise, &kernels::moments};

}  // namespace rhec
