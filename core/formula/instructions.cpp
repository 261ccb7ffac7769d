#include "instructions.hpp"

#include <cstddef>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

TapeCode code_of(Operation operation) {
  switch (operation) {
    case Operation::negate:
      return TapeCode::negate;
    case Operation::reciprocal:
      return TapeCode::reciprocal;
    case Operation::power:
      return TapeCode::power;
    case Operation::square_root:
      return TapeCode::square_root;
    case Operation::exponential:
      return TapeCode::exponential;
    case Operation::logarithm:
      return TapeCode::logarithm;
    case Operation::sine:
      return TapeCode::sine;
    case Operation::cosine:
      return TapeCode::cosine;
    case Operation::tangent:
      return TapeCode::tangent;
    case Operation::arc_sine:
      return TapeCode::arc_sine;
    case Operation::arc_cosine:
      return TapeCode::arc_cosine;
    case Operation::arc_tangent:
      return TapeCode::arc_tangent;
    case Operation::arc_tangent_2:
      return TapeCode::arc_tangent_2;
    case Operation::hyperbolic_tangent:
      return TapeCode::hyperbolic_tangent;
    default:
      return TapeCode::fill;
  }
}

/// Chooses an instruction for each node that is needed, and computes what is known.
class Selection {
 public:
  Selection(const Graph& graph, std::span<const int> inputs, std::span<const int> results, std::span<const int> options)
      : graph_(graph), nodes_(graph.reach(results)), uniform_of_(made_.uniform_of), steps_(made_.steps) {
    const std::size_t size = nodes_.empty() ? 0 : static_cast<std::size_t>(nodes_.back()) + 1;
    uniform_of_.assign(size, -1);
    is_constant_.assign(size, 0);
    filled_.assign(size, 0);
    absorbed_.assign(size, 0);
    uses_.assign(size, 0);
    std::vector<char> is_input(size, 0);
    for (const int input : inputs)
      if (static_cast<std::size_t>(input) < size) is_input[input] = 1;
    for (const int option : options)
      if (static_cast<std::size_t>(option) < size) is_constant_[option] = 1;
    for (const int node : nodes_) {
      const Graph::Node& of = graph_[node];
      if (of.operation == Operation::constant) is_constant_[node] = 1;
      if (of.operation == Operation::input && !is_input[node] && !is_constant_[node])
        throw Error(fmt::format("the formula reads '{}', which is none of its arguments", graph_.name_of(node)));
      find_known(node);
    }
    for (const int result : results) uses_[result] += 2;  // keeps its own register
    for (const int node : nodes_) {
      if (is_uniform(node)) continue;
      for_operands(node, [&](int operand) { ++uses_[operand]; });
    }
    for (std::size_t k = nodes_.size(); k-- > 0;) absorb(nodes_[k]);
    for (const int node : nodes_)
      if (!is_uniform(node) && !absorbed_[node] && graph_[node].operation != Operation::input) select(node);
    join_sines();
  }

  /// All that was selected; a result that is uniform has its uniform, too.
  Instructions finish(std::span<const int> results) {
    for (const int result : results)
      if (is_uniform(result)) uniform(result);
    return std::move(made_);
  }

 private:
  template <class Function>
  void for_operands(int node, Function function) const {
    const Graph::Node& of = graph_[node];
    const int operands = operand_count(of.operation);
    if (operands > 0) function(of.a);
    if (operands > 1) function(of.b);
  }
  bool is_uniform(int node) const { return is_constant_[node] != 0; }
  int new_uniform(UniformNode uniform) {
    const int before = static_cast<int>(made_.uniforms.size());
    if (uniform.node >= 0 && graph_.is_constant(uniform.node, 0.0)) return 0;
    const auto [found, is_new] = numbers_.emplace(std::pair(uniform.node, uniform.is_negated), before);
    if (is_new) made_.uniforms.push_back(uniform);
    return found->second;
  }
  int uniform(int node) { return uniform_of_[node] = new_uniform({node, false}); }
  int negative(int node) { return new_uniform({node, true}); }
  void find_known(int node) {
    const Graph::Node& of = graph_[node];
    const int operands = operand_count(of.operation);
    if (operands > 0 && is_uniform(of.a) && (operands < 2 || is_uniform(of.b))) is_constant_[node] = 1;
  }

  /// A product that only one sum reads becomes a part of it.
  bool is_lone_product(int node) const {
    return !is_uniform(node) && graph_[node].operation == Operation::multiply && uses_[node] == 1;
  }
  void absorb(int node) {
    if (is_uniform(node) || absorbed_[node]) return;
    const Graph::Node& of = graph_[node];
    if (of.operation != Operation::add && of.operation != Operation::subtract) return;
    if (is_lone_product(of.b))
      absorbed_[of.b] = 1;
    else if (is_lone_product(of.a))
      absorbed_[of.a] = 1;
  }

  /// A node in a register, though its value is uniform.
  int in_register(int node) {
    if (is_uniform(node) && !filled_[node]) {
      filled_[node] = 1;
      steps_.push_back({.code = TapeCode::fill, .out = node, .uniforms = {uniform(node), -1, -1}});
    }
    return node;
  }

