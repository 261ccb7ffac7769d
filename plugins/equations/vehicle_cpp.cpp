#include "rhec/plugins/equations/vehicle_cpp.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cpp_terms.hpp"
#include "definitions.hpp"
#include "vehicle_cpp_templates.hpp"
#include "vehicle_file.hpp"

namespace rhec::equations {
namespace {

/// A word of small letters, digits and underscores.
std::string plugin_name(const std::string& name) {
  std::string word;
  for (const char c : name) {
    const bool is_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    if (is_letter)
      word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    else if (!word.empty() && word.back() != '_')
      word += '_';
  }
  while (word.ends_with('_')) word.pop_back();
  if (word.empty()) return "vehicle";
  return word[0] >= '0' && word[0] <= '9' ? "vehicle_" + word : word;
}
/// SkidSteer for skid_steer.
std::string class_name(const std::string& plugin) {
  std::string name;
  bool begins = true;
  for (const char c : plugin) {
    if (c != '_') name += begins ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
    begins = c == '_';
  }
  return name;
}

std::string about(const std::string& unit, const std::string& meaning) {
  return cpp_comment(meaning.empty() ? fmt::format("[{}]", unit) : fmt::format("{} [{}]", meaning, unit));
}

/// "using std::cos, rhec::named;" of what a function calls.
std::string using_line(const std::set<std::string>& called, const char* indent) {
  std::vector<std::string> names, own;
  for (const std::string& name : called) {
    const bool is_own = name == "named" || name.starts_with("smooth_");
    (is_own ? own : names).push_back((is_own ? "rhec::" : "std::") + name);
  }
  names.insert(names.end(), own.begin(), own.end());
  if (names.empty()) return {};
  return cpp_wrapped(fmt::format("{}using {};", indent, fmt::join(names, ", ")), std::string(indent) + "    ") + "\n";
}

class Writer {
 public:
  explicit Writer(const VehicleFile& file)
      : file_(file), description_(file.description()), definitions_(graph_, file.name(), inputs()) {
    definitions_.add(file.equations());
    definitions_.build();
    plugin_ = plugin_name(description_.name);
    class_ = class_name(plugin_);
    for (const Option& option : file.options()) names_.of(option.name);
    for (const auto* variables : {&description_.states, &description_.inputs, &description_.parameters})
      for (const Variable& variable : *variables) names_.of(variable.name);
    for (const Statement& statement : definitions_.statements())
      if (!statement.target.ends_with('\'')) names_.of(statement.target);
    // The arguments have other names where a variable has theirs.
    state_ = names_.unused("x", "state");
    input_ = names_.unused("u", "input");
    parameter_ = names_.unused("p", "parameter");
    rate_ = names_.unused("dxdt", "rate");
    output_ = names_.unused("y", "output");
  }

  VehicleSources write() {
    VehicleSources made;
    made.plugin = plugin_;
    made.files.push_back({plugin_ + ".hpp", header()});
    made.files.push_back({plugin_ + ".cpp", source()});
    made.files.push_back({"CMakeLists.txt", filled(cmake_template, common())});
    made.files.push_back({"README.md", filled(readme_template, common())});
    made.notes = notes_;
    return made;
  }

 private:
  using Filling = std::map<std::string, std::string>;

  std::map<std::string, int> inputs() {
    std::map<std::string, int> nodes;
    for (const Option& option : file_.options()) nodes.emplace(option.name, graph_.input(option.name));
    for (const auto* variables :
         {&file_.description().states, &file_.description().inputs, &file_.description().parameters})
      for (const Variable& variable : *variables) nodes.emplace(variable.name, graph_.input(variable.name));
    return nodes;
  }

  Filling common() const {
    return {{"INCLUDE", "#include"},
            {"PLUGIN", plugin_},
            {"CLASS", class_},
            {"FILE", std::filesystem::path(file_.name()).filename().string()},
            {"NAME", cpp_comment(description_.name)},
            {"SOURCE", cpp_comment(description_.source)}};
  }

