// What a controller computes for a vehicle: its place on the path, and reference inputs that compensate slip.
#include "rhec/core/control/controller.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace controller_test {

using ::testing::DoubleNear;
using ::testing::ElementsAre;

const Host& host() {
  static const Host found;
  return found;
}

constexpr double speed = 2.0;

std::unique_ptr<Controller> controller_for(const std::string& configuration) {
  const Robot robot(host(), RobotOptions::table().parse(parse_yaml(configuration, "robot.yaml"), "robot"));
  // Straight along the diagonal.
  return robot.make_controller(Path({{0.0, 0.0, speed}, {50.0, 50.0, speed}}));
}

/// The reference inputs for a vehicle at the path's start, facing along it, with the given slip.
std::vector<double> reference(Controller& controller, const std::vector<double>& slip) {
  const Model& model = controller.problem().model();
  Estimate estimate;
  estimate.state = Eigen::VectorXd::Zero(model.state_count());
  model.description().roles.place(0.0, 0.0, 0.25 * std::numbers::pi, estimate.state.data());
  estimate.parameters = Eigen::Map<const Eigen::VectorXd>(slip.data(), static_cast<Eigen::Index>(slip.size()));
  controller.control(estimate);
  const double* first = controller.problem().input_reference(0);
  return {first, first + model.input_count()};
}

