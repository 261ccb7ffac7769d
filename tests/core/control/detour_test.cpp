// A vehicle that looks away from its path: it turns around, or stands and says so.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "rhec/core/control/controller.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/allocations.hpp"

namespace rhec {
namespace turn_around_test {

const Host& host() {
  static const Host found;
  return found;
}

std::unique_ptr<Controller> controller_on(const Path& path, const std::string& configuration) {
  const Robot robot(host(), RobotOptions::table().parse(parse_yaml(configuration, "robot.yaml"), "robot"));
  return robot.make_controller(path);
}

/// A vehicle with the slip of its estimate obeys a command for a sample; the estimate is the truth.
void drive(const Model& model, const Controller::Command& command, Estimate& estimate) {
  const double step = 0.2;
  Eigen::VectorXd next(model.state_count());
  model.integrate({.count = 1,
                   .states = estimate.state.data(),
                   .inputs = command.inputs.data(),
                   .parameters = estimate.parameters.data(),
                   .durations = &step,
                   .next_states = next.data()});
  estimate.state = next;
  estimate.time += step;
}

/// Follows the diagonal for so many samples from its tenth metre, looking off the path by an angle, without slip.
struct Turned {
  bool ever = false, now = false;  ///< facing away, by what the commands say
  bool stands = false;             ///< at the end
  int back = 0;                    ///< samples in which it goes back
  double least_way = 0.0;          ///< along the path [m]
  long allocations = 0;            ///< by the controller
  int turning = 0;                 ///< samples in which it turns around, by what the commands say
  double way = 0.0, beside = 0.0;  ///< along the path, and at the end to its left [m]
  double farthest = 0.0;           ///< from the path [m]
  double heading_error = 0.0;      ///< at the end [rad]
};
Turned turned(const std::string& configuration, double angle, int samples, double aside = 0.0,
              const std::vector<Obstacle>& obstacles = {}) {
  const auto controller = controller_on(Path({{0.0, 0.0, 2.0}, {50.0, 50.0, 2.0}}), configuration);
  const Model& model = controller->vehicle();
  const std::vector<double> slip = nominal_values(model.description().parameters);
  const Roles& roles = model.description().roles;
  Estimate estimate;
  estimate.state = Eigen::VectorXd::Zero(model.state_count());
  const double start = 10.0 / std::numbers::sqrt2;
  roles.place(start - aside / std::numbers::sqrt2, start + aside / std::numbers::sqrt2, 0.25 * std::numbers::pi + angle,
              estimate.state.data());
  estimate.parameters = Eigen::Map<const Eigen::VectorXd>(slip.data(), static_cast<Eigen::Index>(slip.size()));
  const auto along = [&] {
    return (estimate.state[roles.position_x] + estimate.state[roles.position_y]) / std::numbers::sqrt2 - 10.0;
  };
  Turned told;
  for (int k = 0; k < samples; ++k) {
    const long before = allocation_count();
    controller->set_obstacles(obstacles, estimate.time);
    const Controller::Command& command = controller->control(estimate);
    controller->finish();
    told.allocations += allocation_count() - before;
    told.now = command.faces_away;
    told.ever |= told.now;
    told.turning += command.turns_around;
    told.back += command.goes_back;
    told.stands = command.stands;
    drive(model, command, estimate);
    controller->prepare();
    told.beside = (estimate.state[roles.position_y] - estimate.state[roles.position_x]) / std::numbers::sqrt2;
    told.farthest = std::max(told.farthest, std::abs(told.beside));
    told.least_way = std::min(told.least_way, along());
  }
  told.heading_error = std::remainder(estimate.state[roles.heading] - 0.25 * std::numbers::pi, 2.0 * std::numbers::pi);
  told.way = along();
  return told;
}

TEST(TurnAround, ThatIsAwayFromThePathIsTold) {
  const char* const bicycle = "{model: bicycle_slip, controller: {turn_around: false}}";
  for (const double angle : {std::numbers::pi, 3.0, -2.8}) {
    const Turned away = turned(bicycle, angle, 50);
    EXPECT_TRUE(away.now) << angle;
    EXPECT_LT(std::abs(away.way), 0.5) << angle << ": it stands";
  }
  for (const double angle : {0.0, 1.0, -1.8}) {
    const Turned about = turned(bicycle, angle, 100);
    EXPECT_FALSE(about.ever) << angle << ": it turns round by itself";
    EXPECT_GT(about.way, 20.0) << angle;
  }
  // In reverse the vehicle looks the other way, as it should.
  const auto reverse = controller_on(Path({{0.0, 0.0, -1.0}, {20.0, 0.0, -1.0}}), bicycle);
  Estimate estimate;
  estimate.state = Eigen::Vector4d(0.0, 0.0, std::numbers::pi, 0.0);
  estimate.parameters = Eigen::Vector2d(1.0, 1.0);
  EXPECT_FALSE(reverse->control(estimate).faces_away);
  estimate.state[2] = 0.0;
  reverse->locate();
  EXPECT_TRUE(reverse->control(estimate).faces_away);
}

TEST(TurnAround, AVehicleThatLooksAwayTurnsAround) {
  for (const char* const vehicle :
       {"model: bicycle_slip", "model: skid_steer", "model: tractor_trailer",
        "{model: bicycle_slip, controller: {rate_bounds: {u2: [-0.5, 0.5]}}}",
        "{model: bicycle_slip, controller: {weights: {stage: {u1: 5, u2: 5}, rates: {u1: 1, u2: 1}}}}"}) {
    for (const double angle : {std::numbers::pi, 2.8, -2.9}) {
      const Turned about = turned(vehicle, angle, 200);
      EXPECT_FALSE(about.ever) << vehicle << " " << angle;
      EXPECT_EQ(about.allocations, 0) << vehicle << " " << angle;
      EXPECT_LT(about.turning, 130) << vehicle << " " << angle;
      EXPECT_LT(about.farthest, 7.0) << vehicle << " " << angle;
      EXPECT_LT(std::abs(about.beside), 0.01) << vehicle << " " << angle;
      EXPECT_LT(std::abs(about.heading_error), 0.01) << vehicle << " " << angle;
      EXPECT_GT(about.way, 30.0) << vehicle << " " << angle;
    }
    // One that looks back exactly cannot turn by itself.
    EXPECT_GT(turned(vehicle, std::numbers::pi, 30).turning, 15) << vehicle;
  }
}

// As somebody writes it down, told how hard to drive, without bounds, and not how fast: it stands when it begins.
TEST(TurnAround, WhateverTheVehicleIsToldByItsInputs) {
  const std::string kart = R"(
model:
  equations:
    states:
      x: {unit: m, typical: 10, role: position_x}
      y: {unit: m, typical: 10, role: position_y}
      psi: {unit: rad, angle: true, role: heading}
      v: {unit: m/s, typical: 2}
    inputs: {drive: {unit: m/s^2, typical: 1}, delta: {unit: rad, typical: 0.3, bounds: [-0.6, 0.6]}}
    parameters: {grip: {nominal: 0.9}}
    outputs: {x_gps: {unit: m}, y_gps: {unit: m}}
    equations: |
      x' = v * cos(psi)
      y' = v * sin(psi)
      psi' = grip * v * tan(delta) / 1.1
      v' = drive - 0.4 * v
      x_gps = x
      y_gps = y
    straight_motion: |
      v = ground_speed
      drive = 0.4 * ground_speed
      delta = 0
)";
  const Turned about = turned(kart, 3.0, 200);
  EXPECT_FALSE(about.ever);
  EXPECT_GT(about.turning, 10);
  EXPECT_LT(about.turning, 100);
  EXPECT_LT(std::abs(about.beside), 0.05);
  EXPECT_GT(about.way, 30.0);
}

// Limits of terms are beside the path, not beside the way back.
TEST(TurnAround, KeepsLimitsBesideThePath) {
  const auto with = [](const std::string& corridor) {
    return turned("{model: bicycle_slip, controller: {terms: [{name: corridor, " + corridor + "}]}}", 3.0, 250);
  };
  const Turned narrow = with("left: 1, right: 1");
  EXPECT_LT(narrow.farthest, 1.05);
  EXPECT_GT(narrow.way, 20.0) << "there is no room to go round, but to turn in several moves";
  EXPECT_GT(narrow.back, 5);
  EXPECT_GT(narrow.turning, narrow.back + 5);
  EXPECT_EQ(narrow.allocations, 0);
  const Turned wide = with("left: 6, right: 6");
  EXPECT_LT(wide.farthest, 6.0);
  EXPECT_GT(wide.way, 30.0);
}

// Room that waypoints give the path is kept to as well, also where the path leads backwards, and without any term.
TEST(TurnAround, InSeveralMovesWithinTheRoomOfAPath) {
  for (const double speed : {2.0, -2.0}) {
    const std::vector<Waypoint> points{{0.0, 0.0, speed, 1.5, 1.5}, {80.0, 0.0, speed, 1.5, 1.5}};
    const auto controller = controller_on(Path(points), "model: bicycle_slip");
    const Model& model = controller->vehicle();
    const std::vector<double> slip = nominal_values(model.description().parameters);
    Estimate estimate;
    estimate.state = Eigen::Vector4d(10.0, 0.2, speed > 0.0 ? 2.9 : -0.2, 0.0);
    estimate.parameters = Eigen::Map<const Eigen::VectorXd>(slip.data(), static_cast<Eigen::Index>(slip.size()));
    double farthest = 0.0;
    int turning = 0, back = 0, both_ways = 0;
    for (int k = 0; k < 200; ++k) {
      const Controller::Command& command = controller->control(estimate);
      turning += command.turns_around;
      back += command.goes_back;
      both_ways += command.turns_around && !command.goes_back;
      drive(model, command, estimate);
      farthest = std::max(farthest, std::abs(estimate.state[1]));
    }
    EXPECT_GT(turning, 20) << speed;
    EXPECT_GT(back, 5) << speed;
    EXPECT_GT(both_ways, 5) << speed;
    EXPECT_LT(farthest, 1.6) << speed;
    EXPECT_GT(estimate.state[0], 30.0) << speed;
    EXPECT_NEAR(estimate.state[1], 0.0, 0.01) << speed;
    EXPECT_NEAR(std::remainder(estimate.state[2] - (speed > 0.0 ? 0.0 : std::numbers::pi), 2.0 * std::numbers::pi), 0.0,
                0.01)
        << speed;
  }
}

std::string in_corridor(const std::string& vehicle, const std::string& further = "") {
  return "{model: " + vehicle + ", controller: {" + further +
         "terms: [{name: corridor, left: 1, right: 1, hard: true}]}}";
}

// At the edge of a hard corridor, looking out of it: every way on leads beyond the limit.
TEST(GoBack, FromTheEdgeOfACorridor) {
  for (const char* const vehicle : {"bicycle_slip", "skid_steer", "tractor_trailer"}) {
    for (const double side : {1.0, -1.0}) {
      for (const double angle : {0.28, 0.6, 1.2}) {
        if (angle > 1.0 && vehicle == std::string("tractor_trailer")) continue;  // a trailer turns later
        const std::string what = vehicle + (" " + std::to_string(side * angle));
        const Turned back = turned(in_corridor(vehicle), side * angle, 150, side * 0.98);
        EXPECT_FALSE(back.stands) << what;
        EXPECT_LT(back.back, 20) << what;
        EXPECT_GT(back.least_way, -4.0) << what;
        EXPECT_GT(back.way, 40.0) << what;
        EXPECT_LT(std::abs(back.beside), 0.01) << what;
        EXPECT_LT(back.farthest, 1.01) << what;
        EXPECT_EQ(back.allocations, 0) << what;
      }
    }
    EXPECT_GT(turned(in_corridor(vehicle), 1.2, 40, 0.98).back, 2) << vehicle;
  }
  EXPECT_GT(turned(in_corridor("bicycle_slip", "rate_bounds: {u2: [-0.5, 0.5]}, "), 0.4, 150, 0.98).way, 40.0);
}

TEST(GoBack, OnlyWhoMay) {
  const std::string forwards_only = R"({model: {equations: {
    states: {x: {unit: m, typical: 10, role: position_x}, y: {unit: m, typical: 10, role: position_y},
             psi: {unit: rad, angle: true, role: heading}},
    inputs: {v: {unit: m/s, typical: 2, role: speed, bounds: [0, 3]}, delta: {unit: rad, typical: 0.3, bounds: [-0.6, 0.6]}},
    outputs: {x_gps: {unit: m}, y_gps: {unit: m}},
    equations: "x' = v * cos(psi)\ny' = v * sin(psi)\npsi' = v * tan(delta) / 1.1\nx_gps = x\ny_gps = y"}},
    controller: {terms: [{name: corridor, left: 1, right: 1, hard: true}]}})";
  for (const std::string& who : {in_corridor("bicycle_slip", "turn_around: false, "), forwards_only}) {
    const Turned stays = turned(who, 0.4, 100, 0.98);
    EXPECT_EQ(stays.back, 0) << who;
    EXPECT_TRUE(stays.stands) << who;
    EXPECT_FALSE(stays.ever) << who << ": it does not face away";
    EXPECT_GT(stays.least_way, -0.01) << who;
    EXPECT_LT(stays.way, 1.0) << who;
  }
}

