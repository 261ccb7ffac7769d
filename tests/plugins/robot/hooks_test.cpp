// Hooks: one round the other, and nothing where none is hung in.
#include "rhec/plugins/robot/hooks.hpp"

#include <gmock/gmock.h>

#include <string>
#include <utility>

#include "plugins/robot/robots.hpp"
#include "rhec/core/ocp/solver_decorator.hpp"
#include "rhec/plugins/robot/robot.hpp"

namespace rhec {
namespace hooks_test {

using testing::ElementsAre;

/// Writes down what it is asked.
class Writer final : public RobotHooks {
 public:
  Writer(std::string name, std::vector<std::string>& log) : name_(std::move(name)), log_(log) {}
  std::shared_ptr<Solver> wrap_solver(std::string_view kind, std::shared_ptr<Solver> solver) const override {
    log_.push_back(name_ + ": solver of " + std::string(kind));
    return solver;
  }
  std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const override {
    log_.push_back(name_ + ": method");
    return method;
  }

 private:
  std::string name_;
  std::vector<std::string>& log_;
};

/// A solver round another one, as seen from outside.
class Shell final : public SolverDecorator {
 public:
  using SolverDecorator::SolverDecorator;
  Solver& inside() { return inner(); }
};
class ShellHooks final : public RobotHooks {
 public:
  std::shared_ptr<Solver> wrap_solver(std::string_view, std::shared_ptr<Solver> solver) const override {
    return std::make_shared<Shell>(std::move(solver));
  }
};

TEST(RobotHooks, ChangeNothingAsTheyAre) {
  const auto solver = host().make_solver("gn_rti");
  EXPECT_EQ(RobotHooks().wrap_solver("rhe", solver), solver);
  EXPECT_EQ(RobotHookChain().wrap_solver("rhe", solver), solver);
  EXPECT_EQ(RobotHooks().wrap_method(nullptr), nullptr);
}

TEST(RobotHookChain, HasTheFirstOneInside) {
  std::vector<std::string> log;
  RobotHookChain chain;
  chain.add(std::make_shared<Writer>("first", log));
  chain.add(std::make_shared<Writer>("second", log));
  chain.wrap_solver("rhc", nullptr);
  chain.wrap_method(nullptr);
  EXPECT_THAT(log, ElementsAre("first: solver of rhc", "second: solver of rhc", "first: method", "second: method"));
}

TEST(RobotHookChain, WrapsWhatTheLinkBeforeReturned) {
  const auto solver = host().make_solver("gn_rti");
  RobotHookChain chain;
  chain.add(std::make_shared<ShellHooks>());
  chain.add(std::make_shared<ShellHooks>());
  const auto outer = std::dynamic_pointer_cast<Shell>(chain.wrap_solver("rhe", solver));
  ASSERT_NE(outer, nullptr);
  auto* const inner = dynamic_cast<Shell*>(&outer->inside());
  ASSERT_NE(inner, nullptr);
  EXPECT_EQ(&inner->inside(), solver.get());
}

TEST(RecordingNodes, KeepsWhatAnEstimatorIsGiven) {
  Robot robot(host(), RobotOptions::table().parse(settings("model: {name: bicycle_slip}"), "robot.yaml"));
  const auto log = std::make_shared<NodeLog>();
  robot.add_hooks(recording_nodes(log));
  const auto estimator = robot.make_estimator();
  const double outputs[] = {1.0, 2.0, 0.0}, inputs[] = {3.0, 0.1};
  estimator->push_measurement(0.0, outputs);
  estimator->push_input(0.0, inputs);
  estimator->push_measurement(0.1, outputs);
  estimator->estimate(0.1);
  ASSERT_EQ(log->intervals(), 1);
  EXPECT_NEAR(log->durations[0], 0.1, 1e-12);
  EXPECT_THAT(log->inputs, ElementsAre(testing::DoubleEq(3.0), testing::DoubleEq(0.1)));
  EXPECT_THAT(log->outputs, ElementsAre(1.0, 2.0, 0.0, 1.0, 2.0, 0.0));
}

}  // namespace hooks_test
}  // namespace rhec