TEST(ControllerReference, MakesUpForSlipAsFarAsItIsTrusted) {
  const auto controller = controller_for("model: bicycle_slip");
  EXPECT_THAT(reference(*controller, {1.0, 1.0}), ElementsAre(2.0, 0.0));
  EXPECT_THAT(reference(*controller, {0.5, 1.0}), ElementsAre(4.0, 0.0));
  // An estimate below 0.3 is not trusted, nor is NaN.
  const double clipped = 2.0 / 0.3;  // within the bound 2.5 * 2 + 1
  ASSERT_GT(clipped, 6.0);
  for (const double kappa : {0.3, 0.1, 0.0, -0.5, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THAT(reference(*controller, {kappa, 1.0}), ElementsAre(6.0, 0.0)) << kappa;
  const auto wide = controller_for("{model: bicycle_slip, controller: {speed_bound_factor: 5}}");
  for (const double kappa : {0.3, 0.1, 0.0, -0.5, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THAT(reference(*wide, {kappa, 1.0}), ElementsAre(DoubleNear(clipped, 1e-12), 0.0)) << kappa;
}

TEST(ControllerReference, IsThePathsSpeedLiterallyWhereThatIsAskedFor) {
  const auto controller = controller_for("{model: bicycle_slip, controller: {reference_speed: literal}}");
  EXPECT_THAT(reference(*controller, {0.5, 1.0}), ElementsAre(2.0, 0.0));
}

TEST(ControllerReference, KnowsVehiclesWhoseSpeedIsNotOneInput) {
  const auto controller = controller_for(
      "{model: {name: skid_steer, wheel_radius: 0.2}, controller: {speed_bound_factor: 4, speed_bound_offset: 0}}");
  EXPECT_THAT(reference(*controller, {0.5, 0.2, 0.1}),
              ElementsAre(DoubleNear(2.0 / 0.2 / 0.5, 1e-12), DoubleNear(2.0 / 0.2 / 0.8, 1e-12)));
  EXPECT_THAT(reference(*controller, {0.9, -0.1, 0.1}),
              ElementsAre(DoubleNear(2.0 / 0.2 / 0.3, 1e-12), DoubleNear(2.0 / 0.2 / 1.1, 1e-12)));
  const RhcProblem& problem = controller->problem();
  for (int side = 0; side < 2; ++side) {
    EXPECT_EQ(problem.input_lower(0, side), 0.0);
    EXPECT_DOUBLE_EQ(problem.input_upper(0, side), 4.0 * 2.0 / 0.2);
  }
}

/// x' = kappa s cos(psi), y' = kappa s sin(psi), psi' = omega, s' = a.
template <class Scalar>
struct Accelerated {
  static constexpr int state_count = 4, input_count = 2, parameter_count = 1, output_count = 2;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin;
    dxdt[0] = p[0] * x[3] * cos(x[2]);
    dxdt[1] = p[0] * x[3] * sin(x[2]);
    dxdt[2] = u[1];
    dxdt[3] = u[0];
  }
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1];
  }
};

TEST(ControllerReference, KnowsVehiclesWhoseInputIsAnAcceleration) {
  ModelDescription about;
  about.name = "accelerated";
  about.states = {{.name = "x", .unit = "m", .meaning = "x"},
                  {.name = "y", .unit = "m", .meaning = "y"},
                  {.name = "psi", .unit = "rad", .meaning = "heading", .is_angle = true},
                  {.name = "speed", .unit = "m/s", .meaning = "speed of the wheels"}};
  about.inputs = {{.name = "a", .unit = "m/s2", .meaning = "acceleration", .lower = -1.0, .upper = 1.0},
                  {.name = "omega", .unit = "rad/s", .meaning = "yaw rate"}};
  about.parameters = {{.name = "kappa", .unit = "1", .meaning = "slip", .lower = 0.0, .upper = 1.0}};
  about.outputs = {{.name = "x_gps", .unit = "m", .meaning = "x"}, {.name = "y_gps", .unit = "m", .meaning = "y"}};
  about.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed_state = 3, .speed_factor = 0};
  const auto model = std::make_shared<FormulaModel<Accelerated>>(Accelerated<double>{}, about);
  Controller::Setup setup;
  setup.problem.state_weights = {1.0, 1.0, 0.0, 1.0};
  setup.problem.terminal_weights = {1.0, 1.0, 0.0, 0.0};
  setup.problem.input_weights = {0.1, 0.1};
  Controller controller(model, host().make_solver("gn_rti"), Path({{0.0, 0.0, speed}, {50.0, 50.0, speed}}), setup);
  EXPECT_THAT(reference(controller, {0.5}), ElementsAre(0.0, 0.0));
  EXPECT_DOUBLE_EQ(controller.problem().state_reference(3)[3], speed / 0.5);
  EXPECT_EQ(controller.problem().input_upper(3, 0), 1.0);
  // And it drives from standstill to the end of the path, at the requested speed over ground.
  Estimate now;
  now.state = Eigen::VectorXd::Zero(4);
  now.state[2] = 0.25 * std::numbers::pi;
  now.parameters = Eigen::VectorXd::Constant(1, 0.5);
  controller.reset();
  const double step = setup.interval;
  double reached = 0.0;
  for (int k = 0; k < 400 && !controller.finished(); ++k) {
    const std::vector<double> inputs = controller.control(now).inputs;
    Eigen::VectorXd next(4);
    model->integrate({.count = 1,
                      .states = now.state.data(),
                      .inputs = inputs.data(),
                      .parameters = now.parameters.data(),
                      .durations = &step,
                      .next_states = next.data()});
    now.state = next;
    if (k == 100) reached = 0.5 * now.state[3];
  }
  EXPECT_TRUE(controller.finished());
  EXPECT_NEAR(reached, speed, 0.05);
}

TEST(ControllerReference, BoundsTheInputsThatDriveAndNoOthers) {
  const auto controller = controller_for("model: bicycle_slip");
  reference(*controller, {1.0, 1.0});
  const RhcProblem& problem = controller->problem();
  const Variable& steering_rate = problem.model().description().inputs[1];
  EXPECT_EQ(problem.input_lower(3, 0), 0.0);
  EXPECT_EQ(problem.input_upper(3, 0), 2.5 * speed + 1.0);
  EXPECT_EQ(problem.input_lower(3, 1), steering_rate.lower);
  EXPECT_EQ(problem.input_upper(3, 1), steering_rate.upper);
  const auto free = controller_for("{model: bicycle_slip, controller: {speed_bound_factor: .inf}}");
  reference(*free, {1.0, 1.0});
  EXPECT_EQ(free->problem().input_upper(3, 0), std::numeric_limits<double>::infinity());
}

