#include "rhec/sim/problem_file.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "rhec/core/config/option_values.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/qp/kkt.hpp"

namespace rhec::sim {
namespace {

using nlohmann::json;
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double missing = std::numeric_limits<double>::quiet_NaN();
// What rounding may do to an information matrix, as a share of the terms' own magnitudes.
constexpr double rounding_of_information = 1e-8;

std::string at_key(const std::string& where, std::string_view key, std::string_view what) {
  return key.empty() ? fmt::format("{}: {}", where, what) : fmt::format("{}: {}: {}", where, key, what);
}

std::string did_you_mean(std::string_view word, const std::vector<std::string>& known) {
  const std::string near = nearest(word, known);
  return near.empty() ? fmt::format("expected one of {}", fmt::join(known, ", "))
                      : fmt::format("did you mean '{}'?", near);
}

/// A value of the line that knows its key.
class Value {
 public:
  Value(const json& value, std::string key, const std::string& where)
      : value_(&value), key_(std::move(key)), where_(&where) {}

  Error error(std::string_view what) const { return Error(at_key(*where_, key_, what)); }
  Error mismatch(std::string_view expected) const {
    return error(fmt::format("found {}, expected {}", found(), expected));
  }

  bool is_null() const { return value_->is_null(); }
  bool is_list() const { return value_->is_array(); }
  double number() const {
    if (!value_->is_number()) throw mismatch("a number");
    return value_->get<double>();
  }
  /// NaN for null.
  double number_or_missing() const {
    if (is_null()) return missing;
    if (!value_->is_number()) throw mismatch("a number, or null for a missing one");
    return value_->get<double>();
  }
  double number_or(double for_null) const { return is_null() ? for_null : number(); }
  int integer(int at_least) const {
    if (value_->is_number_integer()) {
      const auto number = value_->get<std::int64_t>();
      if (number >= at_least && number <= std::numeric_limits<int>::max()) return static_cast<int>(number);
    }
    throw mismatch(fmt::format("an integer, at least {}", at_least));
  }
  std::string text() const {
    if (!value_->is_string()) throw mismatch("a text");
    return value_->get<std::string>();
  }

  std::vector<Value> items(std::string_view expected) const {
    if (!value_->is_array()) throw mismatch(expected);
    std::vector<Value> all;
    for (std::size_t i = 0; i < value_->size(); ++i)
      all.emplace_back((*value_)[i], fmt::format("{}[{}]", key_, i), *where_);
    return all;
  }
  std::vector<double> numbers() const {
    std::vector<double> all;
    for (const Value& item : items("a list of numbers")) all.push_back(item.number());
    return all;
  }
  std::vector<double> numbers(std::size_t count, std::string_view what) const {
    std::vector<double> all = numbers();
    if (all.size() != count) throw error(fmt::format("{} numbers, expected {}: {}", all.size(), count, what));
    return all;
  }
  /// Rows of any width.
  ProblemRecord::Rows ragged(std::size_t count, std::string_view what) const {
    ProblemRecord::Rows all;
    for (const Value& row : items("a list of rows")) all.push_back(row.numbers());
    if (all.size() != count) throw error(fmt::format("{} rows, expected {}: {}", all.size(), count, what));
    return all;
  }
  /// Rows of one width each, null for missing where that is allowed.
  ProblemRecord::Rows rows(std::size_t count, std::string_view what, bool may_miss) const {
    ProblemRecord::Rows all;
    for (const Value& row : items("a list of rows")) {
      std::vector<double> numbers;
      for (const Value& item : row.items("a row of numbers"))
        numbers.push_back(may_miss ? item.number_or_missing() : item.number());
      if (!all.empty() && numbers.size() != all.front().size())
        throw row.error(fmt::format("{} numbers, expected {} as in the first row", numbers.size(), all.front().size()));
      all.push_back(std::move(numbers));
    }
    if (all.size() != count) throw error(fmt::format("{} rows, expected {}: {}", all.size(), count, what));
    return all;
  }

  const json& map() const {
    if (!value_->is_object()) throw mismatch("a map");
    return *value_;
  }
  Value operator[](const std::string& key) const {
    const auto at = map().find(key);
    if (at == map().end())
      throw Error(at_key(*where_, child(key), "missing; every number a solver needs is on the line"));
    return {*at, child(key), *where_};
  }
  bool has(const std::string& key) const { return map().contains(key); }
  void allow(const std::vector<std::string>& known) const {
    for (const auto& member : map().items())
      if (std::find(known.begin(), known.end(), member.key()) == known.end())
        throw Error(at_key(*where_, child(member.key()), "unknown key; " + did_you_mean(member.key(), known)));
  }
  /// The same, with the keys that came with version 2.
  void allow(std::vector<std::string> known, const std::vector<std::string>& since_2, int version) const {
    for (const std::string& key : since_2)
      if (version < 2 && has(key))
        throw Error(at_key(*where_, child(key), "is a key of version 2; add \"version\": 2 to the line"));
    known.insert(known.end(), since_2.begin(), since_2.end());
    allow(known);
  }
  template <class Each>
  void for_each(Each each) const {
    for (const auto& member : map().items()) each(member.key(), Value(member.value(), child(member.key()), *where_));
  }

