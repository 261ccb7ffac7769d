// The assessment itself: it must see through a solver whose report or point is wrong.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <utility>

#include "assessment.hpp"
#include "families.hpp"
#include "found.hpp"
#include "rhec/core/ocp/solver_decorator.hpp"

namespace rhec::conformance {
namespace assessment_test {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using Lie = std::function<void(const Ocp&, Iterate&, Report&)>;

/// An honest solver whose answers are changed afterwards.
class Liar final : public SolverDecorator {
 public:
  Liar(std::shared_ptr<Solver> solver, Lie lie) : SolverDecorator(std::move(solver)), lie_(std::move(lie)) {}
  using Solver::solve;
  void setup(const Ocp& ocp) override {
    ocp_ = &ocp;
    SolverDecorator::setup(ocp);
  }
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override {
    Report report = inner().solve(iterate, deadline);
    lie_(*ocp_, iterate, report);
    return report;
  }

 private:
  const Ocp* ocp_ = nullptr;
  Lie lie_;
};

std::vector<std::string> complaints_about(const std::string& family_name, const Lie& lie) {
  const Problem problem = family(family_name).make(make_model(host().names(PluginKind::model).front()), 1);
  // The first solver that takes the problem.
  for (const std::string& name : host().names(PluginKind::solver)) {
    Liar solver(make_solver(name), lie);
    if (!solver.why_not(problem.posed()).empty()) continue;
    solver.setup(problem.posed());
    return solve_and_assess(solver, problem.posed(), problem.guess, 1e-8).complaints;
  }
  return {"no solver takes it"};
}

TEST(Assessment, HasNothingToSayAboutAnHonestSolver) {
  for (const char* name : {"rhe_all_at_bounds", "rhc_inputs_at_bounds", "rhe_infeasible", "rhc_limits",
                           "rhc_limits_soft", "rhc_limits_soft_quadratic"})
    EXPECT_THAT(complaints_about(name, [](const Ocp&, Iterate&, Report&) {}), IsEmpty()) << name;
}

TEST(Assessment, SeesAStatusThatIsNotTrue) {
  EXPECT_THAT(complaints_about("rhe_blocks", [](const Ocp&, Iterate& point, Report&) { point.control(3)[0] += 1e-3; }),
              Contains(HasSubstr("it says solved with a KKT residual")));
  EXPECT_THAT(
      complaints_about("rhe_blocks", [](const Ocp&, Iterate&, Report& report) { report.status = Status::stalled; }),
      Contains(HasSubstr("it says stalled of a point with a KKT residual")));
  EXPECT_THAT(complaints_about("rhe_infeasible", [](const Ocp&, Iterate& point, Report&) { point.state(1)[0] += 1.0; }),
              Contains("it says infeasible and has changed the point"));
}

TEST(Assessment, SeesAReportThatIsNotThePoints) {
  EXPECT_THAT(complaints_about("rhc_near", [](const Ocp&, Iterate&, Report& report) { report.objective += 1e-6; }),
              Contains(HasSubstr("it reports an objective")));
  EXPECT_THAT(complaints_about("rhc_near", [](const Ocp&, Iterate&, Report& report) { report.kkt.defect = 1e-3; }),
              Contains(HasSubstr("it reports a KKT residual")));
  EXPECT_THAT(
      complaints_about("rhc_near", [](const Ocp&, Iterate& point,
                                      Report&) { point.costate(2)[0] = std::numeric_limits<double>::quiet_NaN(); }),
      Contains("the point is not finite"));
}

// These are seen without the core's residual.
TEST(Assessment, SeesASolutionThatIsNone) {
  const auto all_costates = [](const Ocp& ocp, Iterate& point, double factor) {
    for (int i = 0; i <= ocp.intervals(); ++i)
      for (int j = 0; j < ocp.state_count(i); ++j) point.costate(i)[j] *= factor;
  };
  EXPECT_THAT(
      complaints_about("rhc_off", [&](const Ocp& ocp, Iterate& point, Report&) { all_costates(ocp, point, -1.0); }),
      Contains(HasSubstr("the Lagrangian is not stationary")));
  EXPECT_THAT(complaints_about("rhe_blocks", [](const Ocp&, Iterate& point, Report&) { point.state(4)[0] += 1e-4; }),
              Contains(HasSubstr("its defect is")));
  EXPECT_THAT(
      complaints_about("rhc_inputs_at_bounds", [](const Ocp& ocp, Iterate& point,
                                                  Report&) { point.control(2)[0] = ocp.control_upper(2)[0] + 1e-4; }),
      Contains(HasSubstr("it violates a bound")));
  EXPECT_THAT(
      complaints_about("rhc_near", [](const Ocp&, Iterate& point, Report&) { point.control_bound(2)[0] = 1.0; }),
      Contains(HasSubstr("a multiplier is not at its bound")));
}

/// The first stage with a limit, past the first node, whose multiplier is at least that.
int stage_with_multiplier(const Ocp& ocp, const Iterate& point, double least) {
  for (int i = 1; i < ocp.intervals(); ++i)
    if (ocp.limit_count(i) > 0 && std::abs(point.limit_bound(i)[0]) >= least) return i;
  ADD_FAILURE() << "no limit has a multiplier";
  return 1;
}

TEST(Assessment, SeesLimitsThatAreNotKept) {
  EXPECT_THAT(complaints_about("rhc_limits",
                               [](const Ocp& ocp, Iterate& point, Report&) {
                                 const int i = stage_with_multiplier(ocp, point, 1e-3);
                                 point.limit_bound(i)[0] *= -1.0;
                               }),
              Contains(HasSubstr("a multiplier is not at its bound")));
  EXPECT_THAT(complaints_about("rhc_limits_soft_quadratic",
                               [](const Ocp& ocp, Iterate& point, Report&) {
                                 const int i = stage_with_multiplier(ocp, point, 1e-3);
                                 point.limit_bound(i)[0] *= 1.5;
                               }),
              Contains(HasSubstr("not the price of its slack")));
  EXPECT_THAT(
      complaints_about("rhc_limits_corridor",
                       [](const Ocp& ocp, Iterate& point, Report&) {
                         const int i = stage_with_multiplier(ocp, point, 1e-3);
                         const testing::Limit& limit = dynamic_cast<const testing::LimitedOcp&>(ocp).limits(i)[0];
                         for (std::size_t k = 0; k < limit.of.size(); ++k)
                           point.row(i)[limit.of[k]] += (point.limit_bound(i)[0] > 0.0 ? 1e-3 : -1e-3) * limit.with[k];
                       }),
      Contains("it violates a bound by 1.0e-03"));
}

}  // namespace assessment_test
}  // namespace rhec::conformance
