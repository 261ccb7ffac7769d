#include "core/horizon/between_cache.hpp"

#include <gtest/gtest.h>

namespace rhec {
namespace between_cache_test {

using namespace testing;

BetweenNodes measured(std::initializer_list<double> times) {
  BetweenNodes between(1, 4);
  for (const double time : times) between.add(time)[0] = 1.0;
  return between;
}

TEST(BetweenCache, HoldsForItsKeyAndTimes) {
  BetweenCache cache(3, 4, 2, 5, 6);
  const BetweenNodes between = measured({0.1, 0.2});
  cache.key()[0] = 1.0;
  cache.key()[1] = 0.5;
  EXPECT_FALSE(cache.holds(1, between));
  EXPECT_FALSE(cache.has_times(1, between, 1));
  cache.begin(1, between);
  EXPECT_TRUE(cache.holds(1, between));
  EXPECT_FALSE(cache.holds(0, between));
  EXPECT_FALSE(cache.holds(1, measured({0.1, 0.21})));
  EXPECT_FALSE(cache.holds(1, measured({0.1})));
  cache.key()[0] = 2.0;
  EXPECT_FALSE(cache.holds(1, between));
  EXPECT_TRUE(cache.has_times(1, between, 1)) << "the other entry of the key is the same";
  EXPECT_FALSE(cache.has_times(1, between, 0));
  EXPECT_FALSE(cache.has_times(1, measured({0.1, 0.2, 0.3}), 1));
}

TEST(BetweenCache, WhatIsForgottenKeepsItsTimes) {
  BetweenCache cache(2, 4, 1, 5, 6);
  const BetweenNodes between = measured({0.1, 0.2});
  cache.key()[0] = 1.0;
  cache.begin(0, between);
  cache.forget();
  EXPECT_FALSE(cache.holds(0, between));
  EXPECT_TRUE(cache.has_times(0, between, 0));
  cache.begin(0, between);
  EXPECT_TRUE(cache.holds(0, between));
}

TEST(BetweenCache, MovesWithTheHorizon) {
  BetweenCache cache(3, 4, 1, 5, 6);
  const BetweenNodes between = measured({0.1, 0.2});
  cache.key()[0] = 1.0;
  cache.begin(2, between);
  cache.results(2, 1)[4] = 7.0;
  cache.results_together(2)[5] = 8.0;
  cache.move(1);
  EXPECT_TRUE(cache.holds(1, between));
  EXPECT_EQ(cache.results(1, 1)[4], 7.0);
  EXPECT_EQ(cache.results_together(1)[5], 8.0);
  EXPECT_FALSE(cache.holds(2, between));
}

}  // namespace between_cache_test
}  // namespace rhec
