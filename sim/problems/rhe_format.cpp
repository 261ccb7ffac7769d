// Estimation: writes, reads, builds and copies an RheProblem.
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "format_parts.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/model/state_noise_model.hpp"
#include "rhec/core/prior/prior.hpp"
#include "rhec/core/prior/process_model.hpp"
#include "rhec/core/qp/symmetric_eigen.hpp"

namespace rhec::sim {
namespace {

// Rounding tolerance of an information matrix, relative to the magnitudes of its terms.
constexpr double rounding_of_information = 1e-8;

void read_transitions(const LineValue& map, ProblemRecord& record) {
  map.for_each([&](const std::string& name, const LineValue& value) {
    const std::string text = value.text();
    if (text != "step" && text != "ramp") throw value.mismatch("\"step\" or \"ramp\"");
    record.transition[name] = text == "ramp" ? Transition::ramp : Transition::step;
  });
}

void read_neighbour_variances(const LineValue& map, ProblemRecord& record) {
  map.for_each([&](const std::string& name, const LineValue& list) {
    const auto starts = record.block_starts.find(name);
    if (starts == record.block_starts.end())
      throw list.error(fmt::format("there is no block_starts.{} that it could belong to", name));
    std::vector<double> variances;
    for (const LineValue& item : list.items("a list of variances, null where blocks are not linked")) {
      const double variance = item.number_or(unbounded);
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

std::vector<double> read_weights(const LineValue& list) {
  std::vector<double> weights;
  for (const LineValue& item : list.items("a list of weights")) {
    weights.push_back(item.number());
    if (!(weights.back() >= 0.0)) throw item.mismatch("a weight of at least 0");
  }
  return weights;
}

void read_block_weights(const LineValue& map, ProblemRecord& record) {
  map.for_each([&](const std::string& name, const LineValue& list) {
    const auto starts = record.block_starts.find(name);
    if (starts == record.block_starts.end())
      throw list.error(fmt::format("there is no block_starts.{} that it could belong to", name));
    std::vector<double> weights = read_weights(list);
    if (weights.size() != starts->second.size())
      throw list.error(fmt::format("{} weights, expected {}: one for each of block_starts.{}", weights.size(),
                                   starts->second.size(), name));
    record.block_weights[name] = std::move(weights);
  });
}

void read_robust(const LineValue& list, ProblemRecord& record) {
  for (const LineValue& item : list.items("a list of {outputs, delta}")) {
    item.allow({"outputs", "delta"});
    ProblemRecord::Robust robust;
    for (const LineValue& name : item["outputs"].items("a list of outputs")) robust.outputs.push_back(name.text());
    if (robust.outputs.empty()) throw item["outputs"].mismatch("at least one output");
    robust.delta = item["delta"].number_or(unbounded);
    if (!(robust.delta > 0.0)) throw item["delta"].mismatch("a number above 0, or null for a quadratic loss");
    record.robust.push_back(std::move(robust));
  }
}

/// Throws unless an information matrix is symmetric and positive semidefinite, up to rounding. Tolerances are relative
/// to the magnitudes of an entry's row and column, since the variables' units may differ by orders of magnitude.
void check_information(const LineValue& information, const ProblemRecord::Rows& rows) {
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
  if (const double least = symmetric_eigen(scaled).values[0];
      !(least >= -rounding_of_information * static_cast<double>(n)))
    throw information.error(
        fmt::format("has a negative eigenvalue ({:.3g} with the diagonal scaled to 1); expected a "
                    "positive semidefinite matrix, the inverse of a covariance",
                    least));
}

void read_processes(const LineValue& line, ProblemRecord& record) {
  std::size_t count = 0;
  line["processes"].for_each([&](const std::string& name, const LineValue& value) {
    const int states = value.integer(1);
    if (states > Prior::max_states)
      throw value.mismatch(fmt::format("a number of states from 1 to {}", Prior::max_states));
    record.processes[name] = states;
    count += ProcessModel::process_data_count(states);
  });
  constexpr std::string_view what = "for every process: 1 for a ramp or 0, F, L";
  record.data =
      line["data"].rows(static_cast<std::size_t>(record.intervals), "one for each interval of the horizon", false);
  for (const std::vector<double>& row : record.data)
    if (row.size() != count)
      throw line["data"].error(fmt::format("rows of {}, expected {}: {}", row.size(), count, what));
}

/// Measurements within the intervals, whose durations are known.
void read_between(const LineValue& list, ProblemRecord& record) {
  const std::size_t width = 1 + record.outputs.front().size();
  const std::vector<LineValue> intervals = list.items("a list of the intervals' measurements");
  if (intervals.size() != static_cast<std::size_t>(record.intervals))
    throw list.error(
        fmt::format("{} items, expected {}: one for each interval of the horizon", intervals.size(), record.intervals));
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    ProblemRecord::Rows& rows = record.between.emplace_back();
    double last = 0.0;
    for (const LineValue& item : intervals[i].items("a list of [time, outputs]")) {
      std::vector<double>& row = rows.emplace_back();
      for (const LineValue& number : item.items("a time and the outputs"))
        row.push_back(row.empty() ? number.number() : number.number_or(std::numeric_limits<double>::quiet_NaN()));
      if (row.size() != width)
        throw item.error(fmt::format("{} numbers, expected {}: a time and every output", row.size(), width));
      if (!(row.front() > last && row.front() < record.durations[i]))
        throw item.error(fmt::format("the time is {}; expected one above {} and below the interval's duration, {}",
                                     row.front(), last, record.durations[i]));
      last = row.front();
    }
  }
}

/// Of measurements that are known.
void read_relative_weights(const LineValue& map, ProblemRecord& record) {
  map.allow({"outputs", "between"});
  const std::size_t width = record.outputs.front().size();
  const auto check = [width](const LineValue& of, const ProblemRecord::Rows& rows) {
    for (const std::vector<double>& row : rows) {
      if (row.size() != width) throw of.error(fmt::format("rows of {}, expected {}: one an output", row.size(), width));
      for (const double weight : row)
        if (!(weight > 0.0)) throw of.error(fmt::format("found {}; expected weights above 0", weight));
    }
  };
  record.relative_weights = map["outputs"].rows(record.outputs.size(), "one for each node of the horizon", false);
  check(map["outputs"], record.relative_weights);
  if (!map.has("between")) return;
  const LineValue between = map["between"];
  const std::vector<LineValue> intervals = between.items("a list of the weights of the intervals' measurements");
  if (intervals.size() != record.between.size())
    throw between.error(
        fmt::format("{} items, expected {}: one for each item of `between`", intervals.size(), record.between.size()));
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    record.relative_weights_between.push_back(
        intervals[i].rows(record.between[i].size(), "one for each measurement of the interval", false));
    check(intervals[i], record.relative_weights_between.back());
  }
}

/// The vehicle with the process noise of its states, if the record has some.
std::shared_ptr<const Model> with_state_noise(const ProblemRecord& record, std::shared_ptr<const Model> model) {
  if (record.state_noise.empty() && record.blocked_noise.empty()) return model;
  const ModelNames names(record, *model);
  const std::vector<Variable>& states = model->description().states;
  const auto states_of = [&](const char* key, const std::vector<std::string>& named) {
    std::vector<int> noisy;
    for (const std::string& name : named) {
      const int state = ModelNames::index_of(states, name);
      if (state < 0)
        throw names.error(key, fmt::format("model '{}' has no state '{}'; {}", model->description().name, name,
                                           did_you_mean(name, names_of(states))));
      if (!noisy.empty() && state <= noisy.back())
        throw names.error(
            key, fmt::format("expected each state once, in the model's order: {}", fmt::join(names_of(states), ", ")));
      noisy.push_back(state);
    }
    return noisy;
  };
  std::vector<int> noisy = states_of("state_noise", record.state_noise),
                   blocked = states_of("blocked_noise", record.blocked_noise);
  for (const int state : blocked)
    if (std::ranges::count(noisy, state) > 0)
      throw names.error("blocked_noise", fmt::format("'{}' is in state_noise already; name each state once",
                                                     states[static_cast<std::size_t>(state)].name));
  return std::make_shared<StateNoiseModel>(std::move(model), std::move(noisy), std::move(blocked));
}

std::vector<std::string> state_names(const ModelDescription& about, const std::vector<int>& states) {
  std::vector<std::string> names;
  names.reserve(states.size());
  for (const int state : states) names.push_back(about.states[static_cast<std::size_t>(state)].name);
  return names;
}

/// The vehicle with its processes, if the record has some.
std::shared_ptr<const Model> with_processes(const ProblemRecord& record, std::shared_ptr<const Model> model) {
  if (record.processes.empty()) return model;
  const ModelNames names(record, *model);
  names.check("processes", record.processes, {&model->description().parameters});
  std::vector<int> counts;
  for (const Variable& parameter : model->description().parameters) {
    const auto found = record.processes.find(parameter.name);
    if (found == record.processes.end())
      throw names.error("processes." + parameter.name, "missing; say how many states its process has");
    counts.push_back(found->second);
  }
  return std::make_shared<ProcessModel>(std::move(model), std::move(counts));
}

/// Parameter -> number of states of its process.
std::map<std::string, int> process_counts(const ModelDescription& about) {
  std::map<std::string, int> counts;
  const auto& first = about.parameter_states;
  for (std::size_t j = 0; j < first.size(); ++j) {
    const std::size_t end = j + 1 < first.size() ? static_cast<std::size_t>(first[j + 1]) : about.states.size();
    counts[about.states[first[j]].name] = static_cast<int>(end) - first[j];
  }
  return counts;
}

std::vector<RobustLoss> robust_losses(const ProblemRecord& record, const ModelNames& names,
                                      const ModelDescription& about) {
  const std::vector<std::string> known = names_of(about.outputs);
  std::vector<RobustLoss> losses;
  std::set<int> taken;
  for (const ProblemRecord::Robust& robust : record.robust) {
    RobustLoss loss;
    loss.delta = robust.delta;
    for (const std::string& name : robust.outputs) {
      const int output = ModelNames::index_of(about.outputs, name);
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

RheProblem::Setup estimation_setup_of(const ProblemRecord& record, const Model& model) {
  const ModelDescription& about = model.description();
  const ModelNames names(record, model);
  names.check_count("arrival.state", record.arrival_state.size(), about.states);
  names.check_count("arrival.parameters", record.arrival_parameters.size(), about.parameters);
  names.check_count("outputs[0]", record.outputs.front().size(), about.outputs);
  if (!record.inputs.empty()) names.check_count("inputs[0]", record.inputs.front().size(), about.inputs);
  names.check_count("weights.outputs", record.output_weights.size(), about.outputs);
  names.check_count("weights.inputs", record.input_weights.size(), about.inputs);
  names.check("bounds", record.bounds, {&about.states, &about.inputs, &about.parameters});
  names.check("block_starts", record.block_starts, {&about.parameters});
  names.check("transition", record.transition, {&about.parameters});
  names.check("block_weights", record.block_weights, {&about.parameters});
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
  for (const ProblemRecord::Rows& rows : record.between)
    setup.most_between = std::max(setup.most_between, static_cast<int>(rows.size()));
  return setup;
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
    problem.set_output(
        i, {record.outputs[i].data(), record.relative_weights.empty() ? nullptr : record.relative_weights[i].data()});
  for (int i = 0; i < record.intervals; ++i) {
    problem.set_duration(i, record.durations[i]);
    std::copy(record.inputs[i].begin(), record.inputs[i].end(), problem.measured_input(i));
    if (!record.data.empty()) std::copy(record.data[i].begin(), record.data[i].end(), problem.interval_data(i));
    problem.between(i).clear();
    for (std::size_t k = 0; !record.between.empty() && k < record.between[i].size(); ++k) {
      const std::vector<double>& row = record.between[i][k];
      problem.between(i).add(row.front());
      problem.between(i).add_outputs(
          static_cast<int>(k),
          {row.data() + 1,
           record.relative_weights_between.empty() ? nullptr : record.relative_weights_between[i][k].data()});
    }
  }
  for (std::size_t j = 0; j < about.parameters.size(); ++j) {
    const std::string& name = about.parameters[j].name;
    problem.set_blocks(static_cast<int>(j), begins_of(record, name).data(),
                       is_ramp(record, name) ? Transition::ramp : Transition::step);
    const std::vector<int>& starts = record.block_starts.at(name);
    if (const auto weights = record.block_weights.find(name); weights != record.block_weights.end())
      for (std::size_t k = 0; k < starts.size(); ++k)
        if (starts[k] < record.intervals) problem.set_block_weight(starts[k], static_cast<int>(j), weights->second[k]);
    const auto variances = record.neighbour_variance.find(name);
    if (variances == record.neighbour_variance.end()) continue;
    for (std::size_t k = 0; k < starts.size(); ++k)
      if (starts[k] < record.intervals) problem.link(starts[k], static_cast<int>(j), variances->second[k]);
  }
  problem.finish();
}

bool same_losses(const std::vector<RobustLoss>& a, const std::vector<RobustLoss>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const RobustLoss& left, const RobustLoss& right) {
    return left.outputs == right.outputs && left.delta == right.delta;
  });
}

// Fixed properties of a set-up.
bool fits(const RheProblem::Setup& wanted, const RheProblem::Setup& there) {
  return wanted.most_between <= there.most_between && wanted.max_intervals <= there.max_intervals &&
         wanted.substeps == there.substeps && wanted.output_weights == there.output_weights &&
         wanted.input_weights == there.input_weights && same_losses(wanted.robust, there.robust) &&
         wanted.state_lower == there.state_lower && wanted.state_upper == there.state_upper &&
         wanted.input_lower == there.input_lower && wanted.input_upper == there.input_upper &&
         wanted.parameter_lower == there.parameter_lower && wanted.parameter_upper == there.parameter_upper;
}

/// Where all are 1, none are kept.
void keep_relative_weights(const RheProblem& problem, ProblemRecord& record) {
  const std::size_t width = record.outputs.front().size();
  bool is_any = false;
  const auto weights_of = [&](Measured measured) {
    std::vector<double> weights(width);
    for (std::size_t j = 0; j < width; ++j) {
      const auto output = static_cast<std::ptrdiff_t>(j);
      weights[j] = std::isnan(measured[output]) ? 1.0 : measured.weight(output);
      is_any = is_any || weights[j] != 1.0;
    }
    return weights;
  };
  for (int i = 0; i <= record.intervals; ++i) record.relative_weights.push_back(weights_of(problem.measured(i)));
  for (std::size_t i = 0; i < record.between.size(); ++i) {
    ProblemRecord::Rows& rows = record.relative_weights_between.emplace_back();
    for (std::size_t k = 0; k < record.between[i].size(); ++k)
      rows.push_back(weights_of(problem.between(static_cast<int>(i)).measured(static_cast<int>(k))));
  }
  if (is_any) return;
  record.relative_weights.clear();
  record.relative_weights_between.clear();
}

class RheFormat final : public ProblemFormat {
 public:
  RheFormat()
      : ProblemFormat(
            {.kind = "rhe",
             .keys = {"version", "id", "problem", "model", "horizon", "arrival", "outputs", "inputs", "weights",
                      "bounds", "block_starts"},
             .added = {{2, {"robust", "neighbour_variance", "transition", "guess", "origin", "processes", "data"}},
                       {4, {"state_noise", "blocked_noise", "block_weights", "between"}},
                       {5, {"relative_weights"}}},
             .looks_back = true,
             .may_be_empty = true,
             .finds_parameters = true}) {}

  void read(const LineValue& line, ProblemRecord& record) const override {
    const auto N = static_cast<std::size_t>(record.intervals);
    const LineValue arrival = line["arrival"], weights = line["weights"];
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
    if (line.has("between")) read_between(line["between"], record);
    if (line.has("relative_weights")) read_relative_weights(line["relative_weights"], record);
    weights.allow({"outputs", "inputs"});
    record.output_weights = read_weights(weights["outputs"]);
    record.input_weights = read_weights(weights["inputs"]);
    if (line.has("transition")) read_transitions(line["transition"], record);
    read_block_starts(line["block_starts"], record);
    if (line.has("neighbour_variance")) read_neighbour_variances(line["neighbour_variance"], record);
    if (line.has("robust")) read_robust(line["robust"], record);
    if (line.has("processes")) read_processes(line, record);
    if (line.has("block_weights")) read_block_weights(line["block_weights"], record);
    for (const auto& [key, names] :
         {std::pair{"state_noise", &record.state_noise}, std::pair{"blocked_noise", &record.blocked_noise}}) {
      if (!line.has(key)) continue;
      for (const LineValue& name : line[key].items("a list of states")) names->push_back(name.text());
    }
  }

  void write(const ProblemRecord& record, Json& line) const override {
    line["arrival"] = {{"state", list_of(record.arrival_state)},
                       {"parameters", list_of(record.arrival_parameters)},
                       {"information", rows_of(record.arrival_information)}};
    line["outputs"] = rows_of(record.outputs);
    line["inputs"] = rows_of(record.inputs);
    if (!record.between.empty()) {
      line["between"] = Json::array();
      for (const ProblemRecord::Rows& rows : record.between) line["between"].push_back(rows_of(rows));
    }
    line["weights"] = {{"outputs", list_of(record.output_weights)}, {"inputs", list_of(record.input_weights)}};
    if (!record.relative_weights.empty()) {
      Json& weights = line["relative_weights"];
      weights["outputs"] = rows_of(record.relative_weights);
      for (const ProblemRecord::Rows& rows : record.relative_weights_between)
        weights["between"].push_back(rows_of(rows));
    }
    if (!record.robust.empty()) {
      line["robust"] = Json::array();
      for (const ProblemRecord::Robust& robust : record.robust)
        line["robust"].push_back({{"outputs", robust.outputs}, {"delta", number_or_null(robust.delta)}});
    }
    line["block_starts"] = map_of(record.block_starts, [](const std::vector<int>& starts) { return Json(starts); });
    if (!record.transition.empty())
      line["transition"] = map_of(record.transition, [](Transition transition) {
        return Json(transition == Transition::ramp ? "ramp" : "step");
      });
    if (!record.neighbour_variance.empty()) line["neighbour_variance"] = map_of(record.neighbour_variance, list_of);
    if (!record.block_weights.empty()) line["block_weights"] = map_of(record.block_weights, list_of);
    if (!record.state_noise.empty()) line["state_noise"] = record.state_noise;
    if (!record.blocked_noise.empty()) line["blocked_noise"] = record.blocked_noise;
    if (record.processes.empty()) return;
    line["processes"] = map_of(record.processes, [](int states) { return Json(states); });
    line["data"] = rows_of(record.data);
  }

  void keep(const HorizonProblem& kept, ProblemRecord& record) const override {
    const auto& problem = as_kind<RheProblem>(kept);
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
    for (int i = 0; i < record.intervals; ++i) {
      ProblemRecord::Rows& rows = record.between.emplace_back();
      const BetweenNodes& between = problem.between(i);
      for (int k = 0; k < between.count(); ++k) {
        rows.push_back(copied(between.outputs(k), between.width()));
        rows.back().insert(rows.back().begin(), between.time(k));
      }
    }
    if (std::ranges::all_of(record.between, [](const ProblemRecord::Rows& rows) { return rows.empty(); }))
      record.between.clear();
    keep_relative_weights(problem, record);
    record.processes = process_counts(about);
    record.state_noise = state_names(about, about.noisy_states);
    record.blocked_noise = state_names(about, about.blocked_noises);
    for (int i = 0; i < record.intervals && !record.processes.empty(); ++i)
      record.data.push_back(copied(problem.interval_data(i), problem.model().data_count()));
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
      std::vector<double> variances, weights;
      if (problem.structure().is_ramp(j)) {
        record.transition[name] = Transition::ramp;
      } else {
        starts.push_back(0);
        variances.push_back(unbounded);
        weights.push_back(problem.block_weight(0, j));
      }
      for (int i = 0; i < record.intervals; ++i) {
        if (!problem.structure().starts_block(i, j)) continue;
        starts.push_back(i);
        // The problem stores the reciprocal. Taking the reciprocal three times gives the same bits as taking it once.
        variances.push_back(problem.link_variance(i, j));
        weights.push_back(problem.block_weight(i, j));
      }
      if (std::any_of(weights.begin(), weights.end(), [](double weight) { return weight > 0.0; }))
        record.block_weights[name] = std::move(weights);
      if (std::any_of(variances.begin(), variances.end(), [](double variance) { return std::isfinite(variance); }))
        record.neighbour_variance[name] = std::move(variances);
    }
  }

  std::unique_ptr<HorizonProblem> build(const ProblemRecord& record, std::shared_ptr<const Model> model,
                                        int max_intervals, std::vector<int> one_block) const override {
    model = with_processes(record, with_state_noise(record, std::move(model)));
    RheProblem::Setup setup = estimation_setup_of(record, *model);
    if (record.processes.empty()) setup.one_block = std::move(one_block);
    setup.max_intervals = std::max({record.intervals, max_intervals, 1});
    auto problem = std::make_unique<RheProblem>(std::move(model), std::move(setup));
    fill(record, *problem);
    check_guess(record, *problem);
    return problem;
  }

  bool refill(const ProblemRecord& record, HorizonProblem& filled) const override {
    auto& problem = as_kind<RheProblem>(filled);
    if (process_counts(problem.model().description()) != record.processes) return false;
    const ModelDescription& about = problem.model().description();
    if (state_names(about, about.noisy_states) != record.state_noise) return false;
    if (state_names(about, about.blocked_noises) != record.blocked_noise) return false;
    if (!fits(estimation_setup_of(record, problem.model()), problem.setup())) return false;
    for (const int parameter : problem.setup().one_block)
      if (!is_one_block(record, problem.model(), parameter)) return false;
    fill(record, problem);
    check_guess(record, problem);
    return true;
  }

  ColdStart cold_start(const ProblemRecord& record, const ModelDescription&) const override {
    ColdStart start{record.arrival_state, record.arrival_parameters, {}};
    for (const std::vector<double>& row : record.inputs)
      start.inputs.insert(start.inputs.end(), row.begin(), row.end());
    return start;
  }

  std::unique_ptr<HorizonProblem> copy(const HorizonProblem& problem) const override {
    return std::make_unique<RheProblem>(as_kind<RheProblem>(problem));
  }
  void take_data(const HorizonProblem& from, HorizonProblem& to) const override {
    as_kind<RheProblem>(to).take_data(as_kind<RheProblem>(from));
  }
};

}  // namespace

const ProblemFormat& rhe_format() noexcept {
  static const RheFormat format;
  return format;
}

}  // namespace rhec::sim
