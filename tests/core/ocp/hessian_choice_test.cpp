#include "rhec/core/ocp/hessian_choice.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <vector>

#include "support/cart.hpp"
#include "support/test_models.hpp"

namespace rhec {
namespace hessian_choice_test {

/// Two intervals of two states and one control, whose exact Hessian is 1 + `bend` times Gauss-Newton's.
class Bowl final : public Ocp {
 public:
  double bend = 0.0, gauss_newton_cost = 50000.0, exact_cost = 100000.0;
  bool small_residuals = false;
  mutable int linearised = 0;

  Capacity capacity() const noexcept override { return {2, 2, 1}; }
  int intervals() const noexcept override { return 2; }
  int state_count(int) const noexcept override { return 2; }
  int control_count(int) const noexcept override { return 1; }
  const double* initial_state() const noexcept override { return zeros_; }
  const double* state_lower(int) const noexcept override { return zeros_; }
  const double* state_upper(int) const noexcept override { return zeros_; }
  const double* control_lower(int) const noexcept override { return zeros_; }
  const double* control_upper(int) const noexcept override { return zeros_; }
  bool has_second_derivatives() const noexcept override { return true; }
  bool has_small_residuals() const noexcept override { return small_residuals; }
  StepOperations step_operations() const noexcept override { return {gauss_newton_cost, exact_cost}; }
  std::size_t scratch_size() const noexcept override { return 0; }
  double evaluate_stages(const Iterate&, double*, double*, std::span<double>) const noexcept override { return 0.0; }
  void simulate_interval(int, Iterate&, std::span<double>) const noexcept override {}
  double linearise(StageRange range, const Iterate&, Hessian hessian, StageQp& qp,
                   std::span<double>) const noexcept override {
    ++linearised;
    qp.set_intervals(2);
    const double scale = hessian == Hessian::exact ? 1.0 + bend : 1.0;
    for (int i = range.first; i <= range.last; ++i) {
      const int width = i < 2 ? 3 : 2;
      qp.set_sizes(i, 2, width - 2);
      for (int r = 0; r < width; ++r)
        for (int c = 0; c < width; ++c) qp.H(i)[r * qp.stride() + c] = scale * (r == c ? 2.0 : 0.5);
    }
    return 0.0;
  }

 private:
  double zeros_[2] = {};
};

struct Steps {
  Bowl bowl;
  HessianChoice choice;
  Iterate before{Capacity{2, 2, 1}}, after{Capacity{2, 2, 1}};