  std::string header() {
    Filling filling = common();
    std::string equations, where;
    for (const SourceText::Line& line : lines_of_text(file_.equations_text()))
      equations += line.text.empty() ? "///\n" : fmt::format("///     {}\n", cpp_comment(line.text));
    filling["EQUATIONS"] = equations;
    filling["COUNTS"] = fmt::format("state_count = {}, input_count = {}, parameter_count = {}, output_count = {}",
                                    description_.states.size(), description_.inputs.size(),
                                    description_.parameters.size(), description_.outputs.size());
    std::set<std::string> called;
    bool uses_pi = false;
    filling["MEMBERS"] = members(called, uses_pi);
    filling["OPTIONS"] = options();
    filling["DYNAMICS"] = function(true, uses_pi);
    filling["OUTPUTS"] = function(false, uses_pi);
    filling["STRAIGHT_MOTION"] = straight_motion(uses_pi);
    filling["INCLUDES"] = uses_pi ? "#include <numbers>\n" : "";
    if (needs_limits_) filling["INCLUDES"] = "#include <limits>\n" + filling["INCLUDES"];
    const std::string source = description_.source.empty()
                                   ? ""
                                   : cpp_wrapped("/// Source: " + cpp_comment(description_.source) + "\n", "/// ");
    filling["SOURCE_LINES"] = source.empty() ? "" : "///\n" + source;
    return filled(header_template, filling);
  }

  static std::vector<SourceText::Line> lines_of_text(std::string_view text) {
    std::vector<SourceText::Line> lines;
    while (!text.empty()) {
      const std::size_t end = text.find('\n');
      lines.push_back({text.substr(0, end)});
      if (end == std::string_view::npos) break;
      text.remove_prefix(end + 1);
    }
    return lines;
  }

  /// The options as members, with their defaults.
  std::string members(std::set<std::string>& called, bool& uses_pi) {
    std::vector<std::pair<std::string, std::string>> lines;
    for (const Option& option : file_.options()) {
      CppTerms terms(definitions_, names_, "Scalar");
      std::string value;
      if (option.otherwise.empty()) {
        value = "std::numeric_limits<double>::quiet_NaN()";
        needs_limits_ = true;
      } else {
        value = terms.text(option.otherwise);
      }
      for (const Item& item : option.otherwise)
        if (item.kind == Item::Kind::name && item.name != "pi")
          notes_.push_back(fmt::format("the default of '{}' is computed of that of '{}': who sets '{}' sets both",
                                       option.name, item.name, item.name));
      // Functions are found by their arguments, or by `using`, which a member's place has no room for.
      if (!terms.called().empty())
        value = fmt::format("[this] {{ {} return Scalar({}); }}()", using_line(terms.called(), ""), value);
      value.erase(std::remove(value.begin(), value.end(), '\n'), value.end());
      lines.emplace_back(fmt::format("  Scalar {}{{{}}};", names_.of(option.name), value),
                         cpp_comment(option.described()));
      called.insert(terms.called().begin(), terms.called().end());
      uses_pi = uses_pi || terms.uses_pi();
    }
    return lines.empty() ? "" : "\n" + cpp_aligned(lines, "///<");
  }

  static std::string range_text(const Range& range) {
    const bool has_lower = std::isfinite(range.lower), has_upper = std::isfinite(range.upper);
    if (!has_lower && !has_upper) return {};
    if (!has_upper)
      return fmt::format(", rhec::{}({})", range.lower_is_open ? "greater_than" : "at_least",
                         signed_number(range.lower));
    if (has_lower && !range.lower_is_open)
      return fmt::format(", rhec::between({}, {})", signed_number(range.lower), signed_number(range.upper));
    if (!has_lower) return fmt::format(", rhec::Range{{.upper = {}}}", signed_number(range.upper));
    return fmt::format(", rhec::Range{{.lower = {}, .upper = {}, .lower_is_open = true}}", signed_number(range.lower),
                       signed_number(range.upper));
  }
  static std::string signed_number(double value) { return (value < 0 ? "-" : "") + cpp_number(std::abs(value)); }

