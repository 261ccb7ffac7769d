#include "rhec/plugins/equations/equations.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "definitions.hpp"
#include "rhec/core/model/chosen_outputs.hpp"
#include "rhec/core/model/graph_model.hpp"
#include "vehicle_file.hpp"

namespace rhec {
namespace equations {
namespace {

/// Of equations with so many operations, derivatives are made in a moment; no vehicle known to us has a tenth of it.
constexpr int most_operations = 10000;

/// The options of a file as inputs of a graph, with their values.
class OptionValues {
 public:
  OptionValues(Graph& graph, std::string file) : graph_(graph), file_(std::move(file)) {}

  void add(const Option& option, double value) {
    const int node = graph_.input(option.name);
    known_.push_back({node, value});
    nodes_.emplace(option.name, node);
  }
  const std::vector<Tape::Known>& known() const { return known_; }
  const std::map<std::string, int>& nodes() const { return nodes_; }

  /// The value of a term of numbers and of the options so far.
  double value_of(const std::vector<Item>& term) const {
    const int node =
        Definitions(graph_, file_, nodes_, "a number, pi, or an option that is declared above").build_term(term);
    std::vector<int> inputs;
    std::vector<double> values;
    for (const auto& [option, value] : known_) {
      inputs.push_back(option);
      values.push_back(value);
    }
    return graph_.evaluate({&node, 1}, inputs, values)[0];
  }
  /// The default; throws Error if it is none of the allowed values.
  double default_of(const Option& option) const {
    const double value = value_of(option.otherwise);
    if (!option.range.contains(value))
      throw error_at(file_, option.otherwise.front().place,
                     fmt::format("the default {} of '{}' is not {}", value, option.name, option.range.text()));
    return value;
  }

 private:
  Graph& graph_;
  std::string file_;
  std::vector<Tape::Known> known_;
  std::map<std::string, int> nodes_;
};

/// Makes the graph of a file's vehicle for some values of its options.
class VehicleBuilder {
 public:
  VehicleBuilder(const VehicleFile& file, const Settings& settings)
      : file_(file), description_(file.description()), options_(*vehicle_.graph, file.name()) {
    set_options(settings);
    set_bounds();
    vehicle_.states = add_inputs(description_.states);
    vehicle_.inputs = add_inputs(description_.inputs);
    vehicle_.parameters = add_inputs(description_.parameters);
    build_equations();
    build_straight_motion();
  }

  std::shared_ptr<Model> make() {
    std::vector<int> results = vehicle_.rates;
    results.insert(results.end(), vehicle_.outputs.begin(), vehicle_.outputs.end());
    const int operations = graph().count_operations(results);
    if (operations > most_operations)
      throw error_at(file_.name(), file_.place("equations", ""),
                     fmt::format("the equations have {} operations; expected at most {}", operations, most_operations));
    return std::make_shared<GraphModel>(vehicle_, description_);
  }

 private:
  Graph& graph() { return *vehicle_.graph; }

  std::vector<int> add_inputs(const std::vector<Variable>& variables) {
    std::vector<int> nodes;
    for (const Variable& variable : variables) {
      nodes.push_back(graph().input(variable.name));
      variables_.emplace(variable.name, nodes.back());
    }
    return nodes;
  }

  void set_options(const Settings& settings) {
    std::vector<std::string> names;
    for (const Option& option : file_.options()) names.push_back(option.name);
    const std::string owner = fmt::format("vehicle '{}'", description_.name);
    check_keys(settings, names, owner, {"name", "equations", "outputs"});
    for (const Option& option : file_.options()) {
      if (const Settings* given = settings.find(option.name))
        options_.add(option, NumberValue{option.range}.read(*given, OptionContext{owner, option.described()}));
      else if (option.otherwise.empty())
        throw settings.error(fmt::format("{}: the vehicle has no default for it; set it in the section 'model' ({})",
                                         option.name, option.described()));
      else
        options_.add(option, options_.default_of(option));
    }
    vehicle_.options = options_.known();
    variables_ = options_.nodes();
  }

  void set_bounds() {
    std::size_t k = 0;
    for (auto* variables : {&description_.states, &description_.inputs, &description_.parameters}) {
      for (Variable& variable : *variables) {
        const Bounds& bounds = file_.bounds()[k++];
        if (!bounds.lower.empty()) variable.lower = options_.value_of(bounds.lower);
        if (!bounds.upper.empty()) variable.upper = options_.value_of(bounds.upper);
        if (variable.lower <= variable.upper) continue;
        const Place place = (bounds.lower.empty() ? bounds.upper : bounds.lower).front().place;
        throw error_at(file_.name(), place,
                       fmt::format("the bounds of '{}' are [{}, {}], expected lower <= upper", variable.name,
                                   variable.lower, variable.upper));
      }
    }
  }

