// Closed-loop runs over a grid of paths, speeds, block structures and seeds. Reports the runs per second, the time of
// the whole grid, and the shares of a sample's time: the estimator's solver, the controller's solver, and the other
// parts.
//
//     closed_loop_grid [--share 0.02] [--threads 2]
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <mutex>
#include <numeric>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/loop/run_files.hpp"
#include "ticks.hpp"

namespace rhec::bench {
namespace {

using Steady = std::chrono::steady_clock;

struct Run {
  std::shared_ptr<const Settings> scenario;  // of a path; read only once
  std::vector<std::string> assignments;
};

/// 2 paths, 10 speeds, 30 block structures, 16 seeds.
std::vector<Run> whole_grid() {
  std::vector<std::string> blockings = {"{name: full_horizon}", "{name: unblocked, neighbour_sigma: 0.04}"};
  for (const int size : {1, 2, 3, 4, 5, 6, 8})
    for (const int overlap : {0, 1, 2, 4})
      blockings.push_back("{name: structured, size: " + std::to_string(size) + ", overlap: " + std::to_string(overlap) +
                          "}");
  std::vector<Run> grid;
  for (const char* path : {"figure8", "zigzag"}) {
    const auto scenario =
        std::make_shared<const Settings>(load_yaml(RHEC_SOURCE_DIRECTORY "/scenarios/" + std::string(path) + ".yaml"));
    for (int speed = 1; speed <= 10; ++speed)
      for (const std::string& blocking : blockings)
        for (int seed = 1; seed <= 16; ++seed)
          grid.push_back(
              {scenario,
               {"speed=" + std::to_string(speed), "seed=" + std::to_string(seed), "blocking.kappa=" + blocking}});
  }
  return grid;
}

// The parts of a run's time; LoopPart names those of a sample. The solvers report their own times.
enum Part {
  estimator_solver,
  controller_solver,
  simulation,
  window,
  covariance,
  references,
  log,
  setup,
  making,
  summary,
  part_count,
};
constexpr std::array part_names = {"estimator_solver",
                                   "controller_solver",
                                   "simulation",
                                   "window",
                                   "covariance",
                                   "references",
                                   "log",
                                   "setup",
                                   "making",
                                   "summary"};
static_assert(part_names.size() == part_count);

/// The part to which time counts once a LoopPart has begun; the solvers' reported times are subtracted afterwards.
Part part_of(sim::LoopPart part) {
  switch (part) {
    case sim::LoopPart::simulate:
      return simulation;
    case sim::LoopPart::estimate:
      return covariance;
    case sim::LoopPart::prepare_estimate:
      return window;
    case sim::LoopPart::control:
    case sim::LoopPart::prepare_control:
      return references;
    case sim::LoopPart::log_sample:
      return log;
    case sim::LoopPart::end:  // only the teardown is left
      break;
  }
  return setup;
}

struct Totals {
  long runs = 0, completed = 0, samples = 0;
  std::array<double, part_count> us{};
  double csv_us = 0.0;  // not a part: a grid keeps only the summaries
  void add(const Totals& other) {
    runs += other.runs, completed += other.completed, samples += other.samples;
    for (int part = 0; part < part_count; ++part) us[part] += other.us[part];
    csv_us += other.csv_us;
  }
};

/// Measures consecutive laps.
class Stopwatch {
 public:
  double lap_us() {
    const Ticks::Count now = Ticks::now(), before = std::exchange(last_, now);
    return Ticks::microseconds(before, now);
  }