  std::string options() {
    if (file_.options().empty()) return "  void options(Visitor&&) {}\n";
    std::string text = "  void options(Visitor&& visit) {\n";
    for (const Option& option : file_.options())
      text += cpp_wrapped(fmt::format("    visit({}, {}, {}{});", cpp_text(option.name), names_.of(option.name),
                                      cpp_text(option.described()), range_text(option.range)),
                          "          ") +
              "\n";
    return text + "  }\n";
  }

  /// The statements that these need, and themselves.
  std::set<std::string> needed_by(const std::vector<std::string>& targets) const {
    std::set<std::string> needed;
    std::vector<std::string> open = targets;
    while (!open.empty()) {
      const std::string target = open.back();
      open.pop_back();
      if (!definitions_.has(target) || !needed.insert(target).second) continue;
      for (const Statement& statement : definitions_.statements())
        if (statement.target == target)
          for (const Item& item : statement.term)
            if (item.kind == Item::Kind::name) open.push_back(item.name);
    }
    return needed;
  }

  /// dynamics or outputs.
  std::string function(bool is_dynamics, bool& uses_pi) {
    const std::vector<Variable>& results = is_dynamics ? description_.states : description_.outputs;
    std::vector<std::string> targets;
    targets.reserve(results.size());
    for (const Variable& result : results) targets.push_back(result.name + (is_dynamics ? "'" : ""));
    const std::set<std::string> needed = needed_by(targets);
    std::set<std::string> used;  // names in terms
    for (const Statement& statement : definitions_.statements())
      if (needed.contains(statement.target))
        for (const Item& item : statement.term)
          if (item.kind == Item::Kind::name) used.insert(item.name);

    CppTerms terms(definitions_, names_, "Scalar");
    struct Line {
      std::string identifier, text;
      bool is_named;
    };
    std::vector<Line> definitions;
    std::string lines;
    std::map<std::string, std::string> texts;
    for (const int k : definitions_.order()) {
      const Statement& statement = definitions_.statements()[k];
      if (!needed.contains(statement.target)) continue;
      const bool is_result = std::find(targets.begin(), targets.end(), statement.target) != targets.end();
      const std::string text = terms.text(statement.term);
      if (is_result && !used.contains(statement.target)) {
        texts.emplace(statement.target, text);
        continue;
      }
      const bool is_constant = definitions_.constant_value(definitions_.node(statement.target)).has_value();
      const std::string value = is_constant ? text : fmt::format("named({}, {})", text, cpp_text(statement.target));
      const std::string line = fmt::format("    const Scalar {} = {};", names_.of(statement.target), value);
      definitions.push_back({names_.of(statement.target), cpp_wrapped(line, "        ") + "\n", !is_constant});
    }
    for (std::size_t k = 0; k < targets.size(); ++k) {
      const auto own = texts.find(targets[k]);
      // A measured state has no statement.
      const std::string value = own != texts.end() ? own->second : names_.of(targets[k]);
      lines += cpp_wrapped(fmt::format("    {}[{}] = {};", is_dynamics ? rate_ : output_, k, value), "        ") + "\n";
    }
    // An exponent that is a number is written as that, and what it was computed of may be needed no longer.
    std::set<std::string> calls;
    for (std::size_t k = definitions.size(); k-- > 0;) {
      if (!cpp_mentions(lines, definitions[k].identifier)) continue;
      lines.insert(0, definitions[k].text);
      if (definitions[k].is_named) calls.insert("named");
    }
    for (const std::string& function : terms.called())
      if (cpp_mentions(lines, function)) calls.insert(function);
    uses_pi = uses_pi || terms.uses_pi();

    std::vector<std::pair<std::string, std::string>> variables;
    const auto add = [&](const std::vector<Variable>& all, const std::string& array) {
      bool is_used = false;
      for (std::size_t k = 0; k < all.size(); ++k) {
        if (!cpp_mentions(lines, names_.of(all[k].name))) continue;
        is_used = true;
        variables.emplace_back(fmt::format("    const Scalar& {} = {}[{}];", names_.of(all[k].name), array, k),
                               about(all[k].unit, all[k].meaning));
      }
      return is_used ? array : fmt::format("/*{}*/", array);
    };
    const std::string x = add(description_.states, state_);
    const std::string u = add(description_.inputs, input_), p = add(description_.parameters, parameter_);
    // Outputs of the state alone have the shorter form.
    const bool is_of_state = !is_dynamics && u.starts_with("/*") && p.starts_with("/*");
    const std::string of_motion = is_of_state ? "" : fmt::format(", const Scalar* {}, const Scalar* {}", u, p);
    const std::string head =
        fmt::format("  void {}(const Scalar* {}{}, Scalar* {}) const {{\n", is_dynamics ? "dynamics" : "outputs", x,
                    of_motion, is_dynamics ? rate_ : output_);
    return head + using_line(calls, "    ") + cpp_aligned(variables, "//") + lines + "  }\n";
  }

