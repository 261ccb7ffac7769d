#include "core/estimation/input_walks.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include <Eigen/LU>

#include "rhec/core/model/formula_model.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace input_walks_test {

using namespace testing;
using ::testing::ElementsAre;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Of three intervals; the second input is missing on the last two.
struct InputWalksTest : ::testing::Test {
  std::shared_ptr<const Model> hovercraft = linear_model<Hovercraft>();
  NodeLog log;
  RheProblem::Setup setup = linear_setup(*hovercraft, 1, ArrivalKind::ekf, {}).problem;

  InputWalksTest() {
    log.durations = {0.25, 0.25, 4.0};
    log.inputs = {0.1, 0.2, 0.3, nan, 0.5, nan};
    setup.input_weights = {4.0, 25.0};
  }
};

TEST_F(InputWalksTest, NeedNothingWhereAllIsMeasured) {
  log.inputs = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  const InputWalks walks(hovercraft, setup, log);
  EXPECT_TRUE(walks.is_empty());
  EXPECT_EQ(walks.model(), hovercraft);
  EXPECT_TRUE(walks.setup(setup).state_lower.size() == setup.state_lower.size());
}

TEST_F(InputWalksTest, LeaveInputsFreeThatHaveNoWeight) {
  setup.input_weights = {4.0, 0.0};
  EXPECT_TRUE(InputWalks(hovercraft, setup, log).is_empty());
}

TEST_F(InputWalksTest, WalkWhereTheyAreMissing) {
  InputWalks walks(hovercraft, setup, log);
  ASSERT_EQ(walks.count(), 1);
  EXPECT_EQ(walks.model()->state_count(), 5);
  const double scale = hovercraft->description().inputs[1].scale, p[] = {0.0, 0.0};
  std::vector<double> data(walks.model()->data_count(), 9.0), measured = {0.1, 0.2};
  walks.write(0, p, data.data(), measured.data());
  EXPECT_THAT(data, ElementsAre(0.0, 1.0, 0.0, 0.0, 0.0, 0.0));
  EXPECT_THAT(measured, ElementsAre(0.1, 0.2));
  measured = {0.5, nan};
  walks.write(2, p, data.data(), measured.data());
  EXPECT_THAT(data, ElementsAre(1.0, 2.0 * scale * 5.0, 0.0, 0.0, 0.0, 0.0)) << "over four seconds, in sigmas of 0.2";
  EXPECT_THAT(measured, ElementsAre(0.5, 0.0));
}

TEST_F(InputWalksTest, TurnInputsThatActIntoThoseOfTheModelAndBack) {
  const InputWalks walks(hovercraft, setup, log);
  const std::vector<double> acting = {0.1, 0.2, 0.3, 0.7, 0.5, 1.7};
  double v = 9.0;
  walks.write_kept(acting, 2, &v);
  EXPECT_EQ(v, 0.7);
  double inputs[] = {0.5, 1.7};
  walks.to_own(2, &v, inputs);
  const double walked = (1.7 - 0.7) / (2.0 * hovercraft->description().inputs[1].scale * 5.0);
  EXPECT_THAT(inputs, ElementsAre(0.5, walked));
  v = 1.7;
  walks.to_acting(&v, inputs);
  EXPECT_THAT(inputs, ElementsAre(0.5, 1.7));
  double measured[] = {0.1, 0.2};
  walks.to_own(0, &v, measured);
  EXPECT_THAT(measured, ElementsAre(0.1, 0.2));
}

TEST_F(InputWalksTest, MoveBoundsToWhatIsKept) {
  setup.input_lower = {-1.0, -2.0};
  setup.input_upper = {1.0, 2.0};
  const RheProblem::Setup own = InputWalks(hovercraft, setup, log).setup(setup);
  EXPECT_THAT(own.input_lower, ElementsAre(-1.0, -infinity));
  EXPECT_THAT(own.input_upper, ElementsAre(1.0, infinity));
  ASSERT_EQ(own.state_lower.size(), 5U);
  EXPECT_EQ(own.state_lower.back(), -2.0);
  EXPECT_EQ(own.state_upper.back(), 2.0);
}

/// Not what was measured, although it is more than the vehicle can do.
TEST_F(InputWalksTest, KeepMissingInputsToWhatTheVehicleCanDo) {
  ModelDescription about = hovercraft->description();
  about.inputs[1].lower = -1.0;
  about.inputs[1].upper = 0.15;
  const auto model = std::make_shared<FormulaModel<Hovercraft>>(Hovercraft<double>{}, about);
  const RheProblem::Setup own = InputWalks(model, setup, log).setup(setup);
  EXPECT_EQ(own.state_lower.back(), -1.0);
  EXPECT_EQ(own.state_upper.back(), 0.2);
}

TEST_F(InputWalksTest, AddWhatIsKnownAtTheStart) {
  const InputWalks walks(hovercraft, setup, log);
  Eigen::VectorXd mean = Eigen::VectorXd::LinSpaced(6, 1.0, 6.0);
  const Eigen::MatrixXd before = initial_covariance(*hovercraft).inverse();
  Eigen::MatrixXd information = before;
  walks.add_start(mean, information);
  EXPECT_EQ(mean, (Eigen::VectorXd(7) << 1.0, 2.0, 3.0, 4.0, 0.0, 5.0, 6.0).finished());
  const double widest = 3.0 * hovercraft->description().inputs[1].scale;
  EXPECT_DOUBLE_EQ(information(4, 4), 1.0 / (widest * widest));
  EXPECT_EQ(information(4, 5), 0.0);
  EXPECT_EQ(information(1, 6), before(1, 5));
  EXPECT_EQ(information(6, 1), before(5, 1));
  EXPECT_EQ(information(3, 2), before(3, 2));
  EXPECT_EQ(information(5, 6), before(4, 5));
}

}  // namespace input_walks_test
}  // namespace rhec
