#pragma once

#include <cmath>
#include <utility>

#include "rhec/core/model/dual.hpp"

// Arithmetic and elementary functions of every Differentiable number. Included by dual.hpp.
//
// A function is defined by its value g and derivatives g', g'' at a point; the number type applies the chain rule.
// Constants may be anything that converts to the number's Value: `2 * x`, `1.0 / x`.

namespace rhec {

template <Differentiable D>
D operator+(const D& a, const D& b) {
  return D::linear([](const auto& s, const auto& t) { return s + t; }, a, b);
}
template <Differentiable D>
D operator-(const D& a, const D& b) {
  return D::linear([](const auto& s, const auto& t) { return s - t; }, a, b);
}
template <Differentiable D>
D operator-(const D& a) {
  return D::linear([](const auto& s) { return -s; }, a);
}
template <Differentiable D>
D operator*(const D& a, const D& b) {
  return D::product(a, b);
}
template <Differentiable D>
D reciprocal(const D& a) {
  using T = typename D::Value;
  const T g = T(1.0) / a.value, g1 = -g * g;
  return D::chain(a, g, g1, T(-2.0) * g * g1);
}
template <Differentiable D>
D operator/(const D& a, const D& b) {
  return a * reciprocal(b);
}

// The same with a constant as one operand.
template <Differentiable D>
D operator+(const D& a, const typename D::Value& b) {
  D sum = a;
  sum.value = a.value + b;
  return sum;
}
template <Differentiable D>
D operator+(const typename D::Value& a, const D& b) {
  return b + a;
}
template <Differentiable D>
D operator-(const D& a, const typename D::Value& b) {
  D difference = a;
  difference.value = a.value - b;
  return difference;
}
template <Differentiable D>
D operator-(const typename D::Value& a, const D& b) {
  return -b + a;
}
template <Differentiable D>
D operator*(const D& a, const typename D::Value& b) {
  return D::linear([&b](const auto& s) { return s * b; }, a);
}
template <Differentiable D>
D operator*(const typename D::Value& a, const D& b) {
  return b * a;
}
template <Differentiable D>
D operator/(const D& a, const typename D::Value& b) {
  return a * (typename D::Value(1.0) / b);
}
template <Differentiable D>
D operator/(const typename D::Value& a, const D& b) {
  return reciprocal(b) * a;
}

template <Differentiable D, class Other>
D& operator+=(D& a, const Other& b) {
  return a = a + b;
}
template <Differentiable D, class Other>
D& operator-=(D& a, const Other& b) {
  return a = a - b;
}
template <Differentiable D, class Other>
D& operator*=(D& a, const Other& b) {
  return a = a * b;
}
template <Differentiable D, class Other>
D& operator/=(D& a, const Other& b) {
  return a = a / b;
}

/// Sine and cosine at once; packs have their own, found by argument-dependent lookup.
inline std::pair<double, double> sincos(double angle) { return {std::sin(angle), std::cos(angle)}; }

template <Differentiable D>
D sqrt(const D& a) {
  using T = typename D::Value;
  using std::sqrt;
  const T g = sqrt(a.value), g1 = T(0.5) / g;
  return D::chain(a, g, g1, T(-0.5) * g1 / a.value);
}
template <Differentiable D>
D exp(const D& a) {
  using std::exp;
  const auto g = exp(a.value);
  return D::chain(a, g, g, g);
}
template <Differentiable D>
D log(const D& a) {
  using T = typename D::Value;
  using std::log;
  const T g1 = T(1.0) / a.value;
  return D::chain(a, log(a.value), g1, -g1 * g1);
}
template <Differentiable D>
D sin(const D& a) {
  const auto [s, c] = sincos(a.value);
  return D::chain(a, s, c, -s);
}
template <Differentiable D>
D cos(const D& a) {
  const auto [s, c] = sincos(a.value);
  return D::chain(a, c, -s, -c);
}
template <Differentiable D>
D tan(const D& a) {
  using T = typename D::Value;
  using std::tan;
  const T g = tan(a.value), g1 = T(1.0) + g * g;
  return D::chain(a, g, g1, T(2.0) * g * g1);
}
template <Differentiable D>
D tanh(const D& a) {
  using T = typename D::Value;
  using std::tanh;
  const T g = tanh(a.value), g1 = T(1.0) - g * g;
  return D::chain(a, g, g1, T(-2.0) * g * g1);
}
template <Differentiable D>
D asin(const D& a) {
  using T = typename D::Value;
  using std::asin, std::sqrt;
  const T x = a.value, g1 = T(1.0) / sqrt((T(1.0) - x) * (T(1.0) + x));
  return D::chain(a, asin(x), g1, x * g1 * g1 * g1);
}
template <Differentiable D>
D acos(const D& a) {
  using T = typename D::Value;
  using std::acos, std::sqrt;
  const T x = a.value, g1 = T(-1.0) / sqrt((T(1.0) - x) * (T(1.0) + x));
  return D::chain(a, acos(x), g1, x * g1 * g1 * g1);
}
template <Differentiable D>
D atan(const D& a) {
  using T = typename D::Value;
  using std::atan;
  const T x = a.value, g1 = T(1.0) / (T(1.0) + x * x);
  return D::chain(a, atan(x), g1, T(-2.0) * x * g1 * g1);
}

/// Angle of the vector (x, y) in (-pi, pi]; its derivatives are smooth everywhere off the origin.
template <Differentiable D>
D atan2(const D& y, const D& x) {
  using T = typename D::Value;
  using std::atan2, std::sqrt;
  // Rotated back by its own angle, the vector is (length, 0). The remaining angle is zero and has all derivatives.
  const T length = sqrt(x.value * x.value + y.value * y.value);
  const T c = x.value / length, s = y.value / length;
  D left = atan((y * c - x * s) / (x * c + y * s));
  left.value = atan2(y.value, x.value);
  return left;
}
template <Differentiable D>
D atan2(const D& y, const typename D::Value& x) {
  return atan2(y, D(x));
}
template <Differentiable D>
D atan2(const typename D::Value& y, const D& x) {
  return atan2(D(y), x);
}

}  // namespace rhec
