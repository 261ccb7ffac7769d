// A controller whose problem has terms.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "rhec/core/control/controller.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/allocations.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace controller_terms_test {

using testing::HasSubstr;

constexpr double step = 0.2;

const Host& host() {
  static const Host found;
  return found;
}

/// A bicycle on a straight path that knows where it is and how much it slips.
struct Drive {
  explicit Drive(const std::string& controller_section, double speed = 2.0)
      : robot(host(),
              RobotOptions::table().parse(
                  parse_yaml("{model: bicycle_slip, step: 0.2, controller: {" + controller_section + "}}", "test"),
                  "robot")),
        controller(robot.make_controller(Path({{0.0, 0.0, speed}, {60.0, 0.0, speed}}))) {
    now.state = Eigen::Vector4d(0.0, 0.0, 0.0, 0.0);
    now.parameters = Eigen::Vector2d(0.9, 0.9);
  }
  const Controller::Command& advance() {
    const Controller::Command& command = controller->control(now);
    const std::vector<double> inputs = command.inputs;
    Eigen::VectorXd next(4);
    robot.model()->integrate({.count = 1,
                              .states = now.state.data(),
                              .inputs = inputs.data(),
                              .parameters = now.parameters.data(),
                              .durations = &step,
                              .next_states = next.data()});
    now.state = next;
    now.time += step;
    controller->finish();
    return command;
  }
  double distance(double x, double y) const { return std::hypot(now.state[0] - x, now.state[1] - y); }

  Robot robot;
  std::unique_ptr<Controller> controller;
  Estimate now;
};

constexpr const char* sparse = ", solver: {name: sparse_sqp}";

/// The least distance from an obstacle that starts at (15, 0.2) and moves.
double least_distance(Drive& drive, double velocity_x) {
  double least = HUGE_VAL;
  for (int k = 0; k < 60; ++k) {
    EXPECT_FALSE(drive.advance().fallback) << k;
    least = std::min(least, drive.distance(15.0 + velocity_x * drive.now.time, 0.2));
  }
  return least;
}

TEST(ControllerTerms, KeepTheVehicleOutOfObstaclesAndInItsCorridor) {
  Drive without("horizon: 15"),
      with(
          "terms: [{name: obstacles, vehicle_radius: 0.5, obstacles: [{x: 15, y: 0.2, radius: "
          "1, velocity_x: -0.3}]}, {name: corridor, left: 3, right: 3}]" +
          std::string(sparse));
  EXPECT_LT(least_distance(without, -0.3), 0.5);
  const double least = least_distance(with, -0.3);
  EXPECT_GT(least, 1.5 - 0.02) << "between nodes it may be a little closer";
  EXPECT_LT(least, 1.7) << "and it goes no further around than it must";
  EXPECT_LT(std::abs(with.now.state[1]), 0.2) << "back on the path";
}

TEST(ControllerTerms, KnowObstaclesThatAreSeenAtRunTime) {
  Drive drive("terms: [{name: obstacles, vehicle_radius: 0.5, most: 2}]" + std::string(sparse));
  const Obstacle seen{.x = 15.0, .y = 0.2, .semi_axis_along = 1.0, .semi_axis_across = 1.0, .velocity_x = -0.3};
  const std::vector<Obstacle> three{seen, {.x = 500.0, .semi_axis_along = 1.0, .semi_axis_across = 1.0}, seen};
  drive.advance();
  const long before = allocation_count();
  EXPECT_EQ(drive.controller->set_obstacles(three, 0.0), 2) << "there is room for two";
  EXPECT_EQ(allocation_count(), before);
  EXPECT_GT(least_distance(drive, -0.3), 1.5 - 0.02);
  EXPECT_EQ(drive.controller->set_obstacles({}, 0.0), 0);
}