  Steps() {
    for (int i = 0; i <= 2; ++i) {
      after.state(i)[0] = 1.0 + i;
      after.state(i)[1] = -0.5;
      if (i < 2) after.control(i)[0] = 0.7;
    }
  }
  void take(int count, double residual = 0.1) {
    for (int k = 0; k < count; ++k) choice.step(before, after, residual, {});
  }
};

TEST(HessianChoice, TakesTheExactOneWhereItAddsLittle) {
  Steps few;
  few.bowl.exact_cost = few.bowl.gauss_newton_cost + 0.9 * HessianChoice::few_operations;
  Steps little;
  little.bowl.gauss_newton_cost = 1e6;
  little.bowl.exact_cost = 1.05e6;
  Steps unknown;
  unknown.bowl.gauss_newton_cost = unknown.bowl.exact_cost = 0.0;
  for (Steps* each : {&few, &little, &unknown}) {
    each->choice.setup(each->bowl);
    each->take(2 * HessianChoice::trial_steps);
    EXPECT_EQ(each->choice.now(), Hessian::exact);
    EXPECT_EQ(each->bowl.linearised, 0) << "nothing is looked at";
  }
}

TEST(HessianChoice, TakesGaussNewtonsOnceATrialHasShownThatItDoesAsWell) {
  Steps steps;
  steps.bowl.bend = -0.05;
  steps.choice.setup(steps.bowl);
  steps.take(HessianChoice::trial_steps - 1);
  EXPECT_EQ(steps.choice.now(), Hessian::exact);
  EXPECT_NEAR(steps.choice.kappa(), 0.05, 1e-12);
  steps.take(1);
  EXPECT_EQ(steps.choice.now(), Hessian::gauss_newton);
  // From now on one step in many is looked at.
  const int before = steps.bowl.linearised;
  steps.take(HessianChoice::trial_steps - 1);
  EXPECT_EQ(steps.bowl.linearised, before);
  steps.take(1);
  EXPECT_EQ(steps.bowl.linearised, before + 2);
  EXPECT_EQ(steps.choice.now(), Hessian::gauss_newton);
  steps.choice.reset();
  EXPECT_EQ(steps.choice.now(), Hessian::exact);
}

TEST(HessianChoice, StaysWithTheExactOneWhereItGains) {
  Steps steps;
  steps.bowl.bend = 0.3;
  steps.choice.setup(steps.bowl);
  steps.take(3 * HessianChoice::trial_steps);
  EXPECT_EQ(steps.choice.now(), Hessian::exact);
  EXPECT_EQ(steps.bowl.linearised, 2) << "one look is enough";
  Steps broken;
  broken.bowl.bend = std::numeric_limits<double>::quiet_NaN();
  broken.choice.setup(broken.bowl);
  broken.take(3 * HessianChoice::trial_steps);
  EXPECT_EQ(broken.choice.now(), Hessian::exact);
}

TEST(HessianChoice, LooksAtAStepWithALargerResidual) {
  Steps steps;
  steps.choice.setup(steps.bowl);
  steps.take(HessianChoice::trial_steps);
  ASSERT_EQ(steps.choice.now(), Hessian::gauss_newton);
  steps.bowl.bend = 0.3;
  steps.take(2, 0.05);
  EXPECT_EQ(steps.choice.now(), Hessian::gauss_newton);
  steps.take(1, 0.2);
  EXPECT_EQ(steps.choice.now(), Hessian::exact);
  EXPECT_NEAR(steps.choice.kappa(), 0.3, 1e-12);
}

TEST(HessianChoice, TakesGaussNewtonsAtOnceWhereTheExactOneCostsFarMore) {
  Steps steps;
  steps.bowl.exact_cost = 5.0 * steps.bowl.gauss_newton_cost;
  steps.choice.setup(steps.bowl);
  EXPECT_EQ(steps.choice.now(), Hessian::gauss_newton);
  steps.bowl.bend = 0.3;
  steps.take(1);
  EXPECT_EQ(steps.choice.now(), Hessian::exact) << "but not where it does not do";
  Steps small;
  small.bowl.small_residuals = true;
  small.choice.setup(small.bowl);
  EXPECT_EQ(small.choice.now(), Hessian::gauss_newton);
  small.take(2);
  EXPECT_EQ(small.bowl.linearised, 0);
}

TEST(StepOperations, AreCountedOfModelAndRecursion) {
  const auto narrow = testing::cart_control(15), longer = testing::cart_control(30);
  const Ocp::StepOperations of = narrow->step_operations();
  EXPECT_GT(of.gauss_newton, 0.0);
  EXPECT_GT(of.exact, of.gauss_newton);
  EXPECT_NEAR(longer->step_operations().exact, 2.0 * of.exact, 1e-9 * of.exact);
  HessianChoice choice;
  choice.setup(*narrow);
  EXPECT_EQ(choice.now(), Hessian::exact) << "a cart takes few operations";
  const RhcProblem blunt(std::make_shared<testing::WithoutSecondDerivatives>(testing::cart()), narrow->setup());
  EXPECT_EQ(blunt.step_operations().exact, 0.0) << "not known";
  choice.setup(blunt);
  EXPECT_EQ(choice.now(), Hessian::gauss_newton);
}

}  // namespace hessian_choice_test
}  // namespace rhec
