#include "sim/tuning/drive_innovations.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/support/driven_log.hpp"

namespace rhec::sim {
namespace drive_innovations_test {

class DriveInnovationsTest : public DrivenLogTest {
 protected:
  void SetUp() override {
    for (const char* assignment : {"estimator.name=ekf", "model.outputs=[x_gps, y_gps, heading]"})
      apply_assignment(settings_, assignment);
    DrivenLogTest::drive(settings_, "drive.csv");
    drive_ = read(ReplayScenario(Host(), settings_).variants().front(), "drive.csv");
  }
  ReplayScenario scenario(bool has_judge) const {
    Settings settings = settings_;
    settings.set("estimator.health.watch", Settings::scalar(has_judge ? "true" : "false"));
    return {Host(), settings};
  }
  std::vector<AskedInnovation> asked(const logs::Drive& drive) const {
    const ReplayScenario with = scenario(false);
    return asked_innovations(with.variants().front().robot, drive, {}, with.simulated_start());
  }
  Settings settings_ = settings_of("skid_steer");
  logs::Drive drive_;
};

TEST_F(DriveInnovationsTest, AtNodesTheyAreThoseOfTheJudge) {
  const ReplayScenario judged = scenario(true);
  const DriveReplay replay = replay_drive(judged.variants().front().robot, drive_, {}, judged.simulated_start());
  const std::vector<AskedInnovation> found = asked(drive_);
  ASSERT_EQ(found.size(), replay.innovations.size());
  ASSERT_GT(found.size(), 200u);
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].sensor, replay.innovations[i].sensor) << i;
    EXPECT_NEAR(found[i].time, replay.innovations[i].time, 1e-9) << i;
    EXPECT_NEAR(found[i].innovation.squared, replay.innovations[i].nis, 1e-6 * (1.0 + replay.innovations[i].nis)) << i;
    EXPECT_NEAR(found[i].innovation.log_determinant, replay.innovations[i].log_determinant, 1e-6) << i;
  }
}

TEST_F(DriveInnovationsTest, BetweenNodesTheyHaveTheExpectedSize) {
  // The heading is measured half an interval later than the position, and is moved on by as much.
  logs::Drive apart = drive_;
  apart.events.clear();
  apart.values.clear();
  for (const logs::DriveEvent& event : drive_.events) {
    const std::size_t count = event.is_output ? 3 : static_cast<std::size_t>(drive_.inputs);
    for (const bool is_second : {false, true}) {
      if (is_second && !event.is_output) continue;
      apart.events.push_back(event);
      apart.events.back().values = apart.values.size();
      if (is_second) apart.events.back().time = apart.events.back().arrival = event.time - 0.1;
      for (std::size_t j = 0; j < count; ++j)
        apart.values.push_back(event.is_output && (j == 2) != is_second ? std::nan("") : drive_.values_of(event)[j]);
    }
  }
  std::stable_sort(apart.events.begin(), apart.events.end(),
                   [](const logs::DriveEvent& a, const logs::DriveEvent& b) { return a.time < b.time; });
  double positions = 0.0;
  int count = 0;
  for (const AskedInnovation& each : asked(apart)) {
    EXPECT_EQ(each.innovation.size, each.sensor == 0 ? 2 : 1);
    if (each.sensor != 0) continue;
    positions += each.innovation.squared;
    ++count;
  }
  ASSERT_GT(count, 100);
  EXPECT_NEAR(positions / count, 2.0, 0.5);
}

TEST_F(DriveInnovationsTest, WhatIsFarOffCountsAndIsNotFollowed) {
  logs::Drive spiked = drive_;
  std::size_t seen = 0;
  double at = 0.0;
  for (const logs::DriveEvent& event : spiked.events)
    if (event.is_output && ++seen == 60) {
      spiked.values[event.values] += 100.0;
      at = event.time;
    }
  const std::vector<AskedInnovation> right = asked(drive_), found = asked(spiked);
  ASSERT_EQ(found.size(), right.size());
  bool is_behind = false;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i].sensor != 0) continue;
    if (std::abs(found[i].time - at) < 1e-9) {
      EXPECT_GT(found[i].innovation.squared, 1e4);
      is_behind = true;
    } else if (is_behind) {
      EXPECT_LT(found[i].innovation.squared, right[i].innovation.squared + 12.0) << found[i].time;
    }
  }
  EXPECT_TRUE(is_behind);
}

}  // namespace drive_innovations_test
}  // namespace rhec::sim
