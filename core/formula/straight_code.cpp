#include "rhec/core/formula/straight_code.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "instructions.hpp"

namespace rhec {
namespace {

/// A number as C++ reads it, to the last bit.
std::string hex(double value) { return fmt::format("{:a}", value); }

const char* function_of(TapeCode code) {
  switch (code) {
    case TapeCode::reciprocal:
      return "reciprocal";
    case TapeCode::square_root:
      return "sqrt";
    case TapeCode::exponential:
      return "exp";
    case TapeCode::logarithm:
      return "log";
    case TapeCode::sine:
      return "sin";
    case TapeCode::cosine:
      return "cos";
    case TapeCode::tangent:
      return "tan";
    case TapeCode::arc_sine:
      return "asin";
    case TapeCode::arc_cosine:
      return "acos";
    case TapeCode::arc_tangent:
      return "atan";
    case TapeCode::arc_tangent_2:
      return "atan2";
    case TapeCode::hyperbolic_tangent:
      return "tanh";
    default:
      return nullptr;
  }
}

/// Whether an instruction is an elementary function, whose code is long.
bool is_elementary(TapeCode code) {
  return code == TapeCode::sine_cosine ||
         (function_of(code) && code != TapeCode::reciprocal && code != TapeCode::square_root);
}

/// The right-hand side of an instruction with operands a, b, c; `prefix` of elementary functions.
std::string formula_of(const Instruction& step, const std::string& a, const std::string& b, const std::string& c,
                       const char* prefix) {
  switch (step.code) {
    case TapeCode::fill:
      return a;
    case TapeCode::add_rr:
    case TapeCode::add_ru:
      return fmt::format("{} + {}", a, b);
    case TapeCode::subtract_rr:
    case TapeCode::subtract_ur:
      return fmt::format("{} - {}", a, b);
    case TapeCode::multiply_rr:
    case TapeCode::multiply_ru:
      return fmt::format("{} * {}", a, b);
    case TapeCode::negate:
      return fmt::format("-{}", a);
    case TapeCode::multiply_add_rrr:
    case TapeCode::multiply_add_rur:
    case TapeCode::multiply_add_rru:
    case TapeCode::multiply_add_ruu:
      return fmt::format("multiply_add({}, {}, {})", a, b, c);
    case TapeCode::multiply_subtract_rrr:
    case TapeCode::multiply_subtract_rur:
      return fmt::format("multiply_subtract({}, {}, {})", a, b, c);
    case TapeCode::subtract_product_rrr:
    case TapeCode::subtract_product_rru:
      return fmt::format("subtract_product({}, {}, {})", c, a, b);
    case TapeCode::power:
      return fmt::format("to_power({}, {})", a, step.exponent);
    case TapeCode::arc_tangent_2:
      return fmt::format("{}atan2({}, {})", prefix, a, b);
    default:
      return fmt::format("{}{}({})", is_elementary(step.code) ? prefix : "", function_of(step.code), a);
  }
}

/// The steps in an order in which each result is finished before the next is begun, so that few values wait.
std::vector<int> by_results(const std::vector<Instruction>& steps, std::span<const int> maker,
                            std::span<const int> results) {
  std::vector<int> order, open;
  std::vector<char> is_done(steps.size(), 0);
  order.reserve(steps.size());
  for (const int result : results) {
    if (maker[result] >= 0) open.push_back(maker[result]);
    while (!open.empty()) {
      const int step = open.back();
      const std::size_t before = open.size();
      if (!is_done[step])
        for (const int read : steps[step].reads)
          if (read >= 0 && maker[read] >= 0 && !is_done[maker[read]]) open.push_back(maker[read]);
      if (open.size() > before) continue;
      open.pop_back();
      if (!is_done[step]) order.push_back(step);
      is_done[step] = 1;
    }
  }
  return order;
}

/// The text of one function.
class FunctionText {
 public:
  FunctionText(const Graph& graph, const std::string& name, const Instructions& of, std::span<const int> inputs,
               std::span<const int> results, const std::vector<std::string>& uniforms)
      : graph_(graph), name_(name), of_(of), uniforms_(uniforms) {
    const auto nodes = static_cast<std::size_t>(graph.size());
    maker_.assign(nodes, -1);
    input_.assign(nodes, -1);
    slot_.assign(nodes, -1);
    piece_.assign(nodes, -1);
    carried_.assign(nodes, -1);
    for (std::size_t k = 0; k < inputs.size(); ++k) input_[inputs[k]] = static_cast<int>(k);
    for (std::size_t s = 0; s < of.steps.size(); ++s) {
      maker_[of.steps[s].out] = static_cast<int>(s);
      if (of.steps[s].second_out >= 0) maker_[of.steps[s].second_out] = static_cast<int>(s);
    }
    registers_ = static_cast<int>(inputs.size());
    for (const int result : results)
      if (!of.is_uniform(result) && input_[result] < 0 && slot_[result] < 0) slot_[result] = registers_++;
    order_ = by_results(of.steps, maker_, results);
    const auto elementary = std::count_if(of.steps.begin(), of.steps.end(),
                                          [](const Instruction& step) { return is_elementary(step.code); });
    if (elementary > most_inlined) prefix_ = "called_";
  }