  Settings settings() const {
    const Origin origin = this->origin();
    if (value_->is_null()) return Settings::null(origin);
    if (value_->is_object()) {
      Settings all = Settings::map(origin);
      for_each([&](const std::string& key, const Value& value) { all.add(key, value.settings()); });
      return all;
    }
    if (value_->is_array()) {
      Settings all = Settings::list(origin);
      for (const Value& item : items("a list")) all.append(item.settings());
      return all;
    }
    return Settings::scalar(value_->is_string() ? text() : value_->dump(), origin);
  }

 private:
  std::string child(const std::string& key) const { return key_.empty() ? key : key_ + "." + key; }
  std::string found() const {
    if (value_->is_object()) return "a map";
    if (value_->is_array()) return fmt::format("a list of {}", value_->size());
    return value_->dump(-1, ' ', false, json::error_handler_t::replace);
  }
  Origin origin() const {
    const std::size_t colon = where_->rfind(':');
    return {where_->substr(0, colon), std::stoi(where_->substr(colon + 1))};
  }

  const json* value_;
  std::string key_;
  const std::string* where_;
};

json parse(std::string_view text, const std::string& where) {
  std::vector<std::set<std::string>> keys;
  const auto refuse_twice = [&](int, json::parse_event_t event, json& parsed) {
    if (event == json::parse_event_t::object_start) keys.emplace_back();
    if (event == json::parse_event_t::object_end) keys.pop_back();
    if (event == json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second)
      throw Error(at_key(where, parsed.get<std::string>(), "the key is written twice; keep one of them"));
    return true;
  };
  try {
    return json::parse(text, refuse_twice);
  } catch (const json::parse_error& mistake) {
    throw Error(
        fmt::format("{}: column {}: no JSON; expected one problem, {{...}}, on each line", where, mistake.byte));
  } catch (const json::exception&) {
    throw Error(fmt::format("{}: a number is too large; expected finite numbers", where));
  }
}

void read_version(const Value& line, ProblemRecord& record) {
  if (!line.has("version")) return;
  record.version = line["version"].integer(1);
  if (record.version > problem_format_version)
    throw line["version"].mismatch(
        fmt::format("1 .. {}, which is what this rhec understands; use a newer one", problem_format_version));
}

void check_keys(const Value& line, const ProblemRecord& record) {
  if (record.kind == "rhe") {
    line.allow({"version", "id", "problem", "model", "horizon", "arrival", "outputs", "inputs", "weights", "bounds",
                "block_starts"},
               {"robust", "neighbour_variance", "transition", "guess", "origin"}, record.version);
  } else {
    line.allow({"version", "id", "problem", "model", "horizon", "initial_state", "parameters", "reference", "weights",
                "bounds", "block_starts"},
               {"guess", "origin"}, record.version);
  }
}

void read_horizon(const Value& horizon, ProblemRecord& record) {
  horizon.allow({"intervals", "dt", "integrator", "substeps"});
  // Before an estimator's second node its window has no interval yet.
  const bool may_be_empty = record.version >= 2 && record.kind == "rhe";
  record.intervals = horizon["intervals"].integer(may_be_empty ? 0 : 1);
  const auto N = static_cast<std::size_t>(record.intervals);
  const Value dt = horizon["dt"];
  const auto duration = [](const Value& value) {
    if (!(value.number() > 0.0)) throw value.mismatch("a number above 0 [s]");
    return value.number();
  };
  if (record.version >= 2 && dt.is_list()) {
    for (const Value& item : dt.items("a list of numbers")) record.durations.push_back(duration(item));
    if (record.durations.size() != N)
      throw dt.error(fmt::format("{} numbers, expected {}: one for each interval", record.durations.size(), N));
  } else {
    if (dt.is_list()) throw dt.mismatch("a number; a list of them is for lines with \"version\": 2");
    record.durations.assign(N, duration(dt));
  }
  if (horizon["integrator"].text() != "rk4")
    throw horizon["integrator"].mismatch("\"rk4\", the classical Runge-Kutta step");
  record.substeps = horizon["substeps"].integer(1);
}

/// One side of a pair of bounds, for every interval.
std::vector<double> read_side(const Value& side, double none, std::size_t intervals) {
  if (!side.is_list()) return std::vector<double>(intervals, side.number_or(none));
  std::vector<double> values;
  for (const Value& item : side.items("a list of numbers")) values.push_back(item.number_or(none));
  if (values.size() != intervals)
    throw side.error(fmt::format("{} numbers, expected {}: one for each interval", values.size(), intervals));
  return values;
}

void read_bounds(const Value& bounds, ProblemRecord& record) {
  bounds.for_each([&](const std::string& name, const Value& pair) {
    constexpr std::string_view expected = "[lower, upper], null for none";
    const std::vector<Value> sides = pair.items(expected);
    if (sides.size() != 2) throw pair.mismatch(expected);
    const bool by_interval = record.version >= 2 && record.kind == "rhc" && (sides[0].is_list() || sides[1].is_list());
    const std::size_t count = by_interval ? static_cast<std::size_t>(record.intervals) : 1;
    const auto read = [&](const Value& side, double none) {
      return by_interval ? read_side(side, none, count) : std::vector<double>{side.number_or(none)};
    };
    const std::vector<double> lower = read(sides[0], -infinity), upper = read(sides[1], infinity);
    std::vector<ProblemRecord::Interval> all;
    for (std::size_t i = 0; i < count; ++i) {
      if (!(lower[i] <= upper[i]))
        throw pair.error(fmt::format("found [{}, {}]{}, expected lower <= upper", lower[i], upper[i],
                                     by_interval ? fmt::format(" on interval {}", i) : ""));
      all.push_back({lower[i], upper[i]});
    }
    if (by_interval) {
      record.interval_bounds[name] = std::move(all);
    } else {
      record.bounds[name] = all.front();
    }
  });
}

void read_transitions(const Value& map, ProblemRecord& record) {
  map.for_each([&](const std::string& name, const Value& value) {
    const std::string text = value.text();
    if (text != "step" && text != "ramp") throw value.mismatch("\"step\" or \"ramp\"");
    record.transition[name] = text == "ramp" ? Transition::ramp : Transition::step;
  });
}

bool is_ramp(const ProblemRecord& record, const std::string& name) {
  const auto at = record.transition.find(name);
  return at != record.transition.end() && at->second == Transition::ramp;
}

void read_block_starts(const Value& starts, ProblemRecord& record) {
  starts.for_each([&](const std::string& name, const Value& list) {
    const bool ramp = is_ramp(record, name);
    std::vector<int> intervals;
    for (const Value& item : list.items("a list of intervals")) {
      const int start = item.integer(0);
      if (start >= record.intervals && (start > 0 || ramp))
        throw item.mismatch(record.intervals > 0 ? fmt::format("an interval of 0 .. {}", record.intervals - 1)
                                                 : "none: the horizon has no interval");
      if (!intervals.empty() && start <= intervals.back()) throw item.mismatch("starts that increase");
      intervals.push_back(start);
    }
    if (!ramp && (intervals.empty() || intervals.front() != 0))
      throw list.error("expected the intervals at which a block begins, 0 first");
    record.block_starts[name] = std::move(intervals);
  });
}

void read_neighbour_variances(const Value& map, ProblemRecord& record) {
  map.for_each([&](const std::string& name, const Value& list) {
    const auto starts = record.block_starts.find(name);
    if (starts == record.block_starts.end())
      throw list.error(fmt::format("there is no block_starts.{} that it could belong to", name));
    std::vector<double> variances;
    for (const Value& item : list.items("a list of variances, null where blocks are not linked")) {
      const double variance = item.number_or(infinity);
      if (!(variance > 0.0)) throw item.mismatch("a variance above 0, or null where the blocks are not linked");
      if (variances.empty() && std::isfinite(variance) && !is_ramp(record, name))
        throw item.mismatch("null: there is no block before the first one that it could be linked to");
      variances.push_back(variance);
    }
    if (variances.size() != starts->second.size())
      throw list.error(fmt::format("{} variances, expected {}: one for each of block_starts.{}", variances.size(),
                                   starts->second.size(), name));
    record.neighbour_variance[name] = std::move(variances);
  });
}

void read_robust(const Value& list, ProblemRecord& record) {
  for (const Value& item : list.items("a list of {outputs, delta}")) {
    item.allow({"outputs", "delta"});
    ProblemRecord::Robust robust;
    for (const Value& name : item["outputs"].items("a list of outputs")) robust.outputs.push_back(name.text());
    if (robust.outputs.empty()) throw item["outputs"].mismatch("at least one output");
    robust.delta = item["delta"].number_or(infinity);
    if (!(robust.delta > 0.0)) throw item["delta"].mismatch("a number above 0, or null for a quadratic loss");
    record.robust.push_back(std::move(robust));
  }
}

void read_guess(const Value& guess, ProblemRecord& record) {
  guess.allow({"states", "controls", "costates", "state_bounds", "control_bounds"});
  const auto N = static_cast<std::size_t>(record.intervals);
  constexpr std::string_view by_node = "one for each node of the horizon", by_interval = "one for each interval";
  ProblemRecord::Guess rows;
  rows.states = guess["states"].ragged(N + 1, by_node);
  rows.controls = guess["controls"].ragged(N, by_interval);
  if (guess.has("costates")) rows.costates = guess["costates"].ragged(N + 1, by_node);
  if (guess.has("state_bounds")) rows.state_bounds = guess["state_bounds"].ragged(N + 1, by_node);
  if (guess.has("control_bounds")) rows.control_bounds = guess["control_bounds"].ragged(N, by_interval);
  record.guess = std::move(rows);
}

/// Throws unless an information matrix is symmetric and positive semidefinite, up to rounding. Each entry is judged by
/// the magnitudes of its row and column, since the variables' units may be orders of magnitude apart.
void check_information(const Value& information, const ProblemRecord::Rows& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd scaled(n, n);
  for (Eigen::Index r = 0; r < n; ++r) {
    if (!(rows[r][r] >= 0.0))
      throw information.error(
          fmt::format("[{0}][{0}] is {1}; expected a positive semidefinite matrix, whose diagonal "
                      "is at least 0: the inverse of a covariance",
                      r, rows[r][r]));
    for (Eigen::Index c = 0; c < n; ++c) {
      const double entry = rows[r][c], mirrored = rows[c][r], scale = std::sqrt(rows[r][r]) * std::sqrt(rows[c][c]);
      if (std::abs(entry - mirrored) >
          rounding_of_information * std::max(scale, std::min(std::abs(entry), std::abs(mirrored))))
        throw information.error(
            fmt::format("[{}][{}] is {}, [{}][{}] is {}; expected a symmetric matrix", r, c, entry, c, r, mirrored));
      if (std::abs(entry) > (1.0 + rounding_of_information) * scale)
        throw information.error(
            fmt::format("[{}][{}] is {}; expected a positive semidefinite matrix, where it is at most {:.6g}, the root "
                        "of the product of the diagonal's two entries",
                        r, c, entry, scale));
      scaled(r, c) = scale > 0.0 ? entry / scale : 0.0;
    }
  }
  if (n == 0) return;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled, Eigen::EigenvaluesOnly);
  if (const double least = eigen.eigenvalues()[0]; !(least >= -rounding_of_information * static_cast<double>(n)))
    throw information.error(
        fmt::format("has a negative eigenvalue ({:.3g} with the diagonal scaled to 1); expected a "
                    "positive semidefinite matrix, the inverse of a covariance",
                    least));
}

std::vector<double> read_weights(const Value& list) {
  std::vector<double> weights;
  for (const Value& item : list.items("a list of weights")) {
    weights.push_back(item.number());
    if (!(weights.back() >= 0.0)) throw item.mismatch("a weight of at least 0");
  }
  return weights;
}

std::map<std::string, double> read_named_weights(const Value& map) {
  std::map<std::string, double> weights;
  map.for_each([&](const std::string& name, const Value& weight) {
    if (!(weight.number() >= 0.0)) throw weight.mismatch("a weight of at least 0");
    weights[name] = weight.number();
  });
  return weights;
}

void read_rhe(const Value& line, ProblemRecord& record) {
  const auto N = static_cast<std::size_t>(record.intervals);
  const Value arrival = line["arrival"], weights = line["weights"];
  arrival.allow({"state", "parameters", "information"});
  record.arrival_state = arrival["state"].numbers();
  record.arrival_parameters = arrival["parameters"].numbers();
  const std::size_t n = record.arrival_state.size() + record.arrival_parameters.size();
  constexpr std::string_view square = "a square matrix for [state; parameters]";
  record.arrival_information = arrival["information"].rows(n, square, false);
  if (n > 0 && record.arrival_information.front().size() != n)
    throw arrival["information"].error(
        fmt::format("rows of {}, expected {}: {}", record.arrival_information.front().size(), n, square));
  check_information(arrival["information"], record.arrival_information);
  record.outputs = line["outputs"].rows(N + 1, "one for each node of the horizon", true);
  record.inputs = line["inputs"].rows(N, "one for each interval of the horizon", true);
  weights.allow({"outputs", "inputs"});
  record.output_weights = read_weights(weights["outputs"]);
  record.input_weights = read_weights(weights["inputs"]);
  if (line.has("transition")) read_transitions(line["transition"], record);
  read_block_starts(line["block_starts"], record);
  if (line.has("neighbour_variance")) read_neighbour_variances(line["neighbour_variance"], record);
  if (line.has("robust")) read_robust(line["robust"], record);
}

void read_rhc(const Value& line, ProblemRecord& record) {
  record.initial_state = line["initial_state"].numbers();
  record.parameters = line["parameters"].numbers();
  line["reference"].for_each(
      [&](const std::string& name, const Value& values) { record.reference[name] = values.numbers(); });
  const Value weights = line["weights"];
  weights.allow({"stage", "terminal"});
  record.stage_weights = read_named_weights(weights["stage"]);
  record.terminal_weights = read_named_weights(weights["terminal"]);
  if (line.has("block_starts")) read_block_starts(line["block_starts"], record);
}

// From names to the model's order.

int index_of(const std::vector<Variable>& variables, const std::string& name) {
  for (std::size_t j = 0; j < variables.size(); ++j)
    if (variables[j].name == name) return static_cast<int>(j);
  return -1;
}

class Names {
 public:
  Names(const ProblemRecord& record, const Model& model) : record_(record), about_(model.description()) {}

