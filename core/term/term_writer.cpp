#include "rhec/core/term/term_writer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/core/formula/graph_copy.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

namespace rhec {

TermWriter::TermWriter(std::string name, const Model& vehicle, Graph& graph, StageVariables variables)
    : name_(std::move(name)), vehicle_(vehicle), graph_(graph), variables_(std::move(variables)) {}

void TermWriter::refuse(const std::string& why) const {
  throw Error(fmt::format("term '{}': the model '{}' {}", name_, vehicle_.description().name, why));
}

const Expression& TermWriter::of_role(int index, const std::vector<Expression>& all, const char* role) const {
  if (index < 0) refuse(fmt::format("does not say which of its variables is its {}; leave the term out", role));
  return all[static_cast<std::size_t>(index)];
}

const Expression& TermWriter::position_x() const {
  return of_role(vehicle_.description().roles.position_x, variables_.states, "position");
}
const Expression& TermWriter::position_y() const {
  return of_role(vehicle_.description().roles.position_y, variables_.states, "position");
}
const Expression& TermWriter::heading() const {
  return of_role(vehicle_.description().roles.heading, variables_.states, "heading");
}
const Expression& TermWriter::wheel_speed() const {
  const Roles& roles = vehicle_.description().roles;
  if (roles.speed_state >= 0) return of_role(roles.speed_state, variables_.states, "speed");
  return of_role(roles.speed, variables_.inputs, "speed");
}

namespace {

/// The variable that has this name, or -1.
int find(std::string_view name, const std::vector<Variable>& among) {
  const auto found = std::ranges::find(among, name, &Variable::name);
  return found == among.end() ? -1 : static_cast<int>(found - among.begin());
}

std::string unknown(std::string_view name, const char* what, const std::vector<Variable>& among) {
  const std::vector<std::string> names = names_of(among);
  const std::string close = nearest(name, names);
  return fmt::format("has no {} '{}'{}; it has {}", what, name,
                     close.empty() ? "" : fmt::format(" (did you mean '{}'?)", close), fmt::join(names, ", "));
}

}  // namespace

const Expression& TermWriter::input(std::string_view name) const {
  const std::vector<Variable>& inputs = vehicle_.description().inputs;
  const int found = find(name, inputs);
  if (found < 0) refuse(unknown(name, "input", inputs));
  return variables_.inputs[static_cast<std::size_t>(found)];
}

const Expression& TermWriter::state(std::string_view name) const {
  const std::vector<Variable>& states = vehicle_.description().states;
  const int found = find(name, states);
  if (found < 0) refuse(unknown(name, "state", states));
  return variables_.states[static_cast<std::size_t>(found)];
}

Expression TermWriter::rate(int state) {
  if (rates_.empty()) {
    const VehicleGraph* const equations = vehicle_.graph();
    if (!equations) refuse("has no equations that can be looked at (Model::graph), and the term needs rates of states");
    std::vector<int> known, known_here;
    const auto adopt = [&](const std::vector<int>& nodes, const std::vector<Expression>& as) {
      for (std::size_t j = 0; j < nodes.size(); ++j) {
        known.push_back(nodes[j]);
        known_here.push_back(as[j].node_in(graph_));
      }
    };
    adopt(equations->states, variables_.states);
    adopt(equations->inputs, variables_.inputs);
    adopt(equations->parameters, variables_.parameters);
    for (const auto& [node, value] : equations->options) {
      known.push_back(node);
      known_here.push_back(graph_.constant(value));
    }
    rates_ = copy_nodes(*equations->graph, equations->rates, graph_, known, known_here);
  }
  return {graph_, rates_[static_cast<std::size_t>(state)]};
}

Expression TermWriter::heading_rate() {
  heading();
  return rate(vehicle_.description().roles.heading);
}

Expression TermWriter::ground_speed() {
  const Expression direction = heading();
  position_x();
  position_y();
  const Roles& roles = vehicle_.description().roles;
  return cos(direction) * rate(roles.position_x) + sin(direction) * rate(roles.position_y);
}

Expression TermWriter::data(std::string name) {
  data_.push_back(graph_.input(std::move(name)));
  return {graph_, data_.back()};
}

void TermWriter::limit(const Expression& value, const Softness& softness, std::string name) {
  const bool is_right = softness.linear >= 0.0 && softness.quadratic >= 0.0 && std::isfinite(softness.quadratic) &&
                        (softness.linear > 0.0 || softness.quadratic > 0.0);
  if (!is_right)
    throw Error(
        fmt::format("term '{}': a violation of '{}' costs {} per unit and {} per unit squared; expected two "
                    "numbers of at least 0, one of them above 0",
                    name_, name, softness.linear, softness.quadratic));
  limits_.push_back({value.node_in(graph_), softness, std::move(name)});
}

void TermWriter::residual(const Expression& value, const Loss& loss, std::string name) {
  if (!(loss.weight >= 0.0) || !std::isfinite(loss.weight) || !(loss.delta > 0.0))
    throw Error(
        fmt::format("term '{}': '{}' has the weight {} and the delta {}; expected a weight of at least 0 and a delta "
                    "above 0",
                    name_, name, loss.weight, loss.delta));
  residuals_.push_back({value.node_in(graph_), loss, std::move(name)});
}

}  // namespace rhec
