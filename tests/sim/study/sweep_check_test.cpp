// What is found out about a sweep before it starts: runs that are the same, and values that no run can have.
#include <gmock/gmock.h>

#include <set>
#include <vector>

#include "sim/support/sweeps.hpp"

namespace rhec::sim {
namespace sweep_check_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

TEST(SweepIdentity, DiffersBetweenRunsAndStaysFromSweepToSweep) {
  const std::vector<RunIdentity> all = grid_of("  speed: [4, 8]\n  seed: {from: 1, to: 50}\n").identities();
  EXPECT_EQ(std::set<RunIdentity>(all.begin(), all.end()).size(), 100);
  const std::vector<RunIdentity> other = grid_of("  - seed: [7]\n    speed: [8.0]\n").identities();
  EXPECT_EQ(all[56], other[0]);
}

TEST(SweepValues, AreGivenUpBetweenAttempts) {
  struct GivenUp {};
  int attempts = 0;
  const Sweep sweep = grid_of("  speed: [4, 5, 6]\n");
  EXPECT_THROW(sweep.check_values(host(),
                                  [&] {
                                    if (++attempts == 2) throw GivenUp();
                                  }),
               GivenUp);
  EXPECT_EQ(attempts, 2);
}

TEST(SweepMistakes, InKeysAndValues) {
  EXPECT_THAT(mistake_in_grid("  seed: [1, 2]\n  spede: [1]\n"),
              AllOf(StartsWith("sweep.yaml:4: "), HasSubstr("did you mean 'speed'")));
  EXPECT_THAT(mistake_in_grid("  speed:\n    - 4\n    - fast\n"), StartsWith("sweep.yaml:5: speed: found 'fast'"));
  EXPECT_THAT(mistake_in_grid("  blocking.kappa.size: {from: 0, to: 100}\n"),
              AllOf(StartsWith("sweep.yaml:3: blocking.kappa.size: found '0'"), HasSubstr("at least 1")));
  EXPECT_THAT(mistake_in_grid("  speed: {from: 1, to: 200}\n"), HasSubstr("speed: found"));
  EXPECT_THAT(mistake_in_grid("  seed: {from: 1, to: 2, count: 4}\n"), HasSubstr("expected an integer"));
  EXPECT_THAT(mistake_in_grid("  estimator.initial: [{stat: {}}]\n"), HasSubstr("did you mean 'state'"));
  EXPECT_THAT(mistake_in_grid("  controller.solver.name: [gn_rti, ipopd]\n"),
              AllOf(StartsWith("sweep.yaml:3"), HasSubstr("did you mean 'ipopt'")));
  EXPECT_THAT(mistake_in_grid("  speed.wheel: [1]\n"),
              AllOf(StartsWith("sweep.yaml:3"), HasSubstr("only a map has keys")));
  EXPECT_THAT(mistake_in("scenario: figure8.yaml\nset: {spede: 3}\ngrid: {seed: [1, 2]}\n"),
              AllOf(StartsWith("sweep.yaml:2"), HasSubstr("did you mean 'speed'")));
}

TEST(SweepMistakes, ValuesThatOnlyDoNotFitOneAnotherAreNone) {
  // An overlap has to be at most the horizon: with 5 two of them are too long, with 15 none is.
  EXPECT_EQ(mistake_in_grid("  estimator.horizon: [5, 15]\n  blocking.kappa.overlap: [0, 4, 6, 9]\n"), "");
  EXPECT_THAT(mistake_in_grid("  estimator.horizon: [5, 15]\n  blocking.kappa.overlap: [0, 4, 6, 16]\n"),
              AllOf(StartsWith("sweep.yaml:4"), HasSubstr("no run can have '16'"), HasSubstr("at least 16 intervals")));
}

TEST(SweepMistakes, RunsThatAreTheSame) {
  EXPECT_THAT(mistake_in_grid("  speed: [4, 8, 4.0]\n"),
              AllOf(StartsWith("sweep.yaml:3"), HasSubstr("run 1 (speed=4) and run 3 (speed=4.0)")));
  EXPECT_THAT(mistake_in_grid("  - speed: [4, 8]\n  - {speed: [3, 8], seed: [1]}\n"),
              AllOf(StartsWith("sweep.yaml:4"), HasSubstr("run 2 (speed=8) and run 4 (speed=8, seed=1)")));
  EXPECT_THAT(mistake_in_grid("  blocking.kappa: [{name: structured, size: 2}, {name: structured, size: 3}]\n"
                              "  blocking.kappa.size: [4, 5]\n"),
              HasSubstr("two runs of the grid are the same"));
}

}  // namespace sweep_check_test
}  // namespace rhec::sim
