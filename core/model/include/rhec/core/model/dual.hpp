#pragma once

#include <concepts>
#include <utility>

#include "rhec/core/base/unrolled.hpp"

namespace rhec {

/// Lists of entries up to this length are unrolled at compile time; longer ones are loops.
inline constexpr int longest_list = 24;
/// The same limit for the entries of a Hessian: 91 entries, i.e. thirteen directions.
inline constexpr int longest_triangle = 91;

/// Array length for `size` entries; at least 1, since `size` may be 0.
constexpr int room_for(int size) { return size > 0 ? size : 1; }

/// As for_indices, but a loop if `count` is large.
template <int count, class Function>
RHEC_INLINE constexpr void for_each_index(const Function& function) {
  if constexpr (count <= longest_list) {
    for_indices<count>(function);
  } else {
    for (int j = 0; j < count; ++j) function(j);
  }
}

/// A number and its first derivatives along N directions:  a + sum_j d_j e_j,  e_i e_j = 0.
/// T is double or a pack of doubles. Formulas use it only through ordinary arithmetic (dual_functions.hpp).
template <class T, int N>
struct Dual {
  using Value = T;
  static constexpr int directions = N;
  T value;
  T d[N];

  Dual() = default;
  /// A constant: all derivatives are zero.
  template <std::convertible_to<T> Constant>
  Dual(const Constant& constant) : value(constant) {  // NOLINT(google-explicit-constructor)
    for_each_index<N>([&](auto j) { d[j] = T(0.0); });
  }
  /// The independent variable along `direction`.
  template <int direction>
  static Dual variable(const T& value) {
    return variable(value, direction);
  }
  static Dual variable(const T& value, int direction) {
    Dual result(value);
    result.d[direction] = T(1.0);
    return result;
  }
  /// g(a) from g, g' and g'' (not needed here) at a.value.
  static Dual chain(const Dual& a, const T& g, const T& g1, const T& /*g2*/) {
    Dual result;
    result.value = g;
    for_each_index<N>([&](auto j) { result.d[j] = g1 * a.d[j]; });
    return result;
  }
  static Dual product(const Dual& a, const Dual& b) {
    Dual result;
    result.value = a.value * b.value;
    for_each_index<N>([&](auto j) { result.d[j] = a.d[j] * b.value + a.value * b.d[j]; });
    return result;
  }
  /// Linear operations act alike on the value and on every derivative.
  template <class Operation, class... Others>
  static Dual linear(Operation operation, const Others&... a) {
    Dual result;
    assign_linear(result, operation, a...);
    return result;
  }
  /// The same, written to `out`, which may be one of the operands.
  template <class Operation, class... Others>
  static void assign_linear(Dual& out, Operation operation, const Others&... a) {
    out.value = operation(a.value...);
    for_each_index<N>([&](auto j) { out.d[j] = operation(a.d[j]...); });
  }
};

/// A number with its gradient along N directions and its Hessian along the first M of them. The Hessian is stored as
/// its lower triangle, row by row.
template <class T, int N, int M = N>
struct SecondOrder {
  using Value = T;
  static constexpr int directions = N;
  static constexpr int hessian_size = M * (M + 1) / 2;
  T value;
  T d[room_for(N)];
  T dd[room_for(hessian_size)];

  SecondOrder() = default;
  /// Copies entry by entry, so that the compiler can omit unused entries; a default copy would copy all of them.
  SecondOrder(const SecondOrder& other) { assign_linear(*this, same, other); }
  SecondOrder& operator=(const SecondOrder& other) {  // NOLINT(bugprone-unhandled-self-assignment)
    assign_linear(*this, same, other);
    return *this;
  }
  template <std::convertible_to<T> Constant>
  SecondOrder(const Constant& constant) : value(constant) {  // NOLINT(google-explicit-constructor)
    for_each_index<N>([&](auto j) { d[j] = T(0.0); });
    for_each_entry([&](auto k) { dd[k] = T(0.0); });
  }
  template <int direction>
  static SecondOrder variable(const T& value) {
    return variable(value, direction);
  }
  static SecondOrder variable(const T& value, int direction) {
    SecondOrder result(value);
    result.d[direction] = T(1.0);
    return result;
  }
  static SecondOrder chain(const SecondOrder& a, const T& g, const T& g1, const T& g2) {
    SecondOrder result;
    result.value = g;
    for_each_index<N>([&](auto j) { result.d[j] = g1 * a.d[j]; });
    const auto fill = [&](int i, int j) {
      result.dd[i * (i + 1) / 2 + j] = g1 * a.dd[i * (i + 1) / 2 + j] + g2 * a.d[i] * a.d[j];
    };
    for_each_pair(fill);
    return result;
  }
  static SecondOrder product(const SecondOrder& a, const SecondOrder& b) {
    SecondOrder result;
    result.value = a.value * b.value;
    for_each_index<N>([&](auto j) { result.d[j] = a.d[j] * b.value + a.value * b.d[j]; });
    const auto fill = [&](int i, int j) {
      const int k = i * (i + 1) / 2 + j;
      result.dd[k] = a.dd[k] * b.value + a.value * b.dd[k] + (a.d[i] * b.d[j] + a.d[j] * b.d[i]);
    };
    for_each_pair(fill);
    return result;
  }
  /// function(k) for all entries of the triangle. With a loop, the compiler would keep the whole number in memory.
  template <class Function>
  RHEC_INLINE static void for_each_entry(const Function& function) {
    if constexpr (hessian_size <= longest_triangle) {
      for_indices<hessian_size>(function);
    } else {
      for (int k = 0; k < hessian_size; ++k) function(k);
    }
  }
  /// function(i, j) for all j <= i < M.
  template <class Function>
  static void for_each_pair(const Function& function) {
    if constexpr (hessian_size <= longest_triangle) {
      for_indices<M>([&](auto i) { for_indices<i + 1>([&](auto j) { function(i, j); }); });
    } else {
      for (int i = 0; i < M; ++i)
        for (int j = 0; j <= i; ++j) function(i, j);
    }
  }
  template <class Operation, class... Others>
  static SecondOrder linear(Operation operation, const Others&... a) {
    SecondOrder result;
    assign_linear(result, operation, a...);
    return result;
  }
  /// The same, written to `out`, which may be one of the operands.
  template <class Operation, class... Others>
  static void assign_linear(SecondOrder& out, Operation operation, const Others&... a) {
    out.value = operation(a.value...);
    for_each_index<N>([&](auto j) { out.d[j] = operation(a.d[j]...); });
    for_each_entry([&](auto k) { out.dd[k] = operation(a.dd[k]...); });
  }

 private:
  static constexpr auto same = [](const T& a) { return a; };
};

/// Numbers that carry derivatives: Dual and SecondOrder.
template <class D>
concept Differentiable = requires(const D& a, const typename D::Value& t) {
  { D::chain(a, t, t, t) } -> std::same_as<D>;
  { D::product(a, a) } -> std::same_as<D>;
};
/// Those of them that carry second derivatives.
template <class D>
concept TwiceDifferentiable = Differentiable<D> && requires {
  D::hessian_size;
};

}  // namespace rhec

#include "rhec/core/model/dual_functions.hpp"