  Error error(std::string_view key, std::string_view what) const { return Error(at_key(record_.where, key, what)); }

  /// Throws unless every key of a map is the name of a variable of the given groups.
  template <class Map>
  void check(std::string_view key, const Map& map, std::initializer_list<const std::vector<Variable>*> groups) const {
    std::vector<std::string> known;
    for (const auto* group : groups)
      for (const Variable& variable : *group) known.push_back(variable.name);
    for (const auto& [name, value] : map) {
      if (std::find(known.begin(), known.end(), name) != known.end()) continue;
      throw error(fmt::format("{}.{}", key, name),
                  fmt::format("model '{}' has no such variable here; {}", about_.name, did_you_mean(name, known)));
    }
  }
  void check_count(std::string_view key, std::size_t count, const std::vector<Variable>& variables) const {
    if (count == variables.size()) return;
    const std::vector<std::string> names = names_of(variables);
    throw error(key, fmt::format("{} numbers, expected {}, for {} of model '{}'", count, names.size(),
                                 fmt::join(names, ", "), about_.name));
  }
  void fill_bounds(const std::vector<Variable>& variables, std::vector<double>& lower,
                   std::vector<double>& upper) const {
    for (const Variable& variable : variables) {
      const auto at = record_.bounds.find(variable.name);
      lower.push_back(at == record_.bounds.end() ? -infinity : at->second[0]);
      upper.push_back(at == record_.bounds.end() ? infinity : at->second[1]);
    }
  }
  static std::vector<double> in_order(const std::map<std::string, double>& by_name,
                                      const std::vector<Variable>& variables) {
    std::vector<double> ordered;
    for (const Variable& variable : variables) {
      const auto at = by_name.find(variable.name);
      ordered.push_back(at == by_name.end() ? 0.0 : at->second);
    }
    return ordered;
  }

