#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/shift.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/csv.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rhec/sim/problems/problem_file.hpp"

namespace rhec::apps {
namespace {

using sim::Outcome;
using sim::ProblemRecord;

struct SolveArguments {
  std::string problems;
  std::string solver;
  std::vector<std::string> assignments;
  bool sequence = false;
  bool cold = false;
  bool verbose = false;
  std::string out;
  std::vector<std::filesystem::path> plugin_path;
};

/// The models of the records: one object for all records with the same model and options.
class Models {
 public:
  explicit Models(const Host& host) : host_(&host) {}

  std::shared_ptr<const Model> of(const ProblemRecord& record) {
    const std::string key = record.model + (record.is_implicit ? " implicit " : " ") + key_of(record.model_options);
    std::shared_ptr<const Model>& model = made_[key];
    try {
      if (!model) model = sim::as_integrated(record, host_->make_model(record.model, record.model_options));
    } catch (const Error& mistake) {
      const std::string text = mistake.what();  // errors in options begin with a place, errors in the name do not
      throw text.starts_with(record.where) ? mistake : Error(fmt::format("{}: model: {}", record.where, text));
    }
    return model;
  }

 private:
  static std::string key_of(const Settings& settings) {
    std::string key = settings.text();
    for (const Settings& item : settings.items()) key += "[" + key_of(item);
    for (const auto& [name, value] : settings.members()) key += "{" + name + ":" + key_of(value);
    return key;
  }

  const Host* host_;
  std::map<std::string, std::shared_ptr<const Model>> made_;
};

/// A solver and the problem it was set up for; solves one record after the other.
class Bench {
 public:
  Bench(std::string name, std::shared_ptr<Solver> solver, bool cold)
      : name_(std::move(name)), solver_(std::move(solver)), cold_(cold) {}

  /// Solves the problem independently of others, from its initial guess or a cold start.
  std::string solve_alone(const ProblemRecord& record, const std::shared_ptr<const Model>& model, Outcome& outcome) {
    load(record, model, record.intervals);
    begin(record);
    outcome = solve(point_);
    return sim::solution_line(record, *problem_, point_, outcome);
  }

  /// Solves the next problem of a sequence, starting from the previous solution. A controller is evaluated by the
  /// effect of its inputs, so its states are simulated: otherwise defects could lower the objective. An estimator's
  /// states are kept as they are.
  std::string solve_next(const ProblemRecord& record, const std::shared_ptr<const Model>& model, int max_intervals,
                         Outcome& outcome) {
    if (last_first_) shifter_->take(*problem_, point_);
    load(record, model, max_intervals);
    const std::int64_t first = record.first_interval();
    const auto steps = last_first_ ? std::clamp<std::int64_t>(first - *last_first_, -1, 1 << 20) : -1;
    if (!shifter_->apply(static_cast<int>(steps), *problem_, point_)) begin(record);
    outcome = solve(point_);
    last_first_.reset();
    if (is_usable(outcome.status)) last_first_ = first;
    reported_ = point_;
    if (problem_->can_roll_out()) roll_out(*problem_, reported_, scratch_);
    outcome.objective = problem_->evaluate(reported_, nullptr, scratch_);
    return sim::solution_line(record, *problem_, reported_, outcome);
  }

 private:
  void begin(const ProblemRecord& record) {
    solver_->reset();
    if (cold_) {
      sim::cold_start(record, *problem_, point_);
    } else {
      sim::start(record, *problem_, point_);
    }
  }

  void load(const ProblemRecord& record, const std::shared_ptr<const Model>& model, int max_intervals) {
    if (problem_ && problem_->shared_model() == model && sim::refill(record, *problem_)) {
      check(record);
      return;
    }
    problem_ = sim::build(record, model, max_intervals);
    check(record);
    solver_->setup(*problem_);
    point_ = Iterate(problem_->capacity());
    qp_ = StageQp(problem_->capacity());
    scratch_.assign(problem_->scratch_size(), 0.0);
    shifter_.emplace(*problem_);
    last_first_.reset();
  }

  void check(const ProblemRecord& record) const {
    if (const std::string reason = solver_->why_not(*problem_); !reason.empty())
      throw Error(fmt::format("{}: {}: solver '{}' cannot take this problem: {}; choose another one of 'rhec plugins'",
                              record.where, record.id, name_, reason));
  }

