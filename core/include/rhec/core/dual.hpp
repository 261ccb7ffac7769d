#pragma once

#include <concepts>

namespace rhec {

/// A number and its first derivatives along N directions:  a + sum_j d_j e_j,  e_i e_j = 0.
/// T is double or a pack of doubles. Formulas use it only through ordinary arithmetic (dual_functions.hpp).
template <class T, int N>
struct Dual {
  using Value = T;
  static constexpr int directions = N;
  T value;
  T d[N];

  Dual() = default;
  /// A constant is a number.
  template <std::convertible_to<T> Constant>
  Dual(const Constant& constant) : value(constant) {  // NOLINT(google-explicit-constructor)
    for (int j = 0; j < N; ++j) d[j] = T(0.0);
  }
  /// The independent variable number `direction`.
  static Dual variable(const T& value, int direction) {
    Dual result(value);
    result.d[direction] = T(1.0);
    return result;
  }
  /// g(a) from g, g' and g'' (which is not needed here) at a.value.
  static Dual chain(const Dual& a, const T& g, const T& g1, const T& /*g2*/) {
    Dual result;
    result.value = g;
    for (int j = 0; j < N; ++j) result.d[j] = g1 * a.d[j];
    return result;
  }
  static Dual product(const Dual& a, const Dual& b) {
    Dual result;
    result.value = a.value * b.value;
    for (int j = 0; j < N; ++j) result.d[j] = a.d[j] * b.value + a.value * b.d[j];
    return result;
  }
  /// What is linear acts alike on the value and on every derivative.
  template <class Operation, class... Others>
  static Dual linear(Operation operation, const Others&... a) {
    Dual result;
    assign_linear(result, operation, a...);
    return result;
  }
  /// The same into a place; it may be that of an operand.
  template <class Operation, class... Others>
  static void assign_linear(Dual& out, Operation operation, const Others&... a) {
    out.value = operation(a.value...);
    for (int j = 0; j < N; ++j) out.d[j] = operation(a.d[j]...);
  }
};

/// A number with its gradient and Hessian along N directions; the Hessian is kept as its lower triangle by rows.
template <class T, int N>
struct SecondOrder {
  using Value = T;
  static constexpr int directions = N;
  static constexpr int hessian_size = N * (N + 1) / 2;
  T value;
  T d[N];
  T dd[hessian_size];

  SecondOrder() = default;
  template <std::convertible_to<T> Constant>
  SecondOrder(const Constant& constant) : value(constant) {  // NOLINT(google-explicit-constructor)
    for (int j = 0; j < N; ++j) d[j] = T(0.0);
    for (int k = 0; k < hessian_size; ++k) dd[k] = T(0.0);
  }
  static SecondOrder variable(const T& value, int direction) {
    SecondOrder result(value);
    result.d[direction] = T(1.0);
    return result;
  }
  static SecondOrder chain(const SecondOrder& a, const T& g, const T& g1, const T& g2) {
    SecondOrder result;
    result.value = g;
    for (int j = 0; j < N; ++j) result.d[j] = g1 * a.d[j];
    for (int i = 0, k = 0; i < N; ++i) {
      const T g2_di = g2 * a.d[i];
      for (int j = 0; j <= i; ++j, ++k) result.dd[k] = g1 * a.dd[k] + g2_di * a.d[j];
    }
    return result;
  }
  static SecondOrder product(const SecondOrder& a, const SecondOrder& b) {
    SecondOrder result;
    result.value = a.value * b.value;
    for (int j = 0; j < N; ++j) result.d[j] = a.d[j] * b.value + a.value * b.d[j];
    for (int i = 0, k = 0; i < N; ++i)
      for (int j = 0; j <= i; ++j, ++k)
        result.dd[k] = a.dd[k] * b.value + a.value * b.dd[k] + (a.d[i] * b.d[j] + a.d[j] * b.d[i]);
    return result;
  }
  template <class Operation, class... Others>
  static SecondOrder linear(Operation operation, const Others&... a) {
    SecondOrder result;
    assign_linear(result, operation, a...);
    return result;
  }
  /// The same into a place; it may be that of an operand.
  template <class Operation, class... Others>
  static void assign_linear(SecondOrder& out, Operation operation, const Others&... a) {
    out.value = operation(a.value...);
    for (int j = 0; j < N; ++j) out.d[j] = operation(a.d[j]...);
    for (int k = 0; k < hessian_size; ++k) out.dd[k] = operation(a.dd[k]...);
  }
};

/// Numbers that carry derivatives: Dual and SecondOrder.
template <class D>
concept Differentiable = requires(const D& a, const typename D::Value& t) {
  { D::chain(a, t, t, t) } -> std::same_as<D>;
  { D::product(a, a) } -> std::same_as<D>;
};
/// Of these, the ones that carry second derivatives.
template <class D>
concept TwiceDifferentiable = Differentiable<D> && requires {
  D::hessian_size;
};

}  // namespace rhec

#include "rhec/core/dual_functions.hpp"