TEST(ControllerReference, KeepsTheInputsOwnBoundsWhereTheyAreNarrower) {
  const auto slow = controller_for("{model: bicycle_slip, bounds: {u1: [-1, 1.5]}}");
  EXPECT_THAT(reference(*slow, {0.5, 1.0}), ElementsAre(1.5, 0.0));
  EXPECT_EQ(slow->problem().input_lower(3, 0), 0.0);
  EXPECT_EQ(slow->problem().input_upper(3, 0), 1.5);
  const auto rates =
      controller_for("{model: bicycle_slip, bounds: {u1: [-1, 1.5]}, controller: {weights: {rates: {u1: 1}}}}");
  reference(*rates, {0.5, 1.0});
  EXPECT_EQ(rates->problem().state_upper(3)[4], 1.5) << "where the input is a state of the problem";
  const auto quick = controller_for("{model: bicycle_slip, bounds: {u1: [1, 100]}}");
  reference(*quick, {1.0, 1.0});
  EXPECT_EQ(quick->problem().input_lower(3, 0), 1.0);
  EXPECT_EQ(quick->problem().input_upper(3, 0), 2.5 * speed + 1.0);
}

/// The estimate of a vehicle that is somewhere, without slip.
Estimate estimate_at(const Controller& controller, double x, double y, double heading) {
  const Model& model = controller.vehicle();
  Estimate estimate;
  estimate.state = Eigen::VectorXd::Zero(model.state_count());
  model.description().roles.place(x, y, heading, estimate.state.data());
  estimate.parameters = Eigen::VectorXd::Ones(model.parameter_count());
  return estimate;
}

std::unique_ptr<Controller> controller_on(const Path& path, const std::string& configuration = "model: bicycle_slip") {
  return Robot(host(), RobotOptions::table().parse(parse_yaml(configuration, "robot.yaml"), "robot"))
      .make_controller(path);
}

TEST(ControllerReference, BrakesForAStopAndGoesOnInReverse) {
  // From 2 m/s to rest within 4 m: 0.5 m/s^2, 4 s; then back.
  const Path path({{0, 0, 2.0}, {10, 0, 2.0}, {14, 0, 0.0}, {10, 0, -2.0}, {0, 0, -2.0}});
  const auto controller = controller_on(path);
  controller->control(estimate_at(*controller, 11.0, 0.0, 0.0));
  const RhcProblem& problem = controller->problem();
  const double first = std::sqrt(4.0 - 2.0 * 0.5 * 1.0);  // m/s at 11 m
  for (int i = 0; i <= problem.intervals(); ++i) {
    const double t = 0.2 * i, rest = first / 0.5;
    const double x = t < rest ? 11.0 + (first - 0.25 * t) * t : 14.0 - 0.25 * (t - rest) * (t - rest);
    EXPECT_NEAR(problem.state_reference(i)[0], x, 1e-9) << i;
    EXPECT_NEAR(problem.state_reference(i)[2], 0.0, 1e-12) << "in reverse the heading stays";
    if (i == problem.intervals()) break;
    EXPECT_NEAR(problem.input_reference(i)[0], first - 0.5 * (t + 0.1), 1e-9);
  }
  EXPECT_EQ(problem.input_lower(0, 0), 0.0) << "still forwards alone";
  controller->control(estimate_at(*controller, 13.9, 0.0, 0.0));
  EXPECT_EQ(controller->follower().section(), 1);
  EXPECT_LT(controller->problem().input_reference(10)[0], 0.0);
  EXPECT_LT(controller->problem().input_lower(0, 0), -1.0);
  EXPECT_EQ(controller->problem().input_upper(0, 0), 0.0);
  EXPECT_TRUE(is_usable(controller->control(estimate_at(*controller, 13.9, 0.0, 0.0)).report.status));
}

