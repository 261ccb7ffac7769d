// Two receivers, of which one moves.
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
namespace sensor_receivers_test {

using namespace rhec::testing;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::size_t for_good = 25, late = 50, settling = 4;  // samples

struct SensorReceivers : SensorFaults {
  Robot two = with_two_receivers(GetParam(), "0.3");
};
INSTANTIATE_TEST_SUITE_P(All, SensorReceivers, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

/// Of two receivers, the one that jumps is wrong, however much better it was. Once it has stayed away for 25 samples
/// and ten metres it is used without what it is off by, which was known when it jumped; and as it is once it is right
/// again.
TEST_P(SensorReceivers, OneThatHasMovedIsUsedWithoutThat) {
  for (const char* noise : {"0.3", "0.03"}) {
    SCOPED_TRACE(noise);
    const Robot robot = with_two_receivers(GetParam(), noise);
    for (const std::size_t receiver : {0U, 3U})
      for (int seed = 1; seed <= seeds; ++seed) {
        SCOPED_TRACE(receiver);
        SCOPED_TRACE(seed);
        const Fault fault{.spoil = [=](Delivery& d) { d.outputs[receiver] += 10.0; }, .length = 80};
        const Episode episode = drive_with_fault(robot, fault, static_cast<std::uint64_t>(seed), 40);
        EXPECT_GE(episode.honest_share(), 0.95);
        const std::string who = receiver == 0 ? "x_gps and y_gps " : "x_rough and y_rough ", says = "off by about ";
        std::size_t first = 0;
        while (first < episode.during.size() && episode.during[first].words.find(says) == std::string::npos) ++first;
        EXPECT_GE(first, for_good - 1);
        EXPECT_LE(first, late);
        for (std::size_t k = 0; k < episode.during.size(); ++k) {
          const Episode::Sample& sample = episode.during[k];
          EXPECT_EQ(sample.health, HealthLevel::degraded) << "another receiver says where the vehicle is";
          EXPECT_LT(sample.error, receiver == 0 && k < first + settling ? 1.0 : usual_error) << k;
          EXPECT_THAT(sample.words, HasSubstr(who + (k <= first ? "rejected" : says))) << k;
          EXPECT_THAT(sample.words, Not(HasSubstr(" from "))) << "it is known who has jumped";
          if (const std::size_t at = sample.words.find(says); at != std::string::npos) {
            EXPECT_NEAR(std::stod(sample.words.substr(at + says.size())), 10.0, 1.0) << k;
          }
        }
        for (const Episode::Sample& sample : episode.after) EXPECT_LT(sample.error, usual_error);
        EXPECT_LE(episode.samples_to_ok(), 15);
        EXPECT_EQ(episode.counts.rebased, 2) << "when it is used again, and when it is right again";
      }
  }
}

/// What a receiver says in coordinates that turn, or drift, is off by no constant.
TEST_P(SensorReceivers, OneWhoseErrorIsNoConstantIsNotUsed) {
  const auto turn = [](Delivery& d) {
    const double x = d.outputs[0] + 20.0, y = d.outputs[1] - 10.0;
    d.outputs[0] = std::cos(0.5) * x - std::sin(0.5) * y;
    d.outputs[1] = std::sin(0.5) * x + std::cos(0.5) * y;
  };
  const auto drift = [](Delivery& d) { d.outputs[1] += 10.0 + 0.3 * d.since; };
  for (const Fault& fault : {Fault{.spoil = turn, .length = 120}, Fault{.spoil = drift, .length = 120}})
    for (int seed = 1; seed <= seeds; ++seed) {
      SCOPED_TRACE(seed);
      const Episode episode = drive_with_fault(two, fault, static_cast<std::uint64_t>(seed), 0);
      EXPECT_GE(episode.honest_share(), 0.95);
      for (const Episode::Sample& sample : episode.during) {
        EXPECT_LT(sample.error, 1.5);
        EXPECT_THAT(sample.words, Not(HasSubstr("x_gps and y_gps off")));
      }
    }
}

/// One that has moved once is believed less than one that never has: where they contradict each other for long, as it
/// drifts away, it is the other one that says where the vehicle is.
TEST_P(SensorReceivers, OneThatHasMovedIsNotBelievedForEver) {
  constexpr int drifts_from = 60;
  const auto spoil = [](Delivery& d) { d.outputs[0] += 10.0 + 0.1 * std::max(0, d.since - drifts_from); };
  for (int seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE(seed);
    const Episode episode = drive_with_fault(two, {.spoil = spoil, .length = 200}, static_cast<std::uint64_t>(seed), 0);
    EXPECT_GE(episode.honest_share(), 0.95);
    for (std::size_t k = late + settling; k < drifts_from; ++k) EXPECT_LT(episode.during[k].error, usual_error) << k;
    for (const Episode::Sample& sample : episode.during) EXPECT_LT(sample.error, 4.0) << "it drifts by 14 m";
    EXPECT_LT(episode.during.back().error, 1.0);
    EXPECT_THAT(episode.during.back().words, HasSubstr("x_gps and y_gps rejected"));
    EXPECT_THAT(episode.during.back().words, Not(HasSubstr("rough")));
  }
}

}  // namespace sensor_receivers_test
}  // namespace rhec
