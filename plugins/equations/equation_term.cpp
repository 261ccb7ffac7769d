#include "rhec/plugins/equations/equation_term.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "definitions.hpp"
#include "node_number.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/core/formula/expression.hpp"
#include "rhec/core/term/term_options.hpp"
#include "rhec/core/term/term_writer.hpp"
#include "statements.hpp"

namespace rhec {
namespace equations {
namespace {

/// What every vehicle has, and how a writer says it.
struct RoleName {
  const char* name;
  Expression (*of)(TermWriter& writer);
};
constexpr RoleName role_names[] = {{"position_x", [](TermWriter& w) { return w.position_x(); }},
                                   {"position_y", [](TermWriter& w) { return w.position_y(); }},
                                   {"heading", [](TermWriter& w) { return w.heading(); }},
                                   {"wheel_speed", [](TermWriter& w) { return w.wheel_speed(); }},
                                   {"ground_speed", [](TermWriter& w) { return w.ground_speed(); }},
                                   {"heading_rate", [](TermWriter& w) { return w.heading_rate(); }}};

Place place_of(const Settings& at) { return {at.origin().line, 0}; }

/// Places of single terms are lines alone; the key says which term it is.
Error with_key(const Settings& at, const Error& mistake) {
  std::string_view text = mistake.what();
  const std::string place = at.where() + ": ";
  if (text.starts_with(place)) text.remove_prefix(place.size());
  return at.error(text);
}

std::vector<Item> items_of(const Settings& scalar, Functions functions) {
  if (scalar.kind() != Settings::Kind::scalar) throw scalar.mismatch("a term, such as ground_speed * heading_rate");
  try {
    return parse_term({scalar.origin().file, {{scalar.text(), scalar.origin().line, 0}}}, functions);
  } catch (const Error& mistake) {
    throw with_key(scalar, mistake);
  }
}

/// A term's equations as they stand in a configuration, with the values of its options.
class EquationTerm final : public Term {
 public:
  explicit EquationTerm(const Settings& settings) : settings_(settings), section_(*settings_.find("equations")) {
    check_keys(section_, {"name", "meaning", "states", "inputs", "options", "definitions", "limits", "costs"},
               "the equations of a term");
    if (const Settings* name = section_.find("name")) name_ = name->as_text();
    read_options();
    read_names("states", states_);
    read_names("inputs", inputs_);
    for (const RoleName& role : role_names) take_name(section_, role.name);
    for (const PlaceName& place : place_names) take_name(section_, place.name);
    read_limits();
    read_costs();
    if (limits_.empty() && costs_.empty())
      throw section_.error("it has neither limits nor costs; expected one of these keys");
    build();
  }

  void write(TermWriter& writer) const override {
    std::vector<Expression> values(static_cast<std::size_t>(graph_.size()));
    for (const auto& [node, of] : variables_) values[static_cast<std::size_t>(node)] = of(writer);
    for (const int node : used_) {
      const Graph::Node& at = graph_[node];
      Expression& value = values[static_cast<std::size_t>(node)];
      const auto operand = [&](int which) {
        return which < 0 ? Expression(0.0) : values[static_cast<std::size_t>(which)];
      };
      if (at.operation == Operation::constant)
        value = at.value;
      else if (at.operation == Operation::power)
        value = Expression::power(operand(at.a), at.b);
      else if (at.operation != Operation::input)
        value = Expression::of(at.operation, operand(at.a), operand(at.b));
    }
    const auto value_of = [&](const Formula& formula) { return values[static_cast<std::size_t>(formula.node)]; };
    for (const Limit& limit : limits_) writer.limit(value_of(limit), common_.softness(), limit.name);
    for (const Cost& cost : costs_) writer.residual(value_of(cost), cost.loss, cost.name);
  }

  void write_data(const TermPlace& place, double* data, double* lower, double* upper) const noexcept override {
    for (const PlaceName* known : data_) *data++ = place.*known->value;
    for (const Limit& limit : limits_) {
      *lower++ = limit.lower ? limit.lower->at(place) : -infinity;
      *upper++ = limit.upper ? limit.upper->at(place) : infinity;
    }
  }

 private:
  struct Formula {
    std::string name;
    const Settings* at = nullptr;
    std::vector<Item> items;
    int node = -1;
  };
  struct Limit : Formula {
    std::optional<NodeNumber> lower, upper;
  };
  struct Cost : Formula {
    Loss loss;
  };

