// From a problem to its record, and from a record to its line.
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/sim/problem_file.hpp"

namespace rhec::sim {
namespace {

using json = nlohmann::ordered_json;
using Rows = ProblemRecord::Rows;
constexpr double infinity = std::numeric_limits<double>::infinity();

std::vector<double> copied(const double* values, int count) { return {values, values + count}; }

ProblemRecord::Guess guess_of(const HorizonProblem& problem, const Iterate& point) {
  ProblemRecord::Guess guess;
  for (int i = 0; i <= problem.intervals(); ++i) {
    const int states = problem.state_count(i);
    guess.states.push_back(copied(point.state(i), states));
    guess.costates.push_back(copied(point.costate(i), states));
    guess.state_bounds.push_back(copied(point.state_bound(i), states));
    if (i == problem.intervals()) break;
    guess.controls.push_back(copied(point.control(i), problem.control_count(i)));
    guess.control_bounds.push_back(copied(point.control_bound(i), problem.control_count(i)));
  }
  return guess;
}

void keep_bounds(ProblemRecord& record, const std::vector<Variable>& variables, const std::vector<double>& lower,
                 const std::vector<double>& upper) {
  for (std::size_t j = 0; j < variables.size(); ++j)
    if (std::isfinite(lower[j]) || std::isfinite(upper[j])) record.bounds[variables[j].name] = {lower[j], upper[j]};
}

void keep(ProblemRecord& record, const RheProblem& problem) {
  const ModelDescription& about = problem.model().description();
  const RheProblem::Setup& setup = problem.setup();
  const auto nx = static_cast<Eigen::Index>(about.states.size()), n = problem.arrival_mean.size();
  for (Eigen::Index r = 0; r < n; ++r) {
    (r < nx ? record.arrival_state : record.arrival_parameters).push_back(problem.arrival_mean[r]);
    std::vector<double>& row = record.arrival_information.emplace_back();
    for (Eigen::Index c = 0; c < n; ++c) row.push_back(problem.arrival_information(r, c));
  }
  for (int i = 0; i <= record.intervals; ++i) {
    record.outputs.push_back(copied(problem.output(i), static_cast<int>(about.outputs.size())));
    if (i < record.intervals)
      record.inputs.push_back(copied(problem.measured_input(i), static_cast<int>(about.inputs.size())));
  }
  record.output_weights = setup.output_weights;
  record.input_weights = setup.input_weights;
  keep_bounds(record, about.states, setup.state_lower, setup.state_upper);
  keep_bounds(record, about.inputs, setup.input_lower, setup.input_upper);
  keep_bounds(record, about.parameters, setup.parameter_lower, setup.parameter_upper);
  for (const RobustLoss& loss : setup.robust) {
    ProblemRecord::Robust& robust = record.robust.emplace_back();
    for (const int output : loss.outputs) robust.outputs.push_back(about.outputs[output].name);
    robust.delta = loss.delta;
  }
  for (int j = 0; j < static_cast<int>(about.parameters.size()); ++j) {
    const std::string& name = about.parameters[j].name;
    std::vector<int>& starts = record.block_starts[name];
    std::vector<double> variances;
    if (problem.structure().is_ramp(j)) {
      record.transition[name] = Transition::ramp;
    } else {
      starts.push_back(0);
      variances.push_back(infinity);
    }
    for (int i = 0; i < record.intervals; ++i) {
      if (!problem.structure().starts_block(i, j)) continue;
      starts.push_back(i);
      // The problem keeps the reciprocal, and the reciprocal of a reciprocal's reciprocal is itself to the bit.
      variances.push_back(problem.link_variance(i, j));
    }
    if (std::any_of(variances.begin(), variances.end(), [](double variance) { return std::isfinite(variance); }))
      record.neighbour_variance[name] = std::move(variances);
  }
}

void keep(ProblemRecord& record, const RhcProblem& problem) {
  if (record.intervals < 1) throw Error(fmt::format("{}: a control problem without an interval", record.id));
  const ModelDescription& about = problem.model().description();
  const RhcProblem::Setup& setup = problem.setup();
  const int nx = static_cast<int>(about.states.size()), nu = static_cast<int>(about.inputs.size());
  const int np = static_cast<int>(about.parameters.size());
  record.initial_state = copied(problem.initial_state(), nx);
  record.parameters = copied(problem.initial_state() + nx, np);
  for (int j = 0; j < nx; ++j) {
    const std::string& name = about.states[j].name;
    for (int i = 0; i <= record.intervals; ++i) record.reference[name].push_back(problem.state_reference(i)[j]);
    record.stage_weights[name] = setup.state_weights[j];
    record.terminal_weights[name] = setup.terminal_weights[j];
  }
  keep_bounds(record, about.states, setup.state_lower, setup.state_upper);
  for (int j = 0; j < nu; ++j) {
    const std::string& name = about.inputs[j].name;
    record.stage_weights[name] = setup.input_weights[j];
    std::vector<ProblemRecord::Interval> bounds;
    for (int i = 0; i < record.intervals; ++i) {
      record.reference[name].push_back(problem.input_reference(i)[j]);
      bounds.push_back({problem.input_lower(i, j), problem.input_upper(i, j)});
    }
    const bool same =
        std::all_of(bounds.begin(), bounds.end(), [&](const auto& each) { return each == bounds.front(); });
    if (!same) {
      record.interval_bounds[name] = std::move(bounds);
    } else if (std::isfinite(bounds.front()[0]) || std::isfinite(bounds.front()[1])) {
      record.bounds[name] = bounds.front();
    }
  }
  if (!std::is_sorted(setup.blocked_inputs.begin(), setup.blocked_inputs.end()))
    throw Error(
        fmt::format("{}: the problem's blocked inputs are not in the model's order; a line of a problem file has "
                    "no words for another one: sort Setup::blocked_inputs",
                    record.id));
  for (std::size_t b = 0; b < setup.blocked_inputs.size(); ++b) {
    const std::string& name = about.inputs[setup.blocked_inputs[b]].name;
    const int channel = np + static_cast<int>(b);
    if (!problem.structure().starts_block(0, channel))
      throw Error(
          fmt::format("{}: input '{}' is blocked but has no blocks; call RhcProblem::set_blocks", record.id, name));
    for (int i = 0; i < record.intervals; ++i)
      if (problem.structure().starts_block(i, channel)) record.block_starts[name].push_back(i);
  }
}

json number_or_null(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json list_of(const std::vector<double>& values) {
  json list = json::array();
  for (const double value : values) list.push_back(number_or_null(value));
  return list;
}

json rows_of(const Rows& rows) {
  json list = json::array();
  for (const std::vector<double>& row : rows) list.push_back(list_of(row));
  return list;
}

template <class Map, class Value>
json map_of(const Map& map, const Value& value_of) {
  json object = json::object();
  for (const auto& [name, value] : map) object[name] = value_of(value);
  return object;
}

json settings_of(const Settings& settings) {
  switch (settings.kind()) {
    case Settings::Kind::null:
      return nullptr;
    case Settings::Kind::scalar: {
      json literal = json::parse(settings.text(), nullptr, false);
      if (literal.is_number() || literal.is_boolean()) return literal;
      return settings.text();
    }
    case Settings::Kind::list: {
      json list = json::array();
      for (const Settings& item : settings.items()) list.push_back(settings_of(item));
      return list;
    }
    case Settings::Kind::map:
      break;
  }
  json object = json::object();
  for (const auto& [key, value] : settings.members()) object[key] = settings_of(value);
  return object;
}

json bounds_of(const ProblemRecord& record) {
  json all = map_of(record.bounds, [](const ProblemRecord::Interval& bounds) {
    return json{number_or_null(bounds[0]), number_or_null(bounds[1])};
  });
  for (const auto& [name, bounds] : record.interval_bounds) {
    json sides = json::array();
    for (const int side : {0, 1}) {
      std::vector<double> values;
      for (const ProblemRecord::Interval& each : bounds) values.push_back(each[side]);
      const bool same =
          std::all_of(values.begin(), values.end(), [&](double value) { return value == values.front(); });
      sides.push_back(same ? number_or_null(values.front()) : list_of(values));
    }
    if (!sides[0].is_array() && !sides[1].is_array())
      sides[1] = list_of(std::vector<double>(bounds.size(), bounds.front()[1]));
    all[name] = std::move(sides);
  }
  return all;
}

void write_rhe(const ProblemRecord& record, json& line) {
  line["arrival"] = {{"state", list_of(record.arrival_state)},
                     {"parameters", list_of(record.arrival_parameters)},
                     {"information", rows_of(record.arrival_information)}};
  line["outputs"] = rows_of(record.outputs);
  line["inputs"] = rows_of(record.inputs);
  line["weights"] = {{"outputs", list_of(record.output_weights)}, {"inputs", list_of(record.input_weights)}};
  if (!record.robust.empty()) {
    line["robust"] = json::array();
    for (const ProblemRecord::Robust& robust : record.robust)
      line["robust"].push_back({{"outputs", robust.outputs}, {"delta", number_or_null(robust.delta)}});
  }
  line["block_starts"] = map_of(record.block_starts, [](const std::vector<int>& starts) { return json(starts); });
  if (!record.transition.empty())
    line["transition"] = map_of(record.transition, [](Transition transition) {
      return json(transition == Transition::ramp ? "ramp" : "step");
    });
  if (!record.neighbour_variance.empty()) line["neighbour_variance"] = map_of(record.neighbour_variance, list_of);
}

void write_rhc(const ProblemRecord& record, json& line) {
  line["initial_state"] = list_of(record.initial_state);
  line["parameters"] = list_of(record.parameters);
  line["reference"] = map_of(record.reference, list_of);
  line["weights"] = {{"stage", map_of(record.stage_weights, number_or_null)},
                     {"terminal", map_of(record.terminal_weights, number_or_null)}};
  if (!record.block_starts.empty())
    line["block_starts"] = map_of(record.block_starts, [](const std::vector<int>& starts) { return json(starts); });
}

}  // namespace

std::string json_text(const Settings& settings) {
  return settings_of(settings).dump(-1, ' ', false, json::error_handler_t::replace);
}

ProblemRecord record_of(const HorizonProblem& problem, const Iterate* guess, std::string id, std::string model,
                        Settings model_options) {
  ProblemRecord record;
  record.version = problem_format_version;
  record.where = id;
  record.set_id(std::move(id));
  record.kind = problem.kind();
  record.model = std::move(model);
  record.model_options = std::move(model_options);
  record.intervals = problem.intervals();
  for (int i = 0; i < record.intervals; ++i) record.durations.push_back(problem.duration(i));
  record.substeps = problem.substeps();
  if (const auto* rhe = dynamic_cast<const RheProblem*>(&problem)) {
    keep(record, *rhe);
  } else if (const auto* rhc = dynamic_cast<const RhcProblem*>(&problem)) {
    keep(record, *rhc);
  } else {
    throw Error(fmt::format("{}: neither an RheProblem nor an RhcProblem; the format knows no others", record.id));
  }
  if (guess) record.guess = guess_of(problem, *guess);
  return record;
}

std::string problem_line(const ProblemRecord& record) {
  json line;
  line["version"] = problem_format_version;
  line["id"] = record.id;
  line["problem"] = record.kind == "rhe" ? "rhe" : "rhc";
  line["model"]["name"] = record.model;
  for (const auto& [key, value] : record.model_options.members()) line["model"][key] = settings_of(value);
  const auto& durations = record.durations;
  const bool same = !durations.empty() && std::all_of(durations.begin(), durations.end(),
                                                      [&](double value) { return value == durations.front(); });
  line["horizon"] = {{"intervals", record.intervals},
                     {"dt", same ? number_or_null(durations.front()) : list_of(durations)},
                     {"integrator", "rk4"},
                     {"substeps", record.substeps}};
  record.kind == "rhe" ? write_rhe(record, line) : write_rhc(record, line);
  line["bounds"] = bounds_of(record);
  if (record.guess) {
    json& guess = line["guess"];
    guess["states"] = rows_of(record.guess->states);
    guess["controls"] = rows_of(record.guess->controls);
    const auto add = [&](const char* key, const Rows& rows) {
      const auto is_zero = [](const std::vector<double>& row) {
        return std::all_of(row.begin(), row.end(), [](double value) { return value == 0.0 && !std::signbit(value); });
      };
      if (!std::all_of(rows.begin(), rows.end(), is_zero)) guess[key] = rows_of(rows);
    };
    add("costates", record.guess->costates);
    add("state_bounds", record.guess->state_bounds);
    add("control_bounds", record.guess->control_bounds);
  }
  if (!record.origin.empty())
    line["origin"] = map_of(record.origin, [](const std::string& text) { return json(text); });
  return line.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace rhec::sim
