#include "sim/tuning/judgement.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "rhec/sim/numbers/random.hpp"

namespace rhec::sim {
namespace judgement_test {

TEST(Judgement, StatisticsAreWhatTheyAreCalled) {
  EXPECT_EQ(median_of({3.0, 1.0, 2.0}), 2.0);
  EXPECT_EQ(median_of({4.0, 1.0, 2.0, 3.0}), 2.5);
  EXPECT_EQ(mean_of({1.0, 2.0, 6.0}), 3.0);
  EXPECT_NEAR(capped_rmse_of({3.0, 100.0}), std::sqrt((9.0 + error_cap * error_cap) / 2.0), 1e-12);
}

TEST(Judgement, PairsTellChangesApartThatAreSmallerThanTheSpread) {
  RandomStream random(2, "pairs");
  Pairs pairs;
  for (int i = 0; i < 600; ++i) {
    pairs.times.push_back(i);
    pairs.before.push_back(5.0 + random.normal());
    pairs.after.push_back(i % 7 == 0 ? std::nan("") : pairs.before.back() - 0.05);
  }
  const Compared found = compare("mean", "m", pairs, mean_of, 10.0);
  EXPECT_NEAR(found.after - found.before, -0.05, 1e-9);
  EXPECT_NEAR(found.change_interval.first, -0.05, 1e-9);
  EXPECT_NEAR(found.change_interval.second, -0.05, 1e-9);
  const double half = 0.5 * (found.before_interval.second - found.before_interval.first);
  EXPECT_NEAR(half, 1.96 / std::sqrt(600.0 * 6.0 / 7.0), 0.03);
  EXPECT_LT(found.before_interval.first, found.before);
}

TEST(Judgement, BlocksWidenIntervalsOfErrorsThatLast) {
  RandomStream random(2, "lasting");
  Pairs pairs;
  double level = 0.0;
  for (int i = 0; i < 2000; ++i) {
    level = 0.95 * level + random.normal();
    pairs.times.push_back(i);
    pairs.before.push_back(level);
    pairs.after.push_back(level);
  }
  const auto width = [&](double block) {
    const Compared found = compare("mean", "", pairs, mean_of, block);
    return found.before_interval.second - found.before_interval.first;
  };
  EXPECT_GT(width(100.0), 2.0 * width(1.0));
}

}  // namespace judgement_test
}  // namespace rhec::sim
