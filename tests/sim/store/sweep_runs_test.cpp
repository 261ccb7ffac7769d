#include "rhec/sim/store/sweep_runs.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "rhec/sim/store/sweep_store.hpp"
#include "sim/store/sqlite_database.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace sweep_runs_test {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

class SweepRunsTest : public FolderTest {
 protected:
  std::filesystem::path path() const { return file("runs.sqlite"); }

  static SweepRow row_of(const std::string& configuration, std::optional<int> seed) {
    SweepRow row;
    row.configuration = configuration;
    row.identity = identity_of(configuration);
    row.seed = seed;
    row.status = RunStatus::completed;
    row.nees = 6.25;
    row.mae = R"({"kappa":0.5,"position":0.25})";
    row.rmse = row.mae;
    row.mae_after_start = R"({"kappa":0.125})";
    row.statuses = R"({"rhe":{"solved":3}})";
    row.solve_time_us = R"({"rhe":{"median":1.5,"p99":3.0,"max":4.0},"rhc":{"median":2.5,"p99":null}})";
    return row;
  }
  void write(const std::vector<SweepRow>& rows, const std::string& program = "a program") const {
    SweepStore(path(), program).write(rows);
  }
  /// A measure of the first run with this seed in a group.
  static double measure(const SweepRuns& runs, const RunGroup& group, std::int64_t seed, const std::string& name) {
    const auto place = std::find(runs.measures.begin(), runs.measures.end(), name) - runs.measures.begin();
    for (const SeedOutcome& outcome : group.outcomes)
      if (outcome.seed == seed) return outcome.values.at(static_cast<std::size_t>(place));
    throw Error("there is no run with this seed");
  }
};

TEST_F(SweepRunsTest, RunsThatDifferInTheirSeedAloneAreAGroup) {
  write({row_of(R"({"blocking":{"kappa":{"size":2}},"seed":1,"speed":4.5})", 1),
         row_of(R"({"blocking":{"kappa":{"size":2}},"seed":2,"speed":4.5})", 2),
         row_of(R"({"blocking":{"kappa":{"size":2}},"seed":1,"speed":8})", 1)});
  const SweepRuns runs = read_sweep_runs(path());
  EXPECT_EQ(runs.total, 3);
  ASSERT_EQ(runs.groups.size(), 2U);
  const bool is_first = runs.groups[0].outcomes.size() == 2;
  const RunGroup &pair = runs.groups[is_first ? 0 : 1], &single = runs.groups[is_first ? 1 : 0];
  EXPECT_EQ(pair.outcomes.size(), 2U);
  EXPECT_EQ(single.outcomes.size(), 1U);
  EXPECT_THAT(pair.keys, ElementsAre(Pair("blocking.kappa.size", "2"), Pair("speed", "4.5")));
  EXPECT_THAT(single.keys, ElementsAre(Pair("blocking.kappa.size", "2"), Pair("speed", "8")));
  EXPECT_THAT(runs.statuses, ElementsAre(Pair("completed", 3)));
  EXPECT_THAT(runs.programs, ElementsAre("a program"));
}

TEST_F(SweepRunsTest, OnlyTheSeedOfTheWholeConfigurationIsLeftOut) {
  write({row_of(R"({"name":"a \"seed\":9,","path":{"seed":3},"seed":1})", 1),
         row_of(R"({"name":"a \"seed\":9,","path":{"seed":3},"seed":2})", 2),
         row_of(R"({"name":"a \"seed\":9,","path":{"seed":4},"seed":2})", 2), row_of(R"({"seed":5})", 5),
         row_of(R"({})", std::nullopt)});
  const SweepRuns runs = read_sweep_runs(path());
  std::vector<std::size_t> sizes;
  for (const RunGroup& group : runs.groups) {
    sizes.push_back(group.outcomes.size());
    EXPECT_FALSE(group.keys.contains("seed"));
    if (group.keys.empty()) continue;
    EXPECT_EQ(group.keys.at("name"), R"("a \"seed\":9,")");
    EXPECT_EQ(group.keys.at("path.seed"), group.outcomes.size() == 2 ? "3" : "4");
  }
  EXPECT_THAT(sizes, testing::UnorderedElementsAre(2U, 1U, 2U));
}

