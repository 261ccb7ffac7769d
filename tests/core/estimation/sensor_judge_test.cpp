// What is watched at every sample: nothing is found where nothing is wrong, and inputs are those that can be.
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <string>

#include "support/sensor_faults.hpp"

namespace rhec {
namespace sensor_judge_test {

using namespace rhec::testing;

struct JudgedSamples : SensorFaults {};
INSTANTIATE_TEST_SUITE_P(All, JudgedSamples, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

/// What words say that an input is off by; 0: nothing.
double off_of_input(const std::string& words, const std::string& input) {
  const std::string before = "input " + input + " off by about ";
  const std::size_t at = words.find(before);
  return at == std::string::npos ? 0.0 : std::stod(words.substr(at + before.size()));
}

TEST_P(JudgedSamples, NoFaultNoFinding) {
  expect_each({.spoil = {}, .length = 40}, [](const Episode& episode) {
    EXPECT_EQ(episode.samples_to_ok(), 0);
    EXPECT_EQ(episode.counts.rejected, 0);
    EXPECT_EQ(episode.counts.rebased, 0);
  });
}

TEST_P(JudgedSamples, AnImpossibleInputIsNotUsed) {
  for (const double value : {1e6, -9e14, nan, std::numeric_limits<double>::infinity()}) {
    SCOPED_TRACE(value);
    expect_each({.spoil = [=](Delivery& d) { d.inputs[0] = value; }},
                [](const Episode& episode) { EXPECT_LE(episode.samples_to_recover(usual_error), 1); });
  }
}

/// A speed of which no slip takes a share, measured too high for good, as by wheels that slip along.
TEST_P(JudgedSamples, ASpeedThatIsOffForGoodIsUsedWithoutThat) {
  constexpr double off = 0.4;  // [m/s]
  vehicle = with_sideslip(GetParam());
  for (int seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE(seed);
    const Fault fault{.spoil = [](Delivery& d) { d.inputs[0] += off; }, .length = 200};
    const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed));
    EXPECT_TRUE(episode.is_finite);
    EXPECT_GE(episode.honest_share(), 0.95);
    for (std::size_t k = 40; k < episode.during.size(); ++k) EXPECT_LT(episode.during[k].error, 0.15) << k;
    EXPECT_NEAR(off_of_input(episode.during.back().words, "v"), off, 0.1);
    EXPECT_EQ(episode.after.back().health, HealthLevel::ok) << episode.after.back().words;
  }
}

/// Of one that slip takes a share of, slip tells.
TEST_P(JudgedSamples, ASpeedThatSlipExplainsIsNotSaidToBeOff) {
  for (int seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE(seed);
    const Fault fault{.spoil = [](Delivery& d) { d.inputs[0] *= 1.1; }, .length = 150};
    const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed));
    for (const Episode::Sample& sample : episode.during)
      EXPECT_EQ(sample.words.find("input "), std::string::npos) << sample.words;
    EXPECT_LT(episode.during.back().error, usual_error);
  }
}

}  // namespace sensor_judge_test
}  // namespace rhec
