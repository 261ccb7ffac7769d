#include "rhec/sim/loop/ride_along.hpp"

#include <gmock/gmock.h>

#include <array>

#include "rhec/core/base/error.hpp"
#include "sim/support/figure8.hpp"

namespace rhec::sim {
namespace ride_along_test {

constexpr int samples = 60;

std::vector<std::string> with(std::vector<std::string> assignments, const std::string& more) {
  assignments.push_back(more);
  return assignments;
}

/// Rides of a filter, with its judge and without.
std::vector<Ride> rides(const std::string& faults) {
  const std::vector<std::string> drive{"speed=5", "path.radius=12", "estimator.name=ekf", "faults=" + faults};
  const std::array riders{figure8_with(drive), figure8_with(with(drive, "estimator.health.watch=false"))};
  return ride_along(figure8_with(drive), riders, samples);
}

TEST(RideAlong, WithoutFaultsAllIsWell) {
  const std::vector<Ride> all = rides("[]");
  ASSERT_EQ(all.size(), 2u);
  for (const Ride& ride : all) {
    ASSERT_EQ(ride.samples.size(), static_cast<std::size_t>(samples));
    for (const RideSample& sample : ride.samples) {
      EXPECT_LT(sample.error, 0.3);
      EXPECT_FALSE(sample.is_faulty);
      EXPECT_EQ(sample.displaced, 0.0);
      EXPECT_TRUE(sample.is_finite && sample.is_bounded);
      EXPECT_EQ(sample.health, HealthLevel::ok);
    }
  }
  EXPECT_EQ(all[0].sensors.size(), all[0].verdicts.size());
  EXPECT_GT(all[0].verdicts.at(0).accepted, samples - 2);
  EXPECT_TRUE(all[1].sensors.empty()) << "nobody judges";
}

TEST(RideAlong, ASpikeIsFollowedByOneWhoTrusts) {
  const std::vector<Ride> all = rides("[{kind: spike, start: 6, sensors: [x_gps, y_gps], size: 20}]");
  const RideSample &judged = all[0].samples[30], &trusting = all[1].samples[30];
  EXPECT_TRUE(judged.is_faulty && !all[0].samples[31].is_faulty);
  EXPECT_NEAR(judged.displaced, 20.0, 1e-9);
  EXPECT_LT(std::abs(judged.followed), 0.02);
  EXPECT_GT(trusting.followed, 0.1);
  EXPECT_GT(trusting.error, 2.0);
  EXPECT_TRUE(judged.reasons & reason::rejected);
}

TEST(RideAlong, OnceTheReceiverHasMovedForGoodItsCoordinatesCount) {
  const std::vector<Ride> all = rides("[{kind: offset, start: 6, sensors: [x_gps, y_gps], size: 20}]");
  EXPECT_LT(all[0].samples[29].error, 0.3);
  EXPECT_NEAR(all[0].samples[30].error, 20.0, 0.5) << "not followed yet";
  EXPECT_LT(all[0].samples.back().error, 0.5) << "followed";
  EXPECT_NEAR(all[0].samples.back().followed, 1.0, 0.02);
}

TEST(RideAlong, AnAngleThatIsOffAsWellDisplacesNothing) {
  const std::vector<Ride> all = rides(
      "[{kind: offset, start: 6, sensors: [x_gps, y_gps], size: 20}, {kind: offset, start: 6, sensors: [delta], size: "
      "1}]");
  EXPECT_NEAR(all[0].samples[30].displaced, 20.0, 1e-9);
  EXPECT_NEAR(all[0].samples[30].error, 20.0, 0.5) << "the receiver's coordinates count, and are not followed yet";
}

TEST(RideAlong, OneCoordinateAloneThatMovesIsASensorThatIsWrong) {
  const std::vector<Ride> all = rides("[{kind: offset, start: 6, length: 2, sensors: [x_gps], size: 20}]");
  EXPECT_LT(all[0].samples[31].error, 1.0) << "the truth has not moved";
  EXPECT_NEAR(all[0].samples[31].displaced, 20.0, 1e-9);
}

TEST(RideAlong, WhatAnEstimatorSaysDoesNotMoveTheVehicle) {
  const std::vector<Ride> plain = rides("[]"), spoilt = rides("[{kind: stuck, start: 4, sensors: [x_gps, y_gps]}]");
  // The truth is the same, so before the fault is seen nothing differs.
  for (std::size_t k = 0; k < 20; ++k) EXPECT_EQ(plain[1].samples[k].error, spoilt[1].samples[k].error);
  EXPECT_GT(spoilt[1].samples.back().error, 5.0) << "it believes to stand, and the vehicle has gone on";
}

/// On a long straight at 8 m/s a filter has learnt a steering slip of 0, and in the bend its heading stays behind. What
/// slip explains that is at its other bound. Where that was none, the position counted as moved after 26 m.
TEST(RideAlong, SlipAtABoundExplainsAHeadingThatIsBehind) {
  const std::vector<std::string> drive{"path={name: zigzag, legs: 8, leg_length: 68}",
                                       "terrain={name: gaussian, correlation_length: 5, lower: 0.5, upper: 1}",
                                       "speed=8",
                                       "step=0.2",
                                       "seed=52056",
                                       "estimator.name=ekf"};
  const std::array riders{figure8_with(drive)};
  const std::vector<Ride> all = ride_along(figure8_with(drive), riders, 200);
  for (std::size_t k = 0; k < all[0].samples.size(); ++k) EXPECT_LT(all[0].samples[k].error, 1.0) << k;
}

TEST(RideAlong, EndsWithThePath) {
  const std::vector<std::string> drive{"speed=8", "path.radius=5", "path.laps=1", "estimator.name=ekf"};
  const std::array riders{figure8_with(drive)};
  const std::vector<Ride> all = ride_along(figure8_with(drive), riders, 10000);
  EXPECT_GT(all[0].samples.size(), 20u);
  EXPECT_LT(all[0].samples.size(), 200u);
}

}  // namespace ride_along_test
}  // namespace rhec::sim
