// Measurements that are not used for what they are.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/sensor_faults.hpp"

namespace rhec {
namespace sensor_gate_test {

using namespace rhec::testing;
using ::testing::HasSubstr;

struct GatedSensors : SensorFaults {};
INSTANTIATE_TEST_SUITE_P(All, GatedSensors, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

/// Fixes that say how poor they are, e.g. below trees, are no fault, and are used for what they are; those that claim
/// to be better than they are, are one.
TEST_P(GatedSensors, MeasurementsAreJudgedByTheAccuracyThatTheyState) {
  const auto off_by = [](double error, double stated) {
    return [=](Delivery& d) {
      for (int j : {0, 1}) {
        d.outputs[j] += (d.since + j) % 2 == 0 ? error : -error;
        d.sigmas[j] = stated;
      }
    };
  };
  expect_each({.spoil = off_by(2.0, 2.0), .length = 15}, [](const Episode& episode) {
    EXPECT_EQ(episode.counts.rejected, 0);
    EXPECT_LT(episode.largest_error_during(), 2.5);  // by the speed alone, on ground that changes
    for (const Episode::Sample& sample : episode.during) EXPECT_TRUE(sample.inside) << sample.error;
    EXPECT_LE(episode.samples_to_recover(usual_error), 5);
  });
  expect_each({.spoil = off_by(2.0, 0.1), .length = 15}, [](const Episode& episode) {
    EXPECT_GT(episode.counts.rejected, 10);
    EXPECT_THAT(episode.during[0].words, HasSubstr("x_gps and y_gps rejected"));
  });
}

TEST_P(GatedSensors, AValueThatIsStuckIsFound) {
  double held = 0.0;
  expect_each({.spoil =
                   [&](Delivery& d) {
                     if (d.since == 0) held = d.outputs[2];
                     d.outputs[2] = held;
                   },
               .length = 30},
              [](const Episode& episode) {
                EXPECT_LE(episode.samples_to_recover(usual_error), 5);
                bool is_found = false;
                for (const Episode::Sample& sample : episode.during)
                  is_found = is_found || sample.words.find("delta") != std::string::npos;
                EXPECT_TRUE(is_found);
              });
}

}  // namespace sensor_gate_test
}  // namespace rhec
