// Control: writes, reads, builds and copies an RhcProblem.
#include <algorithm>
#include <cmath>
#include <utility>

#include "format_parts.hpp"
#include "rhec/core/control/input_rate_model.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"

namespace rhec::sim {
namespace {

std::map<std::string, double> read_named_weights(const LineValue& map) {
  std::map<std::string, double> weights;
  map.for_each([&](const std::string& name, const LineValue& weight) {
    if (!(weight.number() >= 0.0)) throw weight.mismatch("a weight of at least 0");
    weights[name] = weight.number();
  });
  return weights;
}

/// The vehicle with inputs as states, if the record has some.
std::shared_ptr<const Model> with_rates(const ProblemRecord& record, std::shared_ptr<const Model> model) {
  if (record.rates.empty()) return model;
  const ModelNames names(record, *model);
  const std::vector<Variable>& inputs = model->description().inputs;
  std::vector<int> rated;
  for (const std::string& name : record.rates) {
    const int input = ModelNames::index_of(inputs, name);
    if (input < 0)
      throw names.error("rates", fmt::format("model '{}' has no input '{}'; {}", model->description().name, name,
                                             did_you_mean(name, names_of(inputs))));
    if (!rated.empty() && input <= rated.back())
      throw names.error("rates", fmt::format("expected each input once, in the model's order: {}",
                                             fmt::join(names_of(inputs), ", ")));
    rated.push_back(input);
  }
  return std::make_shared<InputRateModel>(std::move(model), std::move(rated));
}

/// The vehicle's inputs whose rates are inputs of a model.
std::vector<std::string> rated_inputs(const Model& model) {
  std::vector<std::string> names;
  if (const auto* with = dynamic_cast<const InputRateModel*>(&model))
    for (const int input : with->rated()) names.push_back(with->vehicle().description().inputs[input].name);
  return names;
}

/// Which inputs of a model are rates, and of which states.
std::vector<RhcProblem::Rate> rates_of(const Model& model) {
  std::vector<RhcProblem::Rate> rates;
  if (const auto* with = dynamic_cast<const InputRateModel*>(&model))
    for (const int input : with->rated())
      rates.push_back({input, with->vehicle().state_count() + static_cast<int>(rates.size())});
  return rates;
}

RhcProblem::Setup control_setup_of(const ProblemRecord& record, const Model& model) {
  const ModelDescription& about = model.description();
  const ModelNames names(record, model);
  const auto N = static_cast<std::size_t>(record.intervals);
  names.check_count("initial_state", record.initial_state.size(), about.states);
  names.check_count("parameters", record.parameters.size(), about.parameters);
  names.check("reference", record.reference, {&about.states, &about.inputs});
  names.check("weights.stage", record.stage_weights, {&about.states, &about.inputs});
  names.check("weights.terminal", record.terminal_weights, {&about.states});
  names.check("bounds", record.bounds, {&about.states, &about.inputs});
  for (const auto& [name, bounds] : record.interval_bounds)
    if (ModelNames::index_of(about.inputs, name) < 0)
      throw names.error("bounds." + name, "lists of bounds are for inputs; give a number or null for each side");
  names.check("block_starts", record.block_starts, {&about.inputs});
  for (const auto& [name, values] : record.reference) {
    const bool is_state = ModelNames::index_of(about.states, name) >= 0;
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
  setup.state_weights = ModelNames::in_order(record.stage_weights, about.states);
  setup.input_weights = ModelNames::in_order(record.stage_weights, about.inputs);
  setup.terminal_weights = ModelNames::in_order(record.terminal_weights, about.states);
  names.fill_bounds(about.states, setup.state_lower, setup.state_upper);
  names.fill_bounds(about.inputs, setup.input_lower, setup.input_upper);
  for (const auto& [name, starts] : record.block_starts)
    setup.blocked_inputs.push_back(ModelNames::index_of(about.inputs, name));
  std::sort(setup.blocked_inputs.begin(), setup.blocked_inputs.end());
  setup.rates = rates_of(model);
  for (const ProblemRecord::PosedTerm& term : record.terms) {
    if (!term.made.term) throw Error(fmt::format("{}: terms that were not made; call make_terms first", record.where));
    setup.terms.push_back(term.made);
  }
  return setup;
}

ProblemRecord::Interval input_bounds(const ProblemRecord& record, const std::string& name, int interval) {
  if (const auto at = record.interval_bounds.find(name); at != record.interval_bounds.end())
    return at->second[interval];
  const auto at = record.bounds.find(name);
  return at == record.bounds.end() ? ProblemRecord::Interval{-unbounded, unbounded} : at->second;
}

/// Data and bounds of terms at every node, which have to fit the terms.
void fill_terms(const ProblemRecord& record, RhcProblem& problem) {
  for (std::size_t t = 0; t < record.terms.size(); ++t) {
    const ProblemRecord::PosedTerm& term = record.terms[t];
    const TermFunctions& functions = *problem.terms().functions();
    const auto numbers = static_cast<std::size_t>(functions.data_of(t)),
               limits = static_cast<std::size_t>(functions.limits_of(t));
    for (int i = 0; i <= record.intervals; ++i) {
      const auto node = static_cast<std::size_t>(i);
      const auto check = [&](const char* key, const std::vector<double>& row, std::size_t count) {
        if (row.size() != count)
          throw Error(at_key(record.where, fmt::format("terms[{}].{}[{}]", t, key, i),
                             fmt::format("{} numbers, expected {} for the term '{}' with these options", row.size(),
                                         count, term.made.name)));
      };
      check("data", term.data[node], numbers);
      check("lower", term.lower[node], limits);
      check("upper", term.upper[node], limits);
      std::copy_n(term.data[node].begin(), numbers, problem.terms().data(i) + functions.first_data_of(t));
      for (int k = 0; k < functions.limits_of(t); ++k) {
        const int limit = functions.place_of(t, k);
        const double least = term.lower[node][static_cast<std::size_t>(k)],
                     most = term.upper[node][static_cast<std::size_t>(k)];
        if (least > most && functions.linear()[limit] < infinity)
          throw Error(at_key(record.where, fmt::format("terms[{}].lower[{}][{}]", t, i, k),
                             fmt::format("found {:g}, expected at most the upper bound {:g}: a soft limit is not "
                                         "violated on both sides at once",
                                         least, most)));
        problem.terms().lower(i)[limit] = least;
        problem.terms().upper(i)[limit] = most;
      }
    }
  }
  problem.terms().set_price(record.limit_price);
  if (problem.terms().price() != record.limit_price)
    throw Error(at_key(record.where, "limit_price", "there is no hard limit that it could be the price of; drop it"));
}

std::vector<ProblemRecord::PosedTerm> terms_of(const RhcProblem& problem) {
  std::vector<ProblemRecord::PosedTerm> all;
  for (std::size_t t = 0; t < problem.setup().terms.size(); ++t) {
    ProblemRecord::PosedTerm& term = all.emplace_back(ProblemRecord::PosedTerm{problem.setup().terms[t], {}, {}, {}});
    const TermFunctions& functions = *problem.terms().functions();
    for (int i = 0; i <= problem.intervals(); ++i) {
      term.data.push_back(copied(problem.terms().data(i) + functions.first_data_of(t), functions.data_of(t)));
      std::vector<double>&lower = term.lower.emplace_back(), &upper = term.upper.emplace_back();
      for (int k = 0; k < functions.limits_of(t); ++k) {
        lower.push_back(problem.terms().lower(i)[functions.place_of(t, k)]);
        upper.push_back(problem.terms().upper(i)[functions.place_of(t, k)]);
      }
    }
  }
  return all;
}

/// Rows whose null stands for no bound.
ProblemRecord::Rows read_rows_of_bounds(const LineValue& rows, double none, std::size_t count) {
  ProblemRecord::Rows all;
  for (const LineValue& row : rows.items("a list of rows")) {
    std::vector<double>& to = all.emplace_back();
    for (const LineValue& item : row.items("a list of numbers")) to.push_back(item.number_or(none));
  }
  if (all.size() != count) throw rows.error(fmt::format("{} rows, expected {}: one for each node", all.size(), count));
  return all;
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
  fill_terms(record, problem);
  for (const int input : problem.setup().blocked_inputs)
    problem.set_blocks(input, begins_of(record, about.inputs[input].name).data());
  std::vector<double> scratch(problem.scratch_size());
  problem.finish(scratch);
}

// Fixed properties of a set-up.
bool fits(const RhcProblem::Setup& wanted, const RhcProblem::Setup& there) {
  return wanted.max_intervals <= there.max_intervals && wanted.substeps == there.substeps &&
         wanted.state_weights == there.state_weights && wanted.input_weights == there.input_weights &&
         wanted.terminal_weights == there.terminal_weights && wanted.state_lower == there.state_lower &&
         wanted.state_upper == there.state_upper && wanted.blocked_inputs == there.blocked_inputs &&
         wanted.rates == there.rates &&
         std::ranges::equal(wanted.terms, there.terms, {}, &NamedTerm::term, &NamedTerm::term);
}

class RhcFormat final : public ProblemFormat {
 public:
  RhcFormat()
      : ProblemFormat({.kind = "rhc",
                       .keys = {"version", "id", "problem", "model", "horizon", "initial_state", "parameters",
                                "reference", "weights", "bounds", "block_starts"},
                       .added = {{2, {"guess", "origin"}}, {3, {"rates"}}, {4, {"terms"}}, {5, {"limit_price"}}},
                       .has_interval_bounds = true}) {}

  void read(const LineValue& line, ProblemRecord& record) const override {
    record.initial_state = line["initial_state"].numbers();
    record.parameters = line["parameters"].numbers();
    line["reference"].for_each(
        [&](const std::string& name, const LineValue& values) { record.reference[name] = values.numbers(); });
    const LineValue weights = line["weights"];
    weights.allow({"stage", "terminal"});
    record.stage_weights = read_named_weights(weights["stage"]);
    record.terminal_weights = read_named_weights(weights["terminal"]);
    if (line.has("block_starts")) read_block_starts(line["block_starts"], record);
    if (line.has("rates"))
      for (const LineValue& name : line["rates"].items("a list of inputs")) record.rates.push_back(name.text());
    if (line.has("limit_price")) {
      record.limit_price = line["limit_price"].number();
      if (!(record.limit_price > 0.0)) throw line["limit_price"].mismatch("a number above 0");
    }
    if (!line.has("terms")) return;
    const auto nodes = static_cast<std::size_t>(record.intervals) + 1;
    for (const LineValue& item : line["terms"].items("a list of terms")) {
      item.allow({"name", "options", "data", "lower", "upper"});
      ProblemRecord::PosedTerm& term = record.terms.emplace_back();
      term.made.name = item["name"].text();
      term.made.options = item["options"].settings();
      term.data = item["data"].ragged(nodes, "one for each node of the horizon");
      term.lower = read_rows_of_bounds(item["lower"], -unbounded, nodes);
      term.upper = read_rows_of_bounds(item["upper"], unbounded, nodes);
    }
  }

  void write(const ProblemRecord& record, Json& line) const override {
    line["initial_state"] = list_of(record.initial_state);
    line["parameters"] = list_of(record.parameters);
    line["reference"] = map_of(record.reference, list_of);
    line["weights"] = {{"stage", map_of(record.stage_weights, number_or_null)},
                       {"terminal", map_of(record.terminal_weights, number_or_null)}};
    if (!record.rates.empty()) line["rates"] = record.rates;
    for (const ProblemRecord::PosedTerm& term : record.terms)
      line["terms"].push_back({{"name", term.made.name},
                               {"options", json_of(term.made.options)},
                               {"data", rows_of(term.data)},
                               {"lower", rows_of(term.lower)},
                               {"upper", rows_of(term.upper)}});
    if (std::isfinite(record.limit_price)) line["limit_price"] = record.limit_price;
    if (!record.block_starts.empty())
      line["block_starts"] = map_of(record.block_starts, [](const std::vector<int>& starts) { return Json(starts); });
  }

  void keep(const HorizonProblem& kept, ProblemRecord& record) const override {
    const auto& problem = as_kind<RhcProblem>(kept);
    if (record.intervals < 1) throw Error(fmt::format("{}: a control problem without an interval", record.id));
    const ModelDescription& about = problem.model().description();
    const RhcProblem::Setup& setup = problem.setup();
    const int nx = static_cast<int>(about.states.size()), nu = static_cast<int>(about.inputs.size());
    const int np = static_cast<int>(about.parameters.size());
    record.rates = rated_inputs(problem.model());
    if (setup.rates != rates_of(problem.model()))
      throw Error(fmt::format(
          "{}: the problem's rates are not those of its model; give RhcProblem::Setup::rates the inputs and "
          "states of an InputRateModel, in their order",
          record.id));
    record.terms = terms_of(problem);
    record.limit_price = problem.terms().price();
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

  std::unique_ptr<HorizonProblem> build(const ProblemRecord& record, std::shared_ptr<const Model> model,
                                        int max_intervals, std::vector<int>) const override {
    model = with_rates(record, std::move(model));
    RhcProblem::Setup setup = control_setup_of(record, *model);
    setup.max_intervals = std::max({record.intervals, max_intervals, 1});
    auto problem = std::make_unique<RhcProblem>(std::move(model), std::move(setup));
    fill(record, *problem);
    check_guess(record, *problem);
    return problem;
  }

  bool refill(const ProblemRecord& record, HorizonProblem& filled) const override {
    auto& problem = as_kind<RhcProblem>(filled);
    if (rated_inputs(problem.model()) != record.rates) return false;
    if (!fits(control_setup_of(record, problem.model()), problem.setup())) return false;
    fill(record, problem);
    check_guess(record, problem);
    return true;
  }

  ColdStart cold_start(const ProblemRecord& record, const ModelDescription& about) const override {
    ColdStart start{record.initial_state, record.parameters, {}};
    for (int i = 0; i < record.intervals; ++i)
      for (const Variable& input : about.inputs) {
        const auto at = record.reference.find(input.name);
        start.inputs.push_back(at == record.reference.end() ? 0.0 : at->second[i]);
      }
    return start;
  }

  std::unique_ptr<HorizonProblem> copy(const HorizonProblem& problem) const override {
    return std::make_unique<RhcProblem>(as_kind<RhcProblem>(problem));
  }
  void take_data(const HorizonProblem& from, HorizonProblem& to) const override {
    as_kind<RhcProblem>(to).take_data(as_kind<RhcProblem>(from));
  }
};

}  // namespace

const ProblemFormat& rhc_format() noexcept {
  static const RhcFormat format;
  return format;
}

}  // namespace rhec::sim
