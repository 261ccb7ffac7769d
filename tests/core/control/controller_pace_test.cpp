// A controller that heeds the health of its estimates: it slows, stops on the path, and starts again.
#include <gmock/gmock.h>

#include <cmath>
#include <string>
#include <vector>

#include "rhec/core/control/controller.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace controller_pace_test {

using ::testing::HasSubstr;

constexpr double speed = 2.0, step = 0.2;

struct Drive {
  explicit Drive(const std::string& more = "") {
    const Robot robot(host, RobotOptions::table().parse(
                                parse_yaml("{model: bicycle_slip, step: 0.2" + more + "}", "robot.yaml"), "robot"));
    model = robot.model();
    controller = robot.make_controller(Path({{0.0, 0.0, speed}, {500.0, 0.0, speed}}));
    estimate.state = Eigen::VectorXd::Zero(model->state_count());
    estimate.parameters = Eigen::VectorXd::Ones(model->parameter_count());
  }
  /// One sample; returns the wheel speed.
  double go_on(HealthLevel level, std::uint32_t reasons = 0) {
    estimate.health.level = level;
    estimate.health.reasons = reasons;
    const std::vector<double> inputs = controller->control(estimate).inputs;
    Eigen::VectorXd next(estimate.state.size());
    model->integrate({.count = 1,
                      .states = estimate.state.data(),
                      .inputs = inputs.data(),
                      .parameters = estimate.parameters.data(),
                      .durations = &step,
                      .next_states = next.data()});
    estimate.state = next;
    estimate.time += step;
    controller->prepare();
    return inputs[0];
  }
  Host host;
  std::shared_ptr<const Model> model;
  std::unique_ptr<Controller> controller;
  Estimate estimate;
};

TEST(ControllerPace, OfOneThatIsWellIsThePathsSpeed) {
  Drive drive;
  for (int k = 0; k < 20; ++k) EXPECT_NEAR(drive.go_on(HealthLevel::ok), speed, 0.02);
}

TEST(ControllerPace, OneThatIsDegradedSlows) {
  Drive drive(", controller: {health: {degraded: 0.5, seconds: 2}}");
  for (int k = 0; k < 10; ++k) drive.go_on(HealthLevel::ok);
  double last = speed;
  for (int k = 0; k < 5; ++k) {
    const double now = drive.go_on(HealthLevel::degraded);
    EXPECT_LT(now, last + 1e-6);
    EXPECT_GT(now, 0.4 * speed);
    last = now;
  }
  for (int k = 0; k < 10; ++k) last = drive.go_on(HealthLevel::degraded);
  EXPECT_NEAR(last, 0.5 * speed, 0.05);
  for (int k = 0; k < 20; ++k) last = drive.go_on(HealthLevel::ok);
  EXPECT_NEAR(last, speed, 0.05);
}

TEST(ControllerPace, OneThatIsLostStopsAndStands) {
  Drive drive;
  for (int k = 0; k < 10; ++k) drive.go_on(HealthLevel::ok);
  for (int k = 0; k < 20; ++k) drive.go_on(HealthLevel::lost);
  const double place = drive.estimate.state[0];
  for (int k = 0; k < 20; ++k) EXPECT_EQ(drive.go_on(HealthLevel::lost), 0.0);
  EXPECT_EQ(drive.estimate.state[0], place);
  // What it believes to be its place moves; it does not.
  drive.estimate.state[0] += 1.0;
  EXPECT_EQ(drive.go_on(HealthLevel::lost), 0.0);
  double now = 0.0;
  for (int k = 0; k < 30; ++k) now = drive.go_on(HealthLevel::ok);
  EXPECT_NEAR(now, speed, 0.05);
}

TEST(ControllerPace, AHeadingIsSearchedAtFullSpeed) {
  Drive drive;
  for (int k = 0; k < 20; ++k) EXPECT_NEAR(drive.go_on(HealthLevel::lost, reason::starting), speed, 0.02);
}

TEST(ControllerPace, AHeadingThatIsNotKnownAnyMoreIsSoughtSlowly) {
  for (const double share : {0.3, 0.2, 0.0}) {
    Drive drive(share == 0.3 ? "" : ", controller: {health: {heading: " + std::to_string(share) + "}}");
    for (int k = 0; k < 10; ++k) drive.go_on(HealthLevel::ok);
    // Neither is known, as without a receiver; then it comes back.
    double now = speed;
    for (int k = 0; k < 30; ++k) now = drive.go_on(HealthLevel::lost, reason::uncertain);
    EXPECT_EQ(now, 0.0);
    for (int k = 0; k < 30; ++k) now = drive.go_on(HealthLevel::lost, reason::uncertain | reason::heading);
    EXPECT_NEAR(now, share * speed, 0.05) << share;
    for (int k = 0; k < 30; ++k) now = drive.go_on(HealthLevel::ok);
    EXPECT_NEAR(now, speed, 0.05);
  }
}

TEST(ControllerPace, WrongSharesAreRefused) {
  for (const char* wrong : {"degraded: 1.5", "lost: -0.1", "heading: 2", "seconds: 0"})
    EXPECT_THAT(error_of([&] { Drive drive(std::string(", controller: {health: {") + wrong + "}}"); }),
                HasSubstr(std::string(wrong).substr(0, 4)));
}

}  // namespace controller_pace_test
}  // namespace rhec
