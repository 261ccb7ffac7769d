// A position that has moved, was followed, and comes back to where it was.
#include "rhec/core/estimation/sensor_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "support/sensor_faults.hpp"

namespace rhec {
namespace sensor_return_test {

using namespace rhec::testing;
using ::testing::HasSubstr;

struct SensorReturns : SensorFaults {};
INSTANTIATE_TEST_SUITE_P(All, SensorReturns, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

constexpr int followed = 12;  // samples after which a position that has moved is followed for sure
// What a transient of up to ten samples does to the position [m]: nobody sees it on up to 16 m.
constexpr double drift = 4.0;

TEST_P(SensorReturns, APositionThatComesBackIsFollowedAfterThreeSamples) {
  for (const double size : {6.0, 10.0, -100.0}) {
    SCOPED_TRACE(size);
    expect_each({.spoil = [=](Delivery& d) { d.outputs[1] += size; }, .length = 22}, [=](const Episode& episode) {
      EXPECT_GT(episode.during.back().error, 0.8 * std::abs(size)) << "it was never followed";
      EXPECT_THAT(episode.after[0].words, HasSubstr("degraded: x_gps and y_gps rejected"));
      EXPECT_THAT(episode.after[2].words, HasSubstr("x_gps and y_gps rejected and moved"));
      EXPECT_LE(episode.samples_to_recover(usual_error), 2);
      EXPECT_LE(episode.samples_to_ok(), 8);
      EXPECT_EQ(episode.counts.rebased, 2);
    });
  }
}

/// Two samples at the place where it was before are a transient like any other.
TEST_P(SensorReturns, TwoSamplesAreNoReturn) {
  const auto flickers = [](Delivery& d) {
    if (d.since != 25 && d.since != 26) d.outputs[0] += 10.0;
  };
  expect_each_long({.spoil = flickers, .length = 45}, [](const Episode& episode) {
    for (std::size_t k = followed; k < episode.during.size(); ++k) EXPECT_GT(episode.during[k].error, 9.0) << k;
    EXPECT_LE(episode.samples_to_recover(usual_error), 2) << "it does come back in the end";
  });
}

/// A transient that leads elsewhere is none either, for all that is remembered of the place before.
TEST_P(SensorReturns, ATransientThatLeadsElsewhereIsNotFollowed) {
  for (const double way : {-17.0, -7.0, 7.0}) {
    SCOPED_TRACE(way);
    const auto leaves = [=](Delivery& d) {
      if (d.since >= 30) d.outputs[0] += way;
    };
    expect_each({.spoil = leaves, .length = 40, .moved = 10.0}, [](const Episode& episode) {
      for (std::size_t k = followed; k < episode.during.size(); ++k) EXPECT_LT(episode.during[k].error, drift) << k;
      EXPECT_LE(episode.samples_to_recover(usual_error), 5);
      EXPECT_EQ(episode.counts.rebased, 1);
    });
  }
}

/// It jumps on to a third place for some samples before it comes back: where that is was not followed, but is known.
TEST_P(SensorReturns, APositionComesBackByWayOfAnotherPlace) {
  const auto jumps = [](Delivery& d) {
    d.outputs[0] += d.since < 25 ? 8.0 : 0.0;
    d.outputs[1] += d.since < 25 ? 0.0 : 6.0;
  };
  expect_each_long({.spoil = jumps, .length = 33},
                   [](const Episode& episode) { EXPECT_LE(episode.samples_to_recover(usual_error), 3); });
}

/// After it has come back nothing is remembered: the place where it was is one like any other, and what was the way
/// back is none any more.
TEST_P(SensorReturns, ASecondTransientIsNotFollowedEarlier) {
  for (const double second : {10.0, -10.0}) {
    SCOPED_TRACE(second);
    const auto twice = [=](Delivery& d) { d.outputs[0] += d.since < 25 ? 10.0 : d.since < 45 ? 0.0 : second; };
    expect_each_long({.spoil = twice, .length = 54}, [](const Episode& episode) {
      for (std::size_t k = 28; k < episode.during.size(); ++k) EXPECT_LT(episode.during[k].error, drift) << k;
      EXPECT_LE(episode.samples_to_recover(usual_error), 5);
    });
  }
}

/// A transient leaves for a place that is known after some samples, and ends where it began: that is seen even if what
/// is known without a position has become wrong meanwhile.
TEST_P(SensorReturns, ATransientEndsWhereItBegan) {
  const Fault fault{
      .spoil = [](Delivery& d) { d.outputs[1] += 100.0; }, .length = 10, .moved = 0.0, .slip = 0.45, .slip_after = 5};
  expect_each(fault, [](const Episode& episode) {
    EXPECT_LE(episode.samples_to_recover(usual_error), 2);
    EXPECT_LE(episode.samples_to_ok(), 8);
    for (const auto* part : {&episode.during, &episode.after})
      for (const Episode::Sample& sample : *part) EXPECT_EQ(sample.words.find("moved"), std::string::npos);
  });
}

/// Slip that jumps while it is open whether a position has moved does not refute that.
TEST_P(SensorReturns, SlipMayJumpWhileAPositionHasMoved) {
  const Fault fault{.spoil = {}, .length = 9, .moved = 10.0, .slip = 0.35, .slip_after = 6};
  expect_each(fault, [](const Episode& episode) {
    EXPECT_LE(episode.samples_to_recover(usual_error), 5) << "followed after more than 14 samples";
    EXPECT_EQ(episode.counts.rebased, 1);
  });
}

}  // namespace sensor_return_test
}  // namespace rhec