  void take_name(const Settings& at, const std::string& name) {
    if (!is_name(name))
      throw at.error(
          fmt::format("'{}' is no name; expected letters, digits and underscores, and no digit first", name));
    if (is_reserved(name, Functions::with_corners) || name == "infinity")
      throw at.error(fmt::format("'{}' is a function or a constant; choose another name", name));
    if (std::ranges::find(names_, name) != names_.end())
      throw at.error(fmt::format("'{}' is there already; choose another name", name));
    names_.push_back(name);
  }

  /// A map that may be missing; what an entry is, for messages.
  const std::vector<Settings::Member>& map_of(const char* key, const char* what) const {
    static const std::vector<Settings::Member> none;
    const Settings* given = section_.find(key);
    if (given == nullptr || given->is_null()) return none;
    if (given->kind() != Settings::Kind::map) throw given->mismatch(what);
    return given->members();
  }

  void read_options() {
    const std::string owner = fmt::format("term '{}'", name_);
    std::vector<std::string> names{"hard", "soft"};
    for (const auto& [name, about] : map_of("options", "a map of options, each with its default")) {
      if (name == "name" || name == "equations" || name == "hard" || name == "soft")
        throw about.error(fmt::format("'{}' is a key of every term; choose another name", name));
      take_name(about, name);
      names.push_back(name);
      options_[name] = read_option(owner, name, about);
    }
    check_keys(settings_, names, owner, {"name", "equations"});
    Settings common = Settings::map(settings_.origin());
    for (const char* key : {"hard", "soft"})
      if (const Settings* given = settings_.find(key)) common.add(key, *given);
    common_ = with_limit_options(OptionTable<LimitOptions>()).parse(common, owner);
  }
  double read_option(const std::string& owner, const std::string& name, const Settings& about) const {
    Range range;
    std::string meaning;
    const Settings* otherwise = &about;
    if (about.kind() == Settings::Kind::map) {
      check_keys(about, {"default", "unit", "meaning", "above", "at_least"}, fmt::format("option '{}'", name));
      const Settings *above = about.find("above"), *least = about.find("at_least"), *told = about.find("meaning");
      if (above && least) throw above->error("found 'above' and 'at_least'; expected one of them");
      if (above) range = greater_than(above->as_number());
      if (least) range = at_least(least->as_number());
      if (told) meaning = told->as_text();
      otherwise = about.find("default");
    }
    const Settings* given = settings_.find(name);
    if (given == nullptr && otherwise == nullptr)
      throw settings_.error(fmt::format("{}: the term has no default for it; set it beside the equations", name));
    return NumberValue{range}.read(given ? *given : *otherwise, OptionContext{owner, meaning});
  }

  void read_names(const char* key, std::vector<std::string>& into) {
    const Settings* given = section_.find(key);
    if (given == nullptr || given->is_null()) return;
    if (given->kind() != Settings::Kind::list) throw given->mismatch(fmt::format("a list of {} of the vehicle", key));
    for (const Settings& item : given->items()) {
      take_name(item, item.as_text());
      into.push_back(item.as_text());
    }
  }

  std::optional<NodeNumber> bound_of(const Settings& about, const char* key) const {
    const Settings* given = about.find(key);
    if (given == nullptr || given->is_null()) return std::nullopt;
    return number_of(*given, true);
  }
  NodeNumber number_of(const Settings& given, bool may_use_place) const {
    const std::vector<Item> items = items_of(given, Functions::with_corners);
    try {
      return {given.origin().file, items, options_, may_use_place};
    } catch (const Error& mistake) {
      throw with_key(given, mistake);
    }
  }
  void read_formula(const Settings& at, const std::string& name, Formula& into) {
    if (std::ranges::find(rows_, name) != rows_.end())
      throw at.error(fmt::format("there is a limit or a cost '{}' already; choose another name", name));
    rows_.push_back(name);
    const Settings* term = at.kind() == Settings::Kind::map ? at.find("term") : &at;
    if (term == nullptr) throw at.error("it has no term; expected the key 'term'");
    into.name = name;
    into.at = term;
    into.items = items_of(*term, Functions::smooth);
  }