// Where no plan keeps a hard limit, as for one that begins outside, it is the one that violates it least.
TEST(GoBack, IntoACorridorFromOutside) {
  for (const char* const vehicle : {"bicycle_slip", "skid_steer"}) {
    for (const double aside : {1.5, -3.0, 6.0}) {
      for (const double angle : {0.0, 0.4, -0.4, 1.2, -1.2}) {
        const std::string what = fmt::format("{}, {} m, {} rad", vehicle, aside, angle);
        const Turned comes = turned(in_corridor(vehicle), angle, 150, aside);
        EXPECT_LT(std::abs(comes.beside), 0.05) << what;
        EXPECT_GT(comes.way, 20.0) << what;
        EXPECT_LT(comes.farthest, std::abs(aside) + 1.0) << what;
      }
    }
  }
}

// It comes back to the path, or says that it stands: RHEC_PLACES of them for each vehicle (default 10).
TEST(GoBack, FromAnywhereOrItIsSaid) {
  const char* const wanted = std::getenv("RHEC_PLACES");
  const int places = wanted ? std::max(1, std::atoi(wanted)) : 10;
  for (const char* const vehicle : {"skid_steer", "bicycle_slip", "bicycle_sideslip", "tractor_trailer"}) {
    std::mt19937 random(7);
    const auto between = [&](double least, double most) {
      return least + (most - least) * static_cast<double>(random()) / std::mt19937::max();
    };
    int back = 0;
    for (int k = 0; k < places; ++k) {
      const double aside = between(-6.0, 6.0), angle = between(-3.1, 3.1);
      const Turned comes = turned(in_corridor(vehicle), angle, 300, aside);
      const bool is_back = std::abs(comes.beside) < 0.05 && comes.way > 10.0;
      EXPECT_TRUE(is_back || comes.stands) << fmt::format("{}, {} m, {} rad", vehicle, aside, angle);
      back += is_back;
    }
    RecordProperty(std::string("back_") + vehicle, back);
    if (vehicle != std::string("tractor_trailer")) {
      EXPECT_EQ(back, places) << vehicle << " turns on the spot, or in several moves";
    }
    if (wanted) std::printf("%s: %d of %d are back\n", vehicle, back, places);
  }
}

