#include "formula_views.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>

#include "commands.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/check/formula_drawing.hpp"
#include "rhec/sim/check/formula_size.hpp"
#include "rhec/sim/files/output_folder.hpp"

namespace rhec::apps {
namespace {

const VehicleGraph& graph_of(const Model& model, const char* option) {
  const VehicleGraph* graph = model.graph();
  if (graph) return *graph;
  throw Error(
      fmt::format("model '{}' has no graph of its formula, which {} needs; vehicles as equations (docs/equations.md) "
                  "and models made of a formula in C++ have one",
                  model.description().name, option));
}

std::string text_of(double value) {
  return std::isnan(value) ? "nan" : fmt::format("{:.9g}", value + 0.0);  // neither has a sign that matters, nor has 0
}

void print_nodes(const sim::TracedPart& part) {
  std::size_t name = 4, term = 4;
  for (const sim::TracedNode& node : part.nodes) {
    name = std::max(name, node.name.size());
    term = std::max(term, node.term.size());
  }
  fmt::print("{:<6} {:<{}}  {:<{}}  VALUE\n", "NODE", "NAME", name, "TERM", term);
  for (const sim::TracedNode& node : part.nodes)
    fmt::print("{:<6} {:<{}}  {:<{}}  {}{}\n", fmt::format("n{}", node.node), node.name, name, node.term, term,
               text_of(node.value), std::isfinite(node.value) ? "" : "   <-- not finite");
}

/// The first few of a list, and how many more there are.
std::string some_results(const std::vector<std::string>& texts) {
  constexpr std::size_t few = 8;
  const std::size_t shown = std::min(few, texts.size());
  const auto text =
      fmt::format("{}", fmt::join(texts.begin(), texts.begin() + static_cast<std::ptrdiff_t>(shown), ", "));
  return shown == texts.size() ? text : fmt::format("{} and {} more", text, texts.size() - shown);
}

void print_first(const sim::NotFinite& first) {
  const std::string name = first.node.name.empty() ? "" : fmt::format(" ({})", first.node.name);
  fmt::print("  first not finite: n{}{} = {} = {}\n", first.node.node, name, first.node.term,
             text_of(first.node.value));
  fmt::print("    why: {}\n", first.why);
  for (const sim::TracedNode& operand : first.operands)
    fmt::print("    where n{}{} = {} = {}\n", operand.node, operand.name.empty() ? "" : " (" + operand.name + ")",
               operand.term, text_of(operand.value));
  fmt::print("    results that are not finite: {}\n",
             first.results.empty() ? "none; nothing that is used depends on it" : some_results(first.results));
  if (!first.advice.empty()) fmt::print("    -> {}\n", first.advice);
}

void print_pattern(const char* title, const sim::DerivativePattern& pattern) {
  const std::size_t all = pattern.entries.size();
  fmt::print("\n{}: {} of {} entries are not always zero\n", title, pattern.count(), all);
  for (const std::string& line : pattern.lines()) fmt::print("  {}\n", line);
}

}  // namespace

void apply_values(const std::vector<std::string>& assignments, const ModelDescription& about,
                  sim::FormulaPoint& point) {
  for (const std::string& assignment : assignments) {
    Settings given;
    const std::string origin = fmt::format("--at {}", assignment);
    const std::size_t equals = assignment.find('=');
    if (equals == std::string::npos || equals == 0)
      throw Error(fmt::format("{}: expected VARIABLE=NUMBER, e.g. {}=0.5", origin,
                              about.states.empty() ? "v" : about.states.front().name));
    const std::string name = assignment.substr(0, equals);
    const Settings value = Settings::scalar(assignment.substr(equals + 1), {origin, 0});
    std::vector<std::string> known;
    bool is_known = false;
    const auto look_in = [&](const std::vector<Variable>& variables, std::vector<double>& values) {
      for (std::size_t k = 0; k < variables.size(); ++k) {
        known.push_back(variables[k].name);
        if (is_known || variables[k].name != name) continue;
        const auto number = value.number();
        if (!number || !std::isfinite(*number))
          throw value.mismatch(fmt::format("a finite number, the value of '{}'", name));
        values[k] = *number;
        is_known = true;
      }
    };
    look_in(about.states, point.states);
    look_in(about.inputs, point.inputs);
    look_in(about.parameters, point.parameters);
    if (is_known) continue;
    const std::string near = nearest(name, known);
    throw Error(fmt::format("{}: '{}' is no state, input or parameter of {}; {} Options of the model are set by --set",
                            origin, name, about.name,
                            near.empty() ? fmt::format("expected one of {}.", fmt::join(known, ", "))
                                         : fmt::format("did you mean '{}'?", near)));
  }
}

int show_trace(const Model& model, const sim::FormulaPoint& point, bool json) {
  return show_trace(graph_of(model, "--trace"), model.description(), point, "f and h", json);
}

int show_trace(const VehicleGraph& formula, const ModelDescription& about, const sim::FormulaPoint& point,
               std::string_view what, bool json) {
  const sim::FormulaTrace trace = sim::trace_formula(formula, about, point);
  const int code = trace.is_finite() ? exit_fine : exit_not_solved;
  if (json) {
    fmt::print("{}\n", sim::trace_json(trace, about, point));
    return code;
  }
  fmt::print("{}, node by node\n", trace.model);
  for (const sim::TracedPart& part : trace.parts) {
    const bool is_hessian = part.name == "hessian";
    fmt::print("\n{}\n", part.name == "values" ? std::string(what)
                         : part.name == "jacobian"
                             ? fmt::format("Jacobians of {}: what they need besides", what)
                             : fmt::format("Hessian of the sum of {}: what it needs besides", what));
    if (!is_hessian) print_nodes(part);
    if (part.first)
      print_first(*part.first);
    else
      fmt::print("  all {} nodes are finite\n", part.nodes.size());
  }
  return code;
}

int show_graph(const Model& model, const std::string& file, bool json) {
  if (!file.empty() && !file.ends_with(".svg"))
    throw Error(
        fmt::format("--graph {0}: expected nothing or the name of a drawing, *.svg; if '{0}' is the model, name "
                    "it before --graph",
                    file));
  const ModelDescription& about = model.description();
  const VehicleGraph& graph = graph_of(model, "--graph");
  const sim::FormulaSize size = sim::size_of_formula(graph, about);
  if (!file.empty()) {
    const std::string drawing = sim::formula_drawing(graph, about, size);
    const std::filesystem::path path(file);
    sim::OutputFolder folder(path.has_parent_path() ? path.parent_path() : ".");
    folder.write(path.filename().string(), drawing);
    folder.commit();
  }
  if (json) {
    fmt::print("{}\n", sim::size_json(size));
    return exit_fine;
  }
  fmt::print("{}: {} states, {} inputs, {} parameters, {} outputs; depth {}\n\nOPERATIONS\n", size.model,
             about.states.size(), about.inputs.size(), about.parameters.size(), about.outputs.size(), size.depth);
  for (const auto& [what, count] : size.counts) fmt::print("  {:<24} {:>8}\n", what, count);
  std::vector<std::string> kinds;
  for (const auto& [kind, count] : size.kinds) kinds.push_back(fmt::format("{} {}", count, kind));
  fmt::print("  of f and h: {}\n", fmt::join(kinds, ", "));
  print_pattern("df/dz, z = [x; p; u]", size.rates);
  print_pattern("dh/dx", size.outputs);
  print_pattern("Hessian of f, weighted, lower triangle", size.hessian);
  fmt::print("\nx: varies; c: a number, once options are known; .: always zero\n");
  if (!file.empty()) fmt::print("\n{}: the formula as a drawing\n", file);
  return exit_fine;
}

}  // namespace rhec::apps
