// What a controller commands when its solver fails: a fresh start, else the last plan, and the recovery from there.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <ostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/control/controller.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/ocp/solver_decorator.hpp"
#include "rhec/plugins/robot/hooks.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec {
namespace controller_failure_test {

using ::testing::Combine;
using ::testing::HasSubstr;
using ::testing::Values;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double steering_limit = 35.0 * std::numbers::pi / 180.0;
constexpr int intervals = 12;

enum class Fault { none, infeasible, bad_input, not_finite };

void PrintTo(Fault fault, std::ostream* out) {
  constexpr const char* names[] = {"none", "infeasible", "bad_input", "not_finite"};
  *out << names[static_cast<int>(fault)];
}

/// A solver that fails on request.
class Unreliable final : public SolverDecorator {
 public:
  using SolverDecorator::SolverDecorator;

  std::string why_not(const Ocp& ocp) const override { return reason.empty() ? SolverDecorator::why_not(ocp) : reason; }
  void setup(const Ocp& ocp) override {
    if (cannot_set_up) throw std::runtime_error("no licence for this machine");
    SolverDecorator::setup(ocp);
    ocp_ = &ocp;
  }
  Report feedback(Iterate& iterate, Clock::time_point deadline) noexcept override {
    ++asked;
    const Fault now = calls_to_fail > 0 ? fault : Fault::none;
    calls_to_fail -= calls_to_fail > 0;
    if (now == Fault::none) return SolverDecorator::feedback(iterate, deadline);
    Report report;
    report.status = now == Fault::infeasible   ? Status::infeasible
                    : now == Fault::not_finite ? Status::solved
                                               : Status::bad_input;
    for (int i = 0; now == Fault::not_finite && i <= intervals; ++i) {
      std::fill_n(iterate.state(i), ocp_->state_count(i), nan);
      if (i < intervals) std::fill_n(iterate.control(i), ocp_->control_count(i), nan);
    }
    return report;
  }
  void finish(Iterate& iterate, Report& report) noexcept override {
    SolverDecorator::finish(iterate, report);
    if (!spoils_finish) return;
    spoils_finish = false;
    iterate.state(intervals)[0] = nan;
  }

  Fault fault = Fault::none;
  int calls_to_fail = 0;       ///< from now on
  bool spoils_finish = false;  ///< once
  int asked = 0;
  std::string reason;
  bool cannot_set_up = false;

 private:
  const Ocp* ocp_ = nullptr;
};

const Host& host() {
  static const Host found;
  return found;
}

Path winding() {
  std::vector<Waypoint> waypoints;
  for (int i = 0; i <= 60; ++i) waypoints.push_back({1.0 * i, 3.0 * std::sin(0.15 * i), 2.0});
  return Path(waypoints);
}

/// Wraps each solver that a robot makes into an unreliable one, and keeps the last one in `made`.
class UnreliableSolver final : public RobotHooks {
 public:
  explicit UnreliableSolver(std::shared_ptr<Unreliable>& made) : made_(made) {}
  std::shared_ptr<Solver> wrap_solver(std::string_view, std::shared_ptr<Solver> solver) const override {
    made_ = std::make_shared<Unreliable>(std::move(solver));
    return made_;
  }

 private:
  std::shared_ptr<Unreliable>& made_;
};

/// A bicycle that starts beside its path, its controller, and a second controller with the same input that never fails.
class Drive {
 public:
  explicit Drive(const std::string& mode = "converge") {
    Robot robot(host(),
                RobotOptions::table().parse(
                    parse_yaml("{model: bicycle_slip, controller: {horizon: " + std::to_string(intervals) +
                                   ", solver: {name: gn_rti, mode: " + mode +
                                   (mode == "converge" ? ", tolerance: 1.0e-10, max_iterations: 200" : "") + "}}}",
                               "robot.yaml"),
                    "robot"));
    sound = robot.make_controller(winding());
    robot.add_hooks(std::make_shared<UnreliableSolver>(solver));
    controller = robot.make_controller(winding());
    now.state = Eigen::VectorXd::Zero(4);
    now.state << 0.0, 0.8, 0.3, 0.0;
    now.parameters = Eigen::VectorXd::Constant(2, 0.9);
  }

