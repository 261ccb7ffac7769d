// Messages of inputs in which something is missing, with a judge.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "support/sensor_faults.hpp"

namespace rhec {
namespace estimator_missing_inputs_test {

using namespace rhec::testing;

constexpr double step = 0.1, fault_begins = 10.0;
using Input = std::vector<double>;  ///< empty: no message

/// Estimates of a drive with 5 m/s in bends, of which `spoil` changes messages of inputs, by the time since the fault
/// began.
std::vector<Estimate> drive(const char* estimator_name, const std::function<Input(double since, Input)>& spoil,
                            bool has_encoder = true, const std::string& more = "") {
  const Robot robot = watched_robot(estimator_name, more);
  Eigen::Vector4d truth = Eigen::Vector4d::Zero();
  const auto estimator = robot.make_estimator(truth);
  std::vector<Estimate> estimates;
  for (int k = 0; k < 200; ++k) {
    const double time = step * k, since = time - fault_begins, steering_rate = 0.1 * std::cos(0.4 * time);
    if (k % 2 == 0) {
      const double y[] = {truth[0] - 0.4 * std::cos(truth[2]), truth[1] - 0.4 * std::sin(truth[2]),
                          has_encoder ? truth[3] : nan};
      estimator->push_measurement(time, y);
    }
    const Input input = spoil(since, {5.0, steering_rate});
    if (!input.empty()) estimator->push_input(time, input.data());
    estimates.push_back(estimator->estimate(time));
    for (int i = 0; i < 10; ++i)
      truth += 0.1 * step *
               Eigen::Vector4d(4.5 * std::cos(truth[2]), 4.5 * std::sin(truth[2]), 4.5 / 1.4 * std::tan(0.9 * truth[3]),
                               steering_rate);
  }
  return estimates;
}

void expect_same(const std::vector<Estimate>& first, const std::vector<Estimate>& second) {
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t k = 0; k < first.size(); ++k) {
    EXPECT_EQ(first[k].state, second[k].state) << k;
    EXPECT_EQ(first[k].covariance, second[k].covariance) << k;
    EXPECT_EQ(first[k].health.level, second[k].health.level) << k;
  }
}

class MissingInputs : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(All, MissingInputs, ::testing::Values("ekf", "bank", "rhe"));

/// A driver that loses its bus goes on sending.
TEST_P(MissingInputs, AMessageThatSaysNothingIsNone) {
  const auto lasts = [](double since) { return since >= 0.0 && since < 4.0; };
  const auto silent = drive(GetParam(), [&](double since, Input u) { return lasts(since) ? Input{} : u; });
  const auto empty = drive(GetParam(), [&](double since, Input u) { return lasts(since) ? Input{nan, nan} : u; });
  expect_same(silent, empty);
  double most = 0.0;
  for (const Estimate& each : silent) most = std::max(most, each.covariance(0, 0));
  EXPECT_GT(most, 4.0 * silent[static_cast<std::size_t>(fault_begins / step)].covariance(0, 0)) << "it is less known";
}

/// For longer than that it may be anything: it is what the sensors see.
TEST_P(MissingInputs, WhatIsMissingHoldsUntilTheNextIsMissed) {
  double last = 0.0;
  const auto held = drive(GetParam(), [&](double since, Input u) {
    const bool is_missing = since >= 0.0 && since < 0.05;
    last = is_missing ? last : u[1];
    return Input{u[0], last};
  });
  expect_same(held, drive(GetParam(), [](double since, Input u) {
                return since >= 0.0 && since < 0.05 ? Input{u[0], nan} : u;
              }));
  // What nobody has said for long is not known, and that is said.
  const auto unknown = drive(GetParam(), [](double since, Input u) { return since >= 0.0 ? Input{u[0], nan} : u; });
  for (const Estimate& each : unknown) EXPECT_TRUE(each.state.allFinite() && each.covariance.allFinite());
  EXPECT_GT(unknown.back().covariance(3, 3), held.back().covariance(3, 3));
}

/// Commands that are told only when they change.
TEST_P(MissingInputs, HoldForAsLongAsIsSaid) {
  const auto constant = [](double since, Input u) { return since < 0.0 ? u : Input{5.0, 0.02}; };
  const auto told = drive(GetParam(), constant);
  for (const char* hold : {"5", ".inf"}) {
    const auto once = drive(
        GetParam(), [&](double since, Input u) { return since > 0.05 && since < 4.0 ? Input{} : constant(since, u); },
        true, fmt::format("  health: {{inputs_hold: {}}}\n", hold));
    // As often as they are asked for: an estimate between nodes is predicted with the input that holds.
    ASSERT_EQ(once.size(), told.size());
    for (std::size_t k = 0; k < told.size(); ++k) {
      EXPECT_LT((once[k].state - told[k].state).norm(), 1e-9) << hold << ' ' << k;
      EXPECT_LT((once[k].covariance - told[k].covariance).norm(), 1e-9) << hold << ' ' << k;
      EXPECT_EQ(once[k].health.level, told[k].health.level) << hold << ' ' << k;
    }
  }
}

TEST_P(MissingInputs, AreNamed) {
  const auto without =
      drive(GetParam(), [](double since, Input u) { return since > 0.0 && since < 4.0 ? Input{} : u; });
  for (std::size_t k = 0; k < without.size(); ++k) {
    const double since = static_cast<double>(k) * step - fault_begins;
    const Health& health = without[k].health;
    const bool is_silent = (health.inputs.reasons & reason::silent) != 0;
    if (since < 0.8 || since > 4.0) {
      EXPECT_FALSE(is_silent) << since;
    } else if (since > 1.3 && since < 3.9) {
      EXPECT_TRUE(is_silent && health.level != HealthLevel::ok) << since;
    }
  }
}

/// A cable that was never plugged in.
TEST_P(MissingInputs, AndSensorsThatNeverCameAreNamed) {
  const auto same = [](double, Input u) { return u; };
  const auto mute = drive(GetParam(), [](double, Input) { return Input{}; }), blind = drive(GetParam(), same, false);
  for (std::size_t k = 0; k < mute.size(); ++k) {
    const bool is_missed = static_cast<double>(k) * step > 5.0 + 1e-6;
    EXPECT_EQ((mute[k].health.inputs.reasons & reason::silent) != 0, is_missed) << k;
    EXPECT_EQ((blind[k].health.sensors[1].reasons & reason::silent) != 0, is_missed) << k;
  }
}

}  // namespace estimator_missing_inputs_test
}  // namespace rhec
