#include "rhec/core/formula/tape.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <utility>

#include "instructions.hpp"
#include "rhec/core/base/padded.hpp"

namespace rhec {
namespace {

/// Orders the steps so that many of one kind follow each other: of those whose operands are there, first the others of
/// the same kind, then those of the kind that most are of.
std::vector<int> in_runs(const std::vector<Instruction>& steps, std::size_t nodes) {
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

std::vector<double> values_of(const std::vector<UniformNode>& uniforms, const Graph& graph,
                              std::span<const int> options, std::span<const double> option_values) {
  std::vector<int> nodes;
  for (std::size_t k = 1; k < uniforms.size(); ++k) nodes.push_back(uniforms[k].node);
  const std::vector<double> found = graph.evaluate(nodes, options, option_values);
  std::vector<double> values{0.0};
  for (std::size_t k = 1; k < uniforms.size(); ++k)
    values.push_back(uniforms[k].is_negated ? -found[k - 1] : found[k - 1]);
  return values;
}

}  // namespace

Tape::Tape(const Graph& graph, std::span<const int> inputs, std::span<const int> results,
           std::span<const Known> known) {
  std::vector<int> options;
  std::vector<double> values;
  for (const auto& [node, value] : known) {
    options.push_back(node);
    values.push_back(value);
  }
  const Instructions selection = Instructions::select(graph, inputs, results, options);
  uniforms_ = values_of(selection.uniforms, graph, options, values);
  const std::vector<Instruction>& steps = selection.steps;
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
    const Instruction& step = steps[order[at]];
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
  instruction_count_ = end;
  results_.reserve(results.size());
  for (const int result : results)
    results_.push_back(selection.is_uniform(result) ? ~selection.uniform(result) : registers.of(result));
}

int Tape::filled_register(double value) {
  for (const Fill& fill : fills_)
    if (std::bit_cast<std::uint64_t>(fill.value) == std::bit_cast<std::uint64_t>(value)) return fill.at;
  fills_.push_back({register_count_, value});
  return register_count_++;
}

StoredRows Tape::rows(int first, int rows, int columns) {
  stored_.resize(results_.size(), -1);
  filled_register(0.0);
  StoredRows made{.rows = rows, .eights = padded(columns) / 8, .all = {}};
  std::size_t row = static_cast<std::size_t>(first);  // its first result
  for (int r = 0; r < rows; ++r, row += static_cast<std::size_t>(columns)) {
    for (std::size_t from = 0; from < static_cast<std::size_t>(columns); from += 8) {
      const int here = std::min(8, columns - static_cast<int>(from));
      StoredEight eight;
      int varying = 0;
      for (int k = 0; k < here; ++k) {
        const int source = results_[row + from + static_cast<std::size_t>(k)];
        if (source >= 0)
          varying = k + 1;
        else
          eight.values[k] = uniforms_[static_cast<std::size_t>(~std::ptrdiff_t{source})];
      }
      const bool is_half = std::all_of(eight.values.begin() + 4, eight.values.end(), [](double v) { return v == 0.0; });
      eight.kind = varying == 0              ? StoredEight::Kind::constant
                   : varying <= 4 && is_half ? StoredEight::Kind::first_4
                                             : StoredEight::Kind::all;
      for (int k = 0; k < 8; ++k) {
        const std::size_t which = row + from + static_cast<std::size_t>(k);
        const bool is_result = k < here;
        const int source = is_result && results_[which] >= 0 ? results_[which] : filled_register(eight.values[k]);
        eight.sources[k] = source * 8;
        if (is_result) stored_[which] = source;
      }
      made.all.push_back(eight);
    }
  }
  return made;
}

}  // namespace rhec
