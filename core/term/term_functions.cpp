#include "rhec/core/term/term_functions.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/formula/derivatives.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

namespace rhec {
namespace {

std::vector<int> nodes_of(Graph& graph, const std::vector<Expression>& expressions) {
  std::vector<int> nodes;
  nodes.reserve(expressions.size());
  for (const Expression& each : expressions) nodes.push_back(each.node_in(graph));
  return nodes;
}

bool depends_on(const Graph& graph, int node, const std::vector<int>& variables) {
  const std::vector<int> reached = graph.reach(std::vector{node});
  return std::ranges::any_of(variables, [&](int each) { return std::ranges::binary_search(reached, each); });
}

/// The independent variables of the problem's stages, and what they are called.
struct Arguments {
  StageVariables variables;
  std::vector<int> states, parameters, inputs, interval;  ///< nodes; of the interval: its duration and data
};

Arguments make_arguments(Graph& graph, const Model& model) {
  Arguments made;
  const ModelDescription& about = model.description();
  StageVariables& v = made.variables;
  const auto variables = [&](const char* letter, const std::vector<Variable>& of) {
    std::vector<Expression> all = new_variables(graph, letter, static_cast<int>(of.size()), names_of(of));
    return all;
  };
  v.states = variables("x", about.states);
  v.parameters = variables("p", about.parameters);
  v.inputs = variables("u", about.inputs);
  v.duration = Expression::input(graph, "duration");
  v.data = new_variables(graph, "data", model.data_count(), {});
  made.states = nodes_of(graph, v.states);
  made.parameters = nodes_of(graph, v.parameters);
  made.inputs = nodes_of(graph, v.inputs);
  made.interval = nodes_of(graph, v.data);
  made.interval.insert(made.interval.begin(), v.duration.node_in(graph));
  return made;
}

/// Which of the groups of rows one belongs to.
enum class Group { state, interval, input };

Group group_of(const Graph& graph, int node, const Arguments& arguments, const std::string& term,
               const std::string& row) {
  if (depends_on(graph, node, arguments.inputs)) return Group::input;
  if (!depends_on(graph, node, arguments.states))
    throw Error(
        fmt::format("term '{}': '{}' depends neither on the state nor on an input; it decides nothing", term, row));
  return depends_on(graph, node, arguments.interval) ? Group::interval : Group::state;
}

bool has(TermFunctions::Stage stage, Group group) {
  if (stage == TermFunctions::Stage::first) return group == Group::input;
  return stage == TermFunctions::Stage::middle || group == Group::state;
}

}  // namespace

TermFunctions::TermFunctions(const Model& model, std::vector<NamedTerm> terms)
    : terms_(std::move(terms)), kernels_(runnable_tape_kernels().back()) {
  Graph graph;
  const Arguments arguments = make_arguments(graph, model);
  const Model* vehicle = &model;
  StageVariables variables = arguments.variables;
  while (const auto* layer = dynamic_cast<const ModelLayer*>(vehicle)) {
    variables = layer->variables_below(variables);
    vehicle = &layer->below();
  }

  struct Formula {
    int node;
    Group group;
    std::size_t term;
    int index;  ///< among the term's
  };
  std::vector<Formula> limits, residuals;
  std::vector<int> data;
  std::vector<TermWriter> written;
  for (std::size_t t = 0; t < terms_.size(); ++t) {
    const auto& [name, term, options] = terms_[t];
    TermWriter& writer = written.emplace_back(name, *vehicle, graph, variables);
    term->write(writer);
    first_data_.push_back(static_cast<int>(data.size()));
    data.insert(data.end(), writer.data_nodes().begin(), writer.data_nodes().end());
    most_obstacles_ = std::max(most_obstacles_, term->most_obstacles());
    for (const auto& [node, softness, row] : writer.limits())
      limits.push_back({node, group_of(graph, node, arguments, name, row), t, 0});
    places_.emplace_back(writer.limits().size(), -1);
    for (const auto& [node, loss, row] : writer.residuals()) {
      residuals.push_back({node, group_of(graph, node, arguments, name, row), t, 0});
      losses_.push_back(loss);
    }
    for (std::size_t k = 0; k < writer.limits().size(); ++k)
      limits[limits.size() - writer.limits().size() + k].index = static_cast<int>(k);
  }
  std::ranges::stable_sort(limits, {}, &Formula::group);
  for (std::size_t place = 0; place < limits.size(); ++place) {
    const Formula& of = limits[place];
    const TermWriter::Limit& limit = written[of.term].limits()[static_cast<std::size_t>(of.index)];
    places_[of.term][static_cast<std::size_t>(of.index)] = static_cast<int>(place);
    linear_.push_back(limit.softness.linear);
    quadratic_.push_back(limit.softness.is_hard() ? 0.0 : limit.softness.quadratic);
    limit_names_.push_back(terms_[of.term].name + ": " + limit.name);
  }

  const auto join = [](std::vector<int>& to, const std::vector<int>& more) {
    to.insert(to.end(), more.begin(), more.end());
  };
  std::vector<int> decided = arguments.states, inputs;
  join(decided, arguments.parameters);
  join(decided, arguments.inputs);
  inputs = decided;
  join(inputs, arguments.interval);
  join(inputs, data);
  argument_count_ = static_cast<int>(inputs.size());
  data_count_ = static_cast<int>(data.size());

  for (const Stage stage : {Stage::first, Stage::middle, Stage::last}) {
    Rows& rows = rows_.emplace_back();
    std::vector<int> results;
    for (std::size_t k = 0; k < limits.size(); ++k) {
      if (!has(stage, limits[k].group)) continue;
      if (rows.limits++ == 0) rows.first_limit = static_cast<int>(k);
      results.push_back(limits[k].node);
    }
    for (std::size_t k = 0; k < residuals.size(); ++k) {
      if (!has(stage, residuals[k].group)) continue;
      rows.residuals.push_back(static_cast<int>(k));
      results.push_back(residuals[k].node);
    }
    rows.values = Tape(graph, inputs, results);
    const NodeMatrix slopes = jacobian(graph, results, decided);
    std::vector<int> with_slopes = results;
    for (int r = 0; r < slopes.rows; ++r)
      for (int c = 0; c < slopes.columns; ++c) {
        if (graph.is_constant(slopes.at(r, c), 0.0)) continue;
        rows.slopes.push_back({r, c});
        with_slopes.push_back(slopes.at(r, c));
      }
    rows.jacobians = Tape(graph, inputs, with_slopes);
    std::vector<int> weights, weighted = inputs, entries;
    for (std::size_t r = 0; r < results.size(); ++r) weights.push_back(graph.input("weight"));
    join(weighted, weights);
    const NodeMatrix bends = weighted_hessian(graph, results, weights, decided);
    for (int r = 0; r < bends.rows; ++r)
      for (int c = 0; c <= r; ++c) {
        if (graph.is_constant(bends.at(r, c), 0.0)) continue;
        rows.bends.push_back({r, c});
        entries.push_back(bends.at(r, c));
      }
    rows.hessians = Tape(graph, weighted, entries);
  }
}

int TermFunctions::argument_row() const noexcept { return padded(argument_count_); }

namespace {

/// Calls run(first, count, lanes) for groups of stages.
template <class Run>
void for_each_block(const Tape& tape, int count, const Run& run) {
  for (int first = 0; first < count;) {
    const int lanes = tape.lanes(count - first), here = std::min(lanes, count - first);
    run(first, here, lanes);
    first += here;
  }
}

/// One result of some stages.
void store(const Tape& tape, std::size_t which, const double* registers, int lanes, int count, double* to,
           std::ptrdiff_t step) {
  const std::ptrdiff_t source = tape.results()[which];
  if (source < 0) {
    const double value = tape.uniforms()[static_cast<std::size_t>(~source)];
    for (int i = 0; i < count; ++i) to[i * step] = value;
    return;
  }
  const double* const from = registers + source * lanes;
  for (int i = 0; i < count; ++i) to[i * step] = from[i];
}

void store(const Tape& tape, std::size_t first_result, std::size_t results, const double* registers, int lanes,
           int count, double* to) {
  for (std::size_t k = 0; k < results; ++k)
    store(tape, first_result + k, registers, lanes, count, to + k, static_cast<std::ptrdiff_t>(results));
}

}  // namespace

/// Runs a tape for all stages: use(first, count, lanes) finds the results of some of them in the registers.
template <class Use>
void TermFunctions::run(const Tape& tape, int count, const double* arguments, double* registers,
                        const Use& use) const noexcept {
  for_each_block(tape, count, [&](int first, int here, int lanes) {
    kernels_->load_rows(arguments + static_cast<std::ptrdiff_t>(first) * argument_row(), argument_row(), here,
                        argument_count_, registers, lanes, lanes);
    tape.run(*kernels_, registers, lanes, here);
    use(first, here, lanes);
  });
}

void TermFunctions::evaluate(Stage stage, int count, const double* arguments, double* values, double* slopes,
                             double* scratch) const noexcept {
  const Rows& rows = this->rows(stage);
  const Tape& tape = slopes ? rows.jacobians : rows.values;
  const auto row_count = static_cast<std::size_t>(rows.count());
  double* const registers = Scratch(scratch).rest();
  run(tape, count, arguments, registers, [&](int first, int here, int lanes) {
    store(tape, 0, row_count, registers, lanes, here, values + first * row_count);
    if (slopes) store(tape, row_count, rows.slopes.size(), registers, lanes, here, slopes + first * rows.slopes.size());
  });
}

void TermFunctions::evaluate_limits(Stage stage, int count, const double* arguments, const LimitPlaces& places,
                                    double* scratch) const noexcept {
  const Rows& rows = this->rows(stage);
  double* const registers = Scratch(scratch).rest();
  const Tape& tape = places.slopes ? rows.jacobians : rows.values;
  run(tape, count, arguments, registers, [&](int first, int here, int lanes) {
    double* const values = places.values + first * places.values_step;
    for (int r = 0; r < rows.limits; ++r)
      store(tape, static_cast<std::size_t>(r), registers, lanes, here, values + r, places.values_step);
    if (!places.slopes) return;
    double* const slopes = places.slopes + first * places.slopes_step;
    auto which = static_cast<std::size_t>(rows.count());
    for (const auto& [r, c] : rows.slopes) {
      if (r < rows.limits)
        store(tape, which, registers, lanes, here, slopes + r * places.row_length + c, places.slopes_step);
      ++which;
    }
  });
}

void TermFunctions::curve(Stage stage, int count, const double* arguments, const double* weights, double* bends,
                          double* scratch) const noexcept {
  const Rows& rows = this->rows(stage);
  const Tape& tape = rows.hessians;
  const std::ptrdiff_t row_count = rows.count();
  double* const registers = Scratch(scratch).rest();
  for_each_block(tape, count, [&](int first, int here, int lanes) {
    kernels_->load_rows(arguments + static_cast<std::ptrdiff_t>(first) * argument_row(), argument_row(), here,
                        argument_count_, registers, lanes, lanes);
    for (std::ptrdiff_t r = 0; r < row_count; ++r)
      for (int lane = 0; lane < lanes; ++lane)
        registers[(argument_count_ + r) * lanes + lane] = weights[(first + std::min(lane, here - 1)) * row_count + r];
    tape.run(*kernels_, registers, lanes, here);
    store(tape, 0, rows.bends.size(), registers, lanes, here, bends + first * rows.bends.size());
  });
}

std::size_t TermFunctions::scratch_size() const noexcept {
  int most = 0;
  for (const Rows& rows : rows_)
    for (const Tape* tape : {&rows.values, &rows.jacobians, &rows.hessians})
      most = std::max(most, tape->register_count());
  constexpr std::size_t most_lanes = lanes_for(1000);
  // Arguments and weights are loaded, whether an instruction needs them or not.
  return (static_cast<std::size_t>(std::max(most, 0)) + argument_row() + limit_count() + losses_.size()) * most_lanes +
         8;
}

}  // namespace rhec