  std::string variable_text(const Variable& variable, const Bounds& bounds, CppTerms& terms) {
    std::string text = fmt::format("{{.name = {}, .unit = {}, .meaning = {}", cpp_text(variable.name),
                                   cpp_text(variable.unit), cpp_text(variable.meaning));
    if (!bounds.lower.empty()) text += ", .lower = " + terms.text(bounds.lower);
    if (!bounds.upper.empty()) text += ", .upper = " + terms.text(bounds.upper);
    if (variable.scale != 1.0) text += ", .scale = " + cpp_number(variable.scale);
    if (variable.is_angle) text += ", .is_angle = true";
    if (variable.nominal != 1.0) text += ", .nominal = " + signed_number(variable.nominal);
    if (!variable.usual) text += ", .usual = false";
    return cpp_wrapped("      " + text + "},", "       ") + "\n";
  }

  std::string source() {
    Filling filling = common();
    CppTerms terms(definitions_, names_, "double");
    for (const Option& option : file_.options()) terms.set(option.name, "vehicle." + names_.of(option.name));
    std::string variables;
    std::size_t bounds = 0;
    const auto add = [&](const char* kind, const std::vector<Variable>& all, bool has_bounds) {
      if (all.empty()) return;
      variables += fmt::format("  model.{} = {{\n", kind);
      for (const Variable& variable : all)
        variables += variable_text(variable, has_bounds ? file_.bounds()[bounds++] : Bounds{}, terms);
      variables += "  };\n";
    };
    add("states", description_.states, true);
    add("inputs", description_.inputs, true);
    add("parameters", description_.parameters, true);
    add("outputs", description_.outputs, false);
    const bool needs_vehicle = variables.find("vehicle.") != std::string::npos;
    filling["DESCRIBE_ARGUMENT"] = needs_vehicle ? fmt::format("const {}<double>& vehicle", class_) : "";
    filling["DESCRIBE_CALL"] = needs_vehicle ? "describe(options)" : "describe()";
    filling["USING"] = using_line(terms.called(), "  ");
    filling["MODEL_NAME"] = cpp_text(description_.name);
    filling["MODEL_SOURCE"] = cpp_wrapped("      " + cpp_text(description_.source), "      ");
    filling["PLUGIN_SOURCE"] =
        cpp_wrapped("             .source = " + cpp_text(description_.source), "                       ");
    filling["VARIABLES"] = variables;
    filling["ROLES"] = roles();
    bool uses_pi = terms.uses_pi();
    filling["REQUIRED"] = required();
    std::string includes = uses_pi ? "#include <numbers>\n" : "";
    if (!terms.called().empty() || filling["REQUIRED"] != "}") includes = "#include <cmath>\n" + includes;
    filling["INCLUDES"] = includes.empty() ? includes : includes + "\n";
    return filled(source_template, filling);
  }