  Outcome solve(Iterate& point) {
    const auto start = Clock::now();
    solver_->prepare(point);
    const Report report = solver_->solve(point);
    const double time = microseconds_since(start);
    Outcome outcome;
    outcome.solver = name_;
    outcome.status = report.status;
    outcome.iterations = report.iterations;
    // The same number that a live solve reports; bad input has none, so the point is evaluated.
    outcome.objective =
        report.status == Status::bad_input ? problem_->evaluate(point, nullptr, scratch_) : report.objective;
    outcome.kkt_residual = kkt_residual(*problem_, point, qp_, scratch_).largest();
    outcome.solve_time_us = time;
    return outcome;
  }

  std::string name_;
  std::shared_ptr<Solver> solver_;
  bool cold_;
  std::unique_ptr<HorizonProblem> problem_;
  Iterate point_, reported_;
  StageQp qp_;
  std::vector<double> scratch_;
  std::optional<GuessShifter> shifter_;
  std::optional<std::int64_t> last_first_;  ///< start of the window of `point_`, if that can serve as a guess
};

/// The longest horizon of each sequence. Throws Error if the steps of a sequence do not increase.
std::map<std::string, int> longest_of_each(const std::vector<ProblemRecord>& records) {
  std::map<std::string, int> longest;
  std::map<std::string, const ProblemRecord*> last;
  for (const ProblemRecord& record : records) {
    if (record.step < 0)
      throw Error(
          fmt::format("{}: id: '{}' has no step; --sequence expects ids such as run/rhe/19", record.where, record.id));
    const ProblemRecord*& before = last[record.prefix];
    if (before && before->step >= record.step)
      throw Error(fmt::format("{}: id: step {} comes after step {} ({}); --sequence expects steps that increase",
                              record.where, record.step, before->step, before->where));
    before = &record;
    int& intervals = longest[record.prefix];
    intervals = std::max(intervals, record.intervals);
  }
  return longest;
}

/// The data of the summary for one id prefix.
struct Group {
  std::map<std::string, int> statuses;
  std::vector<double> iterations, times;

  void add(const Outcome& outcome) {
    ++statuses[name_of(outcome.status)];
    iterations.push_back(outcome.iterations);
    times.push_back(outcome.solve_time_us);
  }
};

std::shared_ptr<Solver> make_solver(const Host& host, const std::string& name, const Settings& options) {
  try {
    return host.make_solver(name, options);
  } catch (const Error& mistake) {
    const std::string text = mistake.what();  // errors in options begin with a place
    throw text.starts_with("--set ") ? mistake : Error(fmt::format("--solver {}: {}", name, text));
  }
}

/// The file for the solutions, if not standard output. Checked before solving, which may take long.
class Destination {
 public:
  explicit Destination(const std::string& out) {
    if (out.empty()) return;
    const std::filesystem::path file = std::filesystem::absolute(out);
    if (std::filesystem::is_directory(file))
      throw Error(fmt::format("--out {}: is a folder; give the name of a file", out));
    folder_.emplace(file.parent_path());
    name_ = file.filename().string();
  }
  bool is_file() const { return folder_.has_value(); }
  void commit(const std::string& lines) {
    folder_->write(name_, lines);
    folder_->commit();
  }

