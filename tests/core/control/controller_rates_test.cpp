// A controller whose inputs have weights and bounds of their rates.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "rhec/core/control/controller.hpp"
#include "rhec/core/control/input_rate_model.hpp"
#include "rhec/core/ocp/solver_decorator.hpp"
#include "rhec/plugins/robot/hooks.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace controller_rates_test {

using testing::HasSubstr;

constexpr double nan = std::numeric_limits<double>::quiet_NaN(), step = 0.2;

const Host& host() {
  static const Host found;
  return found;
}

Path winding() {
  std::vector<Waypoint> waypoints;
  for (int i = 0; i <= 60; ++i) waypoints.push_back({1.0 * i, 3.0 * std::sin(0.15 * i), 2.0});
  return Path(waypoints);
}

Robot robot_with(const std::string& controller) {
  return {host(),
          RobotOptions::table().parse(
              parse_yaml("{model: bicycle_slip, step: 0.2, controller: {" + controller + "}}", "test"), "robot")};
}

/// A bicycle that starts beside its path and knows where it is and how much it slips.
struct Drive {
  explicit Drive(const std::string& section) : robot(robot_with(section)) { start(); }
  explicit Drive(Robot with) : robot(std::move(with)) { start(); }

  void start() {
    controller = robot.make_controller(winding());
    now.state = Eigen::Vector4d(0.0, 0.8, 0.3, 0.0);
    now.parameters = Eigen::Vector2d(0.9, 0.9);
  }

  /// Gives the command, and moves on.
  std::vector<double> advance() {
    const std::vector<double> inputs = controller->control(now).inputs;
    Eigen::VectorXd next(4);
    robot.model()->integrate({.count = 1,
                              .states = now.state.data(),
                              .inputs = inputs.data(),
                              .parameters = now.parameters.data(),
                              .durations = &step,
                              .next_states = next.data()});
    now.state = next;
    controller->finish();
    return inputs;
  }

  Robot robot;
  std::unique_ptr<Controller> controller;
  Estimate now;
};

constexpr const char* converge = "solver: {name: gn_rti, mode: converge}";

TEST(ControllerRates, CostWhatIsWrittenOfThem) {
  Drive drive("weights: {stage: {u1: 2, u2: 0.5}, rates: {u1: 0.3, u2: 0.7}}, " + std::string(converge));
  std::vector<double> last{nan, nan};
  for (int k = 0; k < 5; ++k) {
    const Controller::Command& command = drive.controller->control(drive.now);
    if (k == 0) last = {drive.controller->input_reference(0, 0), 0.0};  // what drives straight ahead
    drive.controller->finish();
    const RhcProblem& problem = drive.controller->problem();
    const Iterate& plan = drive.controller->plan();
    double expected = 0.0;
    std::vector<double> before = last, now(2);
    for (int i = 0; i <= problem.intervals(); ++i) {
      const double weight = i < problem.intervals() ? 1.0 : 10.0;
      for (int j = 0; j < 2; ++j) expected += weight * std::pow(plan.state(i)[j] - problem.state_reference(i)[j], 2);
      if (i == problem.intervals()) break;
      drive.controller->plan_inputs(i, now.data());
      for (int j = 0; j < 2; ++j) {
        expected += (j == 0 ? 2.0 : 0.5) * std::pow(now[j] - drive.controller->input_reference(i, j), 2);
        expected += (j == 0 ? 0.3 : 0.7) * std::pow((now[j] - before[j]) / step, 2);
      }
      before = now;
    }
    // The first node's held inputs are given, and cost a constant.
    for (int j = 0; j < 2; ++j)
      expected +=
          (j == 0 ? 2.0 : 0.5) * std::pow(problem.initial_state()[4 + j] - problem.state_reference(0)[4 + j], 2);
    EXPECT_NEAR(command.report.objective, expected, 1e-9 * expected) << k;
    last = drive.advance();
  }
}

