#include "sim/tuning/tuned_tables.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/support/weaving_drive.hpp"

namespace rhec::sim {
namespace tuned_tables_test {

class TunedTablesTest : public testing::Test {
 protected:
  const Host host_;
  const HoldOut judges_{.every = 5, .phase = 4};
  const LogTables tables_ = WeavingDrive{.seconds = 60.0}.tables();
  const TunedTables log_{host_, tables_, weaving_settings(), judges_};
};

TEST_F(TunedTablesTest, AFixCountsOrJudgesOnceTheHeadingIsKnown) {
  ASSERT_GT(log_.entries().size(), 100u);
  EXPECT_FALSE(log_.entries().front().counts);
  for (std::size_t i = 0; i < log_.entries().size(); ++i) {
    const TunedEntry& entry = log_.entries()[i];
    const bool is_known = entry.counts || entry.is_judge;
    EXPECT_EQ(entry.is_judge, is_known && judges_.holds(i)) << i;
    EXPECT_TRUE(is_known || i == 0 || !(log_.entries()[i - 1].counts || log_.entries()[i - 1].is_judge)) << i;
  }
  EXPECT_TRUE(log_.entries().back().counts || log_.entries().back().is_judge);
}

TEST_F(TunedTablesTest, ResultsHaveAnItemForEachFix) {
  const std::vector<Innovation> innovations = log_.innovations(weaving_settings(), judges_);
  const std::vector<double> predicted = log_.predictions(weaving_settings(), judges_, false);
  const std::vector<double> interpolated = log_.interpolations(weaving_settings(), judges_);
  ASSERT_EQ(innovations.size(), log_.entries().size());
  ASSERT_EQ(predicted.size(), innovations.size());
  ASSERT_EQ(interpolated.size(), innovations.size());
  for (std::size_t i = 0; i < predicted.size(); ++i) {
    EXPECT_EQ(std::isfinite(predicted[i]), judges_.holds(i)) << i;
    EXPECT_EQ(std::isfinite(interpolated[i]), judges_.holds(i)) << i;
    EXPECT_TRUE(innovations[i].size == 0 || !judges_.holds(i)) << i;
  }
}

TEST_F(TunedTablesTest, WhatJudgesDoesNotHelpToPredict) {
  const HoldOut rest{.every = 5, .phase = 0};
  const std::vector<double> with = log_.predictions(weaving_settings(), rest, false),
                            without = log_.predictions(weaving_settings(), rest, true);
  int differ = 0;
  for (std::size_t i = 0; i < with.size(); ++i) {
    EXPECT_EQ(std::isfinite(without[i]), rest.holds(i)) << i;
    differ += rest.holds(i) && with[i] != without[i];
  }
  EXPECT_GT(differ, 10);
}

}  // namespace tuned_tables_test
}  // namespace rhec::sim