  void fail(Fault fault, int calls) {
    solver->fault = fault;
    solver->calls_to_fail = calls;
  }

  const Controller::Command& ask(const Estimate& estimate) {
    reference = sound->control(now).inputs;
    return controller->control(estimate);
  }
  const Controller::Command& ask() { return ask(now); }

  /// Applies inputs until the next sample.
  void drive(std::vector<double> inputs, bool prepare) {
    if (prepare) {
      controller->prepare();
      sound->prepare();
    }
    const double step = 0.2;
    Eigen::VectorXd next(4);
    controller->problem().model().integrate({.count = 1,
                                             .states = now.state.data(),
                                             .inputs = inputs.data(),
                                             .parameters = now.parameters.data(),
                                             .durations = &step,
                                             .next_states = next.data()});
    now.state = next;
  }
  void go_well(int samples, bool prepare) {
    for (int k = 0; k < samples; ++k) drive(ask().inputs, prepare);
  }

  /// The inputs of the current plan for each interval.
  std::vector<std::vector<double>> planned() const {
    std::vector<std::vector<double>> inputs(intervals, std::vector<double>(2));
    for (int i = 0; i < intervals; ++i)
      controller->problem().structure().inputs_on(controller->plan(), i, inputs[i].data());
    return inputs;
  }

  bool is_as_the_other(double tolerance = 1e-7) const {
    bool same = true;
    for (int j = 0; j < 2; ++j) same &= std::abs(last_inputs()[j] - reference[j]) <= tolerance;
    return same;
  }
  std::vector<double> last_inputs() const {
    std::vector<double> inputs(2);
    controller->problem().structure().inputs_on(controller->plan(), 0, inputs.data());
    return inputs;
  }

