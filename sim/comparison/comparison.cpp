#include "rhec/sim/comparison/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "accuracy.hpp"
#include "assessment.hpp"
#include "bench.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/sim/problems/problem_format.hpp"

namespace rhec::sim {
namespace {

// Default number of problems of each kind: enough for a 99th percentile.
constexpr std::int64_t wanted_problems = 400;

/// The recorded problems by kind, in the order in which a loop first solves them: estimation, then control.
using Records = std::vector<std::pair<std::string, std::vector<Recorded>>>;

std::vector<Recorded>& of_kind(Records& records, std::string_view kind) {
  const auto at = std::ranges::find(records, kind, &Records::value_type::first);
  return at != records.end() ? at->second : records.emplace_back(kind, std::vector<Recorded>{}).second;
}

Settings section_of(const Backend& backend, const Settings& options) {
  Settings section = Settings::map(options.origin());
  section.add("name", Settings::scalar(backend.solver));
  for (const auto& [key, value] : options.members()) section.add(key, value);
  return section;
}

/// The scenario of a seed, with a backend as the solver of both loops.
Scenario scenario_with(const Host& host, Settings settings, std::int64_t seed, const Backend& backend,
                       const Settings& estimator_options, const Settings& controller_options) {
  settings.set("seed", Settings::scalar(std::to_string(seed)));
  settings.set("estimator.solver", section_of(backend, estimator_options));
  settings.set("controller.solver", section_of(backend, controller_options));
  return {host, settings};
}

/// Shared by all parts of a comparison.
struct Task {
  const Host& host;
  const Settings& scenario;
  const ComparisonOptions& options;
  std::vector<std::int64_t> seeds;
  double work = 1.0, done = 0.0;  // in units of about equal effort

