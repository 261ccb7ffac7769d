#include "term_formula.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "rhec/core/term/term_writer.hpp"

namespace rhec::sim {
namespace {

constexpr double unwritten = std::numeric_limits<double>::quiet_NaN();
constexpr double duration = 0.2;         // of an interval [s]; no term of a vehicle can ask for it
constexpr std::size_t room_behind = 16;  // numbers behind those that a term may write
constexpr double guard = -0x1.9e3779b97f4a8p-300;

std::vector<double> guarded(std::size_t count) {
  std::vector<double> made(count, unwritten);
  made.insert(made.end(), room_behind, guard);
  return made;
}

/// Takes the guards away; whether one of them was written over.
bool is_written_behind(std::vector<double>& numbers) {
  const auto end = numbers.end() - room_behind;
  const bool found = std::any_of(end, numbers.end(), [](double value) { return value != guard; });
  numbers.erase(end, numbers.end());
  return found;
}

std::vector<int> nodes_of(Graph& graph, const std::vector<Expression>& expressions) {
  std::vector<int> nodes;
  nodes.reserve(expressions.size());
  for (const Expression& each : expressions) nodes.push_back(each.node_in(graph));
  return nodes;
}

}  // namespace

TermFormula::TermFormula(const NamedTerm& term, std::shared_ptr<const Model> vehicle)
    : term_(term),
      vehicle_(std::move(vehicle)),
      functions_(*vehicle_, {term}),
      nx_(vehicle_->state_count()),
      nu_(vehicle_->input_count()),
      np_(vehicle_->parameter_count()),
      about_(vehicle_->description()) {
  Graph& graph = *formula_.graph;
  StageVariables variables;
  variables.states = new_variables(graph, "x", nx_, names_of(about_.states));
  variables.parameters = new_variables(graph, "p", np_, names_of(about_.parameters));
  variables.inputs = new_variables(graph, "u", nu_, names_of(about_.inputs));
  formula_.states = nodes_of(graph, variables.states);
  formula_.parameters = nodes_of(graph, variables.parameters);
  formula_.inputs = nodes_of(graph, variables.inputs);
  variables.duration = Expression(duration);
  TermWriter writer(term.name, *vehicle_, graph, variables);
  term.term->write(writer);
  const std::size_t limits = writer.limits().size();
  formula_.outputs.resize(limits);
  about_.outputs.assign(limits, Variable{});
  for (std::size_t k = 0; k < limits; ++k) {
    const TermWriter::Limit& limit = writer.limits()[k];
    const auto place = static_cast<std::size_t>(functions_.place_of(0, static_cast<int>(k)));
    formula_.outputs[place] = limit.node;
    about_.outputs[place].name = limit.name;
    limit_names_.push_back(limit.name);
  }
  for (const TermWriter::Residual& residual : writer.residuals()) {
    formula_.outputs.push_back(residual.node);
    about_.outputs.emplace_back().name = residual.name;
    cost_names_.push_back(residual.name);
  }
  data_nodes_ = writer.data_nodes();
  for (const int node : data_nodes_) data_names_.push_back(graph.name_of(node));
}

NodeNumbers TermFormula::at(const TermPlace& place) const {
  NodeNumbers made{guarded(data_names_.size()), guarded(limit_names_.size()), guarded(limit_names_.size()), false};
  term_.term->write_data(place, made.data.data(), made.lower.data(), made.upper.data());
  for (std::vector<double>* numbers : {&made.data, &made.lower, &made.upper})
    made.is_beyond = is_written_behind(*numbers) || made.is_beyond;
  return made;
}

VehicleGraph TermFormula::graph_with(const std::vector<double>& data) const {
  VehicleGraph made = formula_;
  for (std::size_t k = 0; k < data_nodes_.size(); ++k) made.options.push_back({data_nodes_[k], data[k]});
  return made;
}

int TermFormula::entry_of(int column) const {
  if (column < nx_) return column;
  return column < nx_ + np_ ? column + nu_ : column - np_;
}

std::vector<double> TermFormula::arguments(const StagePoints& points, const std::vector<double>& data) const {
  const int row = functions_.argument_row(), numbers = functions_.data_count();
  std::vector<double> all(static_cast<std::size_t>(points.count) * row, 0.0);
  for (int i = 0; i < points.count; ++i) {
    double* to = all.data() + static_cast<std::ptrdiff_t>(i) * row;
    const auto add = [&to, i](const std::vector<double>& from, int count) {
      to = std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(i) * count, count, to);
    };
    add(points.states, nx_);
    add(points.parameters, np_);
    add(points.inputs, nu_);
    *to++ = duration;
    to += vehicle_->data_count();
    add(data, numbers);
  }
  return all;
}

std::vector<double> TermFormula::values(const StagePoints& points, const std::vector<double>& data) const {
  std::vector<double> made(static_cast<std::size_t>(points.count) * row_count(), unwritten);
  std::vector<double> scratch(functions_.scratch_size());
  functions_.evaluate(TermFunctions::Stage::middle, points.count, arguments(points, data).data(), made.data(), nullptr,
                      scratch.data());
  return made;
}

std::vector<double> TermFormula::jacobians(const StagePoints& points, const std::vector<double>& data) const {
  const std::vector<TermFunctions::Entry>& places = functions_.rows(TermFunctions::Stage::middle).slopes;
  const auto count = static_cast<std::size_t>(points.count), rows = static_cast<std::size_t>(row_count()),
             columns = static_cast<std::size_t>(entries());
  std::vector<double> values(count * rows), slopes(count * places.size() + 1), scratch(functions_.scratch_size());
  functions_.evaluate(TermFunctions::Stage::middle, points.count, arguments(points, data).data(), values.data(),
                      slopes.data(), scratch.data());
  std::vector<double> made(count * columns * rows, 0.0);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t k = 0; k < places.size(); ++k)
      made[(i * columns + static_cast<std::size_t>(entry_of(places[k].column))) * rows +
           static_cast<std::size_t>(places[k].row)] = slopes[i * places.size() + k];
  return made;
}

std::vector<double> TermFormula::hessians(const StagePoints& points, const std::vector<double>& data,
                                          const std::vector<double>& multipliers) const {
  const std::vector<TermFunctions::Entry>& places = functions_.rows(TermFunctions::Stage::middle).bends;
  const auto count = static_cast<std::size_t>(points.count), n = static_cast<std::size_t>(entries());
  std::vector<double> bends(count * places.size() + 1), scratch(functions_.scratch_size());
  functions_.curve(TermFunctions::Stage::middle, points.count, arguments(points, data).data(), multipliers.data(),
                   bends.data(), scratch.data());
  std::vector<double> made(count * n * n, 0.0);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t k = 0; k < places.size(); ++k) {
      const auto row = static_cast<std::size_t>(entry_of(places[k].row)),
                 column = static_cast<std::size_t>(entry_of(places[k].column));
      const double value = bends[i * places.size() + k];
      made[(i * n + row) * n + column] = value;
      made[(i * n + column) * n + row] = value;
    }
  return made;
}

}  // namespace rhec::sim
