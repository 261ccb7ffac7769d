#include "rhec/sim/study/sweep_runner.hpp"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <filesystem>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "support/address_space.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace sweep_runner_test {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Pair;
using testing::UnorderedElementsAre;

const Host& host() {
  static const Host found;
  return found;
}

/// Twelve short runs, one of which is refused: its overlap is longer than its horizon.
Sweep small_sweep(const std::string& grid = "") {
  const std::string own =
      "  - {speed: [8, 10], seed: {from: 1, to: 4}}\n"
      "  - {estimator.horizon: [3, 6], blocking.kappa.overlap: [0, 5]}\n";
  return Sweep(parse_yaml("scenario: paper/figure8.yaml\nset: {path.laps: 1, path.radius: 8, speed: 10}\ngrid:\n" +
                              (grid.empty() ? own : grid),
                          std::string(SCENARIOS) + "/sweep.yaml"));
}

class SweepRunnerTest : public FolderTest {
 protected:
  fs::path file(const std::string& name = "runs.sqlite") const { return folder_ / name; }
};

SweepProgress make(const Sweep& sweep, SweepStore& store, int threads, const SweepHooks& hooks = {}) {
  ThreadWorkers workers(host(), sweep, threads);
  return run_sweep(sweep, store, workers, hooks);
}

/// Without what differs from time to time.
std::vector<std::string> without_times(const std::vector<SweepRow>& rows) {
  std::vector<std::string> all;
  all.reserve(rows.size());
  for (const SweepRow& row : rows)
    all.push_back(fmt::format("{} {} {} {} {} {} {} {} {} {} {} {} {}", row.identity.text(), row.configuration,
                              row.seed.value_or(-1), name_of(row.status), row.reason, row.steps, row.solves,
                              row.fallbacks, row.nees, row.mae, row.rmse, row.mae_after_start, row.statuses));
  return all;
}

TEST_F(SweepRunnerTest, ThreadsMakeTheSameRows) {
  const Sweep sweep = small_sweep();
  ASSERT_EQ(sweep.count(), 12);
  SweepStore one(file("one.sqlite")), three(file("three.sqlite"));
  const SweepProgress first = make(sweep, one, 1), second = make(sweep, three, 3);
  EXPECT_EQ(first.made, 12);
  EXPECT_EQ(second.made, 12);
  EXPECT_FALSE(first.stopped);
  EXPECT_EQ(without_times(one.rows()), without_times(three.rows()));
}

TEST_F(SweepRunnerTest, GoesOnWithTheThreadsThatTheSystemStarts) {
  const Sweep sweep = small_sweep();
  host();
  constexpr int wanted = 1000;
  std::unique_ptr<ThreadWorkers> workers;
  {
    const AddressSpace limit(std::size_t{100} << 20);
    workers = std::make_unique<ThreadWorkers>(host(), sweep, AddressSpace::is_limited ? wanted : 2);
  }
  EXPECT_LT(workers->room(), 2 * wanted);
  SweepStore store(file());
  EXPECT_EQ(run_sweep(sweep, store, *workers, {}).made, 12);
}

TEST_F(SweepRunnerTest, ARunIsThatOfTheScenario) {
  const Sweep sweep = small_sweep();
  SweepStore store(file());
  make(sweep, store, 2);
  for (const std::int64_t run : {std::int64_t{2}, std::int64_t{8}}) {
    const Scenario scenario(host(), sweep.settings(run));
    const RunSummary summary = summarise(run_closed_loop(scenario), scenario);
    const RunIdentity identity = identity_of(canonical_text(sweep.settings(run)));
    const std::vector<SweepRow> rows = store.rows();
    const auto row = std::find_if(rows.begin(), rows.end(), [&](const SweepRow& r) { return r.identity == identity; });
    ASSERT_NE(row, rows.end());
    EXPECT_EQ(row->steps, summary.steps);
    EXPECT_EQ(row->nees, summary.nees);
    EXPECT_EQ(row->seed, scenario.options().seed);
    EXPECT_EQ(*parse_yaml(row->mae, "mae").find("kappa")->number(), summary.mae.parameters.at("kappa"));
    EXPECT_EQ(*parse_yaml(row->rmse, "rmse").find("tracking")->number(), summary.rmse.tracking);
    EXPECT_EQ(*parse_yaml(row->mae_after_start, "mae").find("position")->number(), summary.mae_after_start.position);
    EXPECT_EQ(*parse_yaml(row->solve_time_us, "times").find_path("rhe.median")->number() > 0.0, true);
  }
}