TEST(ControllerTerms, KeepTheObstaclesThatComeClosestToThePlan) {
  const std::string section = "horizon: 15, terms: [{name: obstacles, vehicle_radius: 0.5, most: 2}]";
  const Obstacle near{.x = 15.0, .y = 0.2, .semi_axis_along = 1.0, .semi_axis_across = 1.0};
  std::vector<Obstacle> many(20, {.x = 15.0, .y = 40.0, .semi_axis_along = 1.0, .semi_axis_across = 1.0});
  many.push_back(near);
  // One that is far now, and will be in the way.
  many.push_back({.x = 40.0, .y = 40.0, .semi_axis_along = 1.0, .semi_axis_across = 1.0, .velocity_y = -4.0});
  many.insert(many.end(), 20, {.x = -30.0, .semi_axis_along = 1.0, .semi_axis_across = 1.0});
  Drive drive(section);
  // Before the first plan: by the place on the path.
  EXPECT_EQ(drive.controller->set_obstacles(many, 0.0), 2);
  for (int k = 0; k < 50; ++k) {
    const long before = allocation_count();
    EXPECT_EQ(drive.controller->set_obstacles(many, 0.0), 2);
    EXPECT_EQ(allocation_count(), before);
    drive.advance();
    EXPECT_GT(drive.distance(15.0, 0.2), 1.5 - 0.05) << k;
  }
  EXPECT_GT(drive.now.state[0], 16.0) << "it goes on";
}

/// Exact steps from a plan that leads through its middle stay there, at a saddle point.
TEST(ControllerTerms, GoAroundAnObstacleThatAppearsHeadOn) {
  for (const char* solver : {"gn_rti", "gn_rti, iterations: 5, residual: 0.01"}) {
    for (const char* hard : {"false", "true"}) {
      for (const double distance : {5.0, 6.0, 7.0, 8.0}) {
        for (const double aside : {-0.05, 0.01, 0.05}) {
          Drive drive(fmt::format("horizon: 15, terms: [{{name: obstacles, vehicle_radius: 0.5, most: 1, hard: {}}}], "
                                  "solver: {{name: {}}}",
                                  hard, solver),
                      3.0);
          for (int k = 0; k < 10; ++k) drive.advance();
          const Obstacle seen{
              .x = drive.now.state[0] + distance, .y = aside, .semi_axis_along = 1.0, .semi_axis_across = 1.0};
          drive.controller->set_obstacles({&seen, 1}, drive.now.time);
          double least = HUGE_VAL;
          for (int k = 0; k < 30; ++k) {
            drive.advance();
            least = std::min(least, drive.distance(seen.x, seen.y));
          }
          EXPECT_GT(least, 1.5 - 0.15) << solver << ", hard: " << hard << ", " << distance << " m ahead, " << aside;
          EXPECT_GT(drive.now.state[0], seen.x) << "it goes on";
        }
      }
    }
  }
}

TEST(ControllerTerms, LeaveOutObstaclesWithNumbersThatAreNotFinite) {
  Drive drive("terms: [{name: obstacles, vehicle_radius: 0.5, most: 2}]");
  drive.advance();
  const Obstacle broken{.x = NAN, .semi_axis_along = 1.0, .semi_axis_across = 1.0},
      seen{.x = 15.0, .y = 0.2, .semi_axis_along = 1.0, .semi_axis_across = 1.0, .velocity_x = -0.3};
  const std::vector<Obstacle> both{broken, seen};
  EXPECT_EQ(drive.controller->set_obstacles(both, 0.0), 1);
  EXPECT_GT(least_distance(drive, -0.3), 1.5 - 0.05);
  EXPECT_EQ(drive.controller->set_obstacles(both, NAN), 1) << "at an unknown time it is at rest";
  EXPECT_FALSE(drive.advance().fallback);
}

TEST(ControllerTerms, DataThatAreNewSinceThePreparationCount) {
  const std::string section = "terms: [{name: obstacles, most: 1}], solver: {name: sparse_sqp, hessian: gauss_newton}";
  Drive plain(section), prepared(section);
  for (int k = 0; k < 40; ++k) {
    for (Drive* drive : {&plain, &prepared}) {
      // It is seen late, and then somewhere else at each sample.
      const Obstacle seen{.x = 12.0, .y = 0.4 + 0.01 * k, .semi_axis_along = 0.8, .semi_axis_across = 0.8};
      drive->controller->set_obstacles({&seen, k > 5 ? 1u : 0u}, drive->now.time);
      drive->advance();
    }
    prepared.controller->prepare();
    EXPECT_NEAR((plain.now.state - prepared.now.state).cwiseAbs().maxCoeff(), 0.0, 2e-3) << k;
  }
}

TEST(ControllerTerms, GoWithRatesOfInputsAndBlocks) {
  for (const char* more :
       {", weights: {rates: {u2: 0.3}}", ", blocking: {u2: {name: structured, size: 3, anchor: horizon}}"}) {
    Drive drive(
        "terms: [{name: obstacles, obstacles: [{x: 15, y: 0.2, radius: 1}]}, {name: lateral_acceleration, most: "
        "1}, {name: effort, weights: {u2: 0.1}}]" +
        std::string(sparse) + more);
    EXPECT_GT(least_distance(drive, 0.0), 1.5 - 0.05) << more;
  }
}

