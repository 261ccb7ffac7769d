#include "rhec/sim/logs/recorded_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "sim/support/recorded_drive.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace recorded_log_test {

using testing::AllOf;
using testing::HasSubstr;

class RecordedLogTest : public RecordedDriveTest {
 protected:
  std::string message_for(const std::string& rows, const std::string& fixes) const {
    return error_of([&] { log(scenario_of(), rows, fixes); });
  }
};

TEST_F(RecordedLogTest, FindsTheHeadingAndTheSlipAndPredictsWhatIsWithheld) {
  const LogScenario scenario = scenario_of();
  const RecordedLog drive = log(scenario);
  for (const LogVariant& variant : scenario.variants()) {
    const Replay result = replay(variant.robot, drive, scenario.log(), {5, 4});
    const HeldOutSummary summary = summarise(result, drive);
    EXPECT_EQ(summary.all.count, 40) << variant.name;
    EXPECT_EQ(result.counts.fallbacks, 0) << variant.name;
    EXPECT_LT(summary.all.median, 0.1) << variant.name;
    const LoggedEstimate& last = result.estimates.back();
    EXPECT_NEAR(
        std::remainder(last.values[2] - (heading + kappa * speed / wheelbase * std::tan(steering) * (last.time - 2.0)),
                       2.0 * M_PI),
        0.0, 0.1)
        << variant.name;
    EXPECT_NEAR(last.values[4], kappa, 0.05) << variant.name;
  }
}

TEST_F(RecordedLogTest, AWithheldFixLeavesNoTrace) {
  const LogScenario scenario = scenario_of();
  const HoldOut hold_out{5, 4};
  const RecordedLog drive = log(scenario);
  RecordedLog bent = drive;
  for (std::size_t i = 0; i < bent.fixes.size(); ++i)
    if (hold_out.holds(i)) bent.fixes[i].x += 100.0;
  RecordedLog without = drive;
  without.fixes.clear();
  for (std::size_t i = 0; i < drive.fixes.size(); ++i)
    if (!hold_out.holds(i)) without.fixes.push_back(drive.fixes[i]);
  for (const LogVariant& variant : scenario.variants()) {
    const auto nodes = [&](const RecordedLog& which, const HoldOut& held) {
      std::vector<std::vector<double>> rows;
      for (const LoggedEstimate& entry : replay(variant.robot, which, scenario.log(), held).estimates) {
        if (entry.held_out) continue;
        rows.push_back({entry.time});
        rows.back().insert(rows.back().end(), entry.values.begin(), entry.values.end());
      }
      return rows;
    };
    const auto expected = nodes(drive, hold_out);
    EXPECT_EQ(expected, nodes(bent, hold_out)) << variant.name;
    EXPECT_EQ(expected, nodes(without, {})) << variant.name;
  }
}

TEST_F(RecordedLogTest, NodesAreNeverFurtherApartThanTheStep) {
  const LogScenario scenario = scenario_of(scenario_text, {"ekf"});
  RecordedLog drive = log(scenario);
  drive.fixes.erase(drive.fixes.begin() + 80, drive.fixes.begin() + 120);  // 8 s without fixes
  const Replay result = replay(scenario.variants().front().robot, drive, scenario.log(), {5, 4});
  double last = result.estimates.front().time;
  for (const LoggedEstimate& entry : result.estimates) {
    if (entry.held_out) continue;
    EXPECT_LE(entry.time - last, 0.2 + 1e-6) << entry.time;
    last = entry.time;
  }
  EXPECT_LT(summarise(result, drive).all.rmse_capped, 0.5);
}

