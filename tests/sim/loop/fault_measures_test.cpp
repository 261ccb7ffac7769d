#include "rhec/sim/loop/fault_measures.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace fault_measures_test {

/// A ride whose position is off by `error`, in which nothing is wrong.
Ride calm_ride(int samples, double error = 0.1) {
  Ride ride;
  for (int k = 0; k < samples; ++k) {
    RideSample sample;
    sample.error = error;
    sample.heading_error = 0.02;
    sample.parameter_errors = Eigen::VectorXd::Constant(1, 0.03);
    ride.samples.push_back(sample);
  }
  return ride;
}

/// Faulty from sample 30 to 34, off by 5 m until 37, and not ok until 40.
Ride faulty_ride() {
  Ride ride = calm_ride(60);
  for (int k = 30; k < 41; ++k) {
    RideSample& sample = ride.samples[static_cast<std::size_t>(k)];
    sample.is_faulty = k < 35;
    if (k < 38) sample.error = 5.0;
    if (k > 30) sample.health = HealthLevel::degraded;
    sample.is_inside = k >= 38;
  }
  return ride;
}

TEST(FaultMeasures, CountsFromTheEndOfAFault) {
  const FaultMeasures found = measure_fault(faulty_ride(), calm_ride(60));
  EXPECT_FALSE(found.is_lasting);
  EXPECT_EQ(found.first, 30);
  EXPECT_EQ(found.end, 35);
  EXPECT_DOUBLE_EQ(found.limit, 0.2);
  EXPECT_EQ(found.recovered, 3);
  EXPECT_EQ(found.ok_again, 6);
  EXPECT_EQ(found.counted, 30);
  EXPECT_EQ(found.honest, 29) << "the first sample is off, and ok";
  EXPECT_EQ(found.longest_dishonest, 1);
  EXPECT_EQ(found.ok, 20);
  EXPECT_EQ(found.moved, -1);
  EXPECT_THAT(found.errors, testing::ElementsAre(5.0, 5.0, 5.0, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1));
}

TEST(FaultMeasures, AFaultThatDoesNotEndIsOverWhenItBegins) {
  Ride ride = faulty_ride();
  for (std::size_t k = 30; k < ride.samples.size(); ++k) ride.samples[k].is_faulty = true;
  for (std::size_t k = 36; k < 41; ++k) ride.samples[k].reasons = reason::moved;
  const FaultMeasures found = measure_fault(ride, calm_ride(80));
  EXPECT_TRUE(found.is_lasting);
  EXPECT_EQ(found.end, 30);
  EXPECT_EQ(found.recovered, 8);
  EXPECT_EQ(found.moved, 6);
  EXPECT_EQ(found.doubted, 5) << "not at the first sample";
}

TEST(FaultMeasures, NeverIsNotLate) {
  Ride ride = faulty_ride();
  ride.samples.back().error = 0.21;
  ride.samples.back().health = HealthLevel::lost;
  const FaultMeasures found = measure_fault(ride, calm_ride(60));
  EXPECT_EQ(found.recovered, -1);
  EXPECT_EQ(found.ok_again, 6) << "what is found long after the fault is another matter";
  EXPECT_TRUE(found.is_lost_at_end);
}

TEST(FaultMeasures, AHealthThatFlickersIsNotOkAgain) {
  Ride ride = faulty_ride();
  for (std::size_t k = 41; k < ride.samples.size(); k += 5) ride.samples[k].health = HealthLevel::degraded;
  ride.samples.back().health = HealthLevel::lost;
  EXPECT_EQ(measure_fault(ride, calm_ride(60)).ok_again, -1);
}

TEST(FaultMeasures, WhatIsFollowedIsMoreThanNoise) {
  Ride ride = faulty_ride();
  ride.samples[31].displaced = 1.9;  // less than ten times what is usual
  ride.samples[31].followed = 1.0;
  ride.samples[32].displaced = 2.1;
  ride.samples[32].followed = 0.7;
  ride.samples[45].displaced = 5.0;  // known to be possible
  ride.samples[45].followed = 0.9;
  EXPECT_DOUBLE_EQ(measure_fault(ride, calm_ride(60)).followed, 0.7);
}

TEST(FaultMeasures, VolumesAreComparedWhereHealthIsOk) {
  Ride ride = faulty_ride();
  for (std::size_t k = 31; k < 50; ++k) ride.samples[k].log_volume = std::log(3.0);
  ride.samples[50].log_volume = std::numeric_limits<double>::quiet_NaN();
  const FaultMeasures found = measure_fault(ride, calm_ride(60));
  EXPECT_EQ(found.wide, 10) << "samples 41 to 49, and one without a volume";
  EXPECT_NEAR(found.volume, 1.0, 1e-12);
}

TEST(FaultMeasures, NumbersThatCannotBeAreCounted) {
  Ride ride = faulty_ride();
  ride.samples[10].is_finite = false;  // before the fault
  ride.samples[33].is_finite = false;
  ride.samples[44].is_bounded = ride.samples[45].is_bounded = false;
  const FaultMeasures found = measure_fault(ride, calm_ride(60));
  EXPECT_EQ(found.not_finite, 1);
  EXPECT_EQ(found.not_bounded, 2);
}

TEST(FaultMeasures, RefusesRidesThatDoNotFit) {
  EXPECT_THROW(measure_fault(calm_ride(60), calm_ride(60)), Error) << "nothing went wrong";
  EXPECT_THROW(measure_fault(faulty_ride(), calm_ride(59)), Error);
  EXPECT_THROW(measure_calm(calm_ride(settled_sample)), Error);
}

TEST(FaultMeasures, CalmRidesCountOnceTheyHaveSettled) {
  Ride ride = calm_ride(60);
  ride.samples[5].health = HealthLevel::lost;
  ride.samples[25].health = HealthLevel::degraded;
  ride.samples[25].is_inside = false;
  ride.samples[26].is_inside = false;
  ride.sensors = {{.name = "x_gps and y_gps", .outputs = {0, 1}}};
  ride.verdicts = {{.reasons = 0, .accepted = 58, .rejected = 2}};
  const CalmMeasures found = measure_calm(ride);
  EXPECT_EQ(found.samples, 40);
  EXPECT_EQ(found.ok, 39);
  EXPECT_EQ(found.inside, 38);
  EXPECT_EQ(found.honest, 39);
  EXPECT_NEAR(found.position, 0.1, 1e-12);
  EXPECT_NEAR(found.heading, 0.02, 1e-12);
  EXPECT_NEAR(found.parameters.at(0), 0.03, 1e-12);
  EXPECT_EQ(json_of(found).at("sensors").at("x_gps and y_gps").at("rejected").as_integer(), 2);
}

}  // namespace fault_measures_test
}  // namespace rhec::sim
