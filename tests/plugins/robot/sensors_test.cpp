#include "rhec/plugins/robot/sensors.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rhec/core/model/sensor_model.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace sensors_test {

Robot robot_with(const std::string& noise, const std::string& outputs = "[x_gps, y_gps, delta, yaw_rate]",
                 const std::string& estimator = "rhe") {
  static const Host host;
  const std::string text = "{model: {name: bicycle_slip, outputs: " + outputs + "}, noise: " + noise +
                           ", estimator: {name: " + estimator + "}}";
  return {host, RobotOptions::table().parse(parse_yaml(text, "robot.yaml"), "robot")};
}

TEST(SensorErrors, AreStatesOfEstimatorsAlone) {
  for (const char* estimator : {"ekf", "bank", "rhe"}) {
    const Robot robot = robot_with("{biases: {yaw_rate: {sigma: 0.02, drift: 0.001}}, scales: {delta: {sigma: 0.1}}}",
                                   "[x_gps, y_gps, delta, yaw_rate]", estimator);
    EXPECT_EQ(robot.model()->state_count(), 4);
    EXPECT_EQ(robot.make_controller(Path({{0, 0, 1}, {9, 0, 1}}))->vehicle().state_count(), 4);
    const auto made = robot.make_estimator();
    EXPECT_EQ(names_of(made->model().description().states),
              (std::vector<std::string>{"x_pos", "y_pos", "beta", "delta", "yaw_rate_bias", "delta_scale",
                                        "yaw_rate_at_node"}));
    EXPECT_EQ(names_of(robot.estimated_description().states),
              (std::vector<std::string>{"x_pos", "y_pos", "beta", "delta", "yaw_rate_bias", "delta_scale"}));
    EXPECT_TRUE(senses_motion(made->model()));
    const std::vector<double> fix = {0.0, 0.0, 0.0, 0.0};
    made->push_measurement(0.0, fix.data());
    const Estimate& estimate = made->estimate(0.0);
    EXPECT_NEAR(estimate.covariance(4, 4), 0.02 * 0.02, 1e-5) << estimator;
    EXPECT_NEAR(estimate.covariance(5, 5), 0.1 * 0.1, 1e-5) << estimator;
  }
}

TEST(SensorErrors, LeaveTheOutputsOfMotionWhatTheyAre) {
  const auto sensed = [](const char* noise) {
    const Robot robot = robot_with(noise, "[x_gps, y_gps, delta, yaw_rate, ground_speed]");
    return sensed_motion(robot.make_estimator()->model());
  };
  EXPECT_EQ(sensed("{}"), (std::vector{3, 4}));
  EXPECT_EQ(sensed("{biases: {yaw_rate: {sigma: 0.02}}}"), (std::vector{3, 4}));
  EXPECT_EQ(sensed("{scales: {yaw_rate: {sigma: 0.1}}}"), (std::vector{3, 4}));
}

TEST(SensorErrors, ChangeNothingWhereThereAreNone) {
  const Robot robot = robot_with("{}", "[x_gps, y_gps, delta]");
  EXPECT_EQ(robot.make_estimator()->model().state_count(), 4);
  EXPECT_EQ(robot.estimator_model(), robot.model());
}

TEST(SensorErrors, MistakesAreToldWithTheirKey) {
  const auto told = [](const char* noise) { return error_of([&] { robot_with(noise); }); };
  EXPECT_NE(told("{biases: {yaw_rat: {sigma: 0.02}}}").find("did you mean 'yaw_rate'?"), std::string::npos);
  EXPECT_NE(told("{biases: {yaw_rate: {drift: 0.02}}}").find("yaw_rate"), std::string::npos);
  EXPECT_NE(told("{biases: {yaw_rate: {sigma: -1}}}").find("sigma"), std::string::npos);
  EXPECT_NE(told("{scales: {yaw_rate: {sigma: 1, drft: 1}}}").find("did you mean 'drift'?"), std::string::npos);
  EXPECT_NE(told("{biases: {yaw_rate: {sigma: 1, drift: 1}}, adapt: true}").find("a drift of a sensor"),
            std::string::npos);
}

}  // namespace sensors_test
}  // namespace rhec