TEST_F(RecordedLogTest, MasksAndCountsWhatIsMissing) {
  const LogScenario scenario = scenario_of();
  const auto replaced = [](std::string text, const std::string& start, int column) {
    const std::size_t row = text.find("\n" + start) + 1;
    std::size_t begin = row;
    for (int i = 0; i < column; ++i) begin = text.find(',', begin) + 1;
    return text.replace(begin, text.find_first_of(",\n", begin) - begin, "nan");
  };
  std::string rows = replaced(replaced(rows_, "10.050,", 1), "20.100,", 2);
  const RecordedLog drive = log(scenario, rows, replaced(fixes_, "12.000,", 1));
  EXPECT_EQ(drive.missing_speeds, 1);
  EXPECT_EQ(drive.missing_steerings, 1);
  EXPECT_EQ(drive.missing_coordinates, 1);
  for (const LogVariant& variant : scenario.variants()) {
    const Replay result = replay(variant.robot, drive, scenario.log(), {5, 4});
    for (const LoggedEstimate& entry : result.estimates) ASSERT_TRUE(entry.values.allFinite()) << variant.name;
    EXPECT_LT(summarise(result, drive).all.median, 0.1) << variant.name;
  }
}

TEST_F(RecordedLogTest, AWithheldFixWithoutAnEstimateCountsWithTheCap) {
  const LogScenario scenario = scenario_of(scenario_text, {"ekf"});
  std::string rows = rows_.substr(rows_.find("\n1.500,") + 1);
  const RecordedLog drive = log(scenario, rows, fixes_);
  const Replay result = replay(scenario.variants().front().robot, drive, scenario.log(), {5, 4});
  EXPECT_EQ(result.unpredicted, 1);
  EXPECT_EQ(summarise(result, drive).all.count, 40);
}

TEST_F(RecordedLogTest, TellsFixesThatAgreeWithTheirNeighbours) {
  const std::string rows = "0,0,0\n1,0,0\n";
  const RecordedLog drive = log(
      scenario_of(), rows, "0,0,0\n0.2,0.1,0\n0.4,9,0\n0.6,0.3,0\n0.8,0.4,0\n1.0,0.5,0\n2.5,1,0\n2.7,1,0\n2.9,1,nan\n");
  std::vector<bool> agrees;
  for (const Fix& fix : drive.fixes) agrees.push_back(fix.agrees);
  // The ends have one neighbour; 9 jumps, and so both beside it stand off; 2.5 s is too far from 1.0 s.
  EXPECT_EQ(agrees, (std::vector<bool>{false, false, false, false, true, false, false, false, false}));
}

TEST_F(RecordedLogTest, NamesFileLineAndWhatIsWrong) {
  EXPECT_THAT(message_for("0,1,0\n1,1\n", fixes_), AllOf(HasSubstr("drs.txt:2: "), HasSubstr("3 are expected")));
  EXPECT_THAT(message_for("0,1,0\n1,fast,0\n", fixes_), AllOf(HasSubstr("drs.txt:2: "), HasSubstr("'fast'")));
  EXPECT_THAT(message_for("0,1,0\n2,1,0\n1,1,0\n", fixes_), HasSubstr("drs.txt:3: time runs backwards"));
  EXPECT_THAT(message_for(rows_, "0,1,0\n2,1,0\n1,1,0\n"), HasSubstr("gps.txt:3: time runs backwards"));
  EXPECT_THAT(message_for(rows_, "nan,1,0\n"), HasSubstr("gps.txt:1: the time is missing"));
  EXPECT_THAT(message_for(rows_, "0,1,0\n1e9,1,0\n"), HasSubstr("gps.txt:2: time leaps"));
  EXPECT_THAT(message_for(rows_, "100,1,0\n101,1,0\n"), HasSubstr("expected logs of one drive"));
  EXPECT_THAT(message_for("0,1,80\n", fixes_), AllOf(HasSubstr("drs.txt:1: "), HasSubstr("expected")));
  EXPECT_THAT(error_of([&] { read_recorded_log(file("none.txt"), file("none.txt"), scenario_of()); }),
              HasSubstr("none.txt: cannot be read"));
}