  std::shared_ptr<Unreliable> solver;
  std::unique_ptr<Controller> controller, sound;
  Estimate now;
  std::vector<double> reference;  ///< the second controller's inputs
};

/// The fault, whether `prepare` is called, and the solver's mode.
class EveryFailure : public ::testing::TestWithParam<std::tuple<Fault, bool, std::string>> {
 protected:
  Fault fault() const { return std::get<0>(GetParam()); }
  bool prepares() const { return std::get<1>(GetParam()); }
  Drive drive{std::get<2>(GetParam())};
};

INSTANTIATE_TEST_SUITE_P(Controller, EveryFailure,
                         Combine(Values(Fault::infeasible, Fault::bad_input, Fault::not_finite), Values(false, true),
                                 Values("converge", "rti")));

TEST_P(EveryFailure, OfTheLastPlanIsFollowedByAFreshStart) {
  drive.go_well(3, prepares());
  drive.fail(fault(), 1);
  const int before = drive.solver->asked;
  const auto& command = drive.ask();
  EXPECT_EQ(drive.solver->asked - before, 2);
  EXPECT_TRUE(is_usable(command.report.status));
  EXPECT_TRUE(command.report.fallback_used);
  EXPECT_FALSE(command.fallback);
  EXPECT_EQ(drive.controller->fallbacks(), 0);
  // In mode rti the second controller has not converged.
  EXPECT_TRUE(drive.is_as_the_other(std::get<2>(GetParam()) == "rti" ? 0.05 : 1e-7));
}

TEST_P(EveryFailure, OfTheFreshStartTooLetsTheLastPlanGoOnToItsEnd) {
  drive.go_well(3, prepares());
  const auto command = drive.ask();
  const auto plan = drive.planned();
  const auto [least, most] =
      std::minmax_element(plan.begin(), plan.end(), [](const auto& a, const auto& b) { return a[1] < b[1]; });
  ASSERT_GT((*most)[1] - (*least)[1], 0.02) << "a plan that is the same all along would show nothing";
  drive.drive(command.inputs, prepares());
  for (int k = 1; k < intervals + 4; ++k) {
    drive.fail(fault(), 2);
    const auto& failed = drive.ask();
    EXPECT_TRUE(failed.fallback) << k;
    EXPECT_FALSE(is_usable(failed.report.status)) << k;
    EXPECT_EQ(drive.controller->fallbacks(), k);
    EXPECT_EQ(failed.inputs, plan[std::min(k, intervals - 1)]) << k;
    EXPECT_TRUE(is_finite(drive.controller->problem(), drive.controller->plan())) << k;
    for (int i = 0; i < 4; ++i)
      EXPECT_EQ(drive.controller->plan().state(0)[i], drive.now.state[i]) << "it begins there";
    drive.drive(failed.inputs, prepares());
    EXPECT_TRUE(failed.fallback) << "finish, which prepare calls, has nothing to add";
  }
}

TEST_P(EveryFailure, IsOverWithTheNextGoodSolve) {
  drive.go_well(3, prepares());
  for (int k = 0; k < 3; ++k) {
    drive.fail(fault(), 2);
    drive.drive(drive.ask().inputs, prepares());
  }
  const bool converges = std::get<2>(GetParam()) == "converge";
  for (int k = 0; k < 8; ++k) {
    const auto& command = drive.ask();
    EXPECT_FALSE(command.fallback) << k;
    EXPECT_FALSE(command.report.fallback_used) << k;
    EXPECT_EQ(command.report.status, converges ? Status::solved : Status::step_taken) << k;
    // Real-time iterations take some samples to forget their starting point.
    EXPECT_TRUE(drive.is_as_the_other(converges ? 1e-7 : k < 6 ? 0.3 : 1e-3)) << k;
    drive.drive(command.inputs, prepares());
  }
  EXPECT_EQ(drive.controller->fallbacks(), 3);
}

TEST_P(EveryFailure, OfTheVeryFirstSolveLetsTheVehicleGoStraightAhead) {
  drive.fail(fault(), 1);
  const auto& command = drive.ask();
  EXPECT_TRUE(command.fallback);
  EXPECT_EQ(drive.solver->asked, 1) << "it was a fresh start already";
  const double* straight = drive.controller->problem().input_reference(0);
  EXPECT_EQ(command.inputs, std::vector<double>(straight, straight + 2));
  EXPECT_GT(command.inputs[0], 0.0);
  drive.drive(command.inputs, prepares());
  const auto& second = drive.ask();
  EXPECT_FALSE(second.fallback);
  EXPECT_FALSE(second.report.fallback_used);
  EXPECT_EQ(drive.controller->fallbacks(), 1);
  EXPECT_TRUE(drive.is_as_the_other(std::get<2>(GetParam()) == "rti" ? 0.3 : 1e-7));
}

TEST_P(EveryFailure, IsForgottenByAReset) {
  const auto first = drive.ask().inputs;
  drive.drive(first, prepares());
  drive.fail(fault(), 2);
  drive.ask();
  const Estimate later = drive.now;
  drive.controller->reset();
  EXPECT_EQ(drive.controller->fallbacks(), 0);
  Drive other(std::get<2>(GetParam()));
  other.now.state << 0.0, 0.8, 0.3, 0.0;
  EXPECT_EQ(drive.controller->control(other.now).inputs, first) << "to the last bit";
}

/// Whether `prepare` is called, and the solver's mode.
class NotANumber : public ::testing::TestWithParam<std::tuple<bool, std::string>> {};

INSTANTIATE_TEST_SUITE_P(Controller, NotANumber, Combine(Values(false, true), Values("converge", "rti")));

TEST_P(NotANumber, InTheEstimateLetsTheLastPlanGoOn) {
  const auto& [prepares, mode] = GetParam();
  for (int j = 0; j < 6; ++j) {
    Drive drive(mode);
    drive.go_well(3, prepares);
    const auto command = drive.ask();
    const auto plan = drive.planned();
    drive.drive(command.inputs, prepares);
    for (int k = 1; k <= 4; ++k) {
      Estimate broken = drive.now;
      (j < 4 ? broken.state[j] : broken.parameters[j - 4]) = k % 2 ? nan : std::numeric_limits<double>::infinity();
      const auto& failed = drive.ask(broken);
      EXPECT_TRUE(failed.fallback) << j << ", " << k;
      EXPECT_EQ(failed.report.status, Status::bad_input) << j << ", " << k;
      EXPECT_EQ(failed.inputs, plan[k]) << j << ", " << k;
      EXPECT_TRUE(is_finite(drive.controller->problem(), drive.controller->plan())) << j << ", " << k;
      drive.drive(failed.inputs, prepares);
    }
    const auto& good = drive.ask();
    EXPECT_FALSE(good.fallback) << j;
    EXPECT_FALSE(good.report.fallback_used) << j;
    EXPECT_TRUE(drive.is_as_the_other(mode == "rti" ? 0.3 : 1e-7)) << j;
  }
}

TEST_P(NotANumber, InTheFirstEstimateLetsTheVehicleGoStraightAhead) {
  const auto& [prepares, mode] = GetParam();
  for (int j = 0; j < 6; ++j) {
    Drive drive(mode);
    Estimate broken = drive.now;
    (j < 4 ? broken.state[j] : broken.parameters[j - 4]) = nan;
    for (int k = 1; k <= 2; ++k) {
      const auto& failed = drive.ask(broken);
      EXPECT_TRUE(failed.fallback) << j;
      EXPECT_EQ(drive.controller->fallbacks(), k) << j;
      EXPECT_TRUE(std::isfinite(failed.inputs[0]) && failed.inputs[0] > 0.0) << j;
      EXPECT_EQ(failed.inputs[1], 0.0) << j;
      if (prepares) drive.controller->prepare();
    }
    const auto& good = drive.ask();
    EXPECT_FALSE(good.fallback) << j;
    EXPECT_TRUE(drive.is_as_the_other(mode == "rti" ? 0.3 : 1e-7)) << j;
  }
}

TEST_P(NotANumber, InAFinishedPlanMakesTheNextSampleStartAfresh) {
  const auto& [prepares, mode] = GetParam();
  Drive drive(mode);
  drive.go_well(3, prepares);
  drive.solver->spoils_finish = true;
  drive.drive(drive.ask().inputs, prepares);
  const auto& command = drive.ask();
  EXPECT_FALSE(drive.solver->spoils_finish);
  EXPECT_FALSE(command.fallback);
  EXPECT_FALSE(command.report.fallback_used) << "nothing was tried that could not succeed";
  EXPECT_TRUE(drive.is_as_the_other(mode == "rti" ? 0.05 : 1e-7));
}

/// Whether `prepare` is called. Not in mode rti, whose single step is taken in any case.
class PassedDeadline : public ::testing::TestWithParam<bool> {};

INSTANTIATE_TEST_SUITE_P(Controller, PassedDeadline, ::testing::Bool());

TEST_P(PassedDeadline, LeavesTimeForOneIterationAndIsNoFailure) {
  const bool prepares = GetParam();
  Drive drive;
  drive.go_well(3, prepares);
  const auto command = drive.ask();
  drive.drive(command.inputs, prepares);
  for (int k = 1; k <= 3; ++k) {
    const int before = drive.solver->asked;
    drive.sound->control(drive.now);
    const auto late = drive.controller->control(drive.now, Clock::time_point::min());
    EXPECT_TRUE(late.report.status == Status::deadline || late.report.status == Status::solved) << k;
    EXPECT_LE(late.report.iterations, 1) << k;
    EXPECT_EQ(drive.solver->asked - before, 1) << "there is no time for a fresh start";
    EXPECT_FALSE(late.fallback) << k;
    drive.drive(late.inputs, prepares);
  }
  const auto& in_time = drive.ask();
  EXPECT_EQ(in_time.report.status, Status::solved);
  EXPECT_TRUE(drive.is_as_the_other());
  EXPECT_EQ(drive.controller->fallbacks(), 0);
}

TEST_P(PassedDeadline, AtTheFirstSampleLeavesTimeForOneIteration) {
  Drive drive;
  const auto late = drive.controller->control(drive.now, Clock::time_point::min());
  EXPECT_EQ(late.report.status, Status::deadline);
  EXPECT_EQ(late.report.iterations, 1);
  EXPECT_FALSE(late.fallback);
  if (GetParam()) drive.controller->prepare();
  EXPECT_FALSE(drive.ask().fallback);
  EXPECT_TRUE(drive.is_as_the_other());
}

TEST(ControllerBounds, OutOfTheEstimatesReachAreMovedAndSaidSo) {
  Drive drive;
  drive.go_well(3, false);
  EXPECT_FALSE(drive.ask().relaxed);
  // The estimated steering angle exceeds its limit by an amount that takes two samples at the maximum rate.
  drive.now.state[3] = steering_limit * (1.0 + 0.2 * 1.5);
  for (int k = 0; k < 2; ++k) {
    const auto& command = drive.ask();
    EXPECT_EQ(command.relaxed, k == 0) << k;
    EXPECT_FALSE(command.fallback) << k;
    EXPECT_EQ(command.report.status, Status::solved) << k;
    EXPECT_NEAR(command.inputs[1], -steering_limit, 1e-5) << "back as fast as the rate's bound allows";
    drive.drive(command.inputs, false);
  }
  EXPECT_LT(drive.now.state[3], steering_limit);
  const auto& inside = drive.ask();
  EXPECT_FALSE(inside.relaxed);
  EXPECT_FALSE(inside.fallback);
  EXPECT_EQ(drive.controller->problem().state_upper(1)[3], steering_limit) << "the bound is where it was";
  EXPECT_EQ(drive.controller->fallbacks(), 0);
}

TEST(ControllerBounds, HoldForTheInputsOfAPlanThatGoesOn) {
  Drive drive;
  drive.go_well(3, false);
  const auto plan = drive.planned();
  drive.now.state[3] = steering_limit * 1.3;
  drive.fail(Fault::infeasible, 2);
  const auto& command = drive.ask();
  EXPECT_TRUE(command.fallback);
  EXPECT_TRUE(command.relaxed);
  for (int j = 0; j < 2; ++j) {
    EXPECT_GE(command.inputs[j], drive.controller->problem().input_lower(0, j));
    EXPECT_LE(command.inputs[j], drive.controller->problem().input_upper(0, j));
  }
}

TEST(ControllerSetup, TellsWhyASolverCannotTakeItsProblem) {
  const Robot robot(host(), RobotOptions::table().parse(parse_yaml("model: bicycle_slip", "robot.yaml"), "robot"));
  Controller::Setup setup;
  setup.problem.state_weights = setup.problem.terminal_weights = {1.0, 1.0, 0.0, 0.0};
  setup.problem.input_weights = {0.1, 0.1};
  const auto solver = std::make_shared<Unreliable>(host().make_solver("gn_rti"));
  const auto what_it_throws = [&]() -> std::string {
    try {
      Controller(robot.model(), solver, winding(), setup);
    } catch (const std::exception& error) {
      return error.what();
    }
    return "nothing";
  };
  EXPECT_EQ(what_it_throws(), "nothing");
  solver->reason = "it has no use for paths";
  EXPECT_THAT(what_it_throws(), HasSubstr("the solver cannot take this problem: it has no use for paths"));
  solver->reason.clear();
  solver->cannot_set_up = true;
  EXPECT_THAT(what_it_throws(), HasSubstr("no licence for this machine"));
}

}  // namespace controller_failure_test
}  // namespace rhec
