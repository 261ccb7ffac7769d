#include "rhec/plugins/robot/state_noise.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "rhec/core/model/state_noise_model.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace state_noise_test {

Robot robot_with(const std::string& noise, const std::string& estimator) {
  static const Host host;
  return {host, RobotOptions::table().parse(
                    parse_yaml("{model: bicycle_slip, noise: " + noise + ", estimator: {name: " + estimator + "}}",
                               "robot.yaml"),
                    "robot")};
}

/// Variance of y after ten seconds at rest without a measurement, with nodes that are `step` apart.
double variance_after(const std::string& noise, const std::string& estimator, double step) {
  const Robot robot = robot_with(noise, estimator);
  const auto made = robot.make_estimator();
  const double fix[] = {0.0, 0.0, 0.0}, still[] = {0.0, 0.0};
  const std::vector<double> none(3, std::numeric_limits<double>::quiet_NaN());
  made->push_measurement(0.0, fix);
  made->push_input(0.0, still);
  made->estimate(0.0);
  double time = 0.0;
  while (time < 10.0 - 1e-9) {
    time += step;
    made->push_measurement(time, none.data());
    made->estimate(time);
  }
  return made->estimate(time).covariance(1, 1);
}

TEST(StateNoise, GrowsByTheSecondHoweverADriveIsDivided) {
  for (const char* estimator : {"ekf", "bank", "rhe"})
    for (const double step : {0.1, 0.2}) {
      const double without = variance_after("{}", estimator, step),
                   with = variance_after("{states: {y_pos: 0.3}}", estimator, step);
      EXPECT_NEAR(with - without, 0.09 * 10.0, 0.01) << estimator << ' ' << step;
    }
}

TEST(StateNoise, IsTheBusinessOfEstimatorsAlone) {
  const Robot robot = robot_with("{states: {y_pos: 0.3, delta: 0.01}}", "rhe");
  EXPECT_EQ(robot.model()->input_count(), 2);
  EXPECT_EQ(robot.make_controller(Path({{0, 0, 1}, {9, 0, 1}}))->vehicle().input_count(), 2);
  const auto estimator = robot.make_estimator();
  EXPECT_EQ(estimator->model().input_count(), 4);
  EXPECT_EQ(estimator->model().description().noisy_states, (std::vector{1, 3}));
}

// With nothing measured, a block's value is its prior: its motion has the variance of free noise.
TEST(StateNoise, InBlocksGrowsAsMuch) {
  const auto variance_with = [](const char* blocking, const char* covariance) {
    static const Host host;
    const Robot robot(host,
                      RobotOptions::table().parse(
                          parse_yaml(std::string("{model: bicycle_slip, noise: {states: {y_pos: 0.3}}, blocking: {mu: "
                                                 "full_horizon") +
                                         blocking + "}, estimator: {covariance: " + covariance + "}}",
                                     "robot.yaml"),
                          "robot"));
    const auto made = robot.make_estimator();
    EXPECT_EQ(made->model().input_count(), 3) << "as if there were no blocks";
    const double fix[] = {0.0, 0.0, 0.0}, still[] = {0.0, 0.0};
    const std::vector<double> none(3, std::numeric_limits<double>::quiet_NaN());
    made->push_measurement(0.0, fix);
    made->push_input(0.0, still);
    for (int k = 1; k <= 50; ++k) {
      made->push_measurement(0.2 * k, none.data());
      made->estimate(0.2 * k);
    }
    return made->estimate(10.0).covariance(1, 1);
  };
  for (const char* covariance : {"bank", "blocks"}) {
    const double free = variance_with("", covariance);
    for (const char* blocks : {"{name: structured, size: 5}", "unblocked"})
      EXPECT_NEAR(variance_with((std::string(", y_pos_noise: ") + blocks).c_str(), covariance), free, 1e-6) << blocks;
  }
}

TEST(StateNoise, MistakesAreToldWithTheirKey) {
  const auto told = [](const char* noise) { return error_of([&] { robot_with(noise, "rhe"); }); };
  EXPECT_NE(told("{states: {y_pos: 0.3}, adapt: true}").find("adapt: found true, beside process noise"),
            std::string::npos);
  EXPECT_NE(told("{states: {y_pos: -0.3}}").find("y_pos"), std::string::npos);
  EXPECT_NE(told("{states: {height: 0.3}}").find("height"), std::string::npos);
}

}  // namespace state_noise_test
}  // namespace rhec
