#include "rhec/core/prior/matern.hpp"

#include <cmath>
#include <limits>

namespace rhec {
namespace {

constexpr int most_states = 3, powers = 2 * most_states - 1;

/// m[k] = integral of t^k exp(-rate t) from 0 to d, for k = 0 .. powers - 1. The highest by the series of the lower
/// incomplete gamma function (DLMF 8.7.1), the others by the recurrence downwards: all terms are positive, so that
/// nothing cancels.
void moments(double d, double rate, double (&m)[powers]) noexcept {
  constexpr int top = powers - 1;
  constexpr double far = 80.0;  // where exp(-far) is below the rounding of 1
  const double x = rate * d;
  if (x > far) {
    m[0] = 1.0 / rate;
    for (int k = 1; k <= top; ++k) m[k] = m[k - 1] * k / rate;
    return;
  }
  const double decay = std::exp(-x);
  double term = 1.0 / (top + 1), sum = term;
  for (int j = 1; term > std::numeric_limits<double>::epsilon() * sum; ++j) {
    term *= x / (top + 1 + j);
    sum += term;
  }
  double power = d;  // d^(k + 1)
  for (int k = 0; k < top; ++k) power *= d;
  m[top] = power * decay * sum;
  for (int k = top; k > 0; --k) {
    power = 1.0;
    for (int i = 0; i < k; ++i) power *= d;
    m[k - 1] = (rate * m[k] + power * decay) / k;
  }
}

}  // namespace

double Matern::lambda() const noexcept { return std::sqrt(2.0 * states - 1.0) / length; }

void Matern::stationary(double* P, int rows) const noexcept {
  const double l2 = lambda() * lambda(), variance = sigma * sigma;
  const auto set = [&](int r, int c, double value) { P[c * rows + r] = P[r * rows + c] = value; };
  set(0, 0, variance);
  if (states == 2) {
    set(0, 1, 0.0);
    set(1, 1, variance * l2);
  } else if (states == 3) {
    const double middle = variance * l2 / 3.0;
    set(0, 1, 0.0);
    set(0, 2, -middle);
    set(1, 1, middle);
    set(1, 2, 0.0);
    set(2, 2, variance * l2 * l2);
  }
}

void Matern::transition(double d, double* F, double* Q, int rows) const noexcept {
  const double l = lambda(), decay = std::exp(-l * d), ld = l * d;
  // Column c of exp(A d), times exp(lambda d): polynomials of d.
  const auto set = [&](int r, int c, double value) { F[c * rows + r] = decay * value; };
  if (states == 1) {
    set(0, 0, 1.0);
  } else if (states == 2) {
    set(0, 0, 1.0 + ld);
    set(0, 1, d);
    set(1, 0, -l * ld);
    set(1, 1, 1.0 - ld);
  } else {
    set(0, 0, 1.0 + ld + 0.5 * ld * ld);
    set(0, 1, d * (1.0 + ld));
    set(0, 2, 0.5 * d * d);
    set(1, 0, -0.5 * l * ld * ld);
    set(1, 1, 1.0 + ld - ld * ld);
    set(1, 2, d * (1.0 - 0.5 * ld));
    set(2, 0, l * l * ld * (0.5 * ld - 1.0));
    set(2, 1, l * ld * (ld - 3.0));
    set(2, 2, 1.0 - 2.0 * ld + 0.5 * ld * ld);
  }
  // Q = q integral of g g' exp(-2 lambda t), where g is the last column as a polynomial of t, and q the density of the
  // white noise that drives the last state.
  const double response[most_states][most_states][most_states] = {
      {{1.0}}, {{0.0, 1.0}, {1.0, -l}}, {{0.0, 0.0, 0.5}, {0.0, 1.0, -0.5 * l}, {1.0, -2.0 * l, 0.5 * l * l}}};
  const double density[most_states] = {2.0 * l, 4.0 * l * l * l, 16.0 / 3.0 * l * l * l * l * l};
  const auto& g = response[states - 1];
  const double q = density[states - 1] * sigma * sigma;
  double m[powers];
  moments(d, 2.0 * l, m);
  for (int r = 0; r < states; ++r) {
    for (int c = 0; c <= r; ++c) {
      double sum = 0.0;
      for (int i = 0; i < states; ++i)
        for (int j = 0; j < states; ++j) sum += g[r][i] * g[c][j] * m[i + j];
      Q[c * rows + r] = Q[r * rows + c] = q * sum;
    }
  }
}

}  // namespace rhec
