#include "rhec/core/formula/graph.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

struct OperationInfo {
  const char *name, *identifier;
  int operands;
};
constexpr OperationInfo operations[] = {
    {"constant", "constant", 0},
    {"input", "input", 0},
    {"+", "add", 2},
    {"-", "subtract", 2},
    {"*", "multiply", 2},
    {"negate", "negate", 1},
    {"1/", "reciprocal", 1},
    {"power", "power", 1},
    {"sqrt", "square_root", 1},
    {"exp", "exponential", 1},
    {"log", "logarithm", 1},
    {"sin", "sine", 1},
    {"cos", "cosine", 1},
    {"tan", "tangent", 1},
    {"asin", "arc_sine", 1},
    {"acos", "arc_cosine", 1},
    {"atan", "arc_tangent", 1},
    {"atan2", "arc_tangent_2", 2},
    {"tanh", "hyperbolic_tangent", 1},
};

const OperationInfo& info(Operation operation) noexcept { return operations[static_cast<std::size_t>(operation)]; }

bool is_odd(Operation operation) noexcept {
  return operation == Operation::sine || operation == Operation::tangent || operation == Operation::arc_sine ||
         operation == Operation::arc_tangent || operation == Operation::hyperbolic_tangent;
}

double integer_power(double base, int exponent) noexcept {
  double result = 1.0;
  for (; exponent > 0; exponent >>= 1, base *= base)
    if (exponent & 1) result *= base;
  return result;
}

}  // namespace

std::string_view name_of(Operation operation) noexcept { return info(operation).name; }
std::string_view identifier_of(Operation operation) noexcept { return info(operation).identifier; }
int operand_count(Operation operation) noexcept { return info(operation).operands; }

double value_of(Operation operation, double a, double b) noexcept {
  switch (operation) {
    case Operation::constant:
    case Operation::input:
      return a;
    case Operation::add:
      return a + b;
    case Operation::subtract:
      return a - b;
    case Operation::multiply:
      return a * b;
    case Operation::negate:
      return -a;
    case Operation::reciprocal:
      return 1.0 / a;
    case Operation::power:
      return integer_power(a, static_cast<int>(b));
    case Operation::square_root:
      return std::sqrt(a);
    case Operation::exponential:
      return std::exp(a);
    case Operation::logarithm:
      return std::log(a);
    case Operation::sine:
      return std::sin(a);
    case Operation::cosine:
      return std::cos(a);
    case Operation::tangent:
      return std::tan(a);
    case Operation::arc_sine:
      return std::asin(a);
    case Operation::arc_cosine:
      return std::acos(a);
    case Operation::arc_tangent:
      return std::atan(a);
    case Operation::arc_tangent_2:
      return std::atan2(a, b);
    case Operation::hyperbolic_tangent:
      return std::tanh(a);
  }
  return a;
}

namespace {

std::uint64_t hash_of(const Graph::Node& node) noexcept {
  std::uint64_t hash = static_cast<std::uint64_t>(node.operation) * 0x9e3779b97f4a7c15u;
  const auto mix = [&](std::uint64_t part) {
    hash = (hash ^ part) * 0xff51afd7ed558ccdu;
    hash ^= hash >> 32;
  };
  mix(static_cast<std::uint32_t>(node.a) | static_cast<std::uint64_t>(static_cast<std::uint32_t>(node.b)) << 32);
  mix(std::bit_cast<std::uint64_t>(node.value));
  return hash;
}

bool is_same(const Graph::Node& left, const Graph::Node& right) noexcept {
  return left.operation == right.operation && left.a == right.a && left.b == right.b &&
         std::bit_cast<std::uint64_t>(left.value) == std::bit_cast<std::uint64_t>(right.value);
}

}  // namespace

/// Where a node is in the table, or would be.
std::size_t Graph::slot_of(const Node& node) const noexcept {
  std::size_t slot = hash_of(node) & (slots_.size() - 1);
  while (slots_[slot] >= 0 && !is_same((*this)[slots_[slot]], node)) slot = (slot + 1) & (slots_.size() - 1);
  return slot;
}

