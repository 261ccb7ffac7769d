// An estimator whose sensors fail: what it makes of each fault, and whether it says so.
#include "rhec/core/estimation/sensor_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "rhec/plugins/yaml/yaml.hpp"
#include "support/faulty_drive.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace sensor_watch_test {

using namespace rhec::testing;
using ::testing::HasSubstr;

Robot robot(const std::string& estimator, const std::string& more = "") {
  return {host(), RobotOptions::table().parse(parse_yaml(R"(
step: 0.2
model: {name: bicycle_slip, wheelbase: 1.4, gps_offset: 0.4}
noise: {outputs: {x_gps: 0.03, y_gps: 0.03, delta: 0.01745}, inputs: {u1: 0.1, u2: 0.1}}
bounds: {delta: [-0.61, 0.61], u2: [-0.61, 0.61], kappa: [0, 1], mu: [0, 1]}
estimator:
  name: )" + estimator + R"(
  horizon: 15
  process_noise: {kappa: 0.03, mu: 0.03}
  initial:
    parameters: {kappa: 0.5, mu: 0.5}
    sigma: {x_pos: 0.05, y_pos: 0.05, beta: 0.03, delta: 0.02, kappa: 1, mu: 1}
)" + more,
                                                         "robot"),
                                              "robot")};
}

struct SensorFaults : ::testing::TestWithParam<const char*> {
  Robot vehicle = robot(GetParam());
  static constexpr int seeds = 4;
  static constexpr double usual_error = 0.3;  // [m]

  /// Holds what every fault has to keep, and hands on the episodes.
  template <class Function>
  void expect_each(const Fault& fault, const Function& check) {
    for (int seed = 1; seed <= seeds; ++seed) {
      SCOPED_TRACE(seed);
      const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed));
      EXPECT_TRUE(episode.is_finite);
      EXPECT_GE(episode.honest_share(), 0.95);
      for (const Episode::Sample& sample : episode.before) EXPECT_EQ(sample.health, HealthLevel::ok) << sample.words;
      EXPECT_LE(episode.samples_to_ok(), 25);
      check(episode);
    }
  }
};
std::string name_of_estimator(const ::testing::TestParamInfo<const char*>& about) { return about.param; }
INSTANTIATE_TEST_SUITE_P(All, SensorFaults, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

TEST_P(SensorFaults, NoFaultNoFinding) {
  expect_each({.spoil = {}, .length = 40}, [](const Episode& episode) {
    EXPECT_EQ(episode.samples_to_ok(), 0);
    EXPECT_EQ(episode.counts.rejected, 0);
    EXPECT_EQ(episode.counts.rebased, 0);
  });
}

TEST_P(SensorFaults, ASpikeIsNotFollowed) {
  for (const double size : {1.0, 10.0, 100.0, 1e6}) {
    SCOPED_TRACE(size);
    expect_each({.spoil = [=](Delivery& d) { d.outputs[0] += size; }}, [](const Episode& episode) {
      EXPECT_LT(episode.largest_error_during(), usual_error);
      EXPECT_EQ(episode.samples_to_recover(usual_error), 0);
      EXPECT_THAT(episode.during[0].words, HasSubstr("degraded: x_gps and y_gps rejected"));
    });
  }
}

TEST_P(SensorFaults, ATransientOfTenSamplesIsNotFollowed) {
  for (const double size : {5.0, 10.0, 100.0}) {
    SCOPED_TRACE(size);
    expect_each({.spoil = [=](Delivery& d) { d.outputs[1] += size; }, .length = 10}, [=](const Episode& episode) {
      EXPECT_LT(episode.largest_error_during(), 4.0);  // drift on up to 16 m without a position
      EXPECT_LE(episode.samples_to_recover(usual_error), 5);
    });
  }
}

TEST_P(SensorFaults, APositionThatHasMovedForGoodIsFollowed) {
  for (const double size : {10.0, 100.0}) {
    SCOPED_TRACE(size);
    expect_each({.spoil = {}, .length = 9, .moved = size}, [=](const Episode& episode) {
      for (const Episode::Sample& sample : episode.during) {
        EXPECT_EQ(sample.health, HealthLevel::degraded);
        EXPECT_GT(sample.error, 0.8 * size);
      }
      EXPECT_LE(episode.samples_to_recover(usual_error), 21);
      EXPECT_EQ(episode.counts.rebased, 1);
    });
  }
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

/// Neither slip nor unknown inputs explain what a steering encoder alone says; and however little is known of the angle
/// without it, its error stays one.
TEST_P(SensorFaults, AnAngleThatIsOffForGoodIsNotBelieved) {
  for (const double size : {0.2, -0.3}) {
    SCOPED_TRACE(size);
    const Fault fault{.spoil = [=](Delivery& d) { d.outputs[2] += size; }, .length = 50};
    for (int seed = 1; seed <= seeds; ++seed) {
      SCOPED_TRACE(seed);
      const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed), 0);
      EXPECT_TRUE(episode.is_finite);
      EXPECT_GE(episode.honest_share(), 0.95);
      for (const Episode::Sample& sample : episode.during) {
        EXPECT_THAT(sample.words, HasSubstr("degraded: delta rejected"));
        EXPECT_EQ(sample.words.find("inputs"), std::string::npos);
        EXPECT_LT(sample.error, usual_error);
      }
    }
  }
}