TEST(ControllerTerms, DoNotAllocateInTheLoop) {
  Drive drive("terms: [{name: effort, weights: {u2: 0.5}, delta: 1}], solver: {name: gn_rti}");
  for (int k = 0; k < 3; ++k) drive.advance();
  for (int k = 0; k < 5; ++k) {
    const long before = allocation_count();
    drive.controller->control(drive.now);
    drive.controller->prepare();
    EXPECT_EQ(allocation_count(), before);
  }
  // Rows: as a solver evaluates them.
  const Drive rows(
      "terms: [{name: obstacles, most: 3, obstacles: [{x: 3}]}, {name: corridor}, {name: "
      "lateral_acceleration}]" +
      std::string(sparse));
  RhcProblem problem(rows.controller->problem());
  std::vector<double> scratch(problem.scratch_size());
  problem.finish(scratch);
  Iterate point = rows.controller->plan();
  StageQp qp(problem.capacity());
  std::vector<double> values(static_cast<std::size_t>(problem.intervals() + 1) * problem.capacity().limit_row());
  const long before = allocation_count();
  for (int i = 0; i <= problem.intervals(); ++i) problem.terms().place(i, {.time = 0.2 * i, .x = 1.0 * i});
  problem.linearise(all_stages(problem), point, Hessian::exact, qp, scratch);
  problem.refresh(point, qp, scratch);
  problem.evaluate_limits(point, values.data(), scratch);
  EXPECT_EQ(allocation_count(), before);
}

/// Of the last command, by the name of the limit.
double violation(const Drive& drive, const std::string& name) {
  const std::vector<std::string>& names = drive.controller->problem().terms().functions()->limit_names();
  const auto found = std::ranges::find(names, name);
  return found == names.end() ? NAN : drive.controller->command().violations[found - names.begin()];
}

TEST(ControllerTerms, SayByHowMuchTheyAreViolatedNext) {
  Drive drive("terms: [{name: corridor, left: 3, right: 3}, {name: obstacles, most: 1, soft: {linear: 0.1}}]");
  drive.advance();
  EXPECT_LT(violation(drive, "corridor: lateral"), 1e-6);
  EXPECT_LT(violation(drive, "obstacles: obstacle 1"), 1e-6);
  // It appears at once, right before the vehicle, and costs too little to stop for.
  const Obstacle seen{.x = drive.now.state[0] + 0.6, .y = 0.0, .semi_axis_along = 0.5, .semi_axis_across = 0.5};
  drive.controller->set_obstacles({&seen, 1}, drive.now.time);
  drive.advance();
  EXPECT_LT(violation(drive, "corridor: lateral"), 1e-6);
  const double told = violation(drive, "obstacles: obstacle 1");
  EXPECT_GT(told, 0.2);
  // The radius of the vehicle and of the obstacle, and what is rounded off of the distance near the centre.
  EXPECT_NEAR(told, 1.0 - drive.distance(seen.x, seen.y), 0.3);
  drive.controller->set_obstacles({}, drive.now.time);
  drive.advance();
  EXPECT_LT(violation(drive, "obstacles: obstacle 1"), 1e-6) << "not that of the sample before";
  const long before = allocation_count();
  drive.controller->control(drive.now);
  drive.controller->finish();
  EXPECT_EQ(allocation_count(), before);
}

TEST(ControllerTerms, ThatAreSoftKeepToTheMiddleWhereThereIsNoRoom) {
  for (const bool hard : {false, true}) {
    const Robot robot(host(), RobotOptions::table().parse(
                                  parse_yaml(std::string("{model: bicycle_slip, step: 0.2, controller: {terms: [{name: "
                                                         "corridor, margin: 0.5, hard: ") +
                                                 (hard ? "true" : "false") + "}]" + sparse + "}}",
                                             "test"),
                                  "robot"));
    const auto controller = robot.make_controller(Path({{0.0, 0.0, 2.0, 0.6, 0.2}, {60.0, 0.0, 2.0, 0.6, 0.2}}));
    Estimate now;
    now.state = Eigen::Vector4d(0.0, 0.0, 0.0, 0.0);
    now.parameters = Eigen::Vector2d(0.9, 0.9);
    const Controller::Command& command = controller->control(now);
    controller->finish();
    const HorizonTerms& terms = controller->problem().terms();
    if (hard) {
      EXPECT_TRUE(command.fallback) << "it is never violated, so that there is no plan";
      EXPECT_EQ(command.report.status, Status::infeasible);
      continue;
    }
    EXPECT_FALSE(command.fallback);
    EXPECT_NEAR(terms.lower(5)[0], 0.2, 1e-12);
    EXPECT_NEAR(terms.upper(5)[0], 0.2, 1e-12);
    EXPECT_NEAR(controller->plan().state(15)[1], 0.2, 0.01);
  }
}

