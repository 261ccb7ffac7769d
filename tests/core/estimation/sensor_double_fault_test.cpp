// Two sensors that are wrong at once: a receiver that has moved for good, and a compass or an encoder that is off.
#include "rhec/core/estimation/sensor_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "support/sensor_faults.hpp"

namespace rhec {
namespace sensor_double_fault_test {

using namespace rhec::testing;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double moved = 10.0;  // [m]
constexpr int proof = 11, seeds = 8, samples = 80;

struct DoubleFaults : ::testing::TestWithParam<const char*> {
  /// All since the fault, in the coordinates that the receiver has then, and another output is off.
  static Episode drive(const Robot& robot, std::size_t output, double off, int seed) {
    const auto spoil = [=](Delivery& d) { d.outputs[output] += off; };
    return drive_with_fault(robot, {.spoil = spoil, .length = samples, .moved = moved},
                            static_cast<std::uint64_t>(seed), 0);
  }
  /// Once the receiver has been followed [m].
  static double largest_error_later(const Episode& episode) {
    double most = 0.0;
    for (std::size_t k = proof; k < episode.during.size(); ++k) most = std::max(most, episode.during[k].error);
    return most;
  }
};
INSTANTIATE_TEST_SUITE_P(All, DoubleFaults, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

/// The compass is not believed because the position is: who believes both turns the vehicle by what the compass is off
/// by, and slip has to explain the way that it takes.
TEST_P(DoubleFaults, ACompassIsFoundToBeOffBesideAReceiverThatHasMoved) {
  const Robot robot = with_compass(GetParam());
  int found = 0, rides = 0;
  for (const double off : {0.2, -0.3})
    for (int seed = 1; seed <= seeds; ++seed, ++rides) {
      SCOPED_TRACE(::testing::Message() << off << ' ' << seed);
      const Episode episode = drive(robot, 2, off, seed);
      EXPECT_TRUE(episode.is_finite);
      EXPECT_GE(episode.honest_share(), 0.9);
      EXPECT_LT(largest_error_later(episode), 0.5);
      const std::string& words = episode.during.back().words;
      const std::string before = "heading off by about ";
      const std::size_t at = words.find(before);
      found += at != std::string::npos && std::abs(std::stod(words.substr(at + before.size())) - off) < 0.1;
    }
  EXPECT_GE(found, rides - 3) << "of " << rides;
}

/// The jump of an encoder may just pass its gate. Then the heading goes wrong while the position is not used, and an
/// estimate that drifts to where the receiver is may take that for right. Without the suspicion all of these rides are
/// led away, by up to 49 m.
TEST_P(DoubleFaults, AnEncoderThatPassesItsGateIsSuspectedBesideAReceiverThatHasMoved) {
  const Robot robot = watched_robot(GetParam());
  int led_away = 0;
  for (const double off : {0.2, -0.2})
    for (int seed = 1; seed <= seeds; ++seed) {
      SCOPED_TRACE(::testing::Message() << off << ' ' << seed);
      const Episode episode = drive(robot, 2, off, seed);
      EXPECT_TRUE(episode.is_finite);
      EXPECT_GE(episode.honest_share(), 0.9);
      EXPECT_LT(largest_error_later(episode), 2.0);
      led_away += largest_error_later(episode) > 0.3;
    }
  EXPECT_LE(led_away, 2);
}

/// A receiver that comes back in other coordinates beside a compass that is right: both are believed.
TEST_P(DoubleFaults, ACompassThatIsRightIsBelievedBesideAReceiverThatHasMoved) {
  const Robot robot = with_compass(GetParam());
  for (int seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE(seed);
    const Episode episode = drive(robot, 2, 0.0, seed);
    for (const Episode::Sample& sample : episode.during) EXPECT_THAT(sample.words, Not(HasSubstr("heading")));
  }
}

}  // namespace sensor_double_fault_test
}  // namespace rhec
