#include <unistd.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "output.hpp"
#include "progress.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/report/sweep_table.hpp"
#include "rhec/sim/store/sweep_store.hpp"
#include "rhec/sim/study/sweep.hpp"
#include "rhec/sim/study/sweep_runner.hpp"
#include "stop_request.hpp"
#include "sweep_ranks.hpp"

namespace rhec::apps {
namespace {

struct SweepArguments {
  std::string sweep, out;
  int threads = 0;
  bool yes = false, dry_run = false, json = false;
  std::vector<std::filesystem::path> plugin_path;
};

/// Larger grids need confirmation, and are checked for equal runs only while they run.
constexpr std::int64_t many_runs = 1'000'000;

/// Asks for confirmation on a terminal. Throws Error without a terminal, or if the answer is not yes.
void confirm(const sim::Sweep& sweep, const std::string& file, bool yes) {
  if (yes || sweep.count() <= many_runs) return;
  if (isatty(STDIN_FILENO) != 0 && isatty(STDERR_FILENO) != 0) {
    fmt::print(stderr, "{}: the grid has {} runs. Begin? [y/N] ", file, sweep.count());
    std::fflush(stderr);
    std::string answer;
    std::getline(std::cin, answer);
    if (answer == "y" || answer == "Y" || answer == "yes") return;
  }
  throw Error(fmt::format("{}: the grid has {} runs, more than {}; make it smaller, or begin it with --yes", file,
                          sweep.count(), many_runs));
}

std::string counted(std::int64_t count, const std::string& word) {
  return fmt::format("{} {}{}", count, word, count == 1 ? "" : "s");
}

/// What does not fit into a terminal is in the database.
constexpr std::size_t most_rows = 20, widest_value = 24;

/// What came out, setting by setting, the best first.
void print_table(const sim::SweepTable& table) {
  if (table.measures.empty()) return;
  std::vector<std::vector<std::string>> rows{table.keys};
  rows.front().insert(rows.front().end(), {"RUNS"});
  for (const std::string& measure : table.measures) rows.front().push_back(measure);
  for (const sim::SweepTable::Row& row : table.rows) {
    if (rows.size() > most_rows) break;
    rows.emplace_back();
    for (const std::string& value : row.values)
      rows.back().push_back(value.size() > widest_value ? value.substr(0, widest_value - 1) + "~" : value);
    rows.back().push_back(row.completed == row.runs ? fmt::format("{}", row.runs)
                                                    : fmt::format("{} of {}", row.completed, row.runs));
    for (const double mean : row.means) rows.back().push_back(std::isnan(mean) ? "-" : fmt::format("{:.4g}", mean));
  }
  std::vector<std::size_t> widths(rows.front().size());
  for (const auto& row : rows)
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  fmt::print("\nMean absolute errors of what the database has, the least of {} first:\n", table.measures.front());
  for (const auto& row : rows) {
    for (std::size_t c = 0; c < row.size(); ++c) fmt::print("{}{:>{}}", c == 0 ? "" : "  ", row[c], widths[c]);
    fmt::print("\n");
  }
  if (table.rows.size() > most_rows) fmt::print("and {} settings more\n", table.rows.size() - most_rows);
}

sim::Json json_of(const sim::SweepTable& table) {
  sim::Json settings = sim::Json::array();
  for (const sim::SweepTable::Row& row : table.rows) {
    sim::Json keys = sim::Json::object(), means = sim::Json::object();
    for (std::size_t i = 0; i < table.keys.size(); ++i) keys[table.keys[i]] = row.values[i];
    for (std::size_t i = 0; i < table.measures.size(); ++i) means[table.measures[i]] = row.means[i];
    settings.push_back({{"keys", keys}, {"runs", row.runs}, {"completed", row.completed}, {"mae", means}});
  }
  return settings;
}

/// What was done, as text or JSON.
void print_results(const sim::Sweep& sweep, const sim::SweepProgress& done, std::int64_t there, std::int64_t left,
                   const std::filesystem::path& file, bool json) {
  const sim::SweepTable table =
      done.made + there > 0 ? sim::sweep_table(sim::read_sweep_runs(file)) : sim::SweepTable();
  if (json) {
    sim::Json statuses = sim::Json::object();
    for (const auto& [status, count] : done.statuses) statuses[name_of(status)] = count;
    const sim::Json all{{"name", sweep.name()}, {"made", done.made},       {"there_before", there},     {"left", left},
                        {"statuses", statuses}, {"seconds", done.seconds}, {"settings", json_of(table)}};
    print_json(all.dump(), file);
    return;
  }
  fmt::print("{}: {} made in {:.1f} s", sweep.name(), counted(done.made, "run"), done.seconds);
  if (done.made > 0) fmt::print(" ({:.1f} a second)", static_cast<double>(done.made) / done.seconds);
  if (there > 0) fmt::print(", {} there before", there);
  fmt::print("\n");
  for (const auto& [status, count] : done.statuses) fmt::print("  {:>9} {}\n", count, name_of(status));
  print_table(table);
  if (left > 0) fmt::print("stopped with {} still to make; the same command goes on there\n", counted(left, "run"));
  fmt::print("\ndatabase: {}\n", file.string());
}

/// Prints what was done and returns the exit code; `there` is how many runs the database already had.
int tell(const sim::Sweep& sweep, const sim::SweepProgress& done, std::int64_t there, const std::filesystem::path& file,
         bool json) {
  const std::int64_t left = done.total - there - done.made;
  print_results(sweep, done, there, left, file, json);
  const bool all_completed = std::all_of(done.statuses.begin(), done.statuses.end(),
                                         [](const auto& entry) { return entry.first == sim::RunStatus::completed; });
  return left > 0 || !all_completed ? exit_not_solved : exit_fine;
}

/// The work of all ranks but the first.
int serve(const SweepArguments& arguments, const Host& host, SweepRanks& ranks, int threads) {
  std::optional<sim::Sweep> sweep;
  std::string problem;
  try {
    sweep.emplace(sim::Sweep::from_file(arguments.sweep));
  } catch (const Error& mistake) {  // reported by rank 0, once
    problem = mistake.what();
  }
  ranks.serve(host, sweep, problem, threads);
  return exit_fine;
}

int sweep(const SweepArguments& arguments) {
  const Host host = examined_host(arguments.plugin_path);
  const int rank_count = started_ranks();
  const std::unique_ptr<SweepRanks> ranks = rank_count > 1 ? start_ranks(host, rank_count) : nullptr;
  // By default, each of several processes uses one core.
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int threads = arguments.threads > 0 ? arguments.threads : ranks ? 1 : cores;
  if (ranks && ranks->rank() > 0) return serve(arguments, host, *ranks, threads);

  const sim::Sweep sweep = sim::Sweep::from_file(arguments.sweep);
  sweep.check_values(host);
  if (!arguments.dry_run) confirm(sweep, arguments.sweep, arguments.yes);
  // Identify all runs before the database is created; if there are too many, look up each when its turn comes.
  const std::vector<sim::RunIdentity> runs =
      sweep.count() <= many_runs ? sweep.identities() : std::vector<sim::RunIdentity>();
  if (arguments.dry_run) {
    fmt::print("{}: {}; the first is {}\n", sweep.name(), counted(sweep.count(), "run"), sweep.assignments(0));
    return exit_fine;
  }
  const std::filesystem::path file = out_of(arguments.out, arguments.sweep, ".sqlite");
  sim::SweepStore store(file, "rhec " RHEC_PROJECT_VERSION);
  const std::int64_t there =
      std::count_if(runs.begin(), runs.end(), [&](const sim::RunIdentity& run) { return store.find(run).has_value(); });

  RateLine line(sweep.name());
  const StopRequest stop;
  sim::SweepProgress done;
  {
    const std::unique_ptr<sim::SweepWorkers> workers =
        ranks ? ranks->workers(host, sweep, threads) : std::make_unique<sim::ThreadWorkers>(host, sweep, threads);
    const auto show = [&](const sim::SweepProgress& now) {
      line.show({.total = now.total,
                 .there = std::max(there, now.there),
                 .made = now.made,
                 .seconds = now.seconds,
                 .ends = now.stopped});
    };
    done = sim::run_sweep(sweep, store, *workers, {.progress = show, .stop = [] { return StopRequest::asked(); }});
  }
  line.finish();
  return tell(sweep, done, std::max(there, done.there), file, arguments.json);
}

}  // namespace

void add_sweep(Program& program) {
  auto arguments = std::make_shared<SweepArguments>();
  Command command = program.add(
      "sweep", "Runs a scenario over a grid of its keys, on all cores.",
      "A sweep is a YAML file that names a scenario and gives some of its keys lists or ranges of values; "
      "docs/sweep.md\n"
      "describes it, and the SQLite database that the runs go to. A run is written as soon as it is finished, and one\n"
      "that is there already is not made again: after a crash, or Ctrl-C, the same command goes on.\n\n"
      "Under mpirun, or srun of Slurm, all processes share the runs: mpirun -n 16 rhec sweep SWEEP.yaml\n\n"
      "The exit code is 3 where a run of the grid did not reach the end of its path, or where it was stopped.\n\n"
      "Examples:\n"
      "  rhec sweep scenarios/sweep_blocks.yaml --out out/blocks.sqlite\n"
      "  rhec sweep scenarios/sweep_blocks.yaml --dry-run",
      [arguments] { return sweep(*arguments); });
  command.add("sweep", arguments->sweep, "a YAML file").required();
  add_out(command, arguments->out, "FILE", "database of the runs; otherwise out/ and the sweep's name with .sqlite");
  add_json(command, arguments->json);
  command
      .add("--threads", arguments->threads,
           "runs at the same time; otherwise as many as there are cores, or 1 in each process of mpirun")
      .value("N")
      .within(1, 4096);
  command.add_flag("--yes", arguments->yes, "begin a grid of more than a million runs without being asked");
  command.add_flag("--dry-run", arguments->dry_run, "check the sweep and count its runs, no more");
  add_plugin_path(command, arguments->plugin_path);
}

}  // namespace rhec::apps
