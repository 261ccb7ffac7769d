#include "rhec/sim/study/sweep_runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <new>
#include <optional>
#include <system_error>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/loop/run_files.hpp"

namespace rhec::sim {
namespace {

using Steady = std::chrono::steady_clock;

double seconds_since(Steady::time_point start) { return std::chrono::duration<double>(Steady::now() - start).count(); }

void keep(const RunSummary& summary, SweepRow& row) {
  row.status = summary.completed ? RunStatus::completed : RunStatus::not_completed;
  row.reason = summary.ended;
  row.steps = summary.steps;
  row.solves = summary.solves;
  row.fallbacks = summary.fallbacks;
  row.nees = summary.nees;
  const Json json = json_of(summary);
  row.mae = json["mae"].dump();
  row.rmse = json["rmse"].dump();
  row.mae_after_start = json["mae_after_start"].dump();
  row.statuses = json["statuses"].dump();
  row.solve_time_us = json["solve_time_us"].dump();
}

}  // namespace

SweepRow make_run(const Host& host, const Sweep& sweep, std::int64_t run) {
  const Steady::time_point start = Steady::now();
  const Settings settings = sweep.settings(run);
  SweepRow row;
  row.configuration = canonical_text(settings);
  row.identity = identity_of(row.configuration);
  const Settings* seed = settings.find("seed");
  row.seed = seed ? seed->integer() : ScenarioOptions{}.seed;
  try {
    const Scenario scenario(host, settings);
    keep(summarise(run_closed_loop(scenario), scenario), row);
  } catch (const Error& mistake) {
    row.status = RunStatus::refused;
    row.reason = mistake.what();
  } catch (const std::bad_alloc&) {  // not the run's fault
    throw;
  } catch (const std::exception& failure) {
    row.status = RunStatus::failed;
    row.reason = failure.what();
  }
  row.seconds = seconds_since(start);
  return row;
}

SweepWorkers::~SweepWorkers() = default;

// ---- threads

ThreadWorkers::ThreadWorkers(const Host& host, const Sweep& sweep, int threads) : host_(host), sweep_(sweep) {
  threads_.reserve(static_cast<std::size_t>(std::max(1, threads)));
  for (int t = 0; t < std::max(1, threads); ++t) {
    try {
      threads_.emplace_back([this] { work(); });
    } catch (const std::system_error& refused) {  // there are limits of threads, and of the memory of their stacks
      if (threads_.empty()) throw Error(fmt::format("sweep: no thread can be started: {}", refused.what()));
      break;
    }
  }
}

ThreadWorkers::~ThreadWorkers() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  given_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void ThreadWorkers::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    given_.wait(lock, [this] { return over_ || !waiting_.empty(); });
    if (over_) return;
    const std::int64_t run = waiting_.front();
    waiting_.pop_front();
    lock.unlock();
    std::optional<SweepRow> row;
    std::exception_ptr failure;
    try {
      row = make_run(host_, sweep_, run);
    } catch (...) {  // rethrown by take()
      failure = std::current_exception();
    }
    lock.lock();
    if (row) rows_.push_back(std::move(*row));
    if (failure) failure_ = failure;
    finished_.notify_one();
  }
}

std::int64_t ThreadWorkers::room() {
  const std::lock_guard lock(mutex_);
  // One extra run per thread: a thread that finishes while rows are written continues at once.
  return 2 * std::ssize(threads_) - std::ssize(waiting_);
}

void ThreadWorkers::give(std::int64_t run) {
  {
    const std::lock_guard lock(mutex_);
    waiting_.push_back(run);
  }
  given_.notify_one();
}

std::vector<SweepRow> ThreadWorkers::take(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  finished_.wait_for(lock, patience, [this] { return failure_ || !rows_.empty(); });
  if (rows_.empty() && failure_) std::rethrow_exception(failure_);
  return std::exchange(rows_, {});
}

std::int64_t ThreadWorkers::withdraw() {
  const std::lock_guard lock(mutex_);
  return std::ssize(std::exchange(waiting_, {}));
}

// ---- the sweep

SweepProgress run_sweep(const Sweep& sweep, SweepStore& store, SweepWorkers& workers, const SweepHooks& hooks) {
  constexpr std::chrono::milliseconds patience(100);
  constexpr int most_looked_up = 1000;  // at once, so that progress is still reported
  const Steady::time_point start = Steady::now();
  SweepProgress progress;
  progress.total = sweep.count();
  std::int64_t next = 0, under_way = 0;
  // Returns whether more runs can be looked up without waiting.
  const auto give = [&] {
    std::int64_t room = workers.room();
    for (int looked_up = 0; room > 0 && next < progress.total && looked_up < most_looked_up; ++looked_up, ++next) {
      if (const auto status = store.find(identity_of(canonical_text(sweep.settings(next))))) {
        ++progress.there;
        ++progress.statuses[*status];
        continue;
      }
      workers.give(next);
      ++under_way, --room;
    }
    return room > 0 && next < progress.total;
  };
  for (;;) {
    const bool has_more = !progress.stopped && give();
    if (under_way > 0) {
      const std::vector<SweepRow> rows = workers.take(has_more ? std::chrono::milliseconds(0) : patience);
      store.write(rows);
      under_way -= std::ssize(rows);
      progress.made += std::ssize(rows);
      for (const SweepRow& row : rows) ++progress.statuses[row.status];
    }
    progress.seconds = seconds_since(start);
    if (hooks.progress) hooks.progress(progress);
    if (!progress.stopped && hooks.stop && hooks.stop()) {
      progress.stopped = true;
      under_way -= workers.withdraw();
    }
    if (under_way == 0 && (progress.stopped || next == progress.total)) break;
  }
  return progress;
}

}  // namespace rhec::sim
