#include "rhec/core/estimation/place_smoother.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "rhec/core/prior/walk_prior.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace place_smoother_test {

using namespace testing;

// With a parameter that is constant, what is known of it with all hindsight is the same at every node: the last
// filtered moments. So the smoother has to bring these back over the whole way.
TEST(PlaceSmoother, BringsTheLastMomentsOfAConstantBackOverTheWay) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  PriorBank::Setup setup;
  PriorCombination constants;
  for (const Variable& parameter : model->description().parameters) {
    WalkPrior::Walk walk;
    walk.mean = 0.8;
    walk.mean_sigma = 0.2;
    constants.push_back(std::make_shared<WalkPrior>(walk));
    std::const_pointer_cast<Prior>(constants.back())->set_up(parameter);
  }
  setup.members = {constants};
  setup.output_variances = {1e-4, 1e-4, 1e-4};
  setup.input_variances = {1e-4, 1e-4};
  for (const int lag : {6, 100}) {
    const PlaceSmoother::Setup smoothing{.lag = lag, .input_variances = setup.input_variances};
    BankHistory history(PriorBank(model, setup), 16, 200);
    history.bank().reset(Eigen::Vector4d::Zero(), 1e-4 * Eigen::Matrix4d::Identity());
    PlaceSmoother smoother(model, history.bank(), smoothing);
    SlipMap map({.parameters = 2, .cell = 0.25, .capacity = 1000, .reach = 0.5, .spread = {}, .ageing = {}});
    constexpr int nodes = 60;
    const double inputs[] = {2.0, 0.0};
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    for (int k = 0; k <= nodes; ++k) {
      const double outputs[] = {0.3 * k - 0.4 + 0.005 * std::sin(3.0 * k), 0.004 * std::cos(2.0 * k), 0.0};
      if (k == 0)
        history.start(outputs);
      else
        history.add(0.2, inputs, outputs);
      map.advance(0.2, history.bank().distance());
      smoother.work(history, map);
    }
    smoother.finish(history, map);
    map.begin_drive(map.time());
    history.bank().moments(mean, covariance);
    double means[2], variances[2];
    int known = 0;
    for (double x = 1.0; x < 0.3 * nodes - 1.0; x += 0.5) {
      ASSERT_TRUE(map.look_up(x, 0.0, means, variances)) << x;
      ++known;
      if (lag < nodes) continue;  // then nodes have less hindsight
      EXPECT_NEAR(means[0], mean[4], 2e-4) << x;
      EXPECT_NEAR(variances[0] / covariance(4, 4), 1.0, 0.05) << x;
    }
    EXPECT_GT(known, 20);
    EXPECT_EQ(map.dropped(), 0);
  }
}

}  // namespace place_smoother_test
}  // namespace rhec
