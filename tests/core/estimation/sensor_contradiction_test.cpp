// A measured input, and an encoder that sees the same: one of them is wrong.
#include "rhec/core/estimation/sensor_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "support/contradicted_car.hpp"

namespace rhec {
namespace sensor_contradiction_test {

using namespace rhec::testing;
using ::testing::HasSubstr;
using ::testing::Not;

struct SensorContradictions : ::testing::TestWithParam<const char*> {
  Robot robot = contradicted_car(GetParam());
};
INSTANTIATE_TEST_SUITE_P(All, SensorContradictions, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

/// What is measured of the steering is wrong: in the bend that follows the encoder seems to be off, or slip goes to its
/// bound, until the position tells. Without that it is the encoder, and then the receiver: several metres.
TEST_P(SensorContradictions, AnInputThatIsWrongIsFoundByThePosition) {
  const Spoil kinds[] = {[](SteeringMessage& each) { each.input = 0.0; }, stuck(&SteeringMessage::input),
                         [](SteeringMessage& each) { each.input += 0.1; },
                         [](SteeringMessage& each) { each.input -= 0.2; }};
  int found = 0, rides = 0;
  for (const Spoil& kind : kinds)
    for (std::uint64_t seed = 1; seed <= 3; ++seed, ++rides) {
      SCOPED_TRACE(rides);
      const ContradictedRide ride = drive_contradicted(robot, seed, 20.0, Spoil(kind));
      EXPECT_LT(ride.most, 0.4);
      EXPECT_LT(ride.turned, 0.1);
      EXPECT_EQ(ride.last, "ok");
      found += ride.says("input delta rejected");
    }
  EXPECT_GE(found, rides - 2) << "of " << rides;
}

/// An encoder that is wrong is not taken for an input that is.
TEST_P(SensorContradictions, AnEncoderThatIsWrongIsFound) {
  const Spoil kinds[] = {
      [](SteeringMessage& each) { each.steering = 0.0; },   stuck(&SteeringMessage::steering),
      [](SteeringMessage& each) { each.steering += 0.1; },  [](SteeringMessage& each) { each.steering -= 0.3; },
      [](SteeringMessage& each) { each.steering *= -1.0; }, [](SteeringMessage& each) { each.steering *= 0.5; }};
  for (const Spoil& kind : kinds)
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      SCOPED_TRACE(&kind - kinds);
      const ContradictedRide ride = drive_contradicted(robot, seed, 20.0, Spoil(kind));
      EXPECT_LT(ride.most, 0.2);
      EXPECT_LT(ride.turned, 0.1);
      EXPECT_FALSE(ride.says("input delta"));
      EXPECT_TRUE(ride.says("steering"));
      EXPECT_EQ(ride.last, "ok");
    }
}

/// It is the input that is named, and not all of them.
TEST_P(SensorContradictions, WhatIsDoubtedIsSaid) {
  const ContradictedRide ride = drive_contradicted(robot, 1, 20.0, [](SteeringMessage& each) { each.input -= 0.2; });
  const auto doubted = std::ranges::find_if(
      ride.words, [](const std::string& each) { return each.find("input delta rejected") != std::string::npos; });
  ASSERT_NE(doubted, ride.words.end());
  for (auto each = doubted; each != ride.words.end(); ++each) EXPECT_THAT(*each, Not(HasSubstr("inputs rejected")));
}

}  // namespace sensor_contradiction_test
}  // namespace rhec
