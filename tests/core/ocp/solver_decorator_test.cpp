#include "rhec/core/ocp/solver_decorator.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rhec/core/ocp/ocp.hpp"

namespace rhec {
namespace solver_decorator_test {

/// Records its calls, and returns values that differ from the defaults.
class Witness final : public Solver {
 public:
  std::string why_not(const Ocp&) const override { return "a reason"; }
  void setup(const Ocp& ocp) override {
    calls.emplace_back("setup");
    problem = &ocp;
  }
  void prepare(const Iterate& guess) noexcept override { take("prepare", guess); }
  using Solver::solve;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override {
    take("solve", iterate, deadline);
    return report(1);
  }
  Report feedback(Iterate& iterate, Clock::time_point deadline) noexcept override {
    take("feedback", iterate, deadline);
    return report(2);
  }
  void finish(Iterate& iterate, Report& to) noexcept override {
    take("finish", iterate);
    to = report(3);
  }
  bool covariances(const Iterate& iterate, StageRange nodes, std::span<double> blocks) noexcept override {
    take("covariances", iterate);
    blocks[0] = nodes.first + 10.0 * nodes.last;
    return true;
  }
  void reset() noexcept override { calls.emplace_back("reset"); }

  std::vector<std::string> calls;
  const Ocp* problem = nullptr;
  const Iterate* last_iterate = nullptr;
  Clock::time_point last_deadline;

 private:
  void take(const char* call, const Iterate& asked, Clock::time_point until = {}) {
    calls.emplace_back(call);
    last_iterate = &asked;
    last_deadline = until;
  }
  static Report report(int iterations) {
    Report made;
    made.status = Status::solved;
    made.iterations = iterations;
    return made;
  }
};

/// Its functions are never called.
class NoProblem final : public Ocp {
 public:
  Capacity capacity() const noexcept override { return {}; }
  int intervals() const noexcept override { return 0; }
  int state_count(int) const noexcept override { return 0; }
  int control_count(int) const noexcept override { return 0; }
  const double* initial_state() const noexcept override { return nullptr; }
  const double* state_lower(int) const noexcept override { return nullptr; }
  const double* state_upper(int) const noexcept override { return nullptr; }
  const double* control_lower(int) const noexcept override { return nullptr; }
  const double* control_upper(int) const noexcept override { return nullptr; }
  bool has_second_derivatives() const noexcept override { return false; }
  std::size_t scratch_size() const noexcept override { return 0; }
  double evaluate_stages(const Iterate&, double*, double*, std::span<double>) const noexcept override { return 0.0; }
  void simulate_interval(int, Iterate&, std::span<double>) const noexcept override {}
  double linearise(StageRange, const Iterate&, Hessian, StageQp&, std::span<double>) const noexcept override {
    return 0.0;
  }
};

TEST(SolverDecorator, HandsOnEveryCallAndItsAnswer) {
  const auto witness = std::make_shared<Witness>();
  SolverDecorator decorator(witness);
  const NoProblem problem;
  EXPECT_EQ(decorator.why_not(problem), "a reason");
  decorator.setup(problem);
  EXPECT_EQ(witness->problem, &problem);
  Iterate iterate(Capacity{1, 1, 1});
  const Iterate other(Capacity{1, 1, 1});
  decorator.prepare(other);
  EXPECT_EQ(witness->last_iterate, &other);
  const auto deadline = Clock::now();
  EXPECT_EQ(decorator.solve(iterate, deadline).iterations, 1);
  EXPECT_EQ(witness->last_iterate, &iterate);
  EXPECT_EQ(witness->last_deadline, deadline);
  EXPECT_EQ(decorator.solve(iterate).iterations, 1);
  EXPECT_EQ(witness->last_deadline, Clock::time_point::max());
  Report report = decorator.feedback(iterate, deadline);
  EXPECT_EQ(report.iterations, 2);
  EXPECT_EQ(witness->last_deadline, deadline);
  decorator.finish(iterate, report);
  EXPECT_EQ(report.iterations, 3);
  double block = 0.0;
  EXPECT_TRUE(decorator.covariances(other, {2, 3}, {&block, 1}));
  EXPECT_EQ(block, 32.0);
  decorator.reset();
  EXPECT_THAT(witness->calls, ::testing::ElementsAre("setup", "prepare", "solve", "solve", "feedback", "finish",
                                                     "covariances", "reset"));
}

}  // namespace solver_decorator_test
}  // namespace rhec