int Graph::intern(const Node& node) {
  if (2 * nodes_.size() >= slots_.size()) {
    slots_.assign(std::max<std::size_t>(2 * slots_.size(), 1024), -1);
    for (int known = 0; known < size(); ++known) slots_[slot_of((*this)[known])] = known;
  }
  const std::size_t slot = slot_of(node);
  if (slots_[slot] >= 0) return slots_[slot];
  if (size() >= most_nodes)
    throw Error(fmt::format("a formula with its derivatives has more than {} operations; write it with fewer terms",
                            most_nodes));
  slots_[slot] = size();
  nodes_.push_back(node);
  return slots_[slot];
}

int Graph::constant(double value) {
  return intern({Operation::constant, -1, -1, value == 0.0 ? 0.0 : value});  // one zero, without a sign
}

int Graph::input(std::string name) {
  const int node = intern({Operation::input, size()});  // its own number tells it from others
  this->name(node, std::move(name));
  return node;
}

int Graph::negated(int node) const noexcept {
  return (*this)[node].operation == Operation::negate ? (*this)[node].a : -1;
}

int Graph::add(int a, int b) {
  if (is_constant(a) && is_constant(b)) return constant(value(a) + value(b));
  if (is_constant(b) || (!is_constant(a) && a > b)) std::swap(a, b);  // a constant stands first
  if (is_constant(a, 0.0)) return b;
  if (a == b) return multiply(constant(2.0), a);
  if (negated(a) >= 0) return subtract(b, negated(a));
  if (negated(b) >= 0) return subtract(a, negated(b));
  const Node second = (*this)[b];
  if (is_constant(a) && second.operation == Operation::add && is_constant(second.a))
    return add(constant(value(a) + value(second.a)), second.b);
  return intern({Operation::add, a, b});
}

int Graph::subtract(int a, int b) {
  if (a == b) return constant(0.0);
  if (is_constant(b)) return add(constant(-value(b)), a);
  if (is_constant(a, 0.0)) return negate(b);
  if (negated(b) >= 0) return add(a, negated(b));
  if (negated(a) >= 0) return negate(add(negated(a), b));
  return intern({Operation::subtract, a, b});
}

int Graph::multiply(int a, int b) {
  if (is_constant(a) && is_constant(b)) return constant(value(a) * value(b));
  if (is_constant(b) || (!is_constant(a) && a > b)) std::swap(a, b);
  if (is_constant(a, 0.0)) return a;
  if (is_constant(a, 1.0)) return b;
  if (is_constant(a, -1.0)) return negate(b);
  if (is_constant(a)) {
    if (negated(b) >= 0) return multiply(constant(-value(a)), negated(b));
    const Node second = (*this)[b];
    if (second.operation == Operation::multiply && is_constant(second.a))
      return multiply(constant(value(a) * value(second.a)), second.b);
  } else {
    if (negated(a) >= 0) return negate(multiply(negated(a), b));
    if (negated(b) >= 0) return negate(multiply(a, negated(b)));
    // A constant factor moves out, where it meets others.
    const Node first = (*this)[a], second = (*this)[b];
    if (first.operation == Operation::multiply && is_constant(first.a)) return multiply(first.a, multiply(first.b, b));
    if (second.operation == Operation::multiply && is_constant(second.a))
      return multiply(second.a, multiply(a, second.b));
  }
  return intern({Operation::multiply, a, b});
}

int Graph::divide(int a, int b) {
  if (is_constant(a) && is_constant(b)) return constant(value(a) / value(b));
  return multiply(a, reciprocal(b));
}

int Graph::negate(int a) {
  if (is_constant(a)) return constant(-value(a));
  if (negated(a) >= 0) return negated(a);
  const Node node = (*this)[a];
  if (node.operation == Operation::subtract) return subtract(node.b, node.a);
  if (node.operation == Operation::multiply && is_constant(node.a)) return multiply(constant(-value(node.a)), node.b);
  return intern({Operation::negate, a});
}

int Graph::reciprocal(int a) {
  if (is_constant(a)) return constant(1.0 / value(a));
  if (negated(a) >= 0) return negate(reciprocal(negated(a)));
  if ((*this)[a].operation == Operation::reciprocal) return (*this)[a].a;
  return intern({Operation::reciprocal, a});
}

int Graph::power(int a, int exponent) {
  if (exponent < 0) return reciprocal(power(a, -exponent));
  if (exponent == 0) return constant(1.0);
  if (exponent == 1) return a;
  if (exponent == 2) return multiply(a, a);
  if (is_constant(a)) return constant(integer_power(value(a), exponent));
  if (negated(a) >= 0) {
    const int positive = power(negated(a), exponent);
    return exponent % 2 == 0 ? positive : negate(positive);
  }
  return intern({Operation::power, a, exponent});
}

