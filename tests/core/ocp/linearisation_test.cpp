#include "rhec/core/ocp/linearisation.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "support/cart.hpp"

namespace rhec {
namespace linearisation_test {

using testing::cart_control;
using testing::scattered_point;

class PlainLinearisation : public ::testing::Test {
 protected:
  /// Whether the QP matches the problem's current data.
  void expect_as_anew(Hessian hessian) {
    std::vector<double> scratch(problem->scratch_size());
    StageQp expected(problem->capacity());
    problem->linearise(all_stages(*problem), point, hessian, expected, scratch);
    const StageQp& qp = linearisation.qp();
    const int stride = qp.stride(), wide = qp.capacity().states + qp.capacity().controls;
    for (int i = 0; i <= problem->intervals(); ++i) {
      for (int j = 0; j < stride; ++j) {
        EXPECT_EQ(qp.h(i)[j], expected.h(i)[j]) << i;
        EXPECT_EQ(qp.lower(i)[j], expected.lower(i)[j]) << i;
        EXPECT_EQ(qp.upper(i)[j], expected.upper(i)[j]) << i;
      }
      for (int k = 0; hessian != Hessian::none && k < wide * stride; ++k) EXPECT_EQ(qp.H(i)[k], expected.H(i)[k]) << i;
      for (int k = 0; i < problem->intervals() && k < qp.capacity().states * stride; ++k)
        EXPECT_EQ(qp.AB(i)[k], expected.AB(i)[k]) << i;
    }
    for (int j = 0; j < qp.states(0); ++j) EXPECT_EQ(qp.initial_step()[j], expected.initial_step()[j]);
  }

  std::unique_ptr<RhcProblem> problem = cart_control(5);
  Linearisation linearisation{*problem};
  Iterate point = scattered_point(*problem);
};

TEST_F(PlainLinearisation, IsTheProblemsOwn) {
  std::vector<double> scratch(problem->scratch_size());
  for (const Hessian hessian : {Hessian::gauss_newton, Hessian::exact}) {
    EXPECT_EQ(linearisation.linearise(point, hessian), problem->evaluate(point, nullptr, scratch));
    expect_as_anew(hessian);
  }
  EXPECT_EQ(linearisation.linearise_for_residual(point, Hessian::exact), problem->evaluate(point, nullptr, scratch));
  expect_as_anew(Hessian::none);
}

TEST_F(PlainLinearisation, TakesNewDataAfterItsPreparation) {
  linearisation.prepare(point, Hessian::gauss_newton);
  problem->given_state()[1] = 0.7;
  problem->state_reference(3)[0] = 2.0;
  problem->input_upper(2, 0) = 0.25;
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  linearisation.refresh(point);
  expect_as_anew(Hessian::gauss_newton);
}

TEST_F(PlainLinearisation, KnowsTheIterateThatItWasMadeAt) {
  EXPECT_FALSE(linearisation.is_at(point)) << "there is none yet";
  linearisation.linearise(point, Hessian::gauss_newton);
  EXPECT_TRUE(linearisation.is_at(point));
  Iterate other = point;
  EXPECT_TRUE(linearisation.is_at(other)) << "it is the numbers that count";
  other.control(4)[0] += 1e-15;
  EXPECT_FALSE(linearisation.is_at(other));
  problem->set_intervals(4);
  EXPECT_FALSE(linearisation.is_at(point)) << "the horizon is another";
  problem->set_intervals(5);
  EXPECT_TRUE(linearisation.is_at(point));
  linearisation.forget();
  EXPECT_FALSE(linearisation.is_at(point));
}

TEST(PlainLinearisationOfBlocks, KnowsThatAStageHasAnotherSize) {
  const auto problem = cart_control(5, {0});
  const Iterate point = scattered_point(*problem);
  Linearisation linearisation(*problem);
  linearisation.linearise(point, Hessian::gauss_newton);
  EXPECT_TRUE(linearisation.is_at(point));
  const std::uint8_t begins[5] = {1, 0, 1, 0, 0};
  problem->set_blocks(0, begins);
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  EXPECT_FALSE(linearisation.is_at(point));
}

}  // namespace linearisation_test
}  // namespace rhec