// What is in the way may go.
TEST(GoBack, NotFromAnObstacle) {
  const double there = 14.0 / std::numbers::sqrt2;
  const Turned waits = turned(
      "{model: bicycle_slip, controller: {terms: [{name: corridor, left: 1, right: 1, hard: true}, "
      "{name: obstacles, most: 1, hard: true}]}}",
      0.0, 60, 0.0, {{.x = there, .y = there, .semi_axis_along = 1.5, .semi_axis_across = 1.5}});
  EXPECT_TRUE(waits.stands);
  EXPECT_EQ(waits.back, 0);
  EXPECT_GT(waits.least_way, -0.5);
  EXPECT_LT(waits.way, 3.0);
}

// An estimate that is lost may be wrong of the heading, too.
TEST(TurnAround, OfOneThatIsLostWaits) {
  const auto controller = controller_on(Path({{0.0, 0.0, 2.0}, {50.0, 0.0, 2.0}}),
                                        "{model: bicycle_slip, controller: {health: {lost: 0.5}}}");
  Estimate estimate;
  estimate.state = Eigen::Vector4d(10.0, 0.0, std::numbers::pi, 0.0);
  estimate.parameters = Eigen::Vector2d(1.0, 1.0);
  estimate.health.level = HealthLevel::lost;
  int waited = 0;
  while (waited < 100 && !controller->control(estimate).turns_around) ++waited;
  EXPECT_NEAR(waited, 25, 2) << "five seconds";
}

}  // namespace turn_around_test
}  // namespace rhec
