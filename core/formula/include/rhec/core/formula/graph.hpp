#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// What a node of a graph computes from its operands.
enum class Operation : std::uint8_t {
  constant,
  input,
  add,
  subtract,
  multiply,
  negate,
  reciprocal,
  power,  ///< by a positive integer
  square_root,
  exponential,
  logarithm,
  sine,
  cosine,
  tangent,
  arc_sine,
  arc_cosine,
  arc_tangent,
  arc_tangent_2,  ///< of (y, x), the angle of a vector
  hyperbolic_tangent
};
RHEC_EXPORT std::string_view name_of(Operation operation) noexcept;
/// The enumerator as it is written in C++.
RHEC_EXPORT std::string_view identifier_of(Operation operation) noexcept;
/// How many operands it has: 0, 1 or 2.
RHEC_EXPORT int operand_count(Operation operation) noexcept;

/// A formula as a graph of scalar operations. A node is named by its number; operands have smaller numbers than what is
/// computed of them. Equal nodes are one node, so that common parts are computed once, and each is simplified when it
/// is made: constants are folded, and
///
///     x + 0, x - 0, x * 1, -(-x), 1/(1/x)  become  x        x * 0, x - x     become  0
///     x + (-y)                             becomes x - y    (-x) * y         becomes -(x * y)
///     x / y                                becomes x * (1/y)
///
/// These hold for real numbers, not for all of IEEE 754: 0 * x is 0, and x - x is 0, also where x is infinite or NaN (a
/// derivative that is zero by its structure must be zero for every point), the sign of a zero is not kept, and x / y
/// may differ from the rounded quotient in the last place. What is not finite otherwise stays so: 1 / 0 is infinite.
class RHEC_EXPORT Graph {
 public:
  struct Node {
    Operation operation;
    int a = -1, b = -1;  ///< operands; of a power, b is the exponent
    double value = 0.0;  ///< of a constant
  };
  /// A graph of more nodes than this is refused with an Error.
  static constexpr int most_nodes = 4'000'000;

  Graph() = default;
  Graph(const Graph&) = delete;  // expressions point to it
  Graph& operator=(const Graph&) = delete;

  int size() const noexcept { return static_cast<int>(nodes_.size()); }
  const Node& operator[](int node) const noexcept { return nodes_[static_cast<std::size_t>(node)]; }
  bool is_constant(int node) const noexcept { return (*this)[node].operation == Operation::constant; }
  bool is_constant(int node, double value) const noexcept { return is_constant(node) && (*this)[node].value == value; }

  int constant(double value);
  /// A new independent variable; each call makes another one.
  int input(std::string name);
  int add(int a, int b);
  int subtract(int a, int b);
  int multiply(int a, int b);
  int divide(int a, int b);
  int negate(int a);
  int reciprocal(int a);
  /// a to the power of any integer.
  int power(int a, int exponent);
  /// An elementary function, of one operand or of two.
  int function(Operation operation, int a, int b = -1);
  /// Any operation that has operands.
  int apply(Operation operation, int a, int b);

  /// Gives a node a name for messages and drawings. The first name stays.
  void name(int node, std::string text);
  /// Its name; empty if it has none.
  const std::string& name_of(int node) const noexcept;

  /// The nodes that `targets` are computed from, and these themselves, ascending. What lies before one of `leaves` is
  /// left out.
  std::vector<int> reach(std::span<const int> targets, std::span<const int> leaves = {}) const;
  /// How many of them are operations.
  int count_operations(std::span<const int> targets) const;
  /// `targets` with new nodes in the place of some: `from` becomes `to`, one by one.
  std::vector<int> substitute(std::span<const int> targets, std::span<const int> from, std::span<const int> to);
  /// The values of `targets`, where `inputs` have these values. Every input that is needed must be among them.
  std::vector<double> evaluate(std::span<const int> targets, std::span<const int> inputs,
                               std::span<const double> values) const;

 private:
  std::size_t slot_of(const Node& node) const noexcept;
  int intern(const Node& node);
  double value(int node) const noexcept { return (*this)[node].value; }
  /// The operand of a negation; -1 of any other node.
  int negated(int node) const noexcept;

  std::vector<Node> nodes_;
  std::vector<int> slots_;  ///< a hash table of nodes, of a power of two; -1 where it is free
  std::unordered_map<int, std::string> names_;
};

/// The value of an operation of one or two operands; of a power, b is the exponent.
RHEC_EXPORT double value_of(Operation operation, double a, double b) noexcept;

}  // namespace rhec
