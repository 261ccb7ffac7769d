// The files of a replay, of estimates that are made up here.
#include <gmock/gmock.h>

#include <Eigen/Core>

#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "rhec/sim/files/json.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "sim/support/recorded_drive.hpp"

namespace rhec::sim {
namespace recorded_log_files_test {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

/// Two fixes, of which the second one is withheld and agrees with its neighbours.
RecordedLog two_fixes() {
  RecordedLog log;
  log.rows.resize(5);
  log.fixes = {{1.0, 10.0, 20.0, 1, false}, {2.0, 11.0, missing, 2, true}};
  log.missing_coordinates = 1;
  log.missing_speeds = 3;
  return log;
}

LoggedEstimate estimate_at(double time, std::int64_t fix, bool held_out, double residual) {
  LoggedEstimate estimate;
  estimate.time = time;
  estimate.values = Eigen::VectorXd::LinSpaced(6, 1.0, 6.0);
  estimate.sigmas = Eigen::VectorXd::Constant(6, 0.5);
  estimate.sigmas[1] = missing;
  estimate.fix = fix;
  estimate.held_out = held_out;
  estimate.residual = residual;
  return estimate;
}

Replay replay_of(const std::string& name) {
  Replay replay;
  replay.name = name;
  replay.estimates = {estimate_at(1.0, 0, false, 0.25), estimate_at(1.5, -1, false, missing),
                      estimate_at(2.0, 1, true, 0.75)};
  replay.estimates[1].fallback = true;
  replay.counts.nodes = 2;
  replay.counts.estimates = 2;
  replay.counts.fallbacks = 1;
  replay.solve_us = {10.0, 30.0};
  return replay;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

TEST(EstimatesCsv, HasARowForEachEstimateOfEachVariant) {
  const LogScenario scenario = scenario_of(scenario_text, {"ekf"});
  EXPECT_THAT(lines_of(estimates_csv({replay_of("ekf"), replay_of("rhe")}, two_fixes(), scenario)),
              ElementsAre("variant,time,kind,x_pos,y_pos,beta,delta,kappa,mu,sigma_x_pos,sigma_y_pos,sigma_beta,"
                          "sigma_delta,sigma_kappa,sigma_mu,fix_x,fix_y,residual,held_out,fallback",
                          "ekf,1,fix,1,2,3,4,5,6,0.5,,0.5,0.5,0.5,0.5,10,20,0.25,0,0",
                          "ekf,1.5,node,1,2,3,4,5,6,0.5,,0.5,0.5,0.5,0.5,,,,0,1",
                          "ekf,2,fix,1,2,3,4,5,6,0.5,,0.5,0.5,0.5,0.5,11,,0.75,1,0",
                          "rhe,1,fix,1,2,3,4,5,6,0.5,,0.5,0.5,0.5,0.5,10,20,0.25,0,0",
                          "rhe,1.5,node,1,2,3,4,5,6,0.5,,0.5,0.5,0.5,0.5,,,,0,1",
                          "rhe,2,fix,1,2,3,4,5,6,0.5,,0.5,0.5,0.5,0.5,11,,0.75,1,0"));
}

TEST(TimesCsv, HasARowForEachSolve) {
  EXPECT_EQ(times_csv({replay_of("ekf")}), "variant,node,rhe_us\nekf,0,10.000\nekf,1,30.000\n");
}

TEST(LogSummary, IsAboutTheFirstVariantAndTheOthersBesideIt) {
  const LogScenario scenario = scenario_of(scenario_text, {"ekf"});
  Replay none = replay_of("nothing");
  none.estimates.clear();
  none.solve_us.clear();
  const Json json = Json::parse(summary_json({replay_of("ekf"), none}, two_fixes(), scenario, {5, 4}));
  EXPECT_EQ(json.at("name"), "circle");
  EXPECT_EQ(json.at("variant"), "ekf");
  EXPECT_EQ(json.at("dead_reckoning").at("rows"), 5);
  EXPECT_EQ(json.at("dead_reckoning").at("missing").at("speed"), 3);
  EXPECT_EQ(json.at("fixes").at("rows"), 2);
  EXPECT_EQ(json.at("fixes").at("missing_coordinates"), 1);
  EXPECT_EQ(json.at("fixes").at("consistent"), 1);
  EXPECT_EQ(json.at("hold_out").at("every"), 5);
  EXPECT_EQ(json.at("hold_out").at("phase"), 4);
  EXPECT_EQ(json.at("held_out").at("count"), 1);
  EXPECT_EQ(json.at("held_out").at("median_m"), 0.75);
  EXPECT_EQ(json.at("held_out").at("consistent").at("count"), 1);
  const Json &ekf = json.at("variants").at("ekf"), &nothing = json.at("variants").at("nothing");
  EXPECT_EQ(ekf.at("nodes"), 2);
  EXPECT_EQ(ekf.at("fallbacks"), 1);
  EXPECT_EQ(ekf.at("solve_time_us").at("max"), 30.0);
  EXPECT_EQ(nothing.at("held_out").at("count"), 0);
  EXPECT_TRUE(nothing.at("held_out").at("median_m").is_null()) << "nothing is no perfect zero";
  EXPECT_EQ(nothing.at("solve_time_us").at("median"), 0.0);
}

TEST(ReplaySvg, ShowsFixesAndBesideItTheParametersOfAnother) {
  const LogScenario scenario = scenario_of(scenario_text, {"ekf"});
  const Replay mine = replay_of("mine"), other = replay_of("the other one");
  const std::string alone = replay_svg(mine, two_fixes(), scenario),
                    both = replay_svg(mine, two_fixes(), scenario, &other);
  EXPECT_THAT(alone, HasSubstr("mine; 1 withheld fixes met to 0.750 m in the median"));
  EXPECT_THAT(alone, HasSubstr("withheld"));
  EXPECT_THAT(alone, Not(HasSubstr("the other one")));
  EXPECT_THAT(both, HasSubstr("the other one"));
}

}  // namespace recorded_log_files_test
}  // namespace rhec::sim