TEST(ControllerRates, OfNearlyNoWeightChangeNothing) {
  for (const char* blocking : {"", ", blocking: {u1: {name: structured, size: 3, anchor: horizon}}"}) {
    Drive plain(std::string(converge) + blocking),
        rated("weights: {rates: {u2: 1e-12}}, " + std::string(converge) + blocking);
    ASSERT_NE(dynamic_cast<const InputRateModel*>(&rated.controller->problem().model()), nullptr);
    for (int k = 0; k < 40; ++k) {
      const std::vector<double> expected = plain.advance(), inputs = rated.advance();
      for (int j = 0; j < 2; ++j) ASSERT_NEAR(inputs[j], expected[j], 1e-6) << k << ' ' << j;
    }
    EXPECT_EQ(rated.controller->fallbacks(), 0);
  }
}

TEST(ControllerRates, ThatWeighMoreChangeLess) {
  double before = std::numeric_limits<double>::infinity();
  for (const char* weight : {"0", "0.03", "0.3", "3"}) {
    Drive drive("weights: {stage: {u2: 0.5}, rates: {u2: " + std::string(weight) + "}}");
    double sum = 0.0, last = drive.advance()[1];
    for (int k = 0; k < 100; ++k) {
      const double now = drive.advance()[1];
      sum += std::pow(now - last, 2);
      last = now;
    }
    EXPECT_LT(sum, 0.9 * before) << weight;
    before = sum;
  }
}

TEST(ControllerRates, KeepTheirBoundsAndReachThem) {
  Drive drive("rate_bounds: {u1: [-0.5, 1], u2: [-0.25, 0.25]}, weights: {stage: {u2: 0.1}}");
  std::vector<double> last = drive.advance();
  double largest = 0.0;
  for (int k = 0; k < 120; ++k) {
    const std::vector<double> now = drive.advance();
    EXPECT_GE(now[0] - last[0], -0.5 * step - 1e-12);
    EXPECT_LE(now[0] - last[0], 1.0 * step + 1e-12);
    EXPECT_LE(std::abs(now[1] - last[1]), 0.25 * step + 1e-12);
    largest = std::max(largest, std::abs(now[1] - last[1]));
    last = now;
  }
  EXPECT_NEAR(largest, 0.25 * step, 1e-9);
  EXPECT_EQ(drive.controller->fallbacks(), 0);
}

TEST(ControllerRates, KeepTheBoundsOfTheInputsThemselves) {
  Drive drive("weights: {stage: {u2: 0.001}, rates: {u1: 0.001, u2: 0.001}}");
  const std::vector<Variable>& about = drive.robot.model()->description().inputs;
  double most = 0.0;
  drive.now.state[1] = 3.0;
  for (int k = 0; k < 60; ++k) {
    const std::vector<double> now = drive.advance();
    EXPECT_LE(std::abs(now[1]), about[1].upper + 1e-12);
    EXPECT_LE(now[0], 2.5 * 2.0 + 1.0 + 1e-12) << "the bound of the wheel speed, of the path's speed";
    most = std::max(most, std::abs(now[1]));
  }
  EXPECT_NEAR(most, about[1].upper, 1e-9) << "else the test would prove less than it says";
  EXPECT_EQ(drive.controller->input_upper(0), 6.0);
  EXPECT_EQ(drive.controller->fallbacks(), 0);
}

TEST(ControllerRates, BeginWithWhatWasApplied) {
  Drive drive("rate_bounds: {u1: [-1, 1], u2: [-0.5, 0.5]}");
  EXPECT_NEAR(drive.controller->control(drive.now).inputs[0], 2.0 / 0.9, 1.0 * step + 1e-12) << "the reference";
  drive.controller->reset();
  const std::vector<double> standing{0.0, nan};
  drive.controller->applied(standing.data());
  const std::vector<double> first = drive.controller->control(drive.now).inputs;
  EXPECT_NEAR(first[0], step, 1e-9);
  EXPECT_LE(std::abs(first[1]), 0.5 * step + 1e-12);
  // And one that was beyond its bounds comes back as fast as it may.
  const std::vector<double> beyond{8.0, 0.0};
  drive.controller->applied(beyond.data());
  const Controller::Command& back = drive.controller->control(drive.now);
  EXPECT_NEAR(back.inputs[0], 8.0 - step, 1e-4);
  EXPECT_TRUE(back.relaxed);
  EXPECT_FALSE(back.fallback);
  // Without a bound of its rate it is back at once.
  Drive free("weights: {rates: {u1: 0.1}}");
  free.controller->applied(beyond.data());
  const Controller::Command& at_once = free.controller->control(free.now);
  EXPECT_LE(at_once.inputs[0], 6.0);
  EXPECT_FALSE(at_once.relaxed);
}

