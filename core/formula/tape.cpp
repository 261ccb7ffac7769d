#include "rhec/core/formula/tape.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

/// An instruction between nodes, before it has registers. Operands are nodes, or (of a uniform) numbers of uniforms.
struct Step {
  TapeCode code = TapeCode::fill;
  int out = -1, second_out = -1;         ///< nodes that it computes
  std::array<int, 3> reads{-1, -1, -1};  ///< nodes in registers
  std::array<int, 3> uniforms{-1, -1, -1};
  int exponent = 0;
};

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
  Selection(const Graph& graph, std::span<const int> inputs, std::span<const int> results,
            std::span<const Tape::Known> known, std::vector<double>& uniforms)
      : graph_(graph), nodes_(graph.reach(results)), uniforms_(uniforms) {
    const std::size_t size = nodes_.empty() ? 0 : static_cast<std::size_t>(nodes_.back()) + 1;
    uniform_of_.assign(size, -1);
    filled_.assign(size, 0);
    absorbed_.assign(size, 0);
    uses_.assign(size, 0);
    std::vector<char> is_input(size, 0);
    for (const int input : inputs)
      if (static_cast<std::size_t>(input) < size) is_input[input] = 1;
    for (const auto& [node, value] : known)
      if (static_cast<std::size_t>(node) < size) set_uniform(node, value);
    for (const int node : nodes_) {
      const Graph::Node& of = graph_[node];
      if (of.operation == Operation::constant) set_uniform(node, of.value);
      if (of.operation == Operation::input && !is_input[node] && !is_uniform(node))
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

  const std::vector<int>& nodes() const { return nodes_; }
  std::vector<Step>& steps() { return steps_; }
  bool is_uniform(int node) const { return uniform_of_[node] >= 0; }
  int uniform(int node) const { return uniform_of_[node]; }

 private:
  template <class Function>
  void for_operands(int node, Function function) const {
    const Graph::Node& of = graph_[node];
    const int operands = operand_count(of.operation);
    if (operands > 0) function(of.a);
    if (operands > 1) function(of.b);
  }
  int new_uniform(double value) {
    const auto found =
        std::find(uniforms_.begin(), uniforms_.begin() + std::min<std::ptrdiff_t>(32, std::ssize(uniforms_)), value);
    if (found != uniforms_.begin() + std::min<std::ptrdiff_t>(32, std::ssize(uniforms_)))
      return static_cast<int>(found - uniforms_.begin());
    uniforms_.push_back(value);
    return static_cast<int>(uniforms_.size()) - 1;
  }
  void set_uniform(int node, double value) { uniform_of_[node] = new_uniform(value); }
  double known_value(int node) const { return uniforms_[static_cast<std::size_t>(uniform_of_[node])]; }
  void find_known(int node) {
    const Graph::Node& of = graph_[node];
    const int operands = operand_count(of.operation);
    if (operands == 0 || !is_uniform(of.a) || (operands > 1 && !is_uniform(of.b))) return;
    set_uniform(node, value_of(of.operation, known_value(of.a), operands > 1 ? known_value(of.b) : of.b));
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
        if (is_uniform(of.b))
          return push(node, TapeCode::add_ru, {of.a, -1, -1}, {-1, new_uniform(-known_value(of.b)), -1});
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
      const int factor = minus ? new_uniform(-known_value(b)) : uniform(b);
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
      const int shift = new_uniform(-known_value(other));
      if (is_uniform(b)) return push(node, TapeCode::multiply_add_ruu, {a, -1, -1}, {-1, uniform(b), shift});
      return push(node, TapeCode::multiply_add_rru, {a, b, -1}, {-1, -1, shift});
    }
    if (is_uniform(b)) return push(node, TapeCode::multiply_subtract_rur, {a, -1, other}, {-1, uniform(b), -1});
    push(node, TapeCode::multiply_subtract_rrr, {a, b, other});
  }

  /// Sine and cosine of one angle become one instruction.
  void join_sines() {
    std::vector<int> step_of(uniform_of_.size(), -1);  // by the angle: the sine's or cosine's step
    std::vector<Step> joined;
    for (const Step& step : steps_) {
      if (step.code == TapeCode::sine || step.code == TapeCode::cosine) {
        int& known = step_of[step.reads[0]];
        if (known >= 0) {
          Step& other = joined[known];
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
  std::vector<double>& uniforms_;
  std::vector<int> uniform_of_, uses_;
  std::vector<char> filled_, absorbed_;
  std::vector<Step> steps_;
};

/// Orders the steps so that many of one kind follow each other: of those whose operands are there, first the others of
/// the same kind, then those of the kind that most are of.
std::vector<int> in_runs(const std::vector<Step>& steps, std::size_t nodes) {
  std::vector<int> maker(nodes, -1), missing(steps.size(), 0);
  std::vector<std::vector<int>> readers(steps.size());
  for (std::size_t s = 0; s < steps.size(); ++s) {
    maker[steps[s].out] = static_cast<int>(s);
    if (steps[s].second_out >= 0) maker[steps[s].second_out] = static_cast<int>(s);
  }
  constexpr auto kinds = static_cast<std::size_t>(TapeCode::count);
  std::array<std::vector<int>, kinds> ready;
  std::array<std::size_t, kinds> taken{};
  const auto add = [&](int step) { ready[static_cast<std::size_t>(steps[step].code)].push_back(step); };
  for (std::size_t s = 0; s < steps.size(); ++s) {
    for (const int read : steps[s].reads) {
      if (read < 0 || maker[read] < 0) continue;
      readers[maker[read]].push_back(static_cast<int>(s));
      ++missing[s];
    }
    if (missing[s] == 0) add(static_cast<int>(s));
  }
  std::vector<int> order;
  order.reserve(steps.size());
  const auto waiting = [&](std::size_t kind) { return ready[kind].size() - taken[kind]; };
  for (std::size_t kind = 0; order.size() < steps.size();) {
    if (waiting(kind) == 0) {
      for (std::size_t other = 0; other < kinds; ++other)
        if (waiting(other) > waiting(kind)) kind = other;
    }
    const int step = ready[kind][taken[kind]++];
    order.push_back(step);
    for (const int reader : readers[step])
      if (--missing[reader] == 0) add(reader);
  }
  return order;
}

/// Gives registers to nodes, and takes them back after the last instruction that reads them.
class Registers {
 public:
  explicit Registers(std::size_t nodes) : of_(nodes, -1), last_use_(nodes, -1) {}
  int count() const { return count_; }
  int of(int node) const { return of_[node]; }
  void give(int node) {
    if (of_[node] >= 0) return;
    if (free_.empty()) free_.push_back(count_++);
    of_[node] = free_.back();
    free_.pop_back();
  }
  void use(int node, int at) { last_use_[node] = std::max(last_use_[node], at); }
  void release(int node, int at) {
    if (last_use_[node] == at) {
      last_use_[node] = -2;  // once, though it may be read twice
      free_.push_back(of_[node]);
    }
  }
  int last_use(int node) const { return last_use_[node]; }

 private:
  std::vector<int> of_, last_use_, free_;
  int count_ = 0;
};

}  // namespace

Tape::Tape(const Graph& graph, std::span<const int> inputs, std::span<const int> results,
           std::span<const Known> known) {
  Selection selection(graph, inputs, results, known, uniforms_);
  const std::vector<Step>& steps = selection.steps();
  const std::size_t nodes = static_cast<std::size_t>(graph.size());
  const std::vector<int> order = in_runs(steps, nodes);

  Registers registers(nodes);
  for (const int input : inputs) registers.give(input);
  const int end = static_cast<int>(order.size());
  for (int at = 0; at < end; ++at)
    for (const int read : steps[order[at]].reads)
      if (read >= 0) registers.use(read, at);
  for (const int result : results)
    if (!selection.is_uniform(result)) registers.use(result, end);
  for (int at = 0; at < end; ++at) {
    const Step& step = steps[order[at]];
    TapeOperands operands;
    const auto operand = [&](int which) {
      const int read = step.reads[which];
      return static_cast<std::uint32_t>(read >= 0 ? registers.of(read) : std::max(step.uniforms[which], 0));
    };
    operands.a = operand(0);
    operands.b = step.code == TapeCode::power ? static_cast<std::uint32_t>(step.exponent) : operand(1);
    operands.c = operand(2);
    for (const int read : step.reads)
      if (read >= 0) registers.release(read, at);
    registers.give(step.out);
    operands.out = static_cast<std::uint32_t>(registers.of(step.out));
    if (step.second_out >= 0) {
      registers.give(step.second_out);
      operands.b = static_cast<std::uint32_t>(registers.of(step.second_out));
    }
    operands_.push_back(operands);
    if (runs_.empty() || runs_.back().code != step.code) runs_.push_back({step.code, 0});
    ++runs_.back().length;
  }
  register_count_ = registers.count();
  results_.reserve(results.size());
  for (const int result : results)
    results_.push_back(selection.is_uniform(result) ? ~selection.uniform(result) : registers.of(result));
}

}  // namespace rhec
