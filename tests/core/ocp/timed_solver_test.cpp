#include "rhec/core/ocp/timed_solver.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <memory>

#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {
namespace timed_solver_test {

using std::chrono::microseconds;

/// Nothing moves.
class Rest final : public Model {
 public:
  Rest() {
    description_.name = "rest";
    description_.states.resize(1);
    description_.outputs.resize(1);
  }
  const ModelDescription& description() const noexcept override { return description_; }
  bool has_second_derivatives() const noexcept override { return false; }
  void integrate(const Intervals&) const noexcept override {}
  void observe(const Nodes&) const noexcept override {}
  void rates(const double*, const double*, const double*, double* dxdt) const noexcept override { dxdt[0] = 0.0; }

 private:
  ModelDescription description_;
};

/// Takes some time, but does not report it.
class Waiter final : public Solver {
 public:
  std::string why_not(const Ocp&) const override { return "it waits only"; }
  void setup(const Ocp&) override {}
  void prepare(const Iterate&) noexcept override { wait(microseconds(200)); }
  Report solve(Iterate&, Clock::time_point) noexcept override {
    wait(microseconds(400));
    return report_of(Status::solved, 1);
  }
  Report feedback(Iterate&, Clock::time_point) noexcept override {
    wait(microseconds(100));
    return report_of(Status::step_taken, 2);
  }
  void finish(Iterate&, Report& report) noexcept override {
    wait(microseconds(300));
    report = report_of(Status::stalled, 3);
  }
  bool covariances(const Iterate&, StageRange, std::span<double>) noexcept override { return true; }
  void reset() noexcept override { ++resets; }
  int resets = 0;

 private:
  static Report report_of(Status status, int iterations) noexcept {
    Report report;
    report.status = status;
    report.iterations = iterations;
    return report;
  }
  static void wait(microseconds time) {
    for (const auto start = Clock::now(); Clock::now() - start < time;) {
    }
  }
};

TEST(TimedSolver, SaysWhatTookTheTime) {
  RheProblem::Setup setup;
  setup.max_intervals = 1;
  setup.output_weights = {1.0};
  const RheProblem problem(std::make_shared<Rest>(), setup);
  Iterate point(problem.capacity());
  const auto waiter = std::make_shared<Waiter>();
  TimedSolver solver(waiter);
  EXPECT_EQ(solver.why_not(problem), "it waits only");
  solver.setup(problem);

  solver.prepare(point);
  Report report = solver.feedback(point, Clock::time_point::max());
  EXPECT_EQ(report.iterations, 2);
  EXPECT_GE(report.feedback_us, 100.0);
  EXPECT_GE(report.preparation_us, 200.0);
  const Report before = report;
  solver.finish(point, report);
  EXPECT_EQ(report.status, Status::stalled);
  EXPECT_EQ(report.feedback_us, before.feedback_us);
  EXPECT_EQ(report.preparation_us, before.preparation_us);

  // What came after an answer was for the next one.
  solver.prepare(point);
  report = solver.solve(point);
  EXPECT_EQ(report.iterations, 1);
  EXPECT_GE(report.feedback_us, 400.0);
  EXPECT_GE(report.preparation_us, 300.0 + 200.0);
  EXPECT_EQ(solver.solve(point).preparation_us, 0.0);

  solver.prepare(point);
  solver.reset();
  EXPECT_EQ(waiter->resets, 1);
  EXPECT_EQ(solver.solve(point).preparation_us, 0.0);
  EXPECT_TRUE(solver.covariances(point, {0, 0}, {}));
}

}  // namespace timed_solver_test
}  // namespace rhec
