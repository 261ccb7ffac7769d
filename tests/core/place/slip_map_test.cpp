#include "rhec/core/place/slip_map.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace slip_map_test {

constexpr double day = 86400.0;

SlipMap::Setup of_one() {
  SlipMap::Setup setup;
  setup.parameters = 1;
  setup.capacity = 100;
  return setup;
}

struct Found {
  bool known;
  double mean, variance;
};
Found at(const SlipMap& map, double x, double y) {
  Found found{};
  found.known = map.look_up(x, y, &found.mean, &found.variance);
  return found;
}
void add(SlipMap& map, double x, double y, double mean, double variance) { map.add(x, y, &mean, &variance); }

TEST(SlipMap, KnowsNothingBeforeTheVisitIsOver) {
  SlipMap map(of_one());
  add(map, 0.1, 0.1, 0.7, 0.01);
  EXPECT_FALSE(at(map, 0.1, 0.1).known);
  EXPECT_EQ(at(map, 0.1, 0.1).variance, std::numeric_limits<double>::infinity());
  map.advance(4.0, 19.0);
  EXPECT_FALSE(at(map, 0.1, 0.1).known);
  map.advance(4.0, 2.0);
  const Found found = at(map, 0.1, 0.1);
  EXPECT_TRUE(found.known);
  EXPECT_DOUBLE_EQ(found.mean, 0.7);
  EXPECT_DOUBLE_EQ(found.variance, 0.01);
  EXPECT_FALSE(at(map, 5.0, 0.1).known);
}

TEST(SlipMap, ManyValuesOfOneVisitAreNoBetterThanOne) {
  SlipMap map(of_one());
  for (int i = 0; i < 10; ++i) add(map, 0.1, 0.1, i % 2 ? 0.6 : 0.8, 0.01);
  map.advance(10.0, 100.0);
  EXPECT_NEAR(at(map, 0.1, 0.1).mean, 0.7, 1e-12);
  EXPECT_NEAR(at(map, 0.1, 0.1).variance, 0.01, 1e-12);
}

TEST(SlipMap, NeighboursShareTheirErrors) {
  SlipMap map(of_one());
  for (int i = -3; i <= 3; ++i) add(map, 0.5 * i + 0.25, 0.25, 0.7, 0.01);
  map.advance(10.0, 100.0);
  EXPECT_NEAR(at(map, 0.25, 0.25).mean, 0.7, 1e-12);
  EXPECT_NEAR(at(map, 0.25, 0.25).variance, 0.01, 1e-12);
}

TEST(SlipMap, WhereNeighboursDifferItIsLessSure) {
  SlipMap map(of_one());
  for (int i = -3; i <= 3; ++i) add(map, 0.5 * i + 0.25, 0.25, i < 0 ? 0.5 : 0.9, 1e-4);
  map.advance(10.0, 100.0);
  EXPECT_GT(at(map, 0.0, 0.25).variance, 0.01);
  EXPECT_LT(at(map, 1.7, 0.25).variance, 2e-4);
  EXPECT_GT(at(map, 1.0, 0.25).mean, at(map, -0.5, 0.25).mean);
}

TEST(SlipMap, VisitsAreFusedByTheirVariances) {
  SlipMap map(of_one());
  add(map, 0.1, 0.1, 0.70, 0.01);
  map.advance(10.0, 100.0);
  add(map, 0.1, 0.1, 0.76, 0.02);
  EXPECT_DOUBLE_EQ(at(map, 0.1, 0.1).mean, 0.70) << "the present visit counts not yet";
  map.advance(10.0, 100.0);
  EXPECT_NEAR(at(map, 0.1, 0.1).mean, 0.72, 1e-12);
  EXPECT_NEAR(at(map, 0.1, 0.1).variance, 1.0 / 150.0, 1e-12);
}

TEST(SlipMap, GroundThatHasChangedReplacesWhatWasThere) {
  SlipMap map(of_one());
  add(map, 0.1, 0.1, 0.9, 1e-4);
  map.advance(10.0, 100.0);
  add(map, 0.1, 0.1, 0.5, 4e-4);
  map.advance(10.0, 100.0);
  EXPECT_DOUBLE_EQ(at(map, 0.1, 0.1).mean, 0.5);
  EXPECT_DOUBLE_EQ(at(map, 0.1, 0.1).variance, 4e-4);
}