/// A second without a position is no silence yet; but how little is known by its end is said.
TEST_P(SensorFaults, WhatIsMissingShowsBeforeItIsSilent) {
  expect_each({.spoil = [](Delivery& d) { d.outputs[0] = d.outputs[1] = nan; }, .length = 5},
              [](const Episode& episode) {
                EXPECT_EQ(episode.during[0].health, HealthLevel::ok);
                EXPECT_THAT(episode.during[4].words, HasSubstr("degraded: uncertain"));
                EXPECT_LE(episode.samples_to_ok(), 10);
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

TEST_P(SensorFaults, WheelsThatSpinOrStandAreNotBelieved) {
  for (const double factor : {3.0, 0.0}) {
    SCOPED_TRACE(factor);
    expect_each({.spoil = [=](Delivery& d) { d.inputs[0] *= factor; }, .length = 25},
                [](const Episode& episode) { EXPECT_LE(episode.samples_to_recover(usual_error), 16); });
  }
}

TEST_P(SensorFaults, SlipThatJumpsIsNoFault) {
  expect_each({.spoil = {}, .length = 20, .moved = 0.0, .slip = 0.35}, [](const Episode& episode) {
    EXPECT_EQ(episode.samples_to_recover(usual_error), 0);
    EXPECT_EQ(episode.counts.rebased, 0);
    EXPECT_EQ(episode.counts.rejected, 0) << "what was held back was right, and is not counted";
    std::ptrdiff_t doubted = 0;
    for (const Episode::Sample& sample : episode.during) doubted += sample.health != HealthLevel::ok;
    EXPECT_LE(doubted, 1) << "until the next sample confirms it";
  });
}

TEST_P(SensorFaults, APositionThatWasFollowedIsDoubtedForSomeTime) {
  expect_each({.spoil = [](Delivery& d) { d.outputs[0] += 10.0; }, .length = 20}, [](const Episode& episode) {
    EXPECT_GT(episode.during.back().error, 9.0) << "it cannot be told from one that has moved for good";
    for (const Episode::Sample& sample : episode.during) EXPECT_NE(sample.health, HealthLevel::ok);
    EXPECT_LE(episode.samples_to_recover(usual_error), 11);
  });
}

/// Nobody sees where the vehicle is for two seconds, and then it heads elsewhere: as after a turn on ground that was
/// not what it was taken for.
TEST_P(SensorFaults, AHeadingThatIsWrongAfterAGapIsFound) {
  constexpr int gap = 10;
  for (const double angle : {1.5, -2.2, 3.0})
    for (int seed = 1; seed <= seeds; ++seed) {
      SCOPED_TRACE(angle * seed);
      double x = 0.0, y = 0.0;
      const auto turn = [&](Delivery& d) {
        if (d.since == 0) x = d.outputs[0], y = d.outputs[1];
        const double east = d.outputs[0] - x, north = d.outputs[1] - y;
        d.outputs[0] = d.since < gap ? nan : x + std::cos(angle) * east - std::sin(angle) * north;
        d.outputs[1] = d.since < gap ? nan : y + std::sin(angle) * east + std::cos(angle) * north;
      };
      const Episode episode =
          drive_with_fault(vehicle, {.spoil = turn, .length = 60}, static_cast<std::uint64_t>(seed), 0);
      EXPECT_TRUE(episode.is_finite);
      EXPECT_NE(episode.during[gap].health, HealthLevel::ok);
      EXPECT_EQ(episode.counts.rebased, 1);
      for (std::size_t k = gap + 25; k < episode.during.size(); ++k)
        EXPECT_EQ(episode.during[k].health, HealthLevel::ok) << k << ": " << episode.during[k].words;
    }
}

TEST_P(SensorFaults, WhileNothingComesTheCovarianceGrows) {
  expect_each({.spoil = [](Delivery& d) { d.has_outputs = d.has_inputs = false; }, .length = 20},
              [](const Episode& episode) {
                EXPECT_NE(episode.during.back().health, HealthLevel::ok);
                for (const Episode::Sample& sample : episode.during)
                  EXPECT_TRUE(sample.inside || sample.health == HealthLevel::lost);
                EXPECT_LE(episode.samples_to_recover(usual_error), 15);
              });
}

/// Nothing is said, nothing is asked, and then there is never any time.
TEST_P(SensorFaults, AnEstimatorThatIsAlwaysLateComesBackFromASilence) {
  const Fault fault{.spoil =
                        [](Delivery& d) {
                          d.has_outputs = d.has_inputs = false;
                          d.asked = std::numeric_limits<double>::quiet_NaN();
                        },
                    .length = 100,
                    .is_hurried = true};
  for (int seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE(seed);
    const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed));
    EXPECT_TRUE(episode.is_finite);
    EXPECT_LE(episode.samples_to_recover(usual_error), 80);
    EXPECT_LE(episode.samples_to_ok(), 100);
  }
}

TEST(SensorWatch, APredictionStaysWithinBounds) {
  for (const char* health : {"", "  health: {watch: false}\n"}) {
    SCOPED_TRACE(health);
    const Robot vehicle = robot("ekf", health);
    const auto estimator = vehicle.make_estimator(Eigen::VectorXd::Zero(4));
    const std::vector<double> outputs{0.0, 0.0, 0.0}, inputs{2.0, 0.3};
    estimator->push_measurement(0.0, outputs.data());
    estimator->estimate(0.0);
    estimator->push_input(0.0, inputs.data());
    const double upper = vehicle.model()->description().states[3].upper;
    EXPECT_NEAR(estimator->estimate(0.5).state[3], 0.15, 0.02);
    EXPECT_EQ(estimator->estimate(100.0).state[3], upper) << "a steering angle, at its stop";
  }
}

}  // namespace sensor_watch_test
}  // namespace rhec