 private:
  const ProblemRecord& record_;
  const ModelDescription& about_;
};

std::vector<RobustLoss> robust_losses(const ProblemRecord& record, const Names& names, const ModelDescription& about) {
  const std::vector<std::string> known = names_of(about.outputs);
  std::vector<RobustLoss> losses;
  std::set<int> taken;
  for (const ProblemRecord::Robust& robust : record.robust) {
    RobustLoss loss;
    loss.delta = robust.delta;
    for (const std::string& name : robust.outputs) {
      const int output = index_of(about.outputs, name);
      const std::string key = fmt::format("robust[{}].outputs", losses.size());
      if (output < 0)
        throw names.error(
            key, fmt::format("model '{}' has no output '{}'; {}", about.name, name, did_you_mean(name, known)));
      if (!taken.insert(output).second)
        throw names.error(key, fmt::format("'{}' has a loss already; name each output once", name));
      loss.outputs.push_back(output);
    }
    losses.push_back(std::move(loss));
  }
  return losses;
}

RheProblem::Setup rhe_setup(const ProblemRecord& record, const Model& model) {
  const ModelDescription& about = model.description();
  const Names names(record, model);
  names.check_count("arrival.state", record.arrival_state.size(), about.states);
  names.check_count("arrival.parameters", record.arrival_parameters.size(), about.parameters);
  names.check_count("outputs[0]", record.outputs.front().size(), about.outputs);
  if (!record.inputs.empty()) names.check_count("inputs[0]", record.inputs.front().size(), about.inputs);
  names.check_count("weights.outputs", record.output_weights.size(), about.outputs);
  names.check_count("weights.inputs", record.input_weights.size(), about.inputs);
  names.check("bounds", record.bounds, {&about.states, &about.inputs, &about.parameters});
  names.check("block_starts", record.block_starts, {&about.parameters});
  names.check("transition", record.transition, {&about.parameters});
  for (const Variable& parameter : about.parameters)
    if (!record.block_starts.contains(parameter.name))
      throw names.error("block_starts." + parameter.name, "missing; say where its blocks begin, [0] for one block");
  RheProblem::Setup setup;
  setup.max_intervals = record.intervals;
  setup.substeps = record.substeps;
  setup.output_weights = record.output_weights;
  setup.input_weights = record.input_weights;
  names.fill_bounds(about.states, setup.state_lower, setup.state_upper);
  names.fill_bounds(about.inputs, setup.input_lower, setup.input_upper);
  names.fill_bounds(about.parameters, setup.parameter_lower, setup.parameter_upper);
  setup.robust = robust_losses(record, names, about);
  return setup;
}

RhcProblem::Setup rhc_setup(const ProblemRecord& record, const Model& model) {
  const ModelDescription& about = model.description();
  const Names names(record, model);
  const auto N = static_cast<std::size_t>(record.intervals);
  names.check_count("initial_state", record.initial_state.size(), about.states);
  names.check_count("parameters", record.parameters.size(), about.parameters);
  names.check("reference", record.reference, {&about.states, &about.inputs});
  names.check("weights.stage", record.stage_weights, {&about.states, &about.inputs});
  names.check("weights.terminal", record.terminal_weights, {&about.states});
  names.check("bounds", record.bounds, {&about.states, &about.inputs});
  for (const auto& [name, bounds] : record.interval_bounds)
    if (index_of(about.inputs, name) < 0)
      throw names.error("bounds." + name, "lists of bounds are for inputs; give a number or null for each side");
  names.check("block_starts", record.block_starts, {&about.inputs});
  for (const auto& [name, values] : record.reference) {
    const bool is_state = index_of(about.states, name) >= 0;
    if (values.size() != (is_state ? N + 1 : N))
      throw names.error("reference." + name, fmt::format("{} numbers, expected {}, one for each {}", values.size(),
                                                         is_state ? N + 1 : N, is_state ? "node" : "interval"));
  }
  for (const auto* weights : {&record.stage_weights, &record.terminal_weights})
    for (const auto& [name, weight] : *weights)
      if (weight > 0.0 && !record.reference.contains(name))
        throw names.error("reference." + name,
                          "missing, but the variable has a weight; give the reference or drop the weight");
  RhcProblem::Setup setup;
  setup.max_intervals = record.intervals;
  setup.substeps = record.substeps;
  setup.state_weights = Names::in_order(record.stage_weights, about.states);
  setup.input_weights = Names::in_order(record.stage_weights, about.inputs);
  setup.terminal_weights = Names::in_order(record.terminal_weights, about.states);
  names.fill_bounds(about.states, setup.state_lower, setup.state_upper);
  names.fill_bounds(about.inputs, setup.input_lower, setup.input_upper);
  for (const auto& [name, starts] : record.block_starts) setup.blocked_inputs.push_back(index_of(about.inputs, name));
  std::sort(setup.blocked_inputs.begin(), setup.blocked_inputs.end());
  return setup;
}

std::vector<std::uint8_t> begins_of(const ProblemRecord& record, const std::string& name) {
  std::vector<std::uint8_t> begins(record.intervals, 0);
  for (const int start : record.block_starts.at(name))
    if (start < record.intervals) begins[start] = 1;
  return begins;
}

void fill(const ProblemRecord& record, RheProblem& problem) {
  const ModelDescription& about = problem.model().description();
  const auto n = static_cast<Eigen::Index>(record.arrival_state.size() + record.arrival_parameters.size());
  problem.set_intervals(record.intervals);
  for (Eigen::Index r = 0; r < n; ++r) {
    const auto nx = static_cast<Eigen::Index>(record.arrival_state.size());
    problem.arrival_mean[r] = r < nx ? record.arrival_state[r] : record.arrival_parameters[r - nx];
    for (Eigen::Index c = 0; c < n; ++c) problem.arrival_information(r, c) = record.arrival_information[r][c];
  }
  for (int i = 0; i <= record.intervals; ++i)
    std::copy(record.outputs[i].begin(), record.outputs[i].end(), problem.output(i));
  for (int i = 0; i < record.intervals; ++i) {
    problem.set_duration(i, record.durations[i]);
    std::copy(record.inputs[i].begin(), record.inputs[i].end(), problem.measured_input(i));
  }
  for (std::size_t j = 0; j < about.parameters.size(); ++j) {
    const std::string& name = about.parameters[j].name;
    problem.set_blocks(static_cast<int>(j), begins_of(record, name).data(),
                       is_ramp(record, name) ? Transition::ramp : Transition::step);
    const auto variances = record.neighbour_variance.find(name);
    if (variances == record.neighbour_variance.end()) continue;
    const std::vector<int>& starts = record.block_starts.at(name);
    for (std::size_t k = 0; k < starts.size(); ++k)
      if (starts[k] < record.intervals) problem.link(starts[k], static_cast<int>(j), variances->second[k]);
  }
  problem.finish();
}

ProblemRecord::Interval input_bounds(const ProblemRecord& record, const std::string& name, int interval) {
  if (const auto at = record.interval_bounds.find(name); at != record.interval_bounds.end())
    return at->second[interval];
  const auto at = record.bounds.find(name);
  return at == record.bounds.end() ? ProblemRecord::Interval{-infinity, infinity} : at->second;
}

void fill(const ProblemRecord& record, RhcProblem& problem) {
  const ModelDescription& about = problem.model().description();
  const auto value_of = [&](const Variable& variable, int i) {
    const auto at = record.reference.find(variable.name);
    return at == record.reference.end() ? 0.0 : at->second[i];
  };
  problem.set_intervals(record.intervals);
  std::copy(record.initial_state.begin(), record.initial_state.end(), problem.given_state());
  std::copy(record.parameters.begin(), record.parameters.end(), problem.given_parameters());
  for (int i = 0; i <= record.intervals; ++i) {
    for (std::size_t j = 0; j < about.states.size(); ++j) problem.state_reference(i)[j] = value_of(about.states[j], i);
    if (i == record.intervals) break;
    problem.set_duration(i, record.durations[i]);
    for (std::size_t j = 0; j < about.inputs.size(); ++j) {
      problem.input_reference(i)[j] = value_of(about.inputs[j], i);
      const auto [lower, upper] = input_bounds(record, about.inputs[j].name, i);
      problem.input_lower(i, static_cast<int>(j)) = lower;
      problem.input_upper(i, static_cast<int>(j)) = upper;
    }
  }
  for (const int input : problem.setup().blocked_inputs)
    problem.set_blocks(input, begins_of(record, about.inputs[input].name).data());
  std::vector<double> scratch(problem.scratch_size());
  problem.finish(scratch);
}

void check_guess(const ProblemRecord& record, const HorizonProblem& problem) {
  if (!record.guess) return;
  const auto check = [&](const char* key, const ProblemRecord::Rows& rows, const auto& width_of, const char* what) {
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (const auto width = static_cast<std::size_t>(width_of(static_cast<int>(i))); rows[i].size() != width)
        throw Error(at_key(record.where, fmt::format("guess.{}[{}]", key, i),
                           fmt::format("{} numbers, expected {}: {}", rows[i].size(), width, what)));
  };
  const auto states = [&](int node) { return problem.state_count(node); };
  const auto controls = [&](int interval) { return problem.control_count(interval); };
  constexpr const char *state = "the vehicle's state and the value of each blocked channel",
                       *control = "the free inputs and the value of each block that starts here";
  check("states", record.guess->states, states, state);
  check("controls", record.guess->controls, controls, control);
  check("costates", record.guess->costates, states, state);
  check("state_bounds", record.guess->state_bounds, states, state);
  check("control_bounds", record.guess->control_bounds, controls, control);
}

bool same_losses(const std::vector<RobustLoss>& a, const std::vector<RobustLoss>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const RobustLoss& left, const RobustLoss& right) {
    return left.outputs == right.outputs && left.delta == right.delta;
  });
}