  void show(double share_of_piece) const {
    if (options.progress) options.progress(std::min(1.0, (done + share_of_piece) / work));
  }
  void end_piece() {
    done += 1.0;
    show(0.0);
  }
};

// ---- the problems

/// Runs the reference with one seed and adds the problems of every n-th step.
RunSummary record(const Task& task, std::int64_t seed, int every, Records& records) {
  const Backend& reference = task.options.reference;
  const Scenario scenario =
      scenario_with(task.host, task.scenario, seed, reference, reference.options, reference.options);
  std::exception_ptr failure;
  LoopHooks hooks;
  hooks.progress = [&](double share) { task.show(share); };
  hooks.solved = [&](std::int64_t step, const HorizonProblem& problem, const Iterate& guess, const Iterate& result,
                     const Report& report) {
    if (failure || step % every != 0) return;
    try {
      Recorded kept;
      kept.place = {seed, step};
      kept.problem = problem_format(problem.kind()).copy(problem);
      kept.guess = guess;
      kept.reference = result;
      kept.reference_is_usable = is_usable(report.status);
      of_kind(records, problem.kind()).push_back(std::move(kept));
    } catch (const std::exception&) {
      failure = std::current_exception();  // a solver must not throw
    }
  };
  const RunLog log = run_closed_loop(scenario, hooks);
  if (failure) std::rethrow_exception(failure);
  return summarise(log, scenario);
}

/// The smallest n for which every n-th step gives at most the wanted number of problems, if all seeds are like this
/// one.
int thinning_for(const Records& first_seed, std::size_t seeds) {
  std::int64_t most = 0;
  for (const auto& [kind, records] : first_seed) most = std::max<std::int64_t>(most, records.size());
  return static_cast<int>((most * static_cast<std::int64_t>(seeds) + wanted_problems - 1) / wanted_problems);
}

// ---- the two parts

/// Final options of each backend, by kind.
using Tuned = std::map<std::string, std::vector<Settings>>;

SameProblems solve_same_problems(Task& task, std::string_view kind, const std::vector<Recorded>& records,
                                 const std::vector<Settings>& options, SameProblems result) {
  const std::vector<Backend>& backends = task.options.backends;
  const std::size_t count = backends.size();
  std::vector<Bench> benches;
  for (std::size_t b = 0; b < count; ++b) benches.emplace_back(task.host, backends[b], options[b]);
  Assessor assessor;
  std::vector<Iterate> points(count + 1);  // the reference's comes last
  std::vector<Answer> answers(count + 1);
  std::vector<std::uint8_t> has_point(count + 1);
  for (std::size_t p = 0; p < records.size(); ++p) {
    const Recorded& record = records[p];
    assessor.begin(*record.problem);
    std::fill(has_point.begin(), has_point.end(), 0);
    std::vector<std::uint8_t> taken(count);
    // The first backend rotates from problem to problem, so that none always runs after the same load.
    for (std::size_t turn = 0; turn < count; ++turn) {
      const std::size_t b = (p + turn) % count;
      BackendAnswers& mine = result.backends[b];
      if (const std::string reason = benches[b].why_not(record); !reason.empty()) {
        if (mine.refused++ == 0) mine.refusal = reason;
        continue;
      }
      assessor.warm_up(record.guess);
      answers[b] = benches[b].solve(record, points[b]);
      taken[b] = 1;
      has_point[b] = answers[b].usable;
    }
    points[count] = record.reference;
    answers[count] = {};
    has_point[count] = record.reference_is_usable && is_finite(*record.problem, record.reference);

    std::size_t most_accurate = count + 1;
    for (std::size_t b = 0; b <= count; ++b) {
      if (b < count && !taken[b]) continue;
      answers[b].kkt = assessor.kkt_of(points[b], answers[b]);
      if (has_point[b] && (most_accurate > count || answers[b].kkt < answers[most_accurate].kkt)) most_accurate = b;
    }
    std::size_t best = count + 1;
    std::vector<Assessor::Verdict> verdicts(count + 1);
    if (most_accurate <= count) {
      const Iterate prices = points[most_accurate];
      for (std::size_t b = 0; b <= count; ++b) {
        if (!has_point[b]) continue;
        assessor.make_assessed(points[b]);
        verdicts[b] = assessor.verdict_on(points[b], prices);
        if (verdicts[b].is_feasible() && (best > count || verdicts[b].charged < verdicts[best].charged)) best = b;
      }
    }
    if (best > count) ++result.without_best;
    for (std::size_t b = 0; b < count; ++b) {
      if (!taken[b]) continue;
      Answer& answer = answers[b];
      if (has_point[b]) {
        answer.objective = verdicts[b].objective;
        answer.violation = verdicts[b].violation;
        if (best <= count) {
          answer.gap = (verdicts[b].charged - verdicts[best].charged) / std::max(1.0, std::abs(verdicts[best].charged));
          answer.distance = assessor.distance(points[b], points[best]);
        }
      } else {
        answer.objective = std::numeric_limits<double>::quiet_NaN();
      }
      ++result.backends[b].statuses[name_of(answer.status)];
      result.backends[b].answers.push_back(answer);
      result.backends[b].taken.push_back(p);
    }
    task.show(static_cast<double>(p + 1) / static_cast<double>(records.size()));
  }
  result.kind = kind;
  for (const Recorded& record : records) result.problems.push_back(record.place);
  return result;
}

BackendRuns drive(Task& task, std::size_t index, const Comparison& comparison, const Tuned& tuned) {
  const Backend& backend = task.options.backends[index];
  BackendRuns result;
  for (const SameProblems& same : comparison.problems) {
    if (const BackendAnswers& answers = same.backends[index]; answers.refused > 0)
      result.refusal = fmt::format("{} problems: {}", same.kind == "rhe" ? "estimation" : "control", answers.refusal);
  }
  const auto options_for = [&](const std::string& kind) {
    const auto at = tuned.find(kind);
    return at == tuned.end() ? backend.options : at->second[index];
  };
  for (const std::int64_t seed : task.seeds) {
    if (result.refusal.empty()) {
      const Scenario scenario =
          scenario_with(task.host, task.scenario, seed, backend, options_for("rhe"), options_for("rhc"));
      LoopHooks hooks;
      hooks.progress = [&](double share) { task.show(share); };
      result.runs.push_back(summarise(run_closed_loop(scenario, hooks), scenario));
    }
    task.end_piece();
  }
  return result;
}

}  // namespace

bool Comparison::all_usable() const {
  const auto completed = [](const RunSummary& run) { return run.completed; };
  const auto answered = [](const BackendAnswers& backend) {
    return backend.refused == 0 && std::all_of(backend.answers.begin(), backend.answers.end(),
                                               [](const Answer& answer) { return answer.usable; });
  };
  const auto all_answered = [&](const SameProblems& same) {
    return std::all_of(same.backends.begin(), same.backends.end(), answered);
  };
  const auto all_completed = [&](const BackendRuns& backend) {
    return backend.refusal.empty() && std::all_of(backend.runs.begin(), backend.runs.end(), completed);
  };
  return std::all_of(reference_runs.begin(), reference_runs.end(), completed) &&
         std::all_of(problems.begin(), problems.end(), all_answered) &&
         std::all_of(loops.begin(), loops.end(), all_completed);
}

Spread spread_of(const std::vector<Answer>& answers, double Answer::*number) {
  std::vector<double> values;
  values.reserve(answers.size());
  for (const Answer& answer : answers) values.push_back(answer.*number);
  return spread_of(std::move(values));
}

Spread spread_of(const std::vector<Answer>& answers, int Answer::*number) {
  std::vector<double> values;
  values.reserve(answers.size());
  for (const Answer& answer : answers) values.push_back(answer.*number);
  return spread_of(std::move(values));
}

Mean paired_mean(const std::vector<RunSummary>& runs, const std::vector<RunSummary>& others,
                 const std::function<double(const RunSummary&)>& number) {
  Mean result;
  const auto count = static_cast<double>(runs.size());
  for (const RunSummary& run : runs) result.mean += number(run) / count;
  result.difference = result.standard_error = std::numeric_limits<double>::quiet_NaN();
  if (runs.size() != others.size()) return result;
  result.difference = 0.0;
  for (std::size_t r = 0; r < runs.size(); ++r) result.difference += (number(runs[r]) - number(others[r])) / count;
  double squares = 0.0;
  for (std::size_t r = 0; r < runs.size(); ++r)
    squares += std::pow(number(runs[r]) - number(others[r]) - result.difference, 2);
  result.standard_error = std::sqrt(squares / (count - 1.0) / count);
  return result;
}

Comparison compare(const Host& host, const Settings& scenario, const ComparisonOptions& options) {
  if (options.backends.empty()) throw Error("compare: no backend given; expected at least one");
  Comparison result;
  Task task{host, scenario, options, {}};
  {
    const Backend& reference = options.reference;
    const Scenario first(host, scenario);
    result.scenario = first.options().name;
    for (int s = 0; s < options.seeds; ++s) task.seeds.push_back(std::int64_t{first.options().seed} + s);
    if (task.seeds.back() > std::numeric_limits<int>::max())
      throw Error(fmt::format("compare: seed {} is too large; the scenario's seed and --seeds must give seeds up to {}",
                              task.seeds.back(), std::numeric_limits<int>::max()));
    host.make_solver(reference.solver, reference.options);  // reports invalid options before anything runs
    for (const Backend& backend : options.backends) host.make_solver(backend.solver, backend.options);
  }
  const auto seeds = static_cast<double>(task.seeds.size()), count = static_cast<double>(options.backends.size());
  // Reference runs; then tightening and solving for each kind; then closed-loop runs.
  task.work = seeds + 2.0 * ((options.accuracy ? count : 0.0) + 1.0) + (options.closed_loop ? count * seeds : 0.0);

  Records records;
  result.every = std::max(1, options.every);
  for (const std::int64_t seed : task.seeds) {
    result.reference_runs.push_back(record(task, seed, result.every, records));
    if (options.every < 1 && seed == task.seeds.front()) {
      result.every = std::max(1, thinning_for(records, task.seeds.size()));
      for (auto& [kind, recorded] : records)
        std::erase_if(recorded, [&](const Recorded& each) { return each.place.step % result.every != 0; });
    }
    task.end_piece();
  }

  Tuned tuned;
  for (const auto& [kind, recorded] : records) {
    SameProblems same;
    same.backends.resize(options.backends.size());
    std::vector<Settings>& settings = tuned[kind];
    for (std::size_t b = 0; b < options.backends.size(); ++b) {
      const Backend& backend = options.backends[b];
      settings.push_back(backend.options);
      if (!options.accuracy) continue;
      settings.back() = tighten(host, backend, *options.accuracy, recorded, same.backends[b]);
      task.end_piece();
    }
    result.problems.push_back(solve_same_problems(task, kind, recorded, settings, std::move(same)));
    task.end_piece();
  }
  result.seeds = task.seeds;
  result.accuracy = options.accuracy;
  result.reference = options.reference;
  result.backends = options.backends;
  if (options.closed_loop)
    for (std::size_t b = 0; b < options.backends.size(); ++b) result.loops.push_back(drive(task, b, result, tuned));
  task.done = task.work;
  task.show(0.0);
  return result;
}

}  // namespace rhec::sim