TEST(ControllerTerms, ThatAreHardAndCannotBeKeptAreViolatedLeast) {
  // By a push sideways, to where no plan is inside the corridor at once.
  for (const double aside : {1.5, 2.0, -2.5}) {
    Drive drive("terms: [{name: corridor, left: 1, right: 1, hard: true}]");
    for (int k = 0; k < 10; ++k) EXPECT_FALSE(drive.advance().fallback);
    drive.now.state[1] += aside;
    drive.now.state[2] += aside > 0.0 ? 0.2 : -0.2;
    const long before = allocation_count();
    drive.controller->control(drive.now);
    drive.controller->finish();
    EXPECT_EQ(allocation_count(), before);
    int relaxed = 0, outside = 0;
    for (int k = 0; k < 40; ++k) {
      const Controller::Command& command = drive.advance();
      EXPECT_FALSE(command.fallback) << aside << ", " << k << ": the last plan leads away";
      relaxed += command.report.status == Status::relaxed;
      outside += std::abs(drive.now.state[1]) > 1.0 + 1e-3;
    }
    EXPECT_GT(relaxed, 0) << aside;
    EXPECT_LT(outside, 12) << aside;
    EXPECT_LT(std::abs(drive.now.state[1]), 0.3) << aside;
    EXPECT_EQ(drive.advance().report.status, Status::step_taken) << aside;
  }
}

TEST(ControllerTerms, ThatAreHardAndCannotBeKeptHaveAPriceWithAnySolver) {
  for (const std::string solver : {"sparse_sqp", "ipopt", "nlopt", "gn_rti, mode: converge"}) {
    for (const double aside : {1.5, -2.5}) {
      SCOPED_TRACE(solver);
      Drive drive("horizon: 10, terms: [{name: corridor, left: 1, right: 1, hard: true}], solver: {name: " + solver +
                  "}");
      for (int k = 0; k < 10; ++k) EXPECT_FALSE(drive.advance().fallback);
      drive.now.state[1] += aside;
      drive.now.state[2] += aside > 0.0 ? 0.2 : -0.2;
      int relaxed = 0, outside = 0, fallbacks = 0;
      for (int k = 0; k < 40; ++k) {
        const Controller::Command& command = drive.advance();
        fallbacks += command.fallback;
        relaxed += command.report.status == Status::relaxed;
        outside += std::abs(drive.now.state[1]) > 1.0 + 1e-3;
      }
      EXPECT_EQ(fallbacks, 0);
      EXPECT_GT(relaxed, 0) << aside;
      EXPECT_LT(outside, 12) << aside;
      EXPECT_LT(std::abs(drive.now.state[1]), 0.3) << aside;
      EXPECT_EQ(drive.advance().report.status, Status::solved) << aside;
    }
  }
}

TEST(ControllerTerms, AreReadOneByOneAndRefusedInWords) {
  const auto refused = [](const std::string& section) { return error_of([&] { Drive drive(section); }); };
  EXPECT_THAT(refused("terms: {name: corridor}"), HasSubstr("controller.terms: found a map, expected a list of terms"));
  EXPECT_THAT(refused("terms: [{left: 3}]"), HasSubstr("controller.terms[0]: a term without a name"));
  EXPECT_THAT(refused("terms: [{name: corridr}]"), HasSubstr("did you mean 'corridor'?"));
  EXPECT_THAT(refused("terms: [{name: corridor, lefft: 3}]"), HasSubstr("did you mean 'left'?"));
  EXPECT_THAT(refused("terms: [{name: corridor, soft: {liner: 3}}]"), HasSubstr("did you mean 'linear'?"));
  EXPECT_THAT(refused("terms: [corridor, {name: effort, weights: {u3: 1}}]" + std::string(sparse)),
              HasSubstr("controller.terms[1]: term 'effort': the model 'bicycle_slip' has no input 'u3'"));
}

}  // namespace controller_terms_test
}  // namespace rhec
