#include "rhec/sim/problems/recording_solver.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "sim/support/same_point.hpp"
#include "support/random_problem.hpp"

namespace rhec::sim {
namespace recording_solver_test {

using rhec::testing::RandomProblem;

const Host& host() {
  static const Host one;
  return one;
}

/// Hides the kind of a problem from those who ask for it.
class Disguised final : public Ocp {
 public:
  explicit Disguised(const Ocp& of) : of_(of) {}
  Capacity capacity() const noexcept override { return of_.capacity(); }
  int intervals() const noexcept override { return of_.intervals(); }
  int state_count(int i) const noexcept override { return of_.state_count(i); }
  int control_count(int i) const noexcept override { return of_.control_count(i); }
  const double* initial_state() const noexcept override { return of_.initial_state(); }
  const double* state_lower(int i) const noexcept override { return of_.state_lower(i); }
  const double* state_upper(int i) const noexcept override { return of_.state_upper(i); }
  const double* control_lower(int i) const noexcept override { return of_.control_lower(i); }
  const double* control_upper(int i) const noexcept override { return of_.control_upper(i); }
  bool has_second_derivatives() const noexcept override { return of_.has_second_derivatives(); }
  std::size_t scratch_size() const noexcept override { return of_.scratch_size(); }
  double evaluate_stages(const Iterate& point, double* defects, double* stage_costs,
                         std::span<double> scratch) const noexcept override {
    return of_.evaluate_stages(point, defects, stage_costs, scratch);
  }
  void simulate_interval(int i, Iterate& point, std::span<double> scratch) const noexcept override {
    of_.simulate_interval(i, point, scratch);
  }
  double linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                   std::span<double> scratch) const noexcept override {
    return of_.linearise(range, point, hessian, qp, scratch);
  }
  void refresh(const Iterate& point, StageQp& qp, std::span<double> scratch) const noexcept override {
    of_.refresh(point, qp, scratch);
  }

 private:
  const Ocp& of_;
};

TEST(RecordingSolver, IsTheSolverItIsMadeOf) {
  RandomProblem random(host().make_model("bicycle_slip"), 11);
  const auto problem = random.rhc({});
  const Iterate guess = RandomProblem::cold_start(*problem);
  const auto converge = parse_yaml("mode: converge", "options");
  const auto plain = host().make_solver("gn_rti", converge);
  int calls = 0;
  Iterate result;
  RecordingSolver recording(
      host().make_solver("gn_rti", converge), [] { return std::int64_t{17}; },
      [&](std::int64_t step, const HorizonProblem& asked, const Iterate& from, const Iterate& to,
          const Report& report) {
        ++calls;
        EXPECT_EQ(step, 17);
        EXPECT_EQ(&asked, problem.get());
        expect_same_point(asked, from, guess);
        EXPECT_EQ(report.status, Status::solved);
        result = to;
      });
  EXPECT_EQ(recording.why_not(*problem), plain->why_not(*problem));
  plain->setup(*problem);
  recording.setup(*problem);
  Iterate expected = guess, point = guess;
  plain->prepare(expected);
  recording.prepare(point);
  const Report wanted = plain->solve(expected), report = recording.solve(point);
  EXPECT_EQ(report.iterations, wanted.iterations);
  EXPECT_EQ(report.objective, wanted.objective);
  expect_same_point(*problem, point, expected);
  expect_same_point(*problem, result, expected);
  EXPECT_EQ(calls, 1);

  const Disguised other(*problem);
  recording.setup(other);
  point = guess;
  EXPECT_EQ(recording.solve(point).status, Status::solved);
  EXPECT_EQ(calls, 1) << "a problem of another kind passes unrecorded";
}

TEST(RecordingSolver, TellsOfAFeedbackOnceItIsFinished) {
  RandomProblem random(host().make_model("bicycle_slip"), 11);
  const auto problem = random.rhc({});
  const auto plain = host().make_solver("gn_rti");
  std::int64_t step = 0;
  struct Told {
    std::int64_t step;
    Iterate guess, result;
    Report report;
  };
  std::vector<Told> told;
  RecordingSolver recording(
      host().make_solver("gn_rti"), [&] { return step; },
      [&](std::int64_t at, const HorizonProblem&, const Iterate& from, const Iterate& to, const Report& report) {
        told.push_back({at, from, to, report});
      });
  plain->setup(*problem);
  recording.setup(*problem);
  Iterate expected = RandomProblem::cold_start(*problem), point = expected;
  for (step = 1; step <= 3; ++step) {
    const Iterate guess = point;
    for (Solver* solver : {plain.get(), static_cast<Solver*>(&recording)}) {
      Iterate& iterate = solver == &recording ? point : expected;
      solver->prepare(iterate);
      Report report = solver->feedback(iterate, Clock::time_point::max());
      EXPECT_EQ(std::ssize(told), step - 1) << "what is not finished has no KKT residual yet";
      if (solver == &recording) ++step;  // whoever asks is a step further by then
      solver->finish(iterate, report);
      if (solver == &recording) --step;
    }
    ASSERT_EQ(std::ssize(told), step);
    EXPECT_EQ(told.back().step, step) << "the step at which it was asked";
    expect_same_point(*problem, told.back().guess, guess);
    expect_same_point(*problem, told.back().result, expected);
    EXPECT_GT(told.back().report.objective, 0.0);
  }
  // An iterate that cannot be used is not finished by anybody.
  problem->input_lower(0, 0) = std::nan("");
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  recording.prepare(point);
  EXPECT_FALSE(is_usable(recording.feedback(point, Clock::time_point::max()).status));
  EXPECT_EQ(told.size(), 4U);
}

}  // namespace recording_solver_test
}  // namespace rhec::sim