  void select(int node) {
    const Graph::Node& of = graph_[node];
    switch (of.operation) {
      case Operation::add:
        if (absorbed_[of.b]) return select_fused(node, of.b, of.a, false);
        if (absorbed_[of.a]) return select_fused(node, of.a, of.b, false);
        return select_commutative(node, TapeCode::add_rr, TapeCode::add_ru);
      case Operation::multiply:
        return select_commutative(node, TapeCode::multiply_rr, TapeCode::multiply_ru);
      case Operation::subtract:
        if (absorbed_[of.b]) return select_fused(node, of.b, of.a, true);
        if (absorbed_[of.a]) return select_product_minus(node, of.a, of.b);
        if (is_uniform(of.a)) return push(node, TapeCode::subtract_ur, {-1, of.b, -1}, {uniform(of.a), -1, -1});
        if (is_uniform(of.b)) return push(node, TapeCode::add_ru, {of.a, -1, -1}, {-1, negative(of.b), -1});
        return push(node, TapeCode::subtract_rr, {of.a, of.b, -1});
      case Operation::arc_tangent_2: {
        const int a = in_register(of.a), b = in_register(of.b);
        return push(node, TapeCode::arc_tangent_2, {a, b, -1});
      }
      default:
        push(node, code_of(of.operation), {of.a, -1, -1});
        if (of.operation == Operation::power) steps_.back().exponent = of.b;
    }
  }
  void push(int node, TapeCode code, std::array<int, 3> reads, std::array<int, 3> uniforms = {-1, -1, -1}) {
    steps_.push_back({.code = code, .out = node, .reads = reads, .uniforms = uniforms});
  }
  void select_commutative(int node, TapeCode of_registers, TapeCode with_uniform) {
    int a = graph_[node].a, b = graph_[node].b;
    if (is_uniform(a)) std::swap(a, b);
    if (is_uniform(b)) return push(node, with_uniform, {a, -1, -1}, {-1, uniform(b), -1});
    push(node, of_registers, {a, b, -1});
  }
  /// other + product or other - product.
  void select_fused(int node, int product, int other, bool minus) {
    int a = graph_[product].a, b = graph_[product].b;
    if (is_uniform(a)) std::swap(a, b);
    const bool other_is_uniform = is_uniform(other);
    if (is_uniform(b)) {
      const int factor = minus ? negative(b) : uniform(b);
      if (other_is_uniform) return push(node, TapeCode::multiply_add_ruu, {a, -1, -1}, {-1, factor, uniform(other)});
      return push(node, TapeCode::multiply_add_rur, {a, -1, other}, {-1, factor, -1});
    }
    if (other_is_uniform)
      return push(node, minus ? TapeCode::subtract_product_rru : TapeCode::multiply_add_rru, {a, b, -1},
                  {-1, -1, uniform(other)});
    push(node, minus ? TapeCode::subtract_product_rrr : TapeCode::multiply_add_rrr, {a, b, other});
  }
  void select_product_minus(int node, int product, int other) {
    int a = graph_[product].a, b = graph_[product].b;
    if (is_uniform(a)) std::swap(a, b);
    if (is_uniform(other)) {
      const int shift = negative(other);
      if (is_uniform(b)) return push(node, TapeCode::multiply_add_ruu, {a, -1, -1}, {-1, uniform(b), shift});
      return push(node, TapeCode::multiply_add_rru, {a, b, -1}, {-1, -1, shift});
    }
    if (is_uniform(b)) return push(node, TapeCode::multiply_subtract_rur, {a, -1, other}, {-1, uniform(b), -1});
    push(node, TapeCode::multiply_subtract_rrr, {a, b, other});
  }

  /// Sine and cosine of one angle become one instruction.
  void join_sines() {
    std::vector<int> step_of(uses_.size(), -1);  // by the angle: the sine's or cosine's step
    std::vector<Instruction> joined;
    for (const Instruction& step : steps_) {
      if (step.code == TapeCode::sine || step.code == TapeCode::cosine) {
        int& known = step_of[step.reads[0]];
        if (known >= 0) {
          Instruction& other = joined[known];
          const bool is_sine = step.code == TapeCode::sine;
          other = {.code = TapeCode::sine_cosine,
                   .out = is_sine ? step.out : other.out,
                   .second_out = is_sine ? other.out : step.out,
                   .reads = step.reads};
          continue;
        }
        known = static_cast<int>(joined.size());
      }
      joined.push_back(step);
    }
    steps_ = std::move(joined);
  }

  const Graph& graph_;
  std::vector<int> nodes_;
  Instructions made_;
  std::map<std::pair<int, bool>, int> numbers_;  ///< of uniforms
  std::vector<int>& uniform_of_;
  std::vector<Instruction>& steps_;
  std::vector<int> uses_;
  std::vector<char> is_constant_, filled_, absorbed_;
};

}  // namespace

Instructions Instructions::select(const Graph& graph, std::span<const int> inputs, std::span<const int> results,
                                  std::span<const int> options) {
  return Selection(graph, inputs, results, options).finish(results);
}

}  // namespace rhec