  int registers() const { return registers_; }
  int source(int result) const { return input_[result] >= 0 ? input_[result] : slot_[result]; }

  std::string text() {
    const auto size = static_cast<int>(order_.size());
    const int pieces = std::max(1, (size + StraightWriter::piece - 1) / StraightWriter::piece);
    find_carried(pieces);
    std::string all;
    for (int k = 0; k < pieces; ++k) {
      const std::string piece_name = pieces == 1 ? name_ + "_pack" : fmt::format("{}_pack_{}", name_, k + 1);
      fmt::format_to(std::back_inserter(all),
                     "RHEC_STRAIGHT void {}(const double* in, [[maybe_unused]] const double* u, [[maybe_unused]] "
                     "double* out{}) {{\n",
                     piece_name, carried_count_ > 0 ? ", double* carried" : "");
      write_piece(all, k, size * k / pieces, size * (k + 1) / pieces);
      all += "}\n";
    }
    fmt::format_to(std::back_inserter(all),
                   "void {}(double* registers, const double* uniforms, int count) {{\n"
                   "  for (int row = 0; row < count; row += lane_width) {{\n",
                   name_);
    if (carried_count_ > 0)
      fmt::format_to(std::back_inserter(all), "    alignas(64) double carried[{} * rhec::StraightFunction::rows];\n",
                     carried_count_);
    for (int k = 0; k < pieces; ++k)
      fmt::format_to(std::back_inserter(all), "    {}(registers + row, uniforms, registers + row{});\n",
                     pieces == 1 ? name_ + "_pack" : fmt::format("{}_pack_{}", name_, k + 1),
                     carried_count_ > 0 ? ", carried" : "");
    all += "  }\n}\n";
    return all;
  }

 private:
  int piece_of(int position, int pieces) const {
    const auto size = static_cast<int>(order_.size());
    for (int k = 0; k < pieces; ++k)
      if (position < size * (k + 1) / pieces) return k;
    return pieces - 1;
  }
  /// Values that a later piece reads.
  void find_carried(int pieces) {
    for (std::size_t at = 0; at < order_.size(); ++at) {
      const Instruction& step = of_.steps[order_[at]];
      piece_[step.out] = piece_of(static_cast<int>(at), pieces);
      if (step.second_out >= 0) piece_[step.second_out] = piece_[step.out];
      for (const int read : step.reads)
        if (read >= 0 && maker_[read] >= 0 && piece_[read] != piece_[step.out] && carried_[read] < 0)
          carried_[read] = carried_count_++;
    }
  }

  void write_piece(std::string& all, int piece, int first, int last) {
    std::vector<char> is_read(input_.size(), 0);
    const auto out = std::back_inserter(all);
    const auto make = [&](int node) {
      if (slot_[node] >= 0) fmt::format_to(out, "  put(out, {}, v{});\n", slot_[node], number(node));
      if (carried_[node] >= 0) fmt::format_to(out, "  put(carried, {}, v{});\n", carried_[node], number(node));
    };
    for (int at = first; at < last; ++at) {
      const Instruction& step = of_.steps[order_[at]];
      std::array<std::string, 3> operands;
      for (std::size_t k = 0; k < 3; ++k) {
        const int node = step.reads[k];
        if (node < 0) {
          if (step.uniforms[k] >= 0) operands[k] = uniforms_[static_cast<std::size_t>(step.uniforms[k])];
          continue;
        }
        if (input_[node] >= 0 && !is_read[node])
          fmt::format_to(out, "  const Lane x{0} = get(in, {0});\n", input_[node]);
        else if (input_[node] < 0 && piece_[node] != piece && !is_read[node])
          fmt::format_to(out, "  const Lane v{} = get(carried, {});\n", number(node), carried_[node]);
        is_read[node] = 1;
        operands[k] = fmt::format("{}{}", input_[node] >= 0 ? 'x' : 'v', number(node));
      }
      const std::string& label = graph_.name_of(step.out);
      if (step.second_out >= 0) {
        const int sine = number(step.out), cosine = number(step.second_out);
        fmt::format_to(out, "  const auto [v{}, v{}] = {}sincos({});\n", sine, cosine, prefix_, operands[0]);
        make(step.out);
        make(step.second_out);
        continue;
      }
      const int made = number(step.out);
      fmt::format_to(out, "  const Lane v{} = {};{}{}\n", made,
                     formula_of(step, operands[0], operands[1], operands[2], prefix_), label.empty() ? "" : "  // ",
                     label);
      make(step.out);
    }
  }

