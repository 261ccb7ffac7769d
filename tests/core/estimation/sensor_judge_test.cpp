// What is watched at every sample: nothing is found where nothing is wrong, and inputs are those that can be.
#include <gtest/gtest.h>

#include <limits>

#include "support/sensor_faults.hpp"

namespace rhec {
namespace sensor_judge_test {

using namespace rhec::testing;

struct JudgedSamples : SensorFaults {};
INSTANTIATE_TEST_SUITE_P(All, JudgedSamples, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

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

}  // namespace sensor_judge_test
}  // namespace rhec