TEST_F(SweepRunsTest, MeasuresAreThoseOfTheSummary) {
  SweepRow other = row_of(R"({"seed":2})", 2);
  other.mae = R"({"kappa":0.75,"mu":0.5})";
  other.nees = std::nan("");
  write({row_of(R"({"seed":1})", 1), other});
  const SweepRuns runs = read_sweep_runs(path());
  EXPECT_THAT(runs.measures,
              testing::UnorderedElementsAre("mae.kappa", "mae.position", "mae.mu", "rhe.median", "rhe.p99",
                                            "rhc.median", "rhc.p99", "mae_after_start.kappa", "nees"));
  ASSERT_EQ(runs.groups.size(), 1U);
  const RunGroup& group = runs.groups.front();
  EXPECT_EQ(measure(runs, group, 1, "mae.kappa"), 0.5);
  EXPECT_EQ(measure(runs, group, 2, "mae.kappa"), 0.75);
  EXPECT_EQ(measure(runs, group, 1, "mae_after_start.kappa"), 0.125);
  EXPECT_EQ(measure(runs, group, 1, "rhe.p99"), 3.0);
  EXPECT_EQ(measure(runs, group, 1, "nees"), 6.25);
  EXPECT_TRUE(std::isnan(measure(runs, group, 1, "rhc.p99"))) << "null";
  EXPECT_TRUE(std::isnan(measure(runs, group, 2, "nees"))) << "null";
  EXPECT_TRUE(std::isnan(measure(runs, group, 2, "mae.position"))) << "a run that does not have it";
}

TEST_F(SweepRunsTest, WhatWasNotCompletedHasNoValues) {
  SweepRow refused = row_of(R"({"seed":"x"})", std::nullopt);
  refused.status = RunStatus::refused;
  refused.mae = refused.rmse = refused.mae_after_start = refused.statuses = refused.solve_time_us = "";
  SweepRow lost = row_of(R"({"seed":3})", 3);
  lost.status = RunStatus::not_completed;
  write({refused, lost}, "one");
  write({row_of(R"({"seed":1})", 1)}, "two");
  const SweepRuns runs = read_sweep_runs(path());
  for (const RunGroup& group : runs.groups)
    for (const SeedOutcome& outcome : group.outcomes) EXPECT_EQ(outcome.values.empty(), outcome.seed != 1);
  EXPECT_THAT(runs.statuses, ElementsAre(Pair("completed", 1), Pair("not completed", 1), Pair("refused", 1)));
  EXPECT_THAT(runs.programs, ElementsAre("one", "two"));
}

TEST_F(SweepRunsTest, RefusesWhatIsNoSweep) {
  const auto message = [&] { return error_of([&] { read_sweep_runs(path()); }); };
  EXPECT_THAT(message(), HasSubstr("runs.sqlite: cannot be opened"));
  put("runs.sqlite", std::string(5000, 'x'));
  EXPECT_THAT(message(), HasSubstr("is no SQLite database"));
  std::filesystem::remove(path());
  SqliteDatabase(path()).execute("CREATE TABLE runs (a)");
  EXPECT_THAT(message(), HasSubstr("not one of rhec's sweeps"));
  std::filesystem::remove(path());
  write({});
  EXPECT_THAT(message(), HasSubstr("has no runs yet"));
  SqliteDatabase(path()).execute("ALTER TABLE runs RENAME TO kept; CREATE VIEW runs AS SELECT * FROM kept");
  EXPECT_THAT(message(), HasSubstr("has no table 'runs'"));
  SqliteDatabase(path()).execute("PRAGMA user_version = 7");
  EXPECT_THAT(message(), HasSubstr("has version 7 of the schema, and this program reads version 1"));
}

TEST_F(SweepRunsTest, NamesTheRunWhoseSummaryIsBroken) {
  SweepRow broken = row_of(R"({"seed":1})", 1);
  broken.mae = R"({"kappa":)";
  write({broken});
  const std::string message = error_of([&] { read_sweep_runs(path()); });
  EXPECT_THAT(message, HasSubstr("run " + broken.identity.text() + ": mae is no map of JSON"));
}

}  // namespace sweep_runs_test
}  // namespace rhec::sim
