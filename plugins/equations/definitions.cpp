#include "definitions.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/config/option_values.hpp"
#include "rhec/core/formula/expression.hpp"

namespace rhec::equations {
namespace {

/// What the user wrote, for messages.
std::string sign_of(const Item& item) {
  switch (item.kind) {
    case Item::Kind::divide:
      return "this quotient";
    case Item::Kind::power:
      return "this power";
    case Item::Kind::function:
      return item.name + "(...)";
    default:
      return "this term";
  }
}

}  // namespace

Definitions::Definitions(Graph& graph, std::string file, std::map<std::string, int> variables, std::string expected)
    : graph_(graph), file_(std::move(file)), expected_(std::move(expected)), variables_(std::move(variables)) {}

void Definitions::add(std::vector<Statement> statements) {
  for (Statement& statement : statements) {
    if (variables_.contains(statement.target))
      throw error_at(
          file_, statement.place,
          fmt::format("the value of '{0}' is given; expected an equation for the derivative of a state ({0}' = "
                      "..., if it is one), for an output, or for a new name",
                      statement.target));
    const auto [known, is_new] = statement_of_.try_emplace(statement.target, static_cast<int>(statements_.size()));
    if (!is_new)
      throw error_at(file_, statement.place,
                     fmt::format("there is an equation for '{}' in line {} already; remove one of them",
                                 statement.target, statements_[known->second].place.shown_line()));
    statements_.push_back(std::move(statement));
  }
}

int Definitions::node(const std::string& target) const {
  const auto found = statement_of_.find(target);
  return found == statement_of_.end() ? -1 : nodes_[found->second];
}

Place Definitions::place(const std::string& target) const { return statements_[statement_of_.at(target)].place; }

void Definitions::check_names() const {
  for (const Statement& statement : statements_)
    for (const Item& item : statement.term)
      if (item.kind == Item::Kind::name && item.name != "pi" && !variables_.contains(item.name) && !has(item.name))
        resolve(item);  // throws
}

/// Without recursion.
std::vector<int> Definitions::order() const {
  enum class Mark : char { unseen, open, done };
  std::vector<Mark> marks(statements_.size(), Mark::unseen);
  std::vector<int> ordered;
  struct Visit {
    int statement;
    std::size_t item;
  };
  std::vector<Visit> path;
  for (std::size_t first = 0; first < statements_.size(); ++first) {
    if (marks[first] != Mark::unseen) continue;
    path.push_back({static_cast<int>(first), 0});
    marks[first] = Mark::open;
    while (!path.empty()) {
      auto& [statement, item] = path.back();
      const std::vector<Item>& term = statements_[statement].term;
      int needed = -1;
      for (; item < term.size() && needed < 0; ++item) {
        if (term[item].kind != Item::Kind::name) continue;
        const auto found = statement_of_.find(term[item].name);
        if (found == statement_of_.end() || marks[found->second] == Mark::done) continue;
        needed = found->second;
        if (marks[needed] != Mark::open) continue;
        std::string circle;
        bool inside = false;
        for (const Visit& visit : path) {
          inside = inside || visit.statement == needed;
          if (inside) circle += statements_[visit.statement].target + " -> ";
        }
        throw error_at(file_, term[item].place,
                       fmt::format("'{}' needs itself: {}{}; write one of them without the others",
                                   statements_[needed].target, circle, statements_[needed].target));
      }
      if (needed >= 0) {
        marks[needed] = Mark::open;
        path.push_back({needed, 0});
      } else {
        marks[statement] = Mark::done;
        ordered.push_back(statement);
        path.pop_back();
      }
    }
  }
  return ordered;
}

void Definitions::build() {
  nodes_.assign(statements_.size(), -1);
  check_names();
  for (const int statement : order()) {
    nodes_[statement] = build_term(statements_[statement].term);
    if (!graph_.is_constant(nodes_[statement])) graph_.name(nodes_[statement], statements_[statement].target);
  }
}

int Definitions::resolve(const Item& name) const {
  if (name.name == "pi") return graph_.constant(std::numbers::pi);
  const auto variable = variables_.find(name.name);
  if (variable != variables_.end()) return variable->second;
  const int defined = node(name.name);
  if (defined >= 0) return defined;
  std::vector<std::string> known{"pi"};
  for (const auto& [known_name, node] : variables_) known.push_back(known_name);
  for (const Statement& statement : statements_) known.push_back(statement.target);
  const std::string near = nearest(name.name, known);
  std::string advice = near.empty() ? "; expected " + expected_ : fmt::format("; did you mean '{}'?", near);
  if (name.name == "t" || name.name == "time") advice = "; equations do not depend on time. Expected " + expected_;
  if (name.name == "nan" || name.name == "inf") advice = "; expected a finite number";
  throw error_at(file_, name.place, fmt::format("'{}' is not known{}", name.name, advice));
}

std::vector<int> Definitions::build_items(const std::vector<Item>& term) {
  std::vector<int> operands, nodes;
  for (const Item& item : term) {
    const int made = apply(item, operands);
    if (graph_.is_constant(made) && !std::isfinite(graph_[made].value))
      throw error_at(
          file_, item.place,
          fmt::format("{} is not a finite number, whatever the values: it is {}; expected a term that has a value",
                      sign_of(item), std::isnan(graph_[made].value) ? "undefined" : "infinite"));
    operands.push_back(made);
    nodes.push_back(made);
  }
  return nodes;
}

int Definitions::apply(const Item& item, std::vector<int>& operands) {
  const auto count = static_cast<std::ptrdiff_t>(operands_of(item));
  const std::vector<int> arguments(operands.end() - count, operands.end());
  operands.resize(operands.size() - static_cast<std::size_t>(count));
  switch (item.kind) {
    case Item::Kind::number:
      return graph_.constant(item.value);
    case Item::Kind::name:
      return resolve(item);
    case Item::Kind::negate:
      return graph_.negate(arguments[0]);
    case Item::Kind::add:
      return graph_.add(arguments[0], arguments[1]);
    case Item::Kind::subtract:
      return graph_.subtract(arguments[0], arguments[1]);
    case Item::Kind::multiply:
      return graph_.multiply(arguments[0], arguments[1]);
    case Item::Kind::divide:
      if (graph_.is_constant(arguments[1], 0.0)) throw error_at(file_, item.place, "this divides by 0");
      return graph_.divide(arguments[0], arguments[1]);
    case Item::Kind::power:
      return apply_power(arguments[0], arguments[1]);
    case Item::Kind::function:
      break;
  }
  return apply_function(item, arguments);
}

int Definitions::apply_power(int base, int exponent) {
  constexpr double largest = 1000.0;
  if (graph_.is_constant(exponent)) {
    const double value = graph_[exponent].value;
    if (value == std::round(value) && std::abs(value) <= largest) return graph_.power(base, static_cast<int>(value));
    if (value == 0.5) return graph_.function(Operation::square_root, base);
  }
  return pow(Expression(graph_, base), Expression(graph_, exponent)).node_in(graph_);
}

int Definitions::apply_function(const Item& item, const std::vector<int>& arguments) {
  struct Elementary {
    const char* name;
    Operation operation;
  };
  static constexpr Elementary elementary[] = {{"sqrt", Operation::square_root},
                                              {"exp", Operation::exponential},
                                              {"log", Operation::logarithm},
                                              {"sin", Operation::sine},
                                              {"cos", Operation::cosine},
                                              {"tan", Operation::tangent},
                                              {"asin", Operation::arc_sine},
                                              {"acos", Operation::arc_cosine},
                                              {"atan", Operation::arc_tangent},
                                              {"atan2", Operation::arc_tangent_2},
                                              {"tanh", Operation::hyperbolic_tangent}};
  const auto is_of = [&](std::size_t k, Operation operation) { return graph_[arguments[k]].operation == operation; };
  if (item.name == "atan2" && is_of(0, Operation::sine) && is_of(1, Operation::cosine) &&
      graph_[arguments[0]].a == graph_[arguments[1]].a)
    throw error_at(file_, item.place,
                   "this wraps an angle, which equations never do; write the angle itself, and give the variable "
                   "'angle: true', so that differences are taken on the circle");
  for (const Elementary& known : elementary)
    if (item.name == known.name)
      return graph_.function(known.operation, arguments[0], arguments.size() > 1 ? arguments[1] : -1);
  const auto argument = [&](std::size_t k) { return Expression(graph_, arguments[k]); };
  if (item.name == "hypot") return hypot(argument(0), argument(1)).node_in(graph_);
  if (item.name == "smooth_abs") return smooth_abs(argument(0), argument(1)).node_in(graph_);
  if (item.name == "smooth_min") return smooth_min(argument(0), argument(1), argument(2)).node_in(graph_);
  return smooth_max(argument(0), argument(1), argument(2)).node_in(graph_);
}

}  // namespace rhec::equations