 private:
  std::optional<sim::OutputFolder> folder_;
  std::string name_;
};

void print_summary(const std::map<std::string, Group>& groups) {
  std::size_t width = 8;
  for (const auto& [prefix, group] : groups) width = std::max(width, prefix.size());
  fmt::print(stderr, "{:<{}}  {:>8}  {:>14}  {:>14}  {:>14}  {}\n", "PROBLEMS", width, "COUNT", "ITER MED/MAX",
             "TIME MED [us]", "TIME P99 [us]", "STATUS");
  for (const auto& [prefix, group] : groups) {
    std::string statuses;
    for (const auto& [status, count] : group.statuses)
      statuses += fmt::format("{}{} {}", statuses.empty() ? "" : ", ", count, status);
    const sim::Spread iterations = sim::spread_of(group.iterations), times = sim::spread_of(group.times);
    fmt::print(stderr, "{:<{}}  {:>8}  {:>14}  {:>14.1f}  {:>14.1f}  {}\n", prefix, width, group.times.size(),
               fmt::format("{:g}/{:g}", iterations.median, iterations.max), times.median, times.p99, statuses);
  }
}

std::string read_standard_input() {
  return {std::istreambuf_iterator<char>(std::cin), std::istreambuf_iterator<char>()};
}

void print_line(const std::string& line) {
  if (std::fwrite(line.data(), 1, line.size(), stdout) != line.size() || std::fputc('\n', stdout) == EOF ||
      std::fflush(stdout) != 0)
    throw Error("standard output: cannot be written; mend what it goes to, e.g. a full disk");
}

int solve(const SolveArguments& arguments) {
  const bool piped = arguments.problems == "-";
  const std::string name = piped ? "standard input" : arguments.problems;
  const std::string text = piped ? read_standard_input() : sim::read_text(arguments.problems);
  std::vector<ProblemRecord> records = sim::read_problems(text, name);
  if (records.empty()) throw Error(fmt::format("{}: no problem in it; expected one on each line", name));
  std::map<std::string, int> longest;
  if (arguments.sequence) longest = longest_of_each(records);

  const Host host = examined_host(arguments.plugin_path);
  Settings options;
  apply_assignments(options, arguments.assignments);
  Destination destination(arguments.out);
  sim::make_terms(records, host);
  Models models(host);
  std::map<std::string, Bench> benches;  // one for all, or one per sequence
  std::map<std::string, Group> groups;
  std::string lines;
  bool all_usable = true;
  for (const ProblemRecord& record : records) {
    const std::string key = arguments.sequence ? record.prefix : std::string();
    auto at = benches.find(key);
    if (at == benches.end())
      at = benches.emplace(key, Bench(arguments.solver, make_solver(host, arguments.solver, options), arguments.cold))
               .first;
    Outcome outcome;
    const std::string line = arguments.sequence
                                 ? at->second.solve_next(record, models.of(record), longest.at(record.prefix), outcome)
                                 : at->second.solve_alone(record, models.of(record), outcome);
    all_usable = all_usable && is_usable(outcome.status);
    groups[record.prefix].add(outcome);
    if (destination.is_file()) {
      lines += line + "\n";
    } else {
      print_line(line);
    }
  }
  if (destination.is_file()) destination.commit(lines);
  if (arguments.verbose || isatty(STDERR_FILENO)) print_summary(groups);
  return all_usable ? exit_fine : exit_not_solved;
}

}  // namespace

void add_solve(Program& program) {
  auto arguments = std::make_shared<SolveArguments>();
  Command command = program.add(
      "solve", "Solves the problems of a file, one a line, each alone; writes one solution a line.",
      "A solve begins at the line's guess, where it has one, and otherwise (or with --cold) at a simulation with the\n"
      "measured or the reference inputs.\n\n"
      "With --sequence the lines of one id prefix (run/rhe of run/rhe/19) are a sequence over time: the guess is the\n"
      "solution before, shifted by the steps between them. States and objective are then those that follow from the\n"
      "inputs by simulation in control; an estimate is reported as it is, defects and all.\n\n"
      "The exit code is 3 where the status of a line says that its solution is not usable.\n\n"
      "Examples:\n"
      "  rhec solve problems.jsonl --solver gn_rti --set mode=converge --out solutions.jsonl\n"
      "  head -1 problems.jsonl | rhec solve - --solver gn_rti\n"
      "  rhec solve problems.jsonl --solver gn_rti --sequence --verbose > solutions.jsonl",
      [arguments] { return solve(*arguments); });
  command.add("problems", arguments->problems, "a file of problems; - for standard input")
      .required()
      .value("PROBLEMS.jsonl");
  command.add("--solver", arguments->solver, "a solver of 'rhec plugins'").required().value("NAME");
  add_assignments(command, arguments->assignments, "an option of the solver");
  command.add_flag("--sequence", arguments->sequence, "warm starts along each id prefix");
  command.add_flag("--cold", arguments->cold, "pass over the guesses of the file");
  command.add("--out", arguments->out, "write there, whole or not at all, instead of to standard output").value("FILE");
  command.add_flag("--verbose", arguments->verbose, "print a summary even where standard error is no terminal");
  add_plugin_path(command, arguments->plugin_path);
}

}  // namespace rhec::apps
