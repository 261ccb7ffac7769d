#pragma once

#include <concepts>
#include <string>
#include <type_traits>
#include <utility>

#include "rhec/core/formula/graph.hpp"
#include "rhec/core/formula/smooth.hpp"

namespace rhec {

/// A number that records how it is computed: a node of a graph, or a constant that belongs to no graph yet. A formula
/// template that is called with it writes itself down (`trace`, rhec/core/model/vehicle_graph.hpp):
///
///     Graph graph;
///     const Expression x = Expression::input(graph, "x"), y = sin(x) * x + 1;
///
/// It behaves like a double, but that its value is not known: it cannot be compared, branched on or converted to a
/// number, which the compiler says with the remedy. Throws Error where a number is used that was never set, or numbers
/// of two graphs meet.
class RHEC_EXPORT Expression {
 public:
  Expression() = default;  ///< not set
  template <class Number>
  requires std::is_arithmetic_v<Number> Expression(Number constant)
      : value_(static_cast<double>(constant)), is_set_(true) {}  // NOLINT
  Expression(Graph& graph, int node) : graph_(&graph), node_(node), is_set_(true) {}
  static Expression input(Graph& graph, std::string name) { return {graph, graph.input(std::move(name))}; }

  bool is_set() const noexcept { return is_set_; }
  /// Its node in `graph`, in which a constant is made a node.
  int node_in(Graph& graph) const;

  /// A formula has no values to decide by.
  template <class Number>
  requires std::same_as<Number, double> || std::same_as<Number, bool>
  operator Number() const {  // NOLINT(google-explicit-constructor)
    static_assert(!std::same_as<Number, Number>,
                  "a formula's numbers have no value here: do not branch on them or convert them. Let all variables be "
                  "Scalar; call functions without std::, after `using std::sin`; for a case distinction use "
                  "smooth_min, smooth_max or smooth_abs");
    return {};
  }

  static Expression of(Operation operation, const Expression& a, const Expression& b = 0.0);
  static Expression power(const Expression& base, int exponent);
  /// a * (1 / b), but for two constants.
  static Expression quotient(const Expression& a, const Expression& b);
  /// Names its node, if it has one.
  void give_name(const char* name) const;

 private:
  /// The graph of two operands; null if both are constants.
  static Graph* common(const Expression& a, const Expression& b);

  Graph* graph_ = nullptr;
  int node_ = -1;
  double value_ = 0.0;
  bool is_set_ = false;
};

/// Two operands of which one is an Expression and the other one, too, or an ordinary number.
template <class A, class B>
concept ExpressionOperands = (std::same_as<A, Expression> &&
                              (std::same_as<B, Expression> || std::is_arithmetic_v<B>)) ||
                             (std::is_arithmetic_v<A> && std::same_as<B, Expression>);

template <class A, class B>
requires ExpressionOperands<A, B> Expression operator+(const A& a, const B& b) {
  return Expression::of(Operation::add, a, b);
}
template <class A, class B>
requires ExpressionOperands<A, B> Expression operator-(const A& a, const B& b) {
  return Expression::of(Operation::subtract, a, b);
}
template <class A, class B>
requires ExpressionOperands<A, B> Expression operator*(const A& a, const B& b) {
  return Expression::of(Operation::multiply, a, b);
}
template <class A, class B>
requires ExpressionOperands<A, B> Expression operator/(const A& a, const B& b) { return Expression::quotient(a, b); }
inline Expression operator-(const Expression& a) { return Expression::of(Operation::negate, a); }
inline Expression operator+(const Expression& a) { return a; }
template <class B>
Expression& operator+=(Expression& a, const B& b) {
  return a = a + b;
}
template <class B>
Expression& operator-=(Expression& a, const B& b) {
  return a = a - b;
}
template <class B>
Expression& operator*=(Expression& a, const B& b) {
  return a = a * b;
}
template <class B>
Expression& operator/=(Expression& a, const B& b) {
  return a = a / b;
}

#define RHEC_NO_COMPARISON(SIGN)                                                                              \
  template <class A, class B>                                                                                 \
  requires ExpressionOperands<A, B>                                                                           \
  bool operator SIGN(const A&, const B&) {                                                                    \
    static_assert(!std::same_as<A, A>,                                                                        \
                  "a formula does not compare its numbers, whose values are not known here; use smooth_min, " \
                  "smooth_max or smooth_abs, which have derivatives");                                        \
    return false;                                                                                             \
  }
RHEC_NO_COMPARISON(<)
RHEC_NO_COMPARISON(<=)
RHEC_NO_COMPARISON(>)
RHEC_NO_COMPARISON(>=)
RHEC_NO_COMPARISON(==)
RHEC_NO_COMPARISON(!=)
#undef RHEC_NO_COMPARISON

inline Expression sqrt(const Expression& a) { return Expression::of(Operation::square_root, a); }
inline Expression exp(const Expression& a) { return Expression::of(Operation::exponential, a); }
inline Expression log(const Expression& a) { return Expression::of(Operation::logarithm, a); }
inline Expression sin(const Expression& a) { return Expression::of(Operation::sine, a); }
inline Expression cos(const Expression& a) { return Expression::of(Operation::cosine, a); }
inline Expression tan(const Expression& a) { return Expression::of(Operation::tangent, a); }
inline Expression asin(const Expression& a) { return Expression::of(Operation::arc_sine, a); }
inline Expression acos(const Expression& a) { return Expression::of(Operation::arc_cosine, a); }
inline Expression atan(const Expression& a) { return Expression::of(Operation::arc_tangent, a); }
inline Expression tanh(const Expression& a) { return Expression::of(Operation::hyperbolic_tangent, a); }
inline Expression atan2(const Expression& y, const Expression& x) {
  return Expression::of(Operation::arc_tangent_2, y, x);
}
/// The length of (x, y). It has no derivative at the origin.
inline Expression hypot(const Expression& x, const Expression& y) { return sqrt(x * x + y * y); }
/// base to an integer power, or else exp(exponent log(base)), of which the base must be positive.
inline Expression pow(const Expression& base, int exponent) { return Expression::power(base, exponent); }
inline Expression pow(const Expression& base, const Expression& exponent) { return exp(exponent * log(base)); }

/// The same number, whose node has a name for messages and drawings (rhec/core/formula/smooth.hpp has it for others).
RHEC_EXPORT Expression named(const Expression& expression, const char* name);

}  // namespace rhec
