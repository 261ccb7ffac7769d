// Converts problems to records and back.
#include "rhec/sim/problems/problem_record.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "format_parts.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/control/input_rate_model.hpp"
#include "rhec/core/control/slip_ahead_model.hpp"
#include "rhec/core/model/implicit_model.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/prior/process_model.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {
namespace {

ProblemRecord::Guess guess_of(const HorizonProblem& problem, const Iterate& point) {
  ProblemRecord::Guess guess;
  for (int i = 0; i <= problem.intervals(); ++i) {
    const int states = problem.state_count(i);
    guess.states.push_back(copied(point.state(i), states));
    guess.costates.push_back(copied(point.costate(i), states));
    guess.state_bounds.push_back(copied(point.state_bound(i), states));
    if (problem.capacity().limits > 0)
      guess.limit_bounds.push_back(copied(point.limit_bound(i), problem.limit_count(i)));
    if (i == problem.intervals()) break;
    guess.controls.push_back(copied(point.control(i), problem.control_count(i)));
    guess.control_bounds.push_back(copied(point.control_bound(i), problem.control_count(i)));
  }
  return guess;
}

/// Of a model that others may be made of.
bool integrates_implicitly(const Model& model) {
  if (const auto* with_rates = dynamic_cast<const InputRateModel*>(&model))
    return integrates_implicitly(with_rates->vehicle());
  if (const auto* with_processes = dynamic_cast<const ProcessModel*>(&model))
    return integrates_implicitly(with_processes->vehicle());
  if (const auto* ahead = dynamic_cast<const SlipAheadModel*>(&model)) return integrates_implicitly(ahead->vehicle());
  return is_implicit(model);
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

std::int64_t ProblemRecord::first_interval() const {
  return problem_format(kind).traits().looks_back ? step - intervals : step;
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
  record.is_implicit = integrates_implicitly(problem.model());
  problem_format(record.kind).keep(problem, record);
  if (guess) record.guess = guess_of(problem, *guess);
  return record;
}

std::vector<int> one_block_parameters(std::span<const ProblemRecord> records, const Model& model) {
  std::vector<int> found;
  for (int j = 0; j < model.parameter_count(); ++j)
    if (std::ranges::all_of(records, [&](const ProblemRecord& record) { return is_one_block(record, model, j); }))
      found.push_back(j);
  return found;
}

std::shared_ptr<const Model> as_integrated(const ProblemRecord& record, std::shared_ptr<const Model> model) {
  if (record.is_implicit == is_implicit(*model)) return model;
  if (!record.is_implicit) return dynamic_cast<const ImplicitModel&>(*model).vehicle();
  return std::make_shared<const ImplicitModel>(std::move(model));
}

void make_terms(std::span<ProblemRecord> records, const Host& host) {
  std::map<std::string, std::shared_ptr<const Term>> made;
  for (ProblemRecord& record : records)
    for (std::size_t k = 0; k < record.terms.size(); ++k) {
      NamedTerm& wanted = record.terms[k].made;
      std::shared_ptr<const Term>& term = made[wanted.name + json_text(wanted.options)];
      try {
        if (!term) term = host.make_term(wanted.name, wanted.options);
      } catch (const Error& mistake) {
        throw Error(at_key(record.where, fmt::format("terms[{}]", k), mistake.what()));
      }
      wanted.term = term;
    }
}

std::unique_ptr<HorizonProblem> build(const ProblemRecord& record, std::shared_ptr<const Model> model,
                                      int max_intervals, std::vector<int> one_block) {
  return problem_format(record.kind)
      .build(record, as_integrated(record, std::move(model)), max_intervals, std::move(one_block));
}

bool refill(const ProblemRecord& record, HorizonProblem& problem) {
  return record.kind == problem.kind() && record.is_implicit == integrates_implicitly(problem.model()) &&
         problem_format(record.kind).refill(record, problem);
}

void cold_start(const ProblemRecord& record, const HorizonProblem& problem, Iterate& guess) {
  ProblemFormat::ColdStart start = problem_format(record.kind).cold_start(record, problem.model().description());
  for (double& input : start.inputs)
    if (std::isnan(input)) input = 0.0;
  std::vector<double> parameters;
  for (int i = 0; i < record.intervals; ++i)
    parameters.insert(parameters.end(), start.parameters.begin(), start.parameters.end());
  guess.clear_multipliers();
  std::copy(start.parameters.begin(), start.parameters.end(),
            std::copy(start.state.begin(), start.state.end(), guess.state(0)));
  problem.structure().set_decisions(guess, start.inputs.data(), parameters.data());
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
  copy(record.guess->limit_bounds, [&](int node) { return guess.limit_bound(node); });
}

}  // namespace rhec::sim
