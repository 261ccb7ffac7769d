#include "rhec/sim/replay/replay_summary.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/support/driven_log.hpp"

namespace rhec::sim {
namespace replay_summary_test {

class ReplaySummaryTest : public DrivenLogTest {
 protected:
  ReplayScenario scenario_{Host(), settings_of("skid_steer")};
  const Robot& robot_ = scenario_.variants().front().robot;
  DriveReplay replay_ = [] {
    DriveReplay made;
    made.name = "made";
    made.sensors = {{"x_gps and y_gps", {0, 1}}, {"heading", {2}}};
    for (int i = 0; i < 4; ++i)
      made.innovations.push_back({1.0 * i, 0, i != 3, 2.0, 0.0, {0.3, i % 2 ? 0.4 : -0.4}, {0.5, 0.5}});
    made.withheld_sensor = 0;
    made.predictions = {{0, 1.0, {3.0, 4.0}, 5.0}, {1, 2.0, {0.0, 1.0}, 1.0}, {2, 3.0, {std::nan(""), 2.0}, 2.0}};
    made.unpredicted = 2;
    return made;
  }();
};

TEST_F(ReplaySummaryTest, InnovationsAreCountedBySensor) {
  const std::vector<SensorSummary> found = summarise_innovations(replay_, robot_);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].used, 3);
  EXPECT_EQ(found[0].rejected, 1);
  EXPECT_EQ(found[0].nis, 2.0);
  EXPECT_EQ(found[0].expected, 2.0);
  EXPECT_NEAR(found[0].outputs[0].rms, 0.3, 1e-12);
  EXPECT_NEAR(found[0].outputs[0].expected, 0.5, 1e-12);
  EXPECT_NEAR(found[0].outputs[0].correlation, 1.0, 1e-12);
  EXPECT_NEAR(found[0].outputs[1].correlation, -1.0, 1e-12);
  EXPECT_EQ(found[1].used, 0);
  EXPECT_TRUE(std::isnan(found[1].nis));
}

TEST_F(ReplaySummaryTest, PredictionsHaveDistancesAndResiduals) {
  const AccuracySummary found = summarise_predictions(replay_, robot_);
  EXPECT_EQ(found.count, 3);
  EXPECT_EQ(found.unpredicted, 2);
  EXPECT_EQ(found.median, 2.0);
  EXPECT_NEAR(found.rms, std::sqrt(10.0), 1e-12);
  EXPECT_EQ(found.most, 5.0);
  EXPECT_NEAR(found.outputs[0].rms, std::sqrt(4.5), 1e-12);
}

TEST_F(ReplaySummaryTest, FilesHaveARowForEach) {
  replay_.estimates.push_back(
      {.time = 0.5, .values = Eigen::VectorXd::Ones(6), .sigmas = Eigen::VectorXd::Constant(6, NAN)});
  const std::vector<DriveResult> results{{replay_, replay_}};
  const auto lines = [](const std::string& text) { return std::count(text.begin(), text.end(), '\n'); };
  EXPECT_EQ(lines(drive_estimates_csv(results, robot_)), 2);
  EXPECT_THAT(drive_estimates_csv(results, robot_), testing::HasSubstr("made,0.5,1,1,1,1,1,1,,,,,,,0,ok,"));
  EXPECT_EQ(lines(innovations_csv(results, robot_)), 5);
  EXPECT_THAT(innovations_csv(results, robot_), testing::HasSubstr("x_gps and y_gps,0,2,0.3,0.4,,0.5,0.5,"));
  EXPECT_EQ(lines(predictions_csv(results, robot_)), 4);
  EXPECT_THAT(predictions_csv(results, robot_), testing::HasSubstr("made,3,2,,2\n"));
  const Json json = Json::parse(drive_summary_json(results, "name", robot_, {}, "x.mcap", {5, 4}));
  EXPECT_EQ(json["variants"]["made"]["held_out"]["median"].as_number(), 2.0);
  EXPECT_TRUE(json["variants"]["made"]["innovations"]["heading"]["nis"].is_null());
}

}  // namespace replay_summary_test
}  // namespace rhec::sim
