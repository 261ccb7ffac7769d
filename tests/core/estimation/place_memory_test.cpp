#include "rhec/core/estimation/place_memory.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "rhec/core/estimation/bank_estimation.hpp"
#include "rhec/core/prior/standard_bank.hpp"
#include "support/late_driver.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace place_memory_test {

using namespace testing;

constexpr double step = 0.2, length = 100.0;  // of the way [m]

std::shared_ptr<const Model> vehicle() {
  static const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  return model;
}

std::shared_ptr<SlipMap> make_map() {
  SlipMap::Setup setup;
  setup.parameters = 2;
  setup.capacity = 4096;
  return std::make_shared<SlipMap>(setup);
}

BankEstimation::Setup setup_with(std::shared_ptr<SlipMap> map) {
  ModelDescription about = vehicle()->description();
  for (Variable& parameter : about.parameters) parameter.lower = 0.0, parameter.upper = 1.0;
  BankEstimation::Setup setup;
  setup.bank.members = standard_bank(about);
  setup.bank.output_variances = {0.0009, 0.0009, 3e-4};
  setup.bank.input_variances = {0.01, 0.01};
  setup.parameter_lower = {0.0, 0.0};
  setup.parameter_upper = {1.0, 1.0};
  setup.initial_state = Eigen::Vector4d::Zero();
  setup.initial_covariance = 1e-3 * Eigen::Matrix4d::Identity();
  setup.place.map = std::move(map);
  setup.place.least = {0.003, 0.003};
  setup.place.lag = 20;
  return setup;
}

/// kappa at a place of the way.
using Field = double (*)(double x);
double wavy(double x) { return 0.75 + 0.15 * std::sin(0.4 * x); }
double other(double x) { return 0.75 + 0.15 * std::sin(0.5 * x + 2.0); }

struct Drive {
  double error = 0.0, nees = 0.0;  ///< of kappa: mean absolute; mean squared in variances
  std::vector<double> estimates;
};

/// Straight along x at 4 m/s over ground, with steering angle 0. Late: every fourth position comes 3 nodes late.
Drive drive(BankEstimation& bank, Field field, unsigned seed, bool late = false) {
  std::mt19937 random(seed);
  LateDriver driver(bank);
  std::normal_distribution<double> normal;
  Eigen::VectorXd state = Eigen::Vector4d::Zero();
  Drive result;
  Estimate estimate = empty_estimate(*vehicle());
  std::vector<std::vector<double>> pending;
  int nodes = 0;
  for (int k = 0; state[0] < length; ++k, ++nodes) {
    const double offset = -0.4;  // of the antenna, behind the rear axle
    std::vector<double> outputs{state[0] + offset + 0.03 * normal(random), 0.03 * normal(random),
                                0.0174 * normal(random)};
    const double kappa = field(state[0]);
    // Wheel speed on the interval before, for the slip in its middle.
    const double middle = field(state[0] - 0.5 * 4.0 * step);
    std::vector<double> inputs{4.0 / middle + 0.1 * normal(random), 0.1 * normal(random)};
    if (late && k % 4 == 1) {
      pending.push_back(outputs);
      outputs.assign(3, nan);
    }
    if (k == 0)
      driver.start(outputs.data());
    else
      driver.add_node(step, inputs.data(), outputs.data());
    if (late && k % 4 == 0 && !pending.empty()) {
      EXPECT_TRUE(driver.amend(3, pending.back().data()));
      pending.clear();
    }
    bank.estimate(estimate, Clock::time_point::max());
    const double error = estimate.parameters[0] - kappa;
    result.error += std::abs(error);
    result.nees += error * error / estimate.covariance(4, 4);
    result.estimates.push_back(estimate.parameters[0]);
    EXPECT_TRUE(estimate.covariance.allFinite());
    // The true vehicle: ground speed 4 m/s, whatever the wheels need for it.
    state[0] += 4.0 * step;
  }
  result.error /= nodes;
  result.nees /= nodes;
  bank.end_drive();
  return result;
}