TEST(ControllerReference, StartsWhereTheVehicleIs) {
  std::vector<Waypoint> waypoints;
  for (int i = 0; i <= 100; ++i) waypoints.push_back({1.0 * i, 0.0, 2.0});
  const Path path(waypoints);
  const auto controller = controller_on(path);
  const Controller::Command& command = controller->control(estimate_at(*controller, 30.0, 0.5, 0.1));
  EXPECT_NEAR(command.reference.x, 30.0, 1e-9);
  EXPECT_NEAR(command.heading_error, 0.1, 1e-12);
  EXPECT_NEAR(controller->follower().lateral(), 0.5, 1e-12);
  // Then it is searched for near the last place alone, unless that is asked for.
  EXPECT_NEAR(controller->control(estimate_at(*controller, 60.0, 0.0, 0.0)).reference.x, 38.0, 1e-9);
  controller->locate();
  EXPECT_NEAR(controller->control(estimate_at(*controller, 60.0, 0.0, 0.0)).reference.x, 60.0, 1e-9);
  controller->reset();
  EXPECT_NEAR(controller->control(estimate_at(*controller, 80.0, 0.0, 0.0)).reference.x, 80.0, 1e-9);
}

TEST(ControllerReference, StartsOnTheLapThatItIsTold) {
  std::vector<Waypoint> laps;
  for (int i = 0; i <= 240; ++i) {
    const double turn = 2.0 * std::numbers::pi * i / 60.0;
    laps.push_back({8.0 * std::sin(turn), 8.0 - 8.0 * std::cos(turn), 2.0});
  }
  const Path path(laps);
  const double lap = 0.25 * path.length(), third = 2.0 * lap + 10.0;
  const PathPoint place = path.point_at(third);
  const auto controller = controller_on(path);
  const Estimate there = estimate_at(*controller, place.x, place.y, place.heading);
  controller->control(there);
  EXPECT_NEAR(controller->follower().arc_length(), third - 2.0 * lap, 1e-6) << "the first of places that are the same";
  controller->locate(third);
  controller->control(there);
  EXPECT_NEAR(controller->follower().arc_length(), third, 1e-6);
  controller->locate(-5.0);
  controller->control(there);
  EXPECT_LE(controller->follower().arc_length(), third - 2.0 * lap) << "it is looked for near the start";
  controller->locate(1e9);
  EXPECT_TRUE(std::isfinite(controller->control(there).inputs[0]));
  controller->locate(NAN);
  controller->control(there);
  EXPECT_NEAR(controller->follower().arc_length(), third - 2.0 * lap, 1e-6) << "the whole path is searched";
}

TEST(ControllerReference, RefusesAPathThatNoVehicleCanFollow) {
  EXPECT_THAT(error_of([] {
                controller_on(Path({{0, 0, 1.0}, {5, 0, 1.0}, {0, 0.1, 1.0}}));
              }),
              ::testing::HasSubstr("at waypoint 2; where a path turns back, the speed is 0"));
}

TEST(ControllerReference, PutsAllBodiesInLineAlongThePath) {
  const auto controller = controller_for("model: tractor_trailer");
  reference(*controller, {1.0, 1.0, 1.0});
  const double* third = controller->problem().state_reference(3);
  const double distance = 3 * 0.2 * speed, angle = 0.25 * std::numbers::pi;
  EXPECT_NEAR(third[0], distance * std::cos(angle), 1e-12);
  EXPECT_NEAR(third[1], distance * std::sin(angle), 1e-12);
  EXPECT_NEAR(third[2], angle, 1e-12);
  EXPECT_NEAR(third[3], angle, 1e-12);
}

}  // namespace controller_test
}  // namespace rhec