TEST_F(RecordedLogTest, TakesErrorsOfTheDeadReckoningOut) {
  std::string text = scenario_text;
  text.replace(text.find("wheel_offset: 0.5"), std::string("wheel_offset: 0.5").size(),
               "speed_bias: 0.5, speed_scale: 2, steering_bias: 0.1, steering_scale: 0.5, fix_delay: 0.25");
  const RecordedLog drive = log(scenario_of(text), "0,1.5,0.3\n1,2.5,-0.1\n2,2.5,nan\n", "0.5,1,2\n1.5,3,4\n");
  EXPECT_DOUBLE_EQ(drive.rows[0].speed, 2.0);
  EXPECT_DOUBLE_EQ(drive.rows[1].speed, 4.0);
  EXPECT_DOUBLE_EQ(drive.rows[0].steering, 0.1);
  EXPECT_DOUBLE_EQ(drive.rows[1].steering, -0.1);
  EXPECT_TRUE(std::isnan(drive.rows[2].steering));
  EXPECT_DOUBLE_EQ(drive.fixes[0].time, 0.25);
}

TEST_F(RecordedLogTest, PutsReadingsThatAreLateWhereTheyBelong) {
  const auto drive_with = [&](const char* delay) {
    std::string text = scenario_text;
    text.replace(text.find("wheel_offset: 0.5"), std::string("wheel_offset: 0.5").size(),
                 std::string("steering_delay: ") + delay);
    // Both readings grow by one a second: 10 + t and t.
    return log(scenario_of(text), "0,10,0\n1,11,1\n2,12,2\n3,13,3\n", "0.5,1,2\n1.5,3,4\n");
  };
  for (const char* delay : {"0.25", "-0.25"}) {
    const RecordedLog drive = drive_with(delay);
    const bool steering_is_late = delay[0] != '-';
    for (std::size_t i = 1; i < 4; ++i) {
      const double stamp = static_cast<double>(i);
      EXPECT_DOUBLE_EQ(drive.rows[i].time, stamp - 0.25) << delay;
      EXPECT_DOUBLE_EQ(drive.rows[i].stamp, stamp - 0.25) << delay;
      EXPECT_DOUBLE_EQ(drive.rows[i].steering, steering_is_late ? stamp : stamp - 0.25) << delay;
      EXPECT_DOUBLE_EQ(drive.rows[i].speed, 10.0 + (steering_is_late ? stamp - 0.25 : stamp)) << delay;
    }
    EXPECT_TRUE(std::isnan(steering_is_late ? drive.rows[0].speed : drive.rows[0].steering)) << delay;
  }
}

TEST(LogScenario, RefusesWhatDoesNotFit) {
  const auto message = [](const std::string& from, const std::string& to) {
    std::string text = scenario_text;
    text.replace(text.find(from), from.size(), to);
    return error_of([&] { scenario_of(text); });
  };
  EXPECT_THAT(message("wheel_offset", "wheel_ofset"), AllOf(HasSubstr("circle.yaml:5"), HasSubstr("wheel_offset")));
  EXPECT_THAT(message("{wheel_offset: 0.5}", "{steering: gamma}"),
              AllOf(HasSubstr("circle.yaml:5"), HasSubstr("gamma")));
  EXPECT_THAT(message("wheelbase: 2.0, ", ""), HasSubstr("needs model.wheelbase"));
  EXPECT_THAT(message("rhe: {}", "rhe: {estimator: {horizont: 3}}"),
              AllOf(HasSubstr("horizont"), HasSubstr("horizon")));
  EXPECT_THAT(message("rhe: {}", "rhe: {log: {}}"), HasSubstr("shared by all variants"));
  EXPECT_THAT(error_of([] { scenario_of(scenario_text, {"best"}); }),
              AllOf(HasSubstr("'best'"), HasSubstr("rhe, robust, ekf")));
  const std::string whole = scenario_text;
  EXPECT_THAT(error_of([&] { scenario_of(whole.substr(0, whole.find("variants:")), {"rhe"}); }),
              HasSubstr("no variants"));
}

}  // namespace recorded_log_test
}  // namespace rhec::sim