// What of a set-up cannot change afterwards.
bool fits(const RheProblem::Setup& wanted, const RheProblem::Setup& there) {
  return wanted.max_intervals <= there.max_intervals && wanted.substeps == there.substeps &&
         wanted.output_weights == there.output_weights && wanted.input_weights == there.input_weights &&
         same_losses(wanted.robust, there.robust) && wanted.state_lower == there.state_lower &&
         wanted.state_upper == there.state_upper && wanted.input_lower == there.input_lower &&
         wanted.input_upper == there.input_upper && wanted.parameter_lower == there.parameter_lower &&
         wanted.parameter_upper == there.parameter_upper;
}
bool fits(const RhcProblem::Setup& wanted, const RhcProblem::Setup& there) {
  return wanted.max_intervals <= there.max_intervals && wanted.substeps == there.substeps &&
         wanted.state_weights == there.state_weights && wanted.input_weights == there.input_weights &&
         wanted.terminal_weights == there.terminal_weights && wanted.state_lower == there.state_lower &&
         wanted.state_upper == there.state_upper && wanted.blocked_inputs == there.blocked_inputs;
}

/// Whether a record's estimation has one value of a parameter.
bool is_one_block(const ProblemRecord& record, const Model& model, int parameter) {
  const std::string& name = model.description().parameters[parameter].name;
  const auto starts = record.block_starts.find(name);
  const auto transition = record.transition.find(name);
  return starts != record.block_starts.end() && starts->second == std::vector<int>{0} &&
         (transition == record.transition.end() || transition->second == Transition::step);
}

