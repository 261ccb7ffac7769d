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

/// What is seen of a car whose measured inputs read zero for some seconds while it drives on.
struct Unmoved {
  double error = 0.0;       ///< of the position, at most, from the fault's begin on [m]
  double end_error = 0.0;   ///< 10 s behind it [m]
  double said_after = 1e9;  ///< its begin, for good until it ends [s]
  double said_until = 0.0;  ///< after its end [s]
};

/// With a gyro at 50 Hz, an encoder of its steering at 20 Hz, a compass at 10 Hz and positions at 5 Hz that come 0.2 s
/// late. It is built a little otherwise than its model says, and has constant errors that nobody states.
Unmoved drive_unmoved(const std::string& estimator_name, std::uint64_t seed, double speed_wanted, double lasts) {
  const Robot vehicle(host(), RobotOptions::table().parse(parse_yaml(R"(
step: 0.1
model: {name: bicycle_slip, wheelbase: 1.5, gps_offset: 0.5, outputs: [x_gps, y_gps, delta, heading, yaw_rate]}
noise:
  outputs: {x_gps: 0.05, y_gps: 0.05, delta: 0.017, heading: 0.035, yaw_rate: 0.01}
  inputs: {u1: 0.1, u2: 0.1}
  biases: {yaw_rate: {sigma: 0.03, drift: 0.001}}
estimator:
  name: )" + estimator_name + R"(
  initial: {parameters: {kappa: 0.9, mu: 0.9}, sigma: {beta: 0.3}}
)",
                                                                     "robot"),
                                                          "robot"));
  constexpr double tick = 0.01, begins = 25.0, wheelbase = 1.55, antenna = 0.6;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise;
  std::uniform_real_distribution<double> even;
  const double phase = 6.0 * even(random), pace = 0.15 + 0.35 * even(random), ends = begins + lasts;
  const auto estimator = vehicle.make_estimator(Eigen::VectorXd(Eigen::VectorXd::Zero(vehicle.model()->state_count())));
  struct Late {
    double arrives = 0.0, stamp = 0.0;
    std::vector<double> outputs;
  };
  std::vector<Late> positions;
  Unmoved seen;
  double x = 0.0, y = 0.0, heading = 0.0, steering = 0.0, speed = 0.0, said_since = 1e9;
  for (int i = 0; tick * i < ends + 10.0; ++i) {
    const double time = tick * i, slip = 0.85 + 0.05 * std::sin(0.2 * time + phase),
                 aside = 0.85 + 0.05 * std::sin(0.13 * time);
    const double wanted = 0.3 * std::sin(pace * time + phase);
    const double rate = std::min(std::max(3.0 * (wanted - steering), -0.6), 0.6);
    const double turning = aside * speed * std::tan(steering) / wheelbase;
    const bool reads_zero = time >= begins && time < ends;
    if (i % 5 == 0) {
      const std::vector<double> measured{speed + 0.05 * noise(random), rate + 0.03 * noise(random)};
      estimator->push_input(time, reads_zero ? std::vector<double>{0.0, 0.0}.data() : measured.data());
      const double encoder = steering + 0.02 + 0.012 * noise(random);
      estimator->push_measurement(time, std::vector<double>{nan, nan, encoder, nan, nan}.data());
    }
    if (i % 10 == 4) {
      const double compass = heading + 0.05 + 0.02 * noise(random);
      estimator->push_measurement(time, std::vector<double>{nan, nan, nan, compass, nan}.data());
    }
    if (i % 2 == 0) {
      const double gyro = turning + 0.02 + 0.008 * noise(random);
      estimator->push_measurement(time, std::vector<double>{nan, nan, nan, nan, gyro}.data());
    }
    if (i % 20 == 11)
      positions.push_back({.arrives = time + 0.2,
                           .stamp = time,
                           .outputs = {x - antenna * std::cos(heading) + 0.03 * noise(random),
                                       y - antenna * std::sin(heading) + 0.03 * noise(random), nan, nan, nan}});
    if (!positions.empty() && positions.front().arrives <= time) {
      estimator->push_measurement(positions.front().stamp, positions.front().outputs.data());
      positions.erase(positions.begin());
    }
    if (i % 10 == 9) {
      const Estimate& now = estimator->estimate(time);
      const std::string words = estimator->watch()->in_words(now.health);
      seen.end_error = std::hypot(now.state[0] - x, now.state[1] - y);
      if (time >= begins) seen.error = std::max(seen.error, seen.end_error);
      const bool is_said = words.find("inputs rejected") != std::string::npos;
      if (time >= begins && time < ends) said_since = is_said ? std::min(said_since, time) : 1e9;
      seen.said_after = said_since - begins;
      if (time >= ends && is_said) seen.said_until = time - ends;
    }
    x += tick * slip * speed * std::cos(heading);
    y += tick * slip * speed * std::sin(heading);
    heading += tick * turning;
    steering += tick * rate;
    speed += 0.1 * (speed_wanted * (1.0 + 0.1 * std::sin(0.3 * time)) - speed);
  }
  return seen;
}

/// The gyro turns as the vehicle does, and inputs of zero say that it does not: it is not found to be off while
/// positions are disputed. And on the way of 20 ms from one of its samples to the next the vehicle hardly moves, so
/// that inputs of zero nearly explain that: they are believed again by the motion over some positions.
TEST_P(SensorDisputes, InputsThatReadZeroAreNotBelievedBesideAQuickGyro) {
  for (const double speed : {1.0, 2.0}) {
    for (const std::uint64_t seed : {3U, 13U, 15U}) {
      SCOPED_TRACE(speed);
      SCOPED_TRACE(seed);
      const Unmoved seen = drive_unmoved(GetParam(), seed, speed, 6.0);
      EXPECT_LT(seen.error, 1.0 + 1.5 * speed);
      EXPECT_LT(seen.end_error, 0.3);
      EXPECT_LT(seen.said_after, 4.0);
      EXPECT_LT(seen.said_until, 3.0);
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