 private:
  Ticks::Count last_ = Ticks::now();
};

void drive(const Host& host, const Run& run, Totals& totals) {
  Stopwatch watch;
  Settings settings = *run.scenario;
  for (const std::string& assignment : run.assignments) apply_assignment(settings, assignment);
  const sim::Scenario scenario(host, settings);
  totals.us[making] += watch.lap_us();

  // Before its first part the loop is being set up.
  Part current = setup;
  sim::LoopHooks hooks;
  hooks.begins = [&](sim::LoopPart next) {
    totals.us[current] += watch.lap_us();
    current = part_of(next);
  };
  const sim::RunLog log_of_run = sim::run_closed_loop(scenario, hooks);
  totals.us[setup] += watch.lap_us();
  const sim::RunSummary result = sim::summarise(log_of_run, scenario);
  totals.us[summary] += watch.lap_us();
  if (sim::steps_csv(log_of_run, scenario).empty()) throw Error("a run left no log");
  totals.csv_us += watch.lap_us();
  for (const sim::Sample& sample : log_of_run.samples) {
    const double preparation = sample.estimator_us - sample.estimator_feedback_us;
    totals.us[estimator_solver] += sample.estimator_us;
    totals.us[controller_solver] += sample.controller_us;
    totals.us[window] -= preparation;
    totals.us[covariance] -= sample.estimator_feedback_us;
    totals.us[references] -= sample.controller_us;
  }
  ++totals.runs;
  totals.completed += result.completed;
  totals.samples += result.steps;
}

/// Runs in a random but reproducible order, so that a share of the grid is a fair sample.
int run_share(double share, int thread_count) {
  std::vector<Run> grid = whole_grid();
  std::shuffle(grid.begin(), grid.end(), std::mt19937(1));  // NOLINT(cert-msc32-c,cert-msc51-cpp)
  const auto wanted = std::max<std::size_t>(1, static_cast<std::size_t>(share * static_cast<double>(grid.size())));
  const Host host;
  Stopwatch().lap_us();  // the first call calibrates the ticks
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  Totals totals;
  std::exception_ptr failure;
  const auto start = Steady::now();
  const auto work = [&] {
    Totals own;
    try {
      for (std::size_t i = next++; i < wanted; i = next++) drive(host, grid[i], own);
    } catch (...) {
      const std::lock_guard lock(mutex);
      failure = std::current_exception();
    }
    const std::lock_guard lock(mutex);
    totals.add(own);
  };
  std::vector<std::thread> threads;
  threads.reserve(thread_count);
  for (int t = 0; t < thread_count; ++t) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
  // Writing the logs does not count; its time is spread over the threads.
  const double seconds =
      std::chrono::duration<double>(Steady::now() - start).count() - 1e-6 * totals.csv_us / thread_count;

  const double samples = static_cast<double>(totals.samples), runs = static_cast<double>(totals.runs);
  const double all = std::accumulate(totals.us.begin(), totals.us.end(), 0.0);
  const double solves = totals.us[estimator_solver] + totals.us[controller_solver];
  std::printf(
      "{\"grid_runs\": %zu, \"runs\": %ld, \"completed\": %ld, \"threads\": %d, \"seconds\": %.3f, "
      "\"runs_per_second\": %.2f, \"grid_seconds\": %.1f, \"samples\": %ld, \"us_per_sample\": %.3f, "
      "\"rest_to_solves\": %.4f, \"csv_us_per_sample\": %.3f, \"parts_us_per_sample\": {",
      grid.size(), totals.runs, totals.completed, thread_count, seconds, runs / seconds,
      seconds * static_cast<double>(grid.size()) / runs, totals.samples, all / samples, (all - solves) / solves,
      totals.csv_us / samples);
  for (int part = 0; part < part_count; ++part)
    std::printf("%s\"%s\": %.4f", part == 0 ? "" : ", ", part_names[part], totals.us[part] / samples);
  std::printf("}}\n");
  return 0;
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) try {
  double share = 0.02;
  int threads = 2;
  for (int i = 1; i < count; i += 2) {
    const std::string word = words[i];
    char* end = nullptr;
    const double value = i + 1 < count ? std::strtod(words[i + 1], &end) : 0.0;
    const bool is_number = end && *end == '\0';
    if (word == "--share" && is_number && value > 0.0 && value <= 1.0) {
      share = value;
    } else if (word == "--threads" && is_number && value >= 1.0 && value <= 1024.0) {
      threads = static_cast<int>(value);
    } else {
      std::fprintf(stderr, "usage: closed_loop_grid [--share ABOVE_0_TO_1] [--threads COUNT]\n");
      return 2;
    }
  }
  return rhec::bench::run_share(share, threads);
} catch (const std::exception& mistake) {
  std::fprintf(stderr, "%s\n", mistake.what());
  return 1;
}
