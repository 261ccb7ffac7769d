#include "rhec/sim/report/sweep_table.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "sim/support/run_groups.hpp"

namespace rhec::sim {
namespace sweep_table_test {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Seed by seed: what was measured.
RunGroup with(RunGroup group, const std::vector<std::vector<double>>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) group.outcomes[i].values = values[i];
  return group;
}

TEST(SweepTable, HasARowForEachSettingTheBestFirst) {
  SweepRuns runs;
  runs.measures = {"rhe.median", "mae.kappa", "mae.tracking"};
  runs.groups = {with(group_of({{"speed", "4"}, {"estimator.name", "\"ekf\""}, {"step", "0.2"}}, 2),
                      {{9.0, 0.2, 1.0}, {9.0, 0.4, nan}}),
                 with(group_of({{"speed", "8"}, {"step", "0.2"}}, 3), {{9.0, 0.1, 2.0}}),
                 group_of({{"speed", "9"}, {"step", "0.2"}}, 1)};
  const SweepTable table = sweep_table(runs);
  EXPECT_THAT(table.keys, ElementsAre("estimator.name", "speed")) << "what does not vary is no column";
  EXPECT_THAT(table.measures, ElementsAre("kappa", "tracking"));
  ASSERT_EQ(table.rows.size(), 3U);
  EXPECT_THAT(table.rows[0].values, ElementsAre("-", "8"));
  EXPECT_EQ(table.rows[0].runs, 3);
  EXPECT_EQ(table.rows[0].completed, 1);
  EXPECT_THAT(table.rows[0].means, ElementsAre(0.1, 2.0));
  EXPECT_THAT(table.rows[1].values, ElementsAre("ekf", "4"));
  EXPECT_NEAR(table.rows[1].means[0], 0.3, 1e-15);
  EXPECT_EQ(table.rows[1].means[1], 1.0) << "of the runs that have it";
  EXPECT_EQ(table.rows[2].completed, 0);
  EXPECT_TRUE(std::isnan(table.rows[2].means[0])) << "nothing is known: last";
}

TEST(SweepTable, OfNothingIsEmpty) { EXPECT_THAT(sweep_table(SweepRuns{}).rows, IsEmpty()); }

}  // namespace sweep_table_test
}  // namespace rhec::sim
