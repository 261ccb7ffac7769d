// The files of a run, of samples that are made up here.
#include "rhec/sim/loop/run_files.hpp"

#include <gmock/gmock.h>

#include <Eigen/Core>

#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "sim/support/figure8.hpp"

namespace rhec::sim {
namespace run_files_test {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

Sample sample_at(std::int64_t step) {
  Sample sample;
  sample.step = step;
  sample.time = 0.2 * static_cast<double>(step);
  sample.true_state = Eigen::Vector4d(1.0, 2.0, 0.5, 0.25);
  sample.true_parameters = Eigen::Vector2d(0.8, 0.9);
  sample.state = Eigen::Vector4d(1.5, 2.5, 0.25, 0.125);
  sample.parameters = Eigen::Vector2d(0.75, 0.875);
  sample.nees = missing;
  sample.inputs = {4.0, -0.5};
  sample.reference = {1.0, 2.25, 0.5, 8.0};
  sample.tracking = -0.25;
  sample.heading_error = 0.0625;
  sample.controller_status = Status::iteration_limit;
  sample.controller_fallback = true;
  sample.estimator_us = 12.3456;
  sample.controller_us = 7.0;
  return sample;
}

/// Two samples, of which the second one has a covariance.
RunLog two_samples() {
  RunLog log;
  log.samples = {sample_at(0), sample_at(3)};
  log.samples[1].sigma = Eigen::VectorXd::Constant(6, 0.125);
  log.samples[1].nees = 6.25;
  log.samples[1].true_state[0] = 1.0 / 3.0;
  log.samples[1].relaxed = true;
  log.samples[1].faults = "spike+late";
  log.completed = true;
  log.ended = "the end of the path was reached";
  return log;
}

TEST(StepsCsv, HasARowForEachSample) {
  std::vector<std::string> lines;
  std::istringstream stream(steps_csv(two_samples(), figure8_with({})));
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  EXPECT_THAT(
      lines,
      ElementsAre(
          "step,time,true_x_pos,true_y_pos,true_beta,true_delta,true_kappa,true_mu,x_pos,y_pos,beta,"
          "delta,kappa,mu,sigma_x_pos,sigma_y_pos,sigma_beta,sigma_delta,sigma_kappa,sigma_mu,u1,u2,"
          "reference_x,reference_y,reference_heading,reference_speed,tracking,heading_error,nees,estimator_status,"
          "controller_status,estimator_fallback,controller_fallback,relaxed,faults,health,findings",
          "0,0,1,2,0.5,0.25,0.8,0.9,1.5,2.5,0.25,0.125,0.75,0.875,,,,,,,4,-0.5,1,2.25,0.5,8,-0.25,0.0625,,"
          "solved,iteration_limit,0,1,0,,ok,",
          "3,0.6,0.3333333333,2,0.5,0.25,0.8,0.9,1.5,2.5,0.25,0.125,0.75,0.875,0.125,0.125,0.125,"
          "0.125,0.125,0.125,4,-0.5,1,2.25,0.5,8,-0.25,0.0625,6.25,solved,iteration_limit,0,1,1,spike+late,ok,"));
}

TEST(TimesCsv, HasTheTimesOfBothSolvers) {
  EXPECT_EQ(times_csv(two_samples()), "step,rhe_us,rhc_us\n0,12.346,7.000\n3,12.346,7.000\n");
}

TEST(RunSummaryJson, HasWhatTheRunCameTo) {
  RunSummary summary;
  summary.steps = 3;
  summary.completed = true;
  summary.ended = "the end";
  summary.mae.parameters = {{"kappa", 0.125}};
  summary.mae.tracking = 0.5;
  summary.rmse.position = 0.75;
  summary.mae_after_start.heading = 0.25;
  summary.nees = missing;
  summary.estimator_us = {1.0, 2.0, 3.0};
  summary.controller_statuses = {{"solved", 2}, {"deadline", 1}};
  summary.solves = 6;
  summary.fallbacks = 1;
  const std::string text = summary_json(summary);
  EXPECT_EQ(text.back(), '\n');
  const Json json = Json::parse(text);
  EXPECT_EQ(json.at("steps"), 3);
  EXPECT_EQ(json.at("completed"), true);
  EXPECT_EQ(json.at("ended"), "the end");
  EXPECT_EQ(json.at("mae").at("kappa"), 0.125);
  EXPECT_EQ(json.at("mae").at("tracking"), 0.5);
  EXPECT_EQ(json.at("rmse").at("position"), 0.75);
  EXPECT_EQ(json.at("mae_after_start").at("heading"), 0.25);
  EXPECT_TRUE(json.at("nees").is_null());
  EXPECT_EQ(json.at("solve_time_us").at("rhe").at("p99"), 2.0);
  EXPECT_EQ(json.at("statuses").at("rhc").at("deadline"), 1);
  EXPECT_EQ(json.at("statuses").at("rhe").size(), 0U);
  EXPECT_EQ(json.at("solves"), 6);
  EXPECT_EQ(json.at("fallbacks"), 1);
}

TEST(RunSvg, HasATitleAndAPanelForEachParameterAndTheTracking) {
  RunLog log = two_samples();
  log.samples[0].sigma = log.samples[1].sigma;
  const std::string svg = run_svg(log, figure8_with({"name=my run", "seed=7"}));
  for (const char* words : {"my run", "8 m/s, seed 7; the end of the path was reached", "true kappa",
                            "Distance from the path", "estimated"})
    EXPECT_THAT(svg, HasSubstr(words));
}

}  // namespace run_files_test
}  // namespace rhec::sim