  std::string roles() const {
    const Roles& roles = description_.roles;
    std::vector<std::string> parts;
    const auto add = [&](const char* name, int index) {
      if (index >= 0) parts.push_back(fmt::format(".{} = {}", name, index));
    };
    add("position_x", roles.position_x);
    add("position_y", roles.position_y);
    add("heading", roles.heading);
    add("speed", roles.speed);
    add("speed_state", roles.speed_state);
    add("speed_factor", roles.speed_factor);
    if (!roles.other_headings.empty())
      parts.push_back(fmt::format(".other_headings = {{{}}}", fmt::join(roles.other_headings, ", ")));
    return parts.empty()
               ? ""
               : cpp_wrapped(fmt::format("  model.roles = {{{}}};", fmt::join(parts, ", ")), "                 ") +
                     "\n";
  }

  /// What has to be set, since the file has no default for it.
  std::string required() {
    std::string text;
    for (const Option& option : file_.options())
      if (option.otherwise.empty())
        text += fmt::format(
            "    if (std::isnan(options.{}))\n      throw rhec::Error({});\n", names_.of(option.name),
            cpp_text(fmt::format("{}: the vehicle has no default for it; set it in the section 'model' ({})",
                                 option.name, option.described())));
    return text.empty() ? "}" : "\n" + text + "  }";
  }

  /// Straight motion of the formula, where the file says it; names of options are those of its members.
  std::string straight_motion(bool& uses_pi) {
    if (!file_.has_straight_motion()) return {};
    Graph graph;
    std::map<std::string, int> known{{"ground_speed", graph.input("ground_speed")}};
    CppNames names;
    for (const char* argument : {"ground_speed", "p", "state", "inputs"}) names.unused(argument);
    for (const Option& option : file_.options()) {
      known.emplace(option.name, graph.input(option.name));
      names.unused(names_.of(option.name));
    }
    for (const Variable& parameter : description_.parameters)
      known.emplace(parameter.name, graph.input(parameter.name));
    Definitions definitions(graph, file_.name(), known);
    definitions.add(file_.straight_motion());
    definitions.build();
    CppTerms terms(definitions, names, "Scalar");
    terms.set("ground_speed", "ground_speed");
    for (const Option& option : file_.options()) terms.set(option.name, names_.of(option.name));
    for (std::size_t k = 0; k < description_.parameters.size(); ++k)
      terms.set(description_.parameters[k].name, fmt::format("p[{}]", k));
    std::string lines;
    bool has_states = false, has_parameters = false;
    for (const int k : definitions.order()) {
      const Statement& statement = definitions.statements()[k];
      const std::string text = terms.text(statement.term);
      has_parameters = has_parameters || text.find("p[") != std::string::npos;
      const auto index_in = [&](const std::vector<Variable>& all) {
        const auto is_it = [&](const Variable& variable) { return variable.name == statement.target; };
        return static_cast<std::size_t>(std::find_if(all.begin(), all.end(), is_it) - all.begin());
      };
      const std::size_t state = index_in(description_.states), input = index_in(description_.inputs);
      std::string line = fmt::format("    const Scalar {} = {};", names.of(statement.target), text);
      if (state < description_.states.size()) {
        line += fmt::format("\n    state[{}] = {};", state, names.of(statement.target));
        has_states = true;
      } else if (input < description_.inputs.size()) {
        line += fmt::format("\n    inputs[{}] = {};", input, names.of(statement.target));
      }
      lines += line + "\n";
    }
    uses_pi = uses_pi || terms.uses_pi();
    return fmt::format(
        "\n  void straight_motion(const Scalar& ground_speed, const Scalar* {}, Scalar* {}, Scalar* {}) const {{\n{}{} "
        " }}\n",
        has_parameters ? "p" : "/*p*/", has_states ? "state" : "/*state*/",
        description_.inputs.empty() ? "/*inputs*/" : "inputs", using_line(terms.called(), "    "), lines);
  }

  const VehicleFile& file_;
  ModelDescription description_;
  Graph graph_;
  Definitions definitions_;
  CppNames names_;
  std::string plugin_, class_, state_, input_, parameter_, rate_, output_;
  std::vector<std::string> notes_;
  bool needs_limits_ = false;
};

}  // namespace
}  // namespace rhec::equations

namespace rhec {

VehicleSources vehicle_as_cpp(const std::filesystem::path& file) {
  const equations::VehicleFile read(file);
  return equations::Writer(read).write();
}

}  // namespace rhec
