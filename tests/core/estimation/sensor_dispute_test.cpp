// Where a sensor and the estimate disagree: who is found to be wrong.
#include "rhec/core/estimation/sensor_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "support/sensor_faults.hpp"

namespace rhec {
namespace sensor_dispute_test {

using namespace rhec::testing;
using ::testing::HasSubstr;

struct SensorDisputes : SensorFaults {};
INSTANTIATE_TEST_SUITE_P(All, SensorDisputes, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

TEST_P(SensorDisputes, ASpikeIsNotFollowed) {
  for (const double size : {1.0, 10.0, 100.0, 1e6}) {
    SCOPED_TRACE(size);
    expect_each({.spoil = [=](Delivery& d) { d.outputs[0] += size; }}, [=](const Episode& episode) {
      EXPECT_LT(episode.largest_error_during(), usual_error);
      EXPECT_EQ(episode.samples_to_recover(usual_error), 0);
      // What slip may have done as well is not said at once, but the estimate has room for it.
      const Episode::Sample& first = episode.during[0];
      if (size > 1.0 || first.health != HealthLevel::ok) {
        EXPECT_THAT(first.words, HasSubstr("degraded: x_gps and y_gps rejected"));
      }
      EXPECT_TRUE(first.inside);
    });
  }
}

TEST_P(SensorDisputes, ATransientOfTenSamplesIsNotFollowed) {
  for (const double size : {5.0, 10.0, 100.0}) {
    SCOPED_TRACE(size);
    expect_each({.spoil = [=](Delivery& d) { d.outputs[1] += size; }, .length = 10}, [=](const Episode& episode) {
      EXPECT_LT(episode.largest_error_during(), 4.0);  // drift on up to 16 m without a position
      EXPECT_LE(episode.samples_to_recover(usual_error), 5);
    });
  }
}

TEST_P(SensorDisputes, APositionThatHasMovedForGoodIsFollowed) {
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

/// Neither slip nor unknown inputs explain what a steering encoder alone says; and however little is known of the angle
/// without it, its error stays one.
TEST_P(SensorDisputes, AnAngleThatIsOffForGoodIsNotBelieved) {
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

TEST_P(SensorDisputes, WheelsThatSpinOrStandAreNotBelieved) {
  for (const double factor : {3.0, 0.0}) {
    SCOPED_TRACE(factor);
    expect_each({.spoil = [=](Delivery& d) { d.inputs[0] *= factor; }, .length = 25},
                [](const Episode& episode) { EXPECT_LE(episode.samples_to_recover(usual_error), 16); });
  }
}

TEST_P(SensorDisputes, SlipThatJumpsIsNoFault) {
  expect_each({.spoil = {}, .length = 20, .moved = 0.0, .slip = 0.35}, [](const Episode& episode) {
    EXPECT_EQ(episode.samples_to_recover(usual_error), 0);
    EXPECT_EQ(episode.counts.rebased, 0);
    EXPECT_EQ(episode.counts.rejected, 0) << "what was held back was right, and is not counted";
    for (const Episode::Sample& sample : episode.during) {
      EXPECT_EQ(sample.health, HealthLevel::ok) << "it is probable at once, and the covariance is that of both answers";
      EXPECT_TRUE(sample.inside);
    }
  });
}

/// Who knows that slip has jumped forgets what it was, so that slip is known anew at the sample that confirms it; and
/// no law by which slip varies much is believed for that.
TEST_P(SensorDisputes, SlipThatHasJumpedIsKnownAtOnce) {
  const Fault fault{.spoil = {}, .length = 20, .moved = 0.0, .slip = 0.35};
  for (const std::uint64_t seed : {2U, 3U, 7U, 10U, 11U, 15U, 19U}) {  // 6 and 8 m/s: the first fix fails its gate
    SCOPED_TRACE(seed);
    const Episode episode = drive_with_fault(vehicle, fault, seed);
    const double usual_sigma = episode.before.back().slip_sigma;
    EXPECT_GT(std::abs(episode.during[1].slip_error), 0.3);
    EXPECT_GT(episode.during[1].slip_sigma, 5.0 * usual_sigma) << "it is open whether slip has jumped";
    for (std::size_t k = 2; k < 8; ++k) {
      EXPECT_LT(std::abs(episode.during[k].slip_error), 0.05) << k;
      EXPECT_LT(episode.during[k].slip_sigma, 2.0 * usual_sigma) << k;
    }
  }
}

/// A vehicle that moves twice as far as its wheels is not explained by slip within its bounds.
TEST_P(SensorDisputes, SlipThatWouldHaveToLeaveItsBoundsIsSaid) {
  const Fault fault{.spoil = [](Delivery& d) { d.inputs[0] *= 0.4; }, .length = 40};
  for (int seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE(seed);
    const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed));
    EXPECT_GE(episode.honest_share(), 0.95);
    const auto ok = std::ranges::count(episode.during, HealthLevel::ok, &Episode::Sample::health);
    EXPECT_LE(ok, std::ssize(episode.during) / 4);
    EXPECT_LE(episode.samples_to_ok(), 25);
  }
}

/// On the interval in which it jumps slip is a mixture: what that says does not explain the next interval.
TEST_P(SensorDisputes, SlipThatJumpsWithinAnIntervalIsFollowed) {
  constexpr double step = 0.2, speed = 10.0;
  constexpr int parts = 20, before = 60, after = 20;
  for (const double share : {0.3, 0.4, 0.5, 0.6})
    for (int seed = 1; seed <= seeds; ++seed) {
      SCOPED_TRACE(share);
      SCOPED_TRACE(seed);
      std::mt19937_64 random(static_cast<std::uint64_t>(seed));
      std::normal_distribution<double> noise;
      const Model& model = *vehicle.model();
      Eigen::VectorXd truth = Eigen::VectorXd::Zero(model.state_count()), slopes = truth;
      const auto estimator = vehicle.make_estimator(truth);
      std::vector<double> outputs(model.output_count());
      for (int k = 0; k < before + after; ++k) {
        model.observe({.count = 1, .states = truth.data(), .outputs = outputs.data()});
        for (std::size_t j = 0; j < outputs.size(); ++j) outputs[j] += vehicle.output_sigmas()[j] * noise(random);
        estimator->push_measurement(k * step, outputs.data());
        const Estimate& estimate = estimator->estimate(k * step);
        const double error = (estimate.state - truth).head(2).norm();
        const bool is_behind = k > before && k <= before + 2;  // those of which it cannot be known yet
        EXPECT_LT(error, is_behind ? 2.0 : usual_error) << k;
        const std::vector<double> inputs{speed, 0.1 * std::sin(0.3 * k)};
        const std::vector<double> measured{speed + 0.1 * noise(random), inputs[1] + 0.1 * noise(random)};
        estimator->push_input(k * step, measured.data());
        for (int i = 0; i < parts; ++i) {
          const bool is_new = k > before || (k == before && i >= (1.0 - share) * parts);
          const std::vector<double> slip{is_new ? 0.98 : 0.45, 0.8};
          model.rates(truth.data(), inputs.data(), slip.data(), slopes.data());
          truth += slopes * step / parts;
        }
      }
      EXPECT_EQ(estimator->counts().rejected, 0) << "what was held back was right, and is not counted";
      EXPECT_EQ(estimator->counts().rebased, 0);
    }
}

/// A receiver that goes away in two steps is off farther after the second, and then stays: slip would go on.
TEST_P(SensorDisputes, APositionThatLeavesInTwoStepsIsNotSlip) {
  for (const double size : {0.4, 0.8, 2.0}) {
    SCOPED_TRACE(size);
    expect_each({.spoil = [=](Delivery& d) { d.outputs[0] += d.since == 0 ? size : 2.5 * size; }, .length = 9},
                [=](const Episode& episode) {
                  EXPECT_LT(episode.largest_error_during(), 4.0);
                  EXPECT_LE(episode.samples_to_recover(usual_error), 10);
                });
  }
}

/// One that goes on for two samples just as a vehicle would whose slip has jumped is believed. What it has said is
/// taken back once no slip explains the third: position and slip are what they would be without it.
TEST_P(SensorDisputes, SlipThatDoesNotGoOnIsTakenBack) {
  int believed = 0;
  for (const double size : {0.8, 1.0, 1.2})
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      SCOPED_TRACE(size);
      SCOPED_TRACE(seed);
      const Fault fault{.spoil = [=](Delivery& d) { d.outputs[0] += (d.since + 1) * size; }, .length = 2};
      const Episode episode = drive_with_fault(vehicle, fault, seed, 10);
      const double slip_before = std::abs(episode.before.back().slip_error);
      if (std::abs(episode.during[1].slip_error) < slip_before + 0.2) continue;
      ++believed;
      EXPECT_GT(episode.during[1].error, size);
      EXPECT_LT(episode.after[0].error, 2.0 * usual_error) << "three samples without a position";
      EXPECT_TRUE(episode.after[0].inside);
      EXPECT_LT(std::abs(episode.after[0].slip_error), slip_before + 0.05);
      EXPECT_EQ(episode.after[0].health, HealthLevel::degraded);
    }
  EXPECT_GE(believed, 5);
}

TEST_P(SensorDisputes, APositionThatWasFollowedIsDoubtedForSomeTime) {
  expect_each({.spoil = [](Delivery& d) { d.outputs[0] += 10.0; }, .length = 20}, [](const Episode& episode) {
    EXPECT_GT(episode.during.back().error, 9.0) << "it cannot be told from one that has moved for good";
    for (const Episode::Sample& sample : episode.during) EXPECT_NE(sample.health, HealthLevel::ok);
    EXPECT_LE(episode.samples_to_recover(usual_error), 11);
  });
}

/// Nobody sees where the vehicle is for two seconds, and then it heads elsewhere: as after a turn on ground that was
/// not what it was taken for.
TEST_P(SensorDisputes, AHeadingThatIsWrongAfterAGapIsFound) {
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

}  // namespace sensor_dispute_test
}  // namespace rhec
