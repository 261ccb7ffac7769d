#include "solvers/ipopt/violation_nlp.hpp"

#include <gtest/gtest.h>

#include <IpIpoptApplication.hpp>

#include "problems.hpp"
#include "support/limited_ocp.hpp"

namespace rhec::ipopt {
namespace violation_nlp_test {

using namespace testing;
using rhec::testing::Limit;
using rhec::testing::LimitedOcp;
using rhec::testing::with_limits;

/// Counts what Ipopt reports.
struct Counter final : Spectator {
  int seen = 0, most = 1000;
  bool see(int, const PrimalDual* iterate) noexcept override {
    EXPECT_EQ(iterate, nullptr);
    return ++seen <= most;
  }
  void see_last(const PrimalDual&) noexcept override { ADD_FAILURE() << "no iterate of the NLP"; }
};

struct Least {
  double largest = 0.0, slope = 0.0;
  int seen = 0;
};

/// A problem whose state 0 is to be below one value and above another at node 5.
struct Case {
  Case(double below, double above) : random(bicycle(), 11), problem(random.rhc({})), limited(*problem, 2) {
    const double now = problem->initial_state()[0];
    limited.add(5, {Limit::Kind::linear, {0}, {1.0}, -infinity, now + below});
    limited.add(5, {Limit::Kind::linear, {0}, {1.0}, now + above, infinity});
    at = with_limits(limited, RandomProblem::cold_start(*problem));
    nlp = new OcpNlp(limited, Curvature::exact);
    nlp->take(limited);
  }
  /// From where the last one has come to.
  Least minimise(int most = 1000) {
    Counter counter;
    counter.most = most;
    nlp->set_start(at, 0.0);
    const Ipopt::SmartPtr<ViolationNlp> violation = new ViolationNlp(*nlp, counter);
    const Ipopt::SmartPtr<Ipopt::IpoptApplication> application = new Ipopt::IpoptApplication(false);
    application->Options()->SetNumericValue("tol", 1e-10);
    application->OptimizeTNLP(Ipopt::SmartPtr<Ipopt::TNLP>(Ipopt::GetRawPtr(violation)));
    nlp->write(violation->point(), at);
    // Ipopt reports the start, too.
    EXPECT_EQ(violation->iterations() + 1, counter.seen);
    return {violation->largest(), violation->slope(), counter.seen};
  }

  RandomProblem random;
  std::unique_ptr<HorizonProblem> problem;
  LimitedOcp limited;
  Iterate at;
  Ipopt::SmartPtr<OcpNlp> nlp;
};

TEST(ViolationNlp, ComesNearAPointThatMeetsTheConstraintsAndNearerTheNextTime) {
  Case possible(0.1, -0.1);
  const Least first = possible.minimise();
  EXPECT_LT(first.largest, 1e-3);
  EXPECT_GT(first.slope, 1e-2) << "not stationary but for the pull of the start";
  const Least second = possible.minimise();
  EXPECT_LT(second.largest, 0.1 * first.largest);
}

TEST(ViolationNlp, EndsWhereNoStepMakesTheViolationSmaller) {
  const Least least = Case(-1.0, 1.0).minimise();
  // Halfway between the two, which are 2 apart.
  EXPECT_NEAR(least.largest, 1.0, 1e-3);
  EXPECT_LT(least.slope, 1e-4);
}

TEST(ViolationNlp, StopsWhenItIsToldTo) {
  const Least least = Case(-1.0, 1.0).minimise(2);
  EXPECT_EQ(least.seen, 3);
  EXPECT_GT(least.slope, 1e-4);
}

}  // namespace violation_nlp_test
}  // namespace rhec::ipopt