int Graph::function(Operation operation, int a, int b) {
  if (is_constant(a) && (b < 0 || is_constant(b)))
    return constant(value_of(operation, value(a), b < 0 ? 0.0 : value(b)));
  if (operand_count(operation) == 1) {
    b = -1;
    if (negated(a) >= 0 && is_odd(operation)) return negate(function(operation, negated(a)));
    if (negated(a) >= 0 && operation == Operation::cosine) return function(operation, negated(a));
  }
  return intern({operation, a, b});
}

int Graph::apply(Operation operation, int a, int b) {
  switch (operation) {
    case Operation::add:
      return add(a, b);
    case Operation::subtract:
      return subtract(a, b);
    case Operation::multiply:
      return multiply(a, b);
    case Operation::negate:
      return negate(a);
    case Operation::reciprocal:
      return reciprocal(a);
    case Operation::power:
      return power(a, b);
    default:
      return function(operation, a, b);
  }
}

void Graph::name(int node, std::string text) { names_.try_emplace(node, std::move(text)); }

const std::string& Graph::name_of(int node) const noexcept {
  static const std::string none;
  const auto found = names_.find(node);
  return found == names_.end() ? none : found->second;
}

std::vector<int> Graph::reach(std::span<const int> targets, std::span<const int> leaves) const {
  if (targets.empty()) return {};
  const int last = *std::max_element(targets.begin(), targets.end());
  std::vector<char> wanted(static_cast<std::size_t>(last) + 1, 0), is_leaf(wanted.size(), 0);
  for (const int target : targets) wanted[target] = 1;
  for (const int leaf : leaves)
    if (leaf <= last) is_leaf[leaf] = 1;
  std::vector<int> reached;
  for (int node = last; node >= 0; --node) {  // operands have smaller numbers
    if (!wanted[node]) continue;
    reached.push_back(node);
    if (is_leaf[node]) continue;
    const int operands = operand_count((*this)[node].operation);
    if (operands > 0) wanted[(*this)[node].a] = 1;
    if (operands > 1) wanted[(*this)[node].b] = 1;
  }
  std::reverse(reached.begin(), reached.end());
  return reached;
}

int Graph::count_operations(std::span<const int> targets) const {
  const std::vector<int> reached = reach(targets);
  return static_cast<int>(std::count_if(reached.begin(), reached.end(),
                                        [&](int node) { return operand_count((*this)[node].operation) > 0; }));
}

std::vector<int> Graph::substitute(std::span<const int> targets, std::span<const int> from, std::span<const int> to) {
  const std::vector<int> reached = reach(targets, from);
  std::unordered_map<int, int> becomes;
  for (std::size_t k = 0; k < from.size(); ++k) becomes.emplace(from[k], to[k]);
  for (const int node : reached) {
    if (becomes.contains(node)) continue;
    const Node old = (*this)[node];
    const int operands = operand_count(old.operation);
    int made = node;
    if (operands == 2)
      made = apply(old.operation, becomes.at(old.a), becomes.at(old.b));
    else if (operands == 1)
      made = apply(old.operation, becomes.at(old.a), old.b);
    becomes.emplace(node, made);
  }
  std::vector<int> results;
  results.reserve(targets.size());
  for (const int target : targets) results.push_back(becomes.at(target));
  return results;
}

std::vector<double> Graph::evaluate(std::span<const int> targets, std::span<const int> inputs,
                                    std::span<const double> values) const {
  std::unordered_map<int, double> known;
  for (std::size_t k = 0; k < inputs.size(); ++k) known.emplace(inputs[k], values[k]);
  for (const int node : reach(targets, inputs)) {
    if (known.contains(node)) continue;
    const Node& of = (*this)[node];
    if (of.operation == Operation::input)
      throw Error(fmt::format("the input '{}' has no value; give one for each input that is needed", name_of(node)));
    const double a = operand_count(of.operation) > 0 ? known.at(of.a) : of.value;
    const double b = operand_count(of.operation) > 1 ? known.at(of.b) : of.b;
    known.emplace(node, value_of(of.operation, a, b));
  }
  std::vector<double> results;
  results.reserve(targets.size());
  for (const int target : targets) results.push_back(known.at(target));
  return results;
}

}  // namespace rhec
