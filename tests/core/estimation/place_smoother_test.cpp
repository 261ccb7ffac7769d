#include "rhec/core/estimation/place_smoother.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "rhec/core/prior/standard_bank.hpp"
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

// Ground that hardly varies, then an edge: the law that explains most of the way must not smooth the edge away.
TEST(PlaceSmoother, KeepsAnEdgeInGroundThatHardlyVaries) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  ModelDescription about = model->description();
  for (Variable& parameter : about.parameters) parameter.lower = 0.0, parameter.upper = 1.0;
  PriorBank::Setup setup;
  setup.members = standard_bank(about);
  setup.output_variances = {0.0009, 0.0009, 3e-4};
  setup.input_variances = {0.01, 0.01};
  constexpr double edge = 100.0, end = 140.0, before = 0.55, behind = 0.85, step = 0.2, wheels = 12.0;
  double most = 0.0, squares = 0.0;
  int count = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    BankHistory history(PriorBank(model, setup), 16, 200);
    history.bank().reset(Eigen::Vector4d::Zero(), 1e-3 * Eigen::Matrix4d::Identity());
    PlaceSmoother smoother(model, history.bank(), {.lag = 80, .input_variances = setup.input_variances});
    SlipMap map({.parameters = 2, .cell = 0.5, .capacity = 1000, .reach = 1.5, .spread = {}, .ageing = {}});
    double x = 0.0;
    for (int k = 0; x < end; ++k) {
      const double outputs[] = {x - 0.4 + 0.03 * normal(random), 0.03 * normal(random), 0.0174 * normal(random)};
      if (k == 0) {
        history.start(outputs);
      } else {
        const double inputs[] = {wheels + 0.1 * normal(random), 0.1 * normal(random)};
        history.add(step, inputs, outputs);
      }
      map.advance(step, history.bank().distance());
      smoother.work(history, map);
      // Over the edge in the middle of an interval.
      const double left = step * wheels * before, until = edge - x;
      x += until > 0.0 && until < left ? until + (1.0 - until / left) * step * wheels * behind
                                       : step * wheels * (x < edge ? before : behind);
    }
    smoother.finish(history, map);
    map.begin_drive(map.time());
    double means[2], variances[2];
    for (double at = edge - 10.0; at < edge + 10.0; at += 0.5) {
      if (std::abs(at - edge) < 3.0) continue;  // an interval has two metres
      ASSERT_TRUE(map.look_up(at, 0.0, means, variances)) << at;
      const double error = means[0] - (at < edge ? before : behind);
      most = std::max(most, std::abs(error));
      squares += error * error / variances[0];
      ++count;
    }
  }
  EXPECT_LT(most, 0.06);
  EXPECT_LT(squares / count, 2.0);
}

}  // namespace place_smoother_test
}  // namespace rhec