TEST(ControllerRates, DoNotChangeAnInputWithinItsBlocks) {
  Drive drive("blocking: {u2: {name: structured, size: 3, anchor: horizon}}, weights: {rates: {u2: 0.1}}");
  std::vector<double> inputs(2);
  for (int k = 0; k < 5; ++k) {
    drive.advance();
    double held = 0.0;
    for (int i = 0; i < drive.controller->problem().intervals(); ++i) {
      drive.controller->plan_inputs(i, inputs.data());
      if (i % 3 == 0)
        held = inputs[1];
      else
        EXPECT_NEAR(inputs[1], held, 1e-12) << k << ' ' << i;
    }
  }
  EXPECT_EQ(drive.controller->fallbacks(), 0);
}

/// Fails from some call on.
class Failing final : public SolverDecorator {
 public:
  using SolverDecorator::SolverDecorator;
  Report feedback(Iterate& iterate, Clock::time_point deadline) noexcept override {
    if (!fails) return SolverDecorator::feedback(iterate, deadline);
    Report report;
    report.status = Status::infeasible;
    return report;
  }
  bool fails = false;
};

class FailingSolver final : public RobotHooks {
 public:
  explicit FailingSolver(std::shared_ptr<Failing>& made) : made_(made) {}
  std::shared_ptr<Solver> wrap_solver(std::string_view, std::shared_ptr<Solver> solver) const override {
    made_ = std::make_shared<Failing>(std::move(solver));
    return made_;
  }

 private:
  std::shared_ptr<Failing>& made_;
};

TEST(ControllerRates, AFailedSolverIsFollowedByThePlanAndThenByItsLastInput) {
  std::shared_ptr<Failing> solver;
  Robot robot = robot_with("horizon: 8, weights: {rates: {u2: 0.1}}");
  robot.add_hooks(std::make_shared<FailingSolver>(solver));
  Drive drive(std::move(robot));
  for (int k = 0; k < 3; ++k) drive.advance();
  std::vector<std::vector<double>> plan(8, std::vector<double>(2));
  for (int i = 0; i < 8; ++i) drive.controller->plan_inputs(i, plan[i].data());
  ASSERT_GT(std::abs(plan[7][1] - plan[6][1]), 1e-5) << "a plan that would go on changing";
  solver->fails = true;
  for (int i = 1; i < 14; ++i) {
    const std::vector<double> inputs = drive.advance();
    for (int j = 0; j < 2; ++j) EXPECT_NEAR(inputs[j], plan[std::min(i, 7)][j], 1e-9) << i << ' ' << j;
  }
  EXPECT_EQ(drive.controller->fallbacks(), 13);
  solver->fails = false;
  drive.advance();
  EXPECT_EQ(drive.controller->fallbacks(), 13);
}

TEST(ControllerRates, ThatCannotBeAreRefused) {
  const auto refused = [](const auto& spoil) {
    Controller::Setup setup;
    setup.problem.state_weights = {1.0, 1.0, 0.0, 0.0};
    setup.problem.terminal_weights = {1.0, 1.0, 0.0, 0.0};
    setup.problem.input_weights = {1.0, 1.0};
    spoil(setup);
    return error_of(
        [&] { Controller(host().make_model("bicycle_slip"), host().make_solver("gn_rti"), winding(), setup); });
  };
  EXPECT_EQ(refused([](Controller::Setup& s) { s.rate_weights = {0.0, 1.0}; }), "");
  EXPECT_THAT(refused([](Controller::Setup& s) { s.rate_weights = {1.0}; }), HasSubstr("1 numbers; expected 2"));
  EXPECT_THAT(refused([](Controller::Setup& s) { s.rate_weights = {0.0, -1.0}; }), HasSubstr("the rate of 'u2'"));
  EXPECT_THAT(refused([](Controller::Setup& s) { s.rate_lower = {0.0, 0.1}; }), HasSubstr("expected 0 between them"));
}

}  // namespace controller_rates_test
}  // namespace rhec