template <class Problem, class Setup>
std::unique_ptr<HorizonProblem> build_from(const ProblemRecord& record, std::shared_ptr<const Model> model, Setup setup,
                                           int max_intervals) {
  setup.max_intervals = std::max({record.intervals, max_intervals, 1});
  auto problem = std::make_unique<Problem>(std::move(model), std::move(setup));
  fill(record, *problem);
  check_guess(record, *problem);
  return problem;
}

/// True where a stage has a value at a bound.
bool at_bound(const double* values, const double* lower, const double* upper, int count) {
  for (int j = 0; j < count; ++j) {
    const double hair = 1e-7 * (1.0 + std::abs(values[j]));
    if (values[j] <= lower[j] + hair || values[j] >= upper[j] - hair) return true;
  }
  return false;
}

bool any_bound_active(const HorizonProblem& problem, const Iterate& point) {
  for (int i = 0; i <= problem.intervals(); ++i) {
    if (at_bound(point.state(i), problem.state_lower(i), problem.state_upper(i), problem.state_count(i))) return true;
    if (i < problem.intervals() &&
        at_bound(point.control(i), problem.control_lower(i), problem.control_upper(i), problem.control_count(i)))
      return true;
  }
  return false;
}

void append_number(std::string& text, double value) {
  if (value == 0.0 && std::signbit(value)) {
    text += "-0.0";  // as an integer it would lose its sign in reading
  } else if (std::isfinite(value)) {
    fmt::format_to(std::back_inserter(text), "{:.17g}", value);
  } else {
    text += "null";
  }
}