TEST(SlipMap, ForgetsWithTime) {
  SlipMap::Setup setup = of_one();
  setup.ageing = {0.1 / std::sqrt(day)};
  SlipMap map(setup);
  add(map, 0.1, 0.1, 0.7, 0.01);
  map.begin_drive(4.0 * day);
  EXPECT_NEAR(at(map, 0.1, 0.1).variance, 0.01 + 0.04, 1e-9);
  add(map, 0.1, 0.1, 0.8, 0.05);
  map.begin_drive(4.0 * day);
  EXPECT_NEAR(at(map, 0.1, 0.1).mean, 0.75, 1e-9);  // the old value weighs as little as the new one
}

TEST(SlipMap, FarAwayIsLessSure) {
  SlipMap::Setup setup = of_one();
  setup.spread = {0.1};
  SlipMap map(setup);
  add(map, 0.25, 0.25, 0.7, 0.01);
  map.advance(10.0, 100.0);
  EXPECT_NEAR(at(map, 1.25, 0.25).variance, 0.02, 1e-12);
  EXPECT_FALSE(at(map, 1.80, 0.25).known);
}

TEST(SlipMap, LeavesOutWhatIsNoNumberAndCountsWhatFindsNoRoom) {
  SlipMap::Setup setup = of_one();
  setup.capacity = 3;
  SlipMap map(setup);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  add(map, 0.0, 0.0, nan, 0.01);
  add(map, 0.0, 0.0, 0.7, 0.0);
  add(map, 0.0, 0.0, 0.7, std::numeric_limits<double>::infinity());
  EXPECT_EQ(map.size(), 0U);
  add(map, nan, 0.0, 0.7, 0.01);
  EXPECT_EQ(map.dropped(), 1);
  for (int i = 0; i < 5; ++i) add(map, i, 0.0, 0.7, 0.01);
  EXPECT_EQ(map.size(), 3U);
  EXPECT_EQ(map.dropped(), 3);
  EXPECT_FALSE(at(map, nan, 0.0).known);
}

TEST(SlipMap, CellsOfOneMapMergeIntoAnother) {
  SlipMap first(of_one()), second(of_one());
  add(first, 0.1, 0.1, 0.70, 0.01);
  add(second, 0.1, 0.1, 0.76, 0.02);
  add(second, 9.1, -4.1, 0.5, 0.02);
  SlipMap both(of_one());
  for (const SlipMap* map : {&first, &second})
    for (const SlipMap::Cell& cell : map->cells()) EXPECT_TRUE(both.merge(cell));
  both.begin_drive(0.0);
  EXPECT_EQ(both.size(), 2U);
  EXPECT_NEAR(at(both, 0.1, 0.1).mean, 0.72, 1e-12);
  EXPECT_NEAR(at(both, 9.1, -4.1).mean, 0.5, 1e-12);
  const auto cells = both.cells();
  ASSERT_EQ(cells.size(), 2U);
  EXPECT_LT(cells[0].y, cells[1].y);
  EXPECT_EQ(cells[1].visits, 2);
  EXPECT_EQ(cells[1].values, 2);
}

TEST(SlipMap, RefusesNumbersOutOfRange) {
  const auto refused = [](auto change) {
    SlipMap::Setup setup = of_one();
    change(setup);
    EXPECT_THROW(SlipMap{setup}, Error);
  };
  refused([](SlipMap::Setup& s) { s.parameters = 0; });
  refused([](SlipMap::Setup& s) { s.cell = 0.0; });
  refused([](SlipMap::Setup& s) { s.capacity = 0; });
  refused([](SlipMap::Setup& s) { s.reach = 1000.0; });
  refused([](SlipMap::Setup& s) { s.ageing = {-1.0}; });
  refused([](SlipMap::Setup& s) { s.spread = {0.1, 0.1}; });
}

}  // namespace slip_map_test
}  // namespace rhec