  /// Numbers of values in the text: in the order in which they appear.
  int number(int node) {
    if (input_[node] >= 0) return input_[node];
    return numbers_.emplace(node, static_cast<int>(numbers_.size())).first->second;
  }

  /// A function with more elementary functions calls them; each that is inlined is code of a hundred instructions,
  /// which compilers take long for, and which does not stay in the processor's cache.
  static constexpr std::ptrdiff_t most_inlined = 100;

  const Graph& graph_;
  std::string name_;
  const char* prefix_ = "";
  const Instructions& of_;
  const std::vector<std::string>& uniforms_;
  std::vector<int> maker_, input_, slot_, piece_, carried_, order_;
  std::map<int, int> numbers_;
  int registers_ = 0, carried_count_ = 0;
};

}  // namespace

StraightWriter::StraightWriter(const Graph& graph, std::vector<int> options, int most)
    : graph_(graph), options_(std::move(options)), most_(most) {}

int StraightWriter::uniform(int node, bool is_negated) {
  if (node < 0 || graph_.is_constant(node, 0.0)) return 0;
  const auto [found, is_new] =
      uniform_numbers_.emplace(std::pair(node, is_negated), static_cast<int>(uniforms_.size()));
  if (is_new) uniforms_.emplace_back(node, is_negated);
  return found->second;
}

std::string StraightWriter::uniform_text(int uniform) const {
  const auto [node, is_negated] = uniforms_[static_cast<std::size_t>(uniform)];
  if (node < 0) return "Lane(0.0)";
  if (graph_.is_constant(node))
    return fmt::format("Lane({})", hex(is_negated ? -graph_[node].value : graph_[node].value));
  return fmt::format("Lane(u[{}])", uniform);
}

void StraightWriter::add(std::string name, std::span<const int> inputs, std::span<const int> results) {
  const Instructions selected = Instructions::select(graph_, inputs, results, options_);
  Function made{.name = std::move(name),
                .text = {},
                .registers = 0,
                .instructions = static_cast<int>(selected.steps.size()),
                .results = {}};
  if (made.instructions > most_) {
    made.name.clear();
    functions_.push_back(std::move(made));
    return;
  }
  std::vector<int> numbers;
  std::vector<std::string> texts;
  for (const auto& [node, is_negated] : selected.uniforms) {
    numbers.push_back(uniform(node, is_negated));
    texts.push_back(uniform_text(numbers.back()));
  }
  FunctionText text(graph_, made.name, selected, inputs, results, texts);
  made.text = text.text();
  made.registers = text.registers();
  for (const int result : results)
    made.results.push_back(selected.is_uniform(result) ? ~numbers[selected.uniform(result)] : text.source(result));
  functions_.push_back(std::move(made));
}

std::string StraightWriter::kernels(const std::string& prefix, const std::string& about) const {
  std::string all = fmt::format(
      "// {}\n"
      "#include \"rhec/core/formula/lane.hpp\"\n"
      "#include \"rhec/core/formula/straight_code.hpp\"\n\n"
      "#define RHEC_JOINED(a, b) a##b\n#define RHEC_JOIN(a, b) RHEC_JOINED(a, b)\n"
      "#define RHEC_TEXT_OF(a) #a\n#define RHEC_TEXT(a) RHEC_TEXT_OF(a)\n"
      "#define RHEC_STRAIGHT [[gnu::noinline]] static\n\n"
      "namespace rhec::straight {{\nnamespace {{\n\n"
      "using std::sqrt, std::exp, std::log, std::sin, std::cos, std::tan, std::tanh, std::asin, std::acos, std::atan,\n"
      "    std::atan2;\n"
      "\n"
      "[[maybe_unused]] RHEC_INLINE inline Lane get(const double* registers, int which) {{\n"
      "  return rhec::load_lane(registers + which * rhec::StraightFunction::rows);\n}}\n"
      "[[maybe_unused]] RHEC_INLINE inline void put(double* registers, int which, Lane value) {{\n"
      "  rhec::store_lane(value, registers + which * rhec::StraightFunction::rows);\n}}\n\n",
      about);
  if (std::any_of(functions_.begin(), functions_.end(),
                  [](const Function& function) { return function.text.find("called_") != std::string::npos; })) {
    for (const char* name : {"exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "tanh"})
      fmt::format_to(std::back_inserter(all),
                     "[[maybe_unused]] RHEC_STRAIGHT Lane called_{0}(Lane a) {{ return {0}(a); }}\n", name);
    all +=
        "[[maybe_unused]] RHEC_STRAIGHT Lane called_atan2(Lane a, Lane b) { return atan2(a, b); }\n"
        "[[maybe_unused]] RHEC_STRAIGHT std::pair<Lane, Lane> called_sincos(Lane a) { return sincos(a); }\n\n";
  }
  for (const Function& function : functions_)
    if (!function.name.empty())
      fmt::format_to(std::back_inserter(all), "// {} instructions.\n{}\n", function.instructions, function.text);
  all += "constexpr rhec::StraightRun runs[] = {";
  for (const Function& function : functions_)
    all += (&function == functions_.data() ? "" : ", ") + (function.name.empty() ? "nullptr" : "&" + function.name);
  fmt::format_to(std::back_inserter(all),
                 "}};\n\n}}  // namespace\n}}  // namespace rhec::straight\n\n"
                 "extern const rhec::StraightSet RHEC_JOIN({0}_straight_, RHEC_STRAIGHT_SET);\n"
                 "constinit const rhec::StraightSet RHEC_JOIN({0}_straight_, RHEC_STRAIGHT_SET) = "
                 "{{RHEC_TEXT(RHEC_STRAIGHT_SET), rhec::straight::runs}};\n",
                 prefix);
  return all;
}

std::string StraightWriter::table(const std::string& prefix, const std::string& about, std::uint64_t fingerprint,
                                  std::span<const std::string> sets) const {
  std::string all = fmt::format(
      "// {}\n#include <cmath>\n\n#include \"rhec/core/base/instruction_sets.hpp\"\n"
      "#include \"rhec/core/formula/straight_code.hpp\"\n\n",
      about);
  const auto out = std::back_inserter(all);
  for (const std::string& set : sets)
    fmt::format_to(out, "extern const rhec::StraightSet {}_straight_{};\n", prefix, set);
  all += "\nnamespace {\n\n";
  for (const Function& function : functions_)
    if (!function.results.empty())
      fmt::format_to(out, "constexpr int {}_results[] = {{{}}};\n", function.name, fmt::join(function.results, ", "));
  all += "constexpr rhec::StraightFunction functions[] = {\n";
  for (const Function& function : functions_)
    if (function.name.empty())
      fmt::format_to(out, "    {{.instructions = {}}},\n", function.instructions);
    else if (function.results.empty())
      fmt::format_to(out, "    {{\"{}\", {}, {}}},\n", function.name, function.registers, function.instructions);
    else
      fmt::format_to(out, "    {{\"{0}\", {1}, {2}, {0}_results}},\n", function.name, function.registers,
                     function.instructions);
  all +=
      "};\n\n// What depends on options alone.\n"
      "void set_uniforms([[maybe_unused]] const double* o, double* u) {\n  using rhec::Operation, rhec::value_of;\n";
  std::vector<int> wanted;
  for (const auto& [node, is_negated] : uniforms_)
    if (node >= 0) wanted.push_back(node);
  std::map<int, std::string> values;
  for (std::size_t k = 0; k < options_.size(); ++k) values[options_[k]] = fmt::format("o[{}]", k);
  for (const int node : graph_.reach(wanted, options_)) {
    if (values.contains(node)) continue;
    const Graph::Node& of = graph_[node];
    if (of.operation == Operation::constant) {
      values[node] = hex(of.value);
      continue;
    }
    const std::string a = values.at(of.a),
                      b = operand_count(of.operation) > 1 ? values.at(of.b) : fmt::format("{}", of.b);
    const std::string name = fmt::format("w{}", values.size());
    fmt::format_to(out, "  const double {} = value_of(Operation::{}, {}, {});\n", name, identifier_of(of.operation), a,
                   b);
    values[node] = name;
  }
  for (std::size_t k = 0; k < uniforms_.size(); ++k) {
    const auto& [node, is_negated] = uniforms_[k];
    fmt::format_to(out, "  u[{}] = {}{};\n", k, is_negated ? "-1.0 * " : "", node < 0 ? "0.0" : values.at(node));
  }
  fmt::format_to(out,
                 "}}\n\n}}  // namespace\n\nnamespace rhec {{\n"
                 "const StraightCode& {}_kernels();\n"
                 "const StraightCode& {}_kernels() {{\n"
                 "  // Slowest first; a machine that runs one of them runs those before it.\n"
                 "  static const StraightSet sets[] = {{{}}};\n"
                 "  static const StraightCode code{{{:#x}u, {}, {}, functions, {{sets, runnable_sets(sets, "
                 "&StraightSet::name)}}, &set_uniforms}};\n"
                 "  return code;\n}}\n}}  // namespace rhec\n",
                 prefix, prefix,
                 fmt::join(
                     [&] {
                       std::vector<std::string> names;
                       for (const std::string& set : sets) names.push_back(fmt::format("{}_straight_{}", prefix, set));
                       return names;
                     }(),
                     ", "),
                 fingerprint, options_.size(), uniforms_.size());
  return all;
}

}  // namespace rhec