TEST(PlaceMemory, WithoutKnowledgeTheEstimateIsTheBanksBitByBit) {
  BankEstimation plain(vehicle(), setup_with(nullptr)), remembering(vehicle(), setup_with(make_map()));
  EXPECT_EQ(drive(plain, wavy, 1).estimates, drive(remembering, wavy, 1).estimates);
  EXPECT_FALSE(remembering.place()->places().knows_place());
}

TEST(PlaceMemory, TheSecondDriveIsBetterOnTheSameGroundAndHonest) {
  const auto map = make_map();
  double first = 0.0, second = 0.0, nees = 0.0;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const auto own = make_map();
    BankEstimation before(vehicle(), setup_with(own));
    drive(before, wavy, seed);
    EXPECT_GT(own->size(), 150U);
    own->begin_drive(own->time());
    BankEstimation plain(vehicle(), setup_with(nullptr)), remembering(vehicle(), setup_with(own));
    first += drive(plain, wavy, seed + 100).error;
    const Drive again = drive(remembering, wavy, seed + 100);
    second += again.error;
    nees += again.nees / 3.0;
    EXPECT_TRUE(remembering.place()->places().knows_place());
    EXPECT_GT(remembering.place()->places().probability(), 0.8);
  }
  EXPECT_LT(second, 0.7 * first);
  EXPECT_LT(nees, 2.0);
}

TEST(PlaceMemory, OnGroundThatHasChangedTheBankIsRight) {
  double plain_error = 0.0, error = 0.0;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const auto own = make_map();
    BankEstimation before(vehicle(), setup_with(own));
    drive(before, wavy, seed);
    own->begin_drive(own->time());
    BankEstimation plain(vehicle(), setup_with(nullptr)), remembering(vehicle(), setup_with(own));
    plain_error += drive(plain, other, seed + 100).error;
    error += drive(remembering, other, seed + 100).error;
    // And the map has learnt: what contradicts is replaced.
    own->begin_drive(own->time());
    double means[2], variances[2];
    ASSERT_TRUE(own->look_up(50.0, 0.0, means, variances));
    EXPECT_NEAR(means[0], other(50.0), 0.05);
  }
  EXPECT_LT(error, 1.15 * plain_error);
}

TEST(PlaceMemory, LateMeasurementsAreUsedAsIfTheyHadComeInTime) {
  const auto own = make_map();
  BankEstimation before(vehicle(), setup_with(own));
  drive(before, wavy, 1);
  own->begin_drive(own->time());
  // The map is only read here: a copy for each.
  const auto copy = std::make_shared<SlipMap>(*own);
  BankEstimation in_time(vehicle(), setup_with(own)), late(vehicle(), setup_with(copy));
  const Drive a = drive(in_time, wavy, 7), b = drive(late, wavy, 7, true);
  int compared = 0;
  for (std::size_t k = 12; k + 2 < a.estimates.size(); k += 4, ++compared)
    EXPECT_NEAR(a.estimates[k], b.estimates[k], 1e-9) << k;
  EXPECT_GT(compared, 20);
}

TEST(PlaceMemory, TellsWhatIsAhead) {
  const auto own = make_map();
  BankEstimation before(vehicle(), setup_with(own));
  drive(before, wavy, 1);
  own->begin_drive(own->time());
  BankEstimation again(vehicle(), setup_with(own));
  drive(again, wavy, 2);
  const double here[] = {20.0, 0.0}, there[] = {24.0, 0.0}, far[] = {24.0, 50.0}, parameters[] = {wavy(20.0), 0.75};
  double change[2];
  const auto ahead = again.slip_ahead();
  ASSERT_TRUE(ahead);
  ahead->change(here, there, 4.0, parameters, change);
  EXPECT_NEAR(change[0], wavy(24.0) - wavy(20.0), 0.04);
  ahead->change(here, far, 4.0, parameters, change);
  EXPECT_EQ(change[0], 0.0);
}

}  // namespace place_memory_test
}  // namespace rhec
