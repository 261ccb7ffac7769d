#include "rhec/core/ocp/ocp.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/ocp/linearisation.hpp"
#include "support/cart.hpp"
#include "support/test_models.hpp"

namespace rhec {
namespace ocp_test {

using testing::cart_control;
using testing::cart_estimation;
using ::testing::Each;
using testing::scattered_point;

TEST(RollOut, ClipsControlsAndLeavesNoDefect) {
  const auto problem = cart_control(5);
  Iterate point = scattered_point(*problem);
  point.control(1)[0] = 3.0;
  point.control(2)[0] = -3.0;
  const double kept = point.control(3)[0];
  std::vector<double> scratch(problem->scratch_size()), defects(5 * problem->capacity().states, 1.0);
  roll_out(*problem, point, scratch);
  EXPECT_EQ(point.control(1)[0], 1.0);
  EXPECT_EQ(point.control(2)[0], -1.0);
  EXPECT_EQ(point.control(3)[0], kept);
  EXPECT_EQ(point.state(0)[0], problem->given_state()[0]);
  problem->evaluate(point, defects.data(), scratch);
  EXPECT_THAT(defects, Each(0.0));
}

TEST(RollOut, ClipsAFreeInitialState) {
  const auto problem = cart_estimation(4);
  Iterate point = scattered_point(*problem);
  point.state(0)[0] = 123.0;  // has no bounds
  point.state(0)[1] = 9.0;    // a speed of at most 5
  point.state(0)[2] = -1.0;   // the drag is positive
  std::vector<double> scratch(problem->scratch_size()), defects(4 * problem->capacity().states, 1.0);
  roll_out(*problem, point, scratch);
  EXPECT_EQ(point.state(0)[0], 123.0);
  EXPECT_EQ(point.state(0)[1], 5.0);
  EXPECT_EQ(point.state(0)[2], 0.0);
  problem->evaluate(point, defects.data(), scratch);
  EXPECT_THAT(defects, Each(0.0));
}

TEST(Ocp, PrefersTheCurvatureThatConverges) {
  EXPECT_EQ(cart_control(3)->preferred_hessian(), Hessian::exact);
  EXPECT_EQ(cart_estimation(3)->preferred_hessian(), Hessian::gauss_newton) << "its residuals are small";
  RhcProblem::Setup setup = cart_control(3)->setup();
  const RhcProblem blunt(std::make_shared<testing::WithoutSecondDerivatives>(testing::cart()), setup);
  EXPECT_EQ(blunt.preferred_hessian(), Hessian::gauss_newton) << "there is no other";
}

TEST(Ocp, CanRollOutWhereTheInitialStateIsGiven) {
  EXPECT_TRUE(cart_control(3)->can_roll_out());
  EXPECT_FALSE(cart_estimation(3)->can_roll_out());
}

/// A minimal Ocp: the base class provides everything it does not define.
class Plain final : public Ocp {
 public:
  explicit Plain(const Ocp& of) : of_(of) {}
  Capacity capacity() const noexcept override { return of_.capacity(); }
  int intervals() const noexcept override { return of_.intervals(); }
  int state_count(int node) const noexcept override { return of_.state_count(node); }
  int control_count(int interval) const noexcept override { return of_.control_count(interval); }
  const double* initial_state() const noexcept override { return of_.initial_state(); }
  const double* state_lower(int node) const noexcept override { return of_.state_lower(node); }
  const double* state_upper(int node) const noexcept override { return of_.state_upper(node); }
  const double* control_lower(int interval) const noexcept override { return of_.control_lower(interval); }
  const double* control_upper(int interval) const noexcept override { return of_.control_upper(interval); }
  bool has_second_derivatives() const noexcept override { return of_.has_second_derivatives(); }
  std::size_t scratch_size() const noexcept override { return of_.scratch_size(); }
  double evaluate_stages(const Iterate& point, double* defects, double* costs,
                         std::span<double> scratch) const noexcept override {
    return of_.evaluate_stages(point, defects, costs, scratch);
  }
  void simulate_interval(int interval, Iterate& point, std::span<double> scratch) const noexcept override {
    of_.simulate_interval(interval, point, scratch);
  }
  double linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                   std::span<double> scratch) const noexcept override {
    return of_.linearise(range, point, hessian, qp, scratch);
  }

 private:
  const Ocp& of_;
};

TEST(Ocp, MayDependOnEverythingUnlessItSaysOtherwise) {
  const auto problem = cart_control(3);
  const Plain plain(*problem);
  const auto ns = static_cast<std::size_t>(problem->capacity().states);
  std::vector<std::uint8_t> states(ns * ns, 7), controls(ns, 7);
  plain.mark_dynamics(1, states.data(), controls.data());
  EXPECT_THAT(states, Each(1));
  EXPECT_THAT(controls, Each(1));
  problem->mark_dynamics(1, states.data(), controls.data());
  EXPECT_EQ(states[1 * ns + 0], 1) << "the speed changes the position";
  EXPECT_EQ(states[2 * ns + 2], 1) << "a parameter is carried along";
  EXPECT_EQ(states[1 * ns + 2], 0) << "and the speed does not change it";
  EXPECT_EQ(controls[2], 0);
}

TEST(Ocp, RefreshesByLinearisingAnewUnlessItKnowsBetter) {
  const auto problem = cart_control(4);
  const Plain plain(*problem);
  const Iterate point = scattered_point(*problem);
  std::vector<double> scratch(problem->scratch_size());
  StageQp qp(problem->capacity()), expected(problem->capacity());
  plain.linearise(all_stages(plain), point, Hessian::gauss_newton, qp, scratch);
  problem->state_reference(2)[0] += 1.0;
  problem->given_state()[0] += 0.25;
  plain.refresh(point, qp, scratch);
  problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, expected, scratch);
  for (int i = 0; i <= 4; ++i)
    for (int j = 0; j < qp.states(i); ++j) EXPECT_EQ(qp.q(i)[j], expected.q(i)[j]) << i;
  EXPECT_EQ(qp.initial_step()[0], problem->given_state()[0] - point.state(0)[0]);
  const auto linearisation = plain.make_linearisation();
  EXPECT_EQ(&linearisation->ocp(), &plain);
}

}  // namespace ocp_test
}  // namespace rhec
