#include "rhec/sim/tuning/tunable.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/support/weaving_drive.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace tunable_test {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

std::vector<std::string> names(const std::vector<Tunable>& tunables) {
  std::vector<std::string> all;
  for (const Tunable& tunable : tunables) all.push_back(tunable.name);
  return all;
}

std::vector<Tunable> found(const Settings& settings, const TuningWishes& wishes = {}) {
  const Host host;
  return tunables_of(host, LogScenario(host, settings), wishes);
}

TEST(Tunables, AreFoundByTheScenarioAndTheModelsOptions) {
  const std::vector<Tunable> all = found(weaving_settings());
  EXPECT_THAT(names(all),
              testing::ElementsAre("noise.outputs.x_gps, y_gps", "noise.outputs.delta", "noise.inputs.u1",
                                   "noise.inputs.u2", "estimator.process_noise.kappa", "estimator.process_noise.mu",
                                   "log.speed_bias", "log.steering_bias", "log.fix_delay", "log.steering_delay",
                                   "log.wheel_offset", "model.gps_offset"));
  EXPECT_EQ(all[0].start, 0.3);
  EXPECT_EQ(all[0].unit, "m");
  EXPECT_EQ(all[11].kind, Tunable::Kind::offset);
  Settings apart = weaving_settings("bank");
  apart.set("noise.outputs.y_gps", Settings::scalar("0.2"));
  apart.set("estimator.priors.kappa", parse_yaml("{name: matern, length: 8, sigma: 0.1, mean: 0.9}", "prior"));
  const std::vector<std::string> others = names(found(apart));
  EXPECT_THAT(others, Contains("noise.outputs.y_gps"));
  EXPECT_THAT(others, Contains("estimator.priors.kappa.length"));
  EXPECT_THAT(others, Not(Contains("estimator.priors.kappa.mean")));
  EXPECT_THAT(others, Not(Contains("estimator.process_noise.kappa")));
}

TEST(Tunables, CoordinatesAreRatiosOrDifferences) {
  for (const Tunable& tunable : found(weaving_settings())) {
    EXPECT_EQ(tunable.value_at(0.0), tunable.start) << tunable.name;
    EXPECT_NEAR(tunable.coordinate_of(tunable.value_at(0.7)), 0.7, 1e-12) << tunable.name;
    EXPECT_LT(tunable.lower, tunable.start) << tunable.name;
    EXPECT_GT(tunable.upper, tunable.start) << tunable.name;
    const double slope = (tunable.value_at(1e-6) - tunable.value_at(-1e-6)) / 2e-6;
    EXPECT_NEAR(tunable.error_of(1.0, tunable.start), slope, 1e-6 * std::abs(slope)) << tunable.name;
  }
}

TEST(Tunables, AreWrittenToAllOfTheirKeys) {
  const std::vector<Tunable> all = found(weaving_settings());
  Eigen::VectorXd at = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(all.size()));
  at[0] = -0.5;
  const Settings written = with_values(weaving_settings(), all, at, 4);
  for (const char* key : {"noise.outputs.x_gps", "noise.outputs.y_gps"})
    EXPECT_NEAR(*written.find_path(key)->number(), 0.3 / std::sqrt(10.0), 1e-4) << key;
  EXPECT_EQ(*written.find_path("log.fix_delay")->number(), 0.0);
}

TEST(Tunables, FollowWishes) {
  const std::vector<std::string> kept = names(found(weaving_settings(), {.tune = {}, .keep = {"log", "noise.inputs"}}));
  EXPECT_THAT(kept, Not(Contains("log.fix_delay")));
  EXPECT_THAT(kept, Not(Contains("noise.inputs.u1")));
  EXPECT_THAT(kept, Contains("noise.outputs.delta"));
  const std::vector<Tunable> more =
      found(weaving_settings(), {.tune = {"model.wheelbase=[1.5, 2.5]", "model.gps_offset=[-1, 1]"}, .keep = {}});
  EXPECT_THAT(names(more), Contains("model.wheelbase"));
  for (const Tunable& tunable : more) {
    if (tunable.name == "model.wheelbase") {
      EXPECT_EQ(tunable.upper, 2.5);
      EXPECT_EQ(tunable.kind, Tunable::Kind::scale);
    }
    if (tunable.name == "model.gps_offset") {
      EXPECT_EQ(tunable.upper, 1.0);
    }
  }
}

TEST(Tunables, RefuseWishesThatMeanNothing) {
  const auto complaint = [](const TuningWishes& wishes) {
    return error_of([&] { found(weaving_settings(), wishes); });
  };
  EXPECT_THAT(complaint({.tune = {"model.wheelbse"}, .keep = {}}), HasSubstr("no number 'model.wheelbse'"));
  EXPECT_THAT(complaint({.tune = {"model.name"}, .keep = {}}), HasSubstr("no number 'model.name'"));
  EXPECT_THAT(complaint({.tune = {"model.wheelbase=[3, 4]"}, .keep = {}}), HasSubstr("about the scenario's 2"));
  EXPECT_THAT(complaint({.tune = {"model.wheelbase=[3]"}, .keep = {}}), HasSubstr("KEY=[lower, upper]"));
  EXPECT_THAT(complaint({.tune = {}, .keep = {"noises"}}), HasSubstr("noise.outputs.x_gps"));
}

TEST(Tunables, OfAControllerLeaveTheUnitOfItsWeightsAlone) {
  const Settings settings = parse_yaml(R"(
model: bicycle_slip
controller:
  horizon: 12
  weights:
    stage: {x_pos: 1, y_pos: 1, beta: 2, u1: 5, u2: 0.5}
    terminal: {x_pos: 10, y_pos: 10}
    rates: {u1: 0, u2: 0.01}
)",
                                       "robot.yaml");
  const Host host;
  const Robot robot(host, RobotOptions::table().parse(settings, "robot"));
  const std::vector<Tunable> all = controller_tunables(robot, settings);
  EXPECT_THAT(names(all),
              testing::ElementsAre("controller.weights.stage.beta", "controller.weights.stage.u1",
                                   "controller.weights.stage.u2", "controller.weights.terminal.x_pos, y_pos",
                                   "controller.weights.rates.u2", "controller.horizon"));
  EXPECT_TRUE(all.back().is_whole);
  EXPECT_EQ(all.back().value_at(0.3), std::round(12.0 * std::pow(2.0, 0.3)));
}

}  // namespace tunable_test
}  // namespace rhec::sim
