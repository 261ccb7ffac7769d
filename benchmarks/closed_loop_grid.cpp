// Closed-loop runs over a grid: paths, speeds, block structures and seeds. Says how many runs a second there are, what
// the whole grid takes, and what of a sample's time is the estimator's solver, the controller's, and all else.
//
//     closed_loop_grid [--share 0.02] [--threads 2]
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "rhec/core/error.hpp"
#include "rhec/plugins/yaml.hpp"
#include "rhec/sim/closed_loop.hpp"

namespace rhec::bench {
namespace {

using Steady = std::chrono::steady_clock;

struct Run {
  std::string scenario;
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
  for (const char* path : {"figure8", "zigzag"})
    for (int speed = 1; speed <= 10; ++speed)
      for (const std::string& blocking : blockings)
        for (int seed = 1; seed <= 16; ++seed)
          grid.push_back(
              {RHEC_SOURCE_DIRECTORY "/scenarios/" + std::string(path) + ".yaml",
               {"speed=" + std::to_string(speed), "seed=" + std::to_string(seed), "blocking.kappa=" + blocking}});
  return grid;
}

struct Totals {
  long runs = 0, completed = 0, samples = 0;
  double estimator_us = 0.0, controller_us = 0.0, loop_us = 0.0, making_us = 0.0;
  void add(const Totals& other) {
    runs += other.runs, completed += other.completed, samples += other.samples;
    estimator_us += other.estimator_us, controller_us += other.controller_us;
    loop_us += other.loop_us, making_us += other.making_us;
  }
};

double us_since(Steady::time_point start) {
  return std::chrono::duration<double, std::micro>(Steady::now() - start).count();
}

void drive(const Host& host, const Run& run, Totals& totals) {
  const auto start = Steady::now();
  Settings settings = load_yaml(run.scenario);
  for (const std::string& assignment : run.assignments) apply_assignment(settings, assignment);
  const sim::Scenario scenario(host, settings);
  totals.making_us += us_since(start);
  const auto begin = Steady::now();
  const sim::RunLog log = sim::run_closed_loop(scenario);
  totals.loop_us += us_since(begin);
  ++totals.runs;
  totals.completed += log.completed;
  totals.samples += static_cast<long>(log.samples.size());
  for (const sim::Sample& sample : log.samples) {
    totals.estimator_us += sample.estimator_us;
    totals.controller_us += sample.controller_us;
  }
}

/// Runs in an order that is random but always the same, so that a share of them is a fair sample.
int run_share(double share, int thread_count) {
  std::vector<Run> grid = whole_grid();
  std::shuffle(grid.begin(), grid.end(), std::mt19937(1));  // NOLINT(cert-msc32-c,cert-msc51-cpp)
  const auto wanted = std::max<std::size_t>(1, static_cast<std::size_t>(share * static_cast<double>(grid.size())));
  const Host host;
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
  const double seconds = 1e-6 * us_since(start);

  const double all = totals.loop_us + totals.making_us, samples = static_cast<double>(totals.samples);
  std::printf(
      "{\"grid_runs\": %zu, \"runs\": %ld, \"completed\": %ld, \"threads\": %d, \"seconds\": %.3f, "
      "\"runs_per_second\": %.2f, \"grid_seconds\": %.1f, \"samples\": %ld, \"us_per_sample\": %.3f, "
      "\"estimator_solver_share\": %.4f, \"controller_solver_share\": %.4f, \"rest_of_loop_share\": %.4f, "
      "\"making_share\": %.4f}\n",
      grid.size(), totals.runs, totals.completed, thread_count, seconds, static_cast<double>(totals.runs) / seconds,
      seconds * static_cast<double>(grid.size()) / static_cast<double>(totals.runs), totals.samples, all / samples,
      totals.estimator_us / all, totals.controller_us / all,
      (totals.loop_us - totals.estimator_us - totals.controller_us) / all, totals.making_us / all);
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