/// `, "key": [[...], ...]`
template <class Row>
void append_rows(std::string& text, std::string_view key, int rows, int columns, Row row_of) {
  fmt::format_to(std::back_inserter(text), ", \"{}\": [", key);
  std::vector<double> row(columns);
  for (int i = 0; i < rows; ++i) {
    text += i == 0 ? "[" : ", [";
    row_of(i, row.data());
    for (int j = 0; j < columns; ++j) {
      if (j > 0) text += ", ";
      append_number(text, row[j]);
    }
    text += "]";
  }
  text += "]";
}

}  // namespace

void ProblemRecord::set_id(std::string text) {
  id = std::move(text);
  prefix = id;
  step = -1;
  const std::size_t slash = id.rfind('/');
  if (slash == std::string::npos) return;
  std::int64_t number = -1;
  const char *first = id.data() + slash + 1, *last = id.data() + id.size();
  const auto [end, problem] = std::from_chars(first, last, number);
  if (problem != std::errc() || end != last || number < 0) return;
  prefix.resize(slash);
  step = number;
}

ProblemRecord read_problem(std::string_view text, const std::string& file, int line_number) {
  ProblemRecord record;
  record.where = fmt::format("{}:{}", file, line_number);
  const json parsed = parse(text, record.where);
  const Value line(parsed, "", record.where);
  read_version(line, record);
  record.set_id(line["id"].text());
  const std::string kind = line["problem"].text();
  if (kind != "rhe" && kind != "rhc") throw line["problem"].mismatch("\"rhe\" or \"rhc\"");
  record.kind = kind == "rhe" ? "rhe" : "rhc";
  check_keys(line, record);
  record.model = line["model"]["name"].text();
  record.model_options = Settings::map({file, line_number});
  line["model"].for_each([&](const std::string& key, const Value& value) {
    if (key != "name") record.model_options.add(key, value.settings());
  });
  read_horizon(line["horizon"], record);
  read_bounds(line["bounds"], record);
  record.kind == "rhe" ? read_rhe(line, record) : read_rhc(line, record);
  if (line.has("guess")) read_guess(line["guess"], record);
  if (line.has("origin"))
    line["origin"].for_each([&](const std::string& key, const Value& value) { record.origin[key] = value.text(); });
  return record;
}