  void build_equations() {
    Definitions definitions(graph(), file_.name(), variables_);
    definitions.add(file_.equations());
    check_primes(definitions);
    definitions.build();
    for (std::size_t j = 0; j < description_.states.size(); ++j) {
      const std::string& name = description_.states[j].name;
      vehicle_.rates.push_back(definitions.node(name + "'"));
      if (vehicle_.rates.back() < 0)
        throw error_at(file_.name(), file_.place("states", name),
                       fmt::format("the state '{0}' has no equation; expected {0}' = ... in 'equations'", name));
    }
    for (const Variable& output : description_.outputs) {
      const auto state = variables_.find(output.name);
      int node = state == variables_.end() ? definitions.node(output.name) : state->second;
      if (node < 0)
        throw error_at(file_.name(), file_.place("outputs", output.name),
                       fmt::format("the output '{0}' has no equation; expected {0} = ... in 'equations'", output.name));
      vehicle_.outputs.push_back(node);
    }
  }
  /// A derivative is one of a state.
  void check_primes(const Definitions& definitions) const {
    std::vector<std::string> states = names_of(description_.states);
    for (const Statement& statement : definitions.statements()) {
      if (!statement.target.ends_with('\'')) continue;
      const std::string name = statement.target.substr(0, statement.target.size() - 1);
      if (std::find(states.begin(), states.end(), name) != states.end()) continue;
      const std::string near = nearest(name, states);
      throw error_at(file_.name(), statement.place,
                     fmt::format("'{}' is no state{}", name,
                                 near.empty() ? fmt::format("; states are {}", fmt::join(states, ", "))
                                              : fmt::format("; did you mean '{}'?", near)));
    }
  }
  void build_straight_motion() {
    if (!file_.has_straight_motion()) return;
    std::map<std::string, int> known = options_.nodes();
    StraightMotion& straight = vehicle_.straight.emplace();
    straight.ground_speed = graph().input("ground_speed");
    known.emplace("ground_speed", straight.ground_speed);
    for (const Variable& parameter : description_.parameters)
      known.emplace(parameter.name, variables_.at(parameter.name));
    Definitions definitions(graph(), file_.name(), std::move(known),
                            "ground_speed, a parameter, an option, or a name that has an equation");
    definitions.add(file_.straight_motion());
    definitions.build();
    for (const Variable& state : description_.states) straight.states.push_back(definitions.node(state.name));
    for (const Variable& input : description_.inputs) {
      straight.inputs.push_back(definitions.node(input.name));
      if (straight.inputs.back() < 0)
        throw error_at(
            file_.name(), file_.place("straight_motion", ""),
            fmt::format("straight motion has no equation for the input '{0}'; expected {0} = ...", input.name));
    }
  }

  const VehicleFile& file_;
  ModelDescription description_;
  VehicleGraph vehicle_;
  OptionValues options_;
  std::map<std::string, int> variables_;
};

}  // namespace
}  // namespace equations

bool is_equations_file(std::string_view name) { return name.ends_with(".yaml") || name.ends_with(".yml"); }

std::shared_ptr<Model> load_vehicle(const std::filesystem::path& file, const Settings& settings) {
  const equations::VehicleFile read(file);
  return equations::VehicleBuilder(read, settings).make();
}

std::shared_ptr<Model> load_inline_vehicle(const Settings& settings) {
  const Settings* section = settings.find("equations");
  if (!section) throw settings.error("it has no equations; expected the key 'equations' with a vehicle");
  const equations::VehicleFile read(*section);
  return equations::VehicleBuilder(read, settings).make();
}

std::vector<OptionRow> vehicle_options(const std::filesystem::path& file) {
  const equations::VehicleFile read(file);
  Graph graph;
  equations::OptionValues values(graph, read.name());
  std::vector<OptionRow> rows;
  for (const equations::Option& option : read.options()) {
    const NumberValue kind{option.range};
    std::string otherwise;
    if (!option.otherwise.empty()) {
      const double value = values.default_of(option);
      values.add(option, value);
      otherwise = kind.print(value);
    }
    rows.push_back({option.name, kind.type(), otherwise, kind.constraint(), option.described()});
  }
  rows.push_back(outputs_row());
  return rows;
}

}  // namespace rhec
