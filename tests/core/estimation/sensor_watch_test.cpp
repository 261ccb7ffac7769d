// An estimator whose sensors, stamps and inputs fail: what it makes of each fault, and whether it says so.
#include "rhec/core/estimation/sensor_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>

#include "support/sensor_faults.hpp"
#include "support/test_clock.hpp"

namespace rhec {
namespace sensor_watch_test {

using namespace rhec::testing;
using namespace std::chrono_literals;
using ::testing::HasSubstr;

INSTANTIATE_TEST_SUITE_P(All, SensorFaults, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

TEST_P(SensorFaults, NoFaultNoFinding) {
  expect_each({.spoil = {}, .length = 40}, [](const Episode& episode) {
    EXPECT_EQ(episode.samples_to_ok(), 0);
    EXPECT_EQ(episode.counts.rejected, 0);
    EXPECT_EQ(episode.counts.rebased, 0);
  });
}

/// Fixes that say how poor they are, e.g. below trees, are no fault, and are used for what they are; those that claim
/// to be better than they are, are one.
TEST_P(SensorFaults, MeasurementsAreJudgedByTheAccuracyThatTheyState) {
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

TEST_P(SensorFaults, AValueThatIsStuckIsFound) {
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

TEST_P(SensorFaults, AClockThatIsSetIsFollowed) {
  for (const double jump : {-1000.0, 1000.0, -1.5e9}) {
    SCOPED_TRACE(jump);
    expect_each(
        {.spoil = [=](Delivery& d) { d.stamp += jump, d.asked += jump; }, .length = 120}, [](const Episode& episode) {
          for (std::size_t k = 5; k < episode.during.size(); ++k) EXPECT_LT(episode.during[k].error, usual_error) << k;
          EXPECT_EQ(episode.counts.clocks_set, 4);  // that of a row's sensors and that of inputs, there and back
        });
  }
}

TEST_P(SensorFaults, AWrongStampIsRefused) {
  for (const double stamp : {1e9, -1e9, 150.0, std::numeric_limits<double>::infinity(), nan}) {
    SCOPED_TRACE(stamp);
    expect_each({.spoil = [=](Delivery& d) { d.stamp = stamp; }}, [](const Episode& episode) {
      EXPECT_EQ(episode.samples_to_recover(usual_error), 0);
      EXPECT_EQ(episode.counts.clocks_set, 0);
    });
  }
}

TEST_P(SensorFaults, AnImpossibleInputIsNotUsed) {
  for (const double value : {1e6, -9e14, nan, std::numeric_limits<double>::infinity()}) {
    SCOPED_TRACE(value);
    expect_each({.spoil = [=](Delivery& d) { d.inputs[0] = value; }},
                [](const Episode& episode) { EXPECT_LE(episode.samples_to_recover(usual_error), 1); });
  }
}

/// Nothing is said, nothing is asked, and then there is never any time: whenever the estimator looks at the clock, it
/// has gone on by so much, and sometimes the processor was taken away for ten milliseconds.
TEST_P(SensorFaults, AnEstimatorThatIsAlwaysLateComesBackFromASilence) {
  const Fault fault{.spoil =
                        [](Delivery& d) {
                          d.has_outputs = d.has_inputs = false;
                          d.asked = nan;
                        },
                    .length = 100,
                    .is_hurried = true};
  struct Pace {
    std::chrono::nanoseconds look;
    double interrupted;  ///< share of looks
  };
  for (const Pace& pace : {Pace{0ns, 0.0}, Pace{1us, 0.02}, Pace{1us, 0.3}, Pace{100us, 0.0}, Pace{1ms, 0.0}}) {
    for (int seed = 1; seed <= seeds; ++seed) {
      SCOPED_TRACE(::testing::Message() << pace.look.count() << " ns a look, " << pace.interrupted
                                        << " of them interrupted, seed " << seed);
      std::mt19937_64 random(static_cast<std::uint64_t>(seed));
      std::uniform_real_distribution<double> chance;
      const TestClock clock([&] { return pace.look + (chance(random) < pace.interrupted ? 10ms : 0ms); });
      const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed));
      EXPECT_TRUE(episode.is_finite);
      EXPECT_LE(episode.samples_to_recover(usual_error), 10);
      EXPECT_LE(episode.samples_to_ok(), 20);
    }
  }
}

}  // namespace sensor_watch_test
}  // namespace rhec