std::vector<ProblemRecord> read_problems(std::string_view text, const std::string& file) {
  std::vector<ProblemRecord> records;
  for (int line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view each = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (each.find_first_not_of(" \t\r") != std::string_view::npos) records.push_back(read_problem(each, file, line));
  }
  return records;
}

std::vector<int> one_block_parameters(std::span<const ProblemRecord> records, const Model& model) {
  std::vector<int> found;
  for (int j = 0; j < model.parameter_count(); ++j)
    if (std::ranges::all_of(records, [&](const ProblemRecord& record) { return is_one_block(record, model, j); }))
      found.push_back(j);
  return found;
}

std::unique_ptr<HorizonProblem> build(const ProblemRecord& record, std::shared_ptr<const Model> model,
                                      int max_intervals, std::vector<int> one_block) {
  if (record.kind == "rhe") {
    auto setup = rhe_setup(record, *model);
    setup.one_block = std::move(one_block);
    return build_from<RheProblem>(record, std::move(model), std::move(setup), max_intervals);
  }
  auto setup = rhc_setup(record, *model);
  return build_from<RhcProblem>(record, std::move(model), std::move(setup), max_intervals);
}

bool refill(const ProblemRecord& record, HorizonProblem& problem) {
  if (record.kind != problem.kind()) return false;
  if (auto* rhe = dynamic_cast<RheProblem*>(&problem)) {
    if (!fits(rhe_setup(record, problem.model()), rhe->setup())) return false;
    for (const int parameter : rhe->setup().one_block)
      if (!is_one_block(record, problem.model(), parameter)) return false;
    fill(record, *rhe);
    check_guess(record, *rhe);
    return true;
  }
  auto* rhc = dynamic_cast<RhcProblem*>(&problem);
  if (!rhc || !fits(rhc_setup(record, problem.model()), rhc->setup())) return false;
  fill(record, *rhc);
  check_guess(record, *rhc);
  return true;
}

void cold_start(const ProblemRecord& record, const HorizonProblem& problem, Iterate& guess) {
  const ModelDescription& about = problem.model().description();
  const bool is_rhe = record.kind == "rhe";
  const std::vector<double>& state = is_rhe ? record.arrival_state : record.initial_state;
  const std::vector<double>& held = is_rhe ? record.arrival_parameters : record.parameters;
  std::vector<double> inputs, parameters;
  for (int i = 0; i < record.intervals; ++i) {
    for (std::size_t j = 0; j < about.inputs.size(); ++j) {
      double value = 0.0;
      if (is_rhe) {
        value = record.inputs[i][j];
      } else if (const auto at = record.reference.find(about.inputs[j].name); at != record.reference.end()) {
        value = at->second[i];
      }
      inputs.push_back(std::isnan(value) ? 0.0 : value);
    }
    parameters.insert(parameters.end(), held.begin(), held.end());
  }
  guess.clear_multipliers();
  std::copy(held.begin(), held.end(), std::copy(state.begin(), state.end(), guess.state(0)));
  problem.structure().set_decisions(guess, inputs.data(), parameters.data());
  std::vector<double> scratch(problem.scratch_size());
  roll_out(problem, guess, scratch);
}

void start(const ProblemRecord& record, const HorizonProblem& problem, Iterate& guess) {
  if (!record.guess) {
    cold_start(record, problem, guess);
    return;
  }
  guess.clear_multipliers();
  const auto copy = [](const ProblemRecord::Rows& rows, const auto& destination_of) {
    for (std::size_t i = 0; i < rows.size(); ++i)
      std::copy(rows[i].begin(), rows[i].end(), destination_of(static_cast<int>(i)));
  };
  copy(record.guess->states, [&](int node) { return guess.state(node); });
  copy(record.guess->controls, [&](int interval) { return guess.control(interval); });
  copy(record.guess->costates, [&](int node) { return guess.costate(node); });
  copy(record.guess->state_bounds, [&](int node) { return guess.state_bound(node); });
  copy(record.guess->control_bounds, [&](int interval) { return guess.control_bound(interval); });
}

std::string solution_line(const ProblemRecord& record, const HorizonProblem& problem, const Iterate& point,
                          const Outcome& outcome) {
  const Model& model = problem.model();
  const int N = problem.intervals();
  std::string text = fmt::format("{{\"id\": {}, \"objective\": ", json(record.id).dump());
  append_number(text, outcome.objective);
  append_rows(text, "states", N + 1, model.state_count(),
              [&](int i, double* row) { std::copy_n(point.state(i), model.state_count(), row); });
  append_rows(text, "inputs", N, model.input_count(),
              [&](int i, double* row) { problem.structure().inputs_on(point, i, row); });
  if (record.kind == "rhe")
    append_rows(text, "parameters", N, model.parameter_count(),
                [&](int i, double* row) { problem.structure().parameters_on(point, i, row); });
  fmt::format_to(
      std::back_inserter(text), ", \"bounds_active\": {}, \"solver\": {}, \"status\": \"{}\", \"iterations\": {}",
      any_bound_active(problem, point), json(outcome.solver).dump(), name_of(outcome.status), outcome.iterations);
  text += ", \"kkt_residual\": ";
  append_number(text, outcome.kkt_residual);
  text += ", \"solve_time_us\": ";
  append_number(text, std::round(outcome.solve_time_us * 1e3) / 1e3);
  return text + "}";
}

}  // namespace rhec::sim