  void read_limits() {
    for (const auto& [name, about] : map_of("limits", "a map of limits, each with lower, term and upper")) {
      if (about.kind() != Settings::Kind::map) throw about.mismatch("a map of lower, term and upper");
      check_keys(about, {"lower", "term", "upper"}, fmt::format("limit '{}'", name));
      Limit& made = limits_.emplace_back();
      read_formula(about, name, made);
      made.lower = bound_of(about, "lower");
      made.upper = bound_of(about, "upper");
      if (!made.lower && !made.upper) throw about.error("it has no bound; expected 'lower', 'upper' or both");
    }
  }
  void read_costs() {
    for (const auto& [name, about] : map_of("costs", "a map of costs, each a term, or term, weight and delta")) {
      if (about.kind() == Settings::Kind::map)
        check_keys(about, {"term", "weight", "delta"}, fmt::format("cost '{}'", name));
      Cost& made = costs_.emplace_back();
      read_formula(about, name, made);
      const Settings *weight = about.find("weight"), *delta = about.find("delta");
      if (weight) made.loss.weight = number_of(*weight, false).at({});
      if (delta && !delta->is_null()) made.loss.delta = number_of(*delta, false).at({});
      if (!(made.loss.weight >= 0.0) || std::isinf(made.loss.weight))
        throw weight->error(fmt::format("the weight is {}, expected a finite number, at least 0", made.loss.weight));
      if (!(made.loss.delta > 0.0))
        throw delta->error(fmt::format("delta is {}, expected a number greater than 0", made.loss.delta));
    }
  }

  /// Formulas as nodes of a graph of their own, whose inputs are the vehicle's variables and what is known of a node.
  void build() {
    std::map<std::string, int> known;
    for (const auto& [name, value] : options_) known[name] = graph_.constant(value);
    for (const RoleName& role : role_names) add_variable(known, role.name, role.of);
    for (const std::string& name : states_)
      add_variable(known, name, [name](TermWriter& writer) { return writer.state(name); });
    for (const std::string& name : inputs_)
      add_variable(known, name, [name](TermWriter& writer) { return writer.input(name); });
    for (const PlaceName& place : place_names)
      if (place.is_finite)
        add_variable(known, place.name, [name = place.name](TermWriter& writer) { return writer.data(name); });
    Definitions definitions(
        graph_, section_.origin().file, known,
        "an option, a state or an input that 'states' and 'inputs' name, what every vehicle has, or "
        "what is known of a node");
    for (const auto& [name, about] : map_of("definitions", "a map of names and terms")) {
      take_name(about, name);
      definitions.add({{name, place_of(about), items_of(about, Functions::smooth)}});
    }
    definitions.build();
    const auto make = [&](Formula& formula) {
      try {
        formula.node = definitions.build_term(formula.items);
      } catch (const Error& mistake) {
        throw with_key(*formula.at, mistake);
      }
    };
    std::ranges::for_each(limits_, make);
    std::ranges::for_each(costs_, make);
    keep_what_is_used();
  }
  template <class Function>
  void add_variable(std::map<std::string, int>& known, const std::string& name, Function of) {
    const int node = graph_.input(name);
    known[name] = node;
    variables_.push_back({node, of});
  }
  /// Only what is used is asked of a vehicle, and of a node in the order of `place_names`.
  void keep_what_is_used() {
    std::vector<int> targets;
    for (const Limit& limit : limits_) targets.push_back(limit.node);
    for (const Cost& cost : costs_) targets.push_back(cost.node);
    used_ = graph_.reach(targets);
    std::erase_if(variables_, [&](const Variable& each) { return !std::ranges::binary_search(used_, each.node); });
    for (const PlaceName& place : place_names)
      for (const Variable& each : variables_)
        if (graph_.name_of(each.node) == place.name) data_.push_back(&place);
  }

  struct Variable {
    int node;
    std::function<Expression(TermWriter&)> of;
  };

  Settings settings_;
  const Settings& section_;
  std::string name_ = "equations";
  LimitOptions common_;
  std::map<std::string, double> options_;
  std::vector<std::string> states_, inputs_, names_, rows_;
  std::vector<Limit> limits_;
  std::vector<Cost> costs_;
  Graph graph_;
  std::vector<Variable> variables_;
  std::vector<int> used_;
  std::vector<const PlaceName*> data_;
};

}  // namespace
}  // namespace equations

std::shared_ptr<Term> load_inline_term(const Settings& settings) {
  const Settings* section = settings.find("equations");
  if (section == nullptr || section->kind() != Settings::Kind::map)
    throw settings.error("it has no equations; expected the key 'equations' with a map of limits and costs");
  return std::make_shared<equations::EquationTerm>(settings);
}

}  // namespace rhec
