#include "rhec/sim/study/sweep.hpp"

#include <cstdlib>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "rhec/plugins/yaml/yaml.hpp"
#include "sim/support/sweeps.hpp"

namespace rhec::sim {
namespace sweep_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

std::vector<std::string> assignments_of(const Sweep& sweep) {
  std::vector<std::string> all;
  for (std::int64_t run = 0; run < sweep.count(); ++run) all.push_back(sweep.assignments(run));
  return all;
}

// ---- expansion

TEST(SweepGrid, ListsMultiplyAndTheLastKeyIsTheFastest) {
  EXPECT_THAT(assignments_of(grid_of("  speed: [4, 8]\n  seed: [1, 2, 3]\n")),
              ElementsAre("speed=4, seed=1", "speed=4, seed=2", "speed=4, seed=3", "speed=8, seed=1", "speed=8, seed=2",
                          "speed=8, seed=3"));
}

TEST(SweepGrid, KeysOfAGroupVaryTogether) {
  EXPECT_THAT(assignments_of(grid_of("  seed: [1, 2]\n  zip: {speed: [4, 8], step: {from: 0.1, to: 0.2, count: 2}}\n")),
              ElementsAre("seed=1, speed=4, step=0.1", "seed=1, speed=8, step=0.2", "seed=2, speed=4, step=0.1",
                          "seed=2, speed=8, step=0.2"));
  EXPECT_THAT(assignments_of(grid_of("  zip:\n    - {speed: [4, 8], step: [0.1, 0.2]}\n"
                                     "    - {seed: [5, 6], path.laps: [1, 2]}\n")),
              ElementsAre("speed=4, step=0.1, seed=5, path.laps=1", "speed=4, step=0.1, seed=6, path.laps=2",
                          "speed=8, step=0.2, seed=5, path.laps=1", "speed=8, step=0.2, seed=6, path.laps=2"));
}

TEST(SweepGrid, BlocksAddUp) {
  const Sweep sweep = grid_of("  - speed: [4, 8]\n  - {speed: [3], seed: [7, 9]}\n  - seed: {from: 2, to: 3}\n");
  EXPECT_EQ(sweep.count(), 6);
  EXPECT_THAT(assignments_of(sweep),
              ElementsAre("speed=4", "speed=8", "speed=3, seed=7", "speed=3, seed=9", "seed=2", "seed=3"));
}

TEST(SweepGrid, ValuesAreWhatOneWouldHaveTyped) {
  // Each range of decimals has the doubles of the decimals: no 0.30000000000000004.
  struct Case {
    double from, step;
    int count, digits;
  };
  for (const Case& c : {Case{0, 0.1, 11, 1}, Case{0.1, 0.1, 9, 1}, Case{-1, 0.05, 41, 2}, Case{0.003, 0.001, 998, 3},
                        Case{1e-6, 1e-6, 100, 6}, Case{10, -0.7, 12, 1}, Case{1234.56, 0.01, 500, 2}}) {
    const auto typed = [&](int i) { return fmt::format("{:.{}f}", c.from + c.step * i, c.digits); };
    for (const std::string& way : {fmt::format("step: {}", c.step), fmt::format("count: {}", c.count)}) {
      const Sweep sweep = grid_of(fmt::format("  step: {{from: {}, to: {}, {}}}\n", typed(0), typed(c.count - 1), way));
      ASSERT_EQ(sweep.count(), c.count) << way;
      for (int i = 0; i < c.count; ++i)
        ASSERT_EQ(*sweep.settings(i).find("step")->number(), std::strtod(typed(i).c_str(), nullptr)) << way << " " << i;
    }
  }
}

TEST(SweepGrid, RangesEndExactlyWhereTheySay) {
  for (const char* end : {"0.7", "3.3333333333333335", "1e-3", "100000.1", "2"})
    for (const int count : {2, 3, 7, 10, 97}) {
      const Sweep sweep = grid_of(fmt::format("  step: {{from: 0.1, to: {}, count: {}}}\n", end, count));
      EXPECT_EQ(*sweep.settings(0).find("step")->number(), 0.1);
      EXPECT_EQ(*sweep.settings(count - 1).find("step")->number(), std::strtod(end, nullptr));
      for (int i = 1; i < count; ++i) {
        const double gap = *sweep.settings(i).find("step")->number() - *sweep.settings(i - 1).find("step")->number();
        const double even = (std::strtod(end, nullptr) - 0.1) / (count - 1);
        EXPECT_NEAR(gap, even, 1e-9 * std::abs(even));
      }
    }
  EXPECT_THAT(assignments_of(grid_of("  seed: {from: 5, to: 5}\n")), ElementsAre("seed=5"));
  EXPECT_THAT(assignments_of(grid_of("  seed: {from: 3, to: 1, step: -1}\n")),
              ElementsAre("seed=3", "seed=2", "seed=1"));
}

TEST(SweepGrid, TakesNoRoomForItsRuns) {
  const Sweep sweep = grid_of("  seed: {from: 1, to: 1000000000}\n  speed: [1, 2]\n");
  EXPECT_EQ(sweep.count(), 2000000000);
  EXPECT_EQ(sweep.assignments(1999999999), "seed=1000000000, speed=2");
  EXPECT_EQ(mistake_of([&] { sweep.check_values(host()); }), "");
}

TEST(SweepGrid, SettingsAreThoseOfTheScenarioWithWhatIsSetAndGiven) {
  const Sweep sweep = sweep_of(
      "scenario: figure8.yaml\nset: {path.laps: 1, seed: 3}\n"
      "grid:\n  blocking.kappa: [{name: structured, size: 3}]\n  blocking.kappa.overlap: [0, 2]\n");
  Settings expected = load_yaml(std::string(SCENARIOS) + "/figure8.yaml");
  for (const char* assignment : {"path.laps=1", "seed=3", "blocking.kappa={name: structured, size: 3, overlap: 2}"})
    apply_assignment(expected, assignment);
  EXPECT_EQ(canonical_text(sweep.settings(1)), canonical_text(expected));
  EXPECT_EQ(mistake_in("set: {model.name: bicycle_slip, path.laps: 1}\ngrid: {speed: [4, 8]}\n"), "");
}

TEST(SweepGrid, AScenarioIsAKeyToo) {
  const Sweep sweep = sweep_of(
      "set: {path: {name: figure8, laps: 1}}\n"
      "grid: {scenario: [figure8.yaml, skid_steer.yaml], seed: [1, 2]}\n");
  EXPECT_EQ(sweep.count(), 4);
  EXPECT_EQ(sweep.settings(1).find_path("model.name")->text(), "bicycle_slip");
  EXPECT_EQ(sweep.settings(3).find_path("model.name")->text(), "skid_steer");
  EXPECT_EQ(sweep.settings(3).find("scenario"), nullptr);
  EXPECT_EQ(mistake_of([&] { sweep.check_values(host()); }), "");
}

// ---- mistakes

TEST(SweepMistakes, AScenarioSaysWhatItIs) {
  for (const char* text : {"robot: r.yaml", "speed: 3", "model: {name: bicycle_slip}", "signals: {clock: t}"})
    EXPECT_THAT(mistake_in(text), HasSubstr("a sweep names it, 'scenario: FILE'"));
}

TEST(SweepMistakes, InTheFormOfTheFile) {
  EXPECT_THAT(mistake_in(""), HasSubstr("the grid is empty"));
  EXPECT_THAT(mistake_in("scenario: figure8.yaml\ngird: {}\n"), AllOf(StartsWith("sweep.yaml:2"), HasSubstr("'grid'")));
  EXPECT_THAT(mistake_in("scenario: figure8.yaml\ngrid: {}\n"), AllOf(StartsWith("sweep.yaml:2"), HasSubstr("empty")));
  EXPECT_THAT(mistake_in("scenario: figure8.yaml\ngrid: []\n"), AllOf(StartsWith("sweep.yaml:2"), HasSubstr("empty")));
  EXPECT_THAT(mistake_in("scenario: figure8.yaml\ngrid:\n"), HasSubstr("the grid is empty"));
  EXPECT_THAT(mistake_in("scenario: figure8.yaml\ngrid: 5\n"), HasSubstr("sweep.yaml:2"));
  EXPECT_THAT(mistake_in("scenario: figure9.yaml\ngrid: {speed: [1]}\n"),
              AllOf(StartsWith("sweep.yaml:1: scenario: "), HasSubstr("there is no figure9.yaml")));
  EXPECT_THAT(mistake_in("set: 4\ngrid: {speed: [1]}\n"), StartsWith("sweep.yaml:1: set: found '4'"));
}

TEST(SweepMistakes, InTheFormOfTheGrid) {
  EXPECT_THAT(mistake_in_grid("  speed: []\n"), AllOf(StartsWith("sweep.yaml:3: grid.speed: "), HasSubstr("empty")));
  EXPECT_THAT(mistake_in_grid("  speed: 4\n"), HasSubstr("found '4', expected a list of values, or a range"));
  EXPECT_THAT(mistake_in_grid("  estimator: {horizon: [5, 10]}\n"),
              AllOf(HasSubstr("no key 'horizon'"), HasSubstr("estimator.horizon")));
  EXPECT_THAT(mistake_in_grid("  - speed: [1]\n  - {}\n"), AllOf(StartsWith("sweep.yaml:4"), HasSubstr("empty")));
  EXPECT_THAT(mistake_in_grid("  - speed\n"), HasSubstr("expected a block of a grid"));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 1, to: 2, step: 0.3}\n"), HasSubstr("does not end at 2"));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 1, to: 0.5}\n"), HasSubstr("is empty"));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 1, to: 2, step: 0}\n"), HasSubstr("leads nowhere"));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 1, to: 2, step: 1, count: 2}\n"), HasSubstr("keep one of them"));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 1, step: 1}\n"), HasSubstr("without 'to'"));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 1, to: x}\n"), HasSubstr("found 'x', expected a finite number"));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 1, to: .inf}\n"), HasSubstr("expected a finite number"));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 1, to: 2, count: 1}\n"), HasSubstr("expected 2 or more"));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 0, to: 1e15}\n"), HasSubstr("more than 1e+15"));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 1, to: 1e8}\n  seed: {from: 1, to: 1e8}\n"),
              AllOf(StartsWith("sweep.yaml:4: grid.seed"), HasSubstr("more than 1e+15 runs")));
  EXPECT_THAT(mistake_in_grid("  zip: {speed: [1, 2], seed: [1, 2, 3]}\n"),
              AllOf(HasSubstr("grid.zip.seed"), HasSubstr("has 3 values and 'speed' has 2")));
  EXPECT_THAT(mistake_in_grid("  zip: {speed: [1, 2]}\n"), HasSubstr("expected a map of two or more keys"));
  EXPECT_THAT(mistake_in_grid("  speed: [1]\n  zip: {speed: [1, 2], seed: [1, 2]}\n"), HasSubstr("values twice"));
  EXPECT_THAT(mistake_in_grid("  blocking.kappa.size: [1]\n  blocking.kappa: [{name: structured}]\n"),
              AllOf(StartsWith("sweep.yaml:4"), HasSubstr("replaces the whole section")));
}

}  // namespace sweep_test
}  // namespace rhec::sim