TEST_F(SweepRunnerTest, FailingRunsAreRowsWithTheirReason) {
  // Values that do not fit one another; and a vehicle that knows nothing of its slip and leaves its path.
  const Sweep sweep = small_sweep(
      "  - {estimator.horizon: [3, 6], blocking.kappa.overlap: [0, 5]}\n"
      "  - {controller.weights.stage: [{x_pos: 1e-9, y_pos: 1e-9}], controller.weights.terminal: [{x_pos: 0, y_pos: "
      "0}], "
      "path.radius: [60]}\n");
  sweep.check_values(host());
  SweepStore store(file());
  const SweepProgress done = make(sweep, store, 2);
  EXPECT_THAT(done.statuses, UnorderedElementsAre(Pair(RunStatus::completed, 3), Pair(RunStatus::refused, 1),
                                                  Pair(RunStatus::not_completed, 1)));
  for (const SweepRow& row : store.rows()) {
    EXPECT_EQ(row.has_summary(), row.status != RunStatus::refused);
    if (row.status == RunStatus::refused) {
      EXPECT_THAT(row.reason, HasSubstr("an overlap of 5 needs a horizon of at least 5"));
    }
    if (row.status == RunStatus::not_completed) {
      EXPECT_THAT(row.reason, HasSubstr("the vehicle"));
    }
  }
}

TEST_F(SweepRunnerTest, OnlyWhatIsMissingIsMade) {
  const Sweep sweep = small_sweep();
  SweepStore whole(file("whole.sqlite"));
  make(sweep, whole, 2);
  for (const int after : {1, 5, 11}) {
    SweepStore store(file(fmt::format("{}.sqlite", after)));
    std::int64_t made = 0;
    const SweepProgress first =
        make(sweep, store, 1,
             {.progress = [&](const SweepProgress& now) { made = now.made; }, .stop = [&] { return made >= after; }});
    EXPECT_TRUE(first.stopped);
    EXPECT_GE(first.made, after);
    EXPECT_EQ(store.count(), first.made);
    const SweepProgress second = make(sweep, store, 3);
    EXPECT_EQ(second.there, first.made);
    EXPECT_EQ(second.made, 12 - first.made);
    EXPECT_THAT(second.statuses, UnorderedElementsAre(Pair(RunStatus::completed, 11), Pair(RunStatus::refused, 1)));
    EXPECT_EQ(without_times(store.rows()), without_times(whole.rows()));
    EXPECT_EQ(make(sweep, store, 2).made, 0);
  }
}

TEST_F(SweepRunnerTest, ALargerGridMakesWhatIsNew) {
  SweepStore store(file());
  make(small_sweep("  seed: [1, 2]\n"), store, 2);
  const SweepProgress done = make(small_sweep("  seed: [2, 3, 1, 4]\n"), store, 2);
  EXPECT_EQ(done.there, 2);
  EXPECT_EQ(done.made, 2);
}

TEST_F(SweepRunnerTest, StoppingLosesNothingThatWasBegun) {
  const Sweep sweep = small_sweep("  seed: {from: 1, to: 100000}\n");
  SweepStore store(file());
  const SweepProgress done = make(sweep, store, 2, {.stop = [] { return true; }});
  EXPECT_TRUE(done.stopped);
  EXPECT_EQ(done.made, store.count());
  EXPECT_LE(done.made, 6);
}

/// Hands out nothing but an error.
class LostWorkers final : public SweepWorkers {
 public:
  std::int64_t room() override { return 1; }
  void give(std::int64_t) override {}
  std::vector<SweepRow> take(std::chrono::milliseconds) override { throw Error("the workers are gone"); }
  std::int64_t withdraw() override { return 0; }
};

TEST_F(SweepRunnerTest, TheEndOfAWorkerEndsTheSweep) {
  const Sweep sweep = small_sweep();
  SweepStore store(file());
  LostWorkers workers;
  EXPECT_THROW(run_sweep(sweep, store, workers), Error);
}

}  // namespace sweep_runner_test
}  // namespace rhec::sim
