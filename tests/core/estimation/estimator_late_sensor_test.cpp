// A receiver that delivers late beside a quick encoder: faults are judged as if all had come in time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "support/sensor_faults.hpp"

namespace rhec {
namespace estimator_late_sensor_test {

using namespace rhec::testing;

constexpr double duration = 40.0, asked_every = 0.1, speed = 5.0, wheelbase = 1.4, antenna = 0.4;
constexpr double fault_begins = 15.0;  // [s]

struct Message {
  double arrival, stamp;
  std::vector<double> outputs;
};
struct Fault {
  std::string name;
  double length;                                      ///< [s]
  std::function<void(double since, Message&)> spoil;  ///< while it lasts
  double lost_speed = 0.0;                            ///< share of it that the wheels lose
};
struct Timing {
  double lateness = 0.0;         ///< of positions [s]
  int ticks = 20;                ///< of 10 ms, from one position to the next
  double lateness_inputs = 0.0;  ///< [s]
  double jitter = 0.0;           ///< standard deviation of what positions are later than that [s]
  double jitter_inputs = 0.0;    ///< of what inputs are later than their lateness [s]
  int encoder_ticks = 5;         ///< from one angle to the next
};
struct InputMessage {
  double arrival, stamp;
  std::vector<double> inputs;
};
struct Sample {
  double error;  ///< of the position [m]
  HealthLevel health;
  std::string words;
};
struct Result {
  std::vector<Sample> samples;
  Estimate last;
  Estimator::Counts counts;
};

/// Positions at 5 Hz if not told otherwise, the steering angle at 20 Hz between them, and inputs as they change.
Result drive(const char* estimator_name, const Timing& timing, const Fault& fault) {
  const Robot robot = watched_robot(estimator_name);
  constexpr double step = 0.01;
  std::mt19937_64 random(11);
  std::mt19937_64 random_lateness(12);
  std::normal_distribution<double> noise;
  Eigen::Vector4d truth = Eigen::Vector4d::Zero();
  const auto estimator = robot.make_estimator(truth);
  std::vector<Message> messages;
  std::vector<Eigen::Vector4d> states;
  std::vector<InputMessage> inputs;
  for (int i = 0; i * step < duration; ++i) {
    const double time = i * step, since = time - fault_begins;
    const bool is_on = since >= 0.0 && since < fault.length;
    const double steering = 0.3 * std::cos(0.4 * time), kappa = 0.85 + 0.05 * std::sin(0.2 * time);
    states.push_back(truth);
    const auto send = [&](double arrival, std::vector<double> outputs) {
      messages.push_back({arrival, time, std::move(outputs)});
      if (is_on && fault.spoil) fault.spoil(since, messages.back());
    };
    if (i % timing.ticks == 0)
      send(time + timing.lateness + timing.jitter * std::abs(noise(random_lateness)),
           {truth[0] - antenna * std::cos(truth[2]) + 0.03 * noise(random),
            truth[1] - antenna * std::sin(truth[2]) + 0.03 * noise(random), nan});
    if (i % timing.encoder_ticks == 1 % timing.encoder_ticks) send(time, {nan, nan, truth[3] + 0.017 * noise(random)});
    if (i % 20 == 0) {
      const double lateness = timing.lateness_inputs + timing.jitter_inputs * std::abs(noise(random_lateness));
      inputs.push_back({time + lateness, time, {speed + 0.1 * noise(random), steering * 0.4 + 0.1 * noise(random)}});
    }
    const double v = kappa * speed * (is_on ? 1.0 - fault.lost_speed : 1.0);
    truth += step * Eigen::Vector4d(v * std::cos(truth[2]), v * std::sin(truth[2]),
                                    v / wheelbase * std::tan(0.9 * truth[3]), 0.4 * steering);
  }
  std::ranges::stable_sort(messages, {}, &Message::arrival);
  std::ranges::stable_sort(inputs, {}, &InputMessage::arrival);
  Result result;
  std::size_t next = 0, next_input = 0;
  // Beyond the end everything has arrived.
  for (double now = 0.0; now < duration + 1.0 + timing.lateness; now += asked_every) {
    for (; next_input < inputs.size() && inputs[next_input].arrival <= now; ++next_input)
      estimator->push_input(inputs[next_input].stamp, inputs[next_input].inputs.data());
    for (; next < messages.size() && messages[next].arrival <= now + 1e-9; ++next)
      estimator->push_measurement(messages[next].stamp, messages[next].outputs.data());
    const double asked = std::min(now, duration - step);
    const Estimate& estimate = estimator->estimate(asked);
    const Eigen::Vector4d& there = states[static_cast<std::size_t>(std::lround(asked / step))];
    result.samples.push_back({(estimate.state.head<2>() - there.head<2>()).norm(), estimate.health.level,
                              estimator->watch()->in_words(estimate.health)});
    EXPECT_NE(result.samples.back().words, "degraded") << fault.name << " at " << asked << ": and why?";
    result.last = estimate;
  }
  result.counts = estimator->counts();
  return result;
}

void displace(Message& message, double by) {
  if (!std::isnan(message.outputs[0])) message.outputs[0] += by;
}
const Fault faults[] = {
    {.name = "Nothing", .length = 0.0, .spoil = {}},
    {.name = "Spikes",
     .length = 1.9,
     .spoil = [](double since, Message& m) { displace(m, since < 1.0 ? 30.0 : -20.0); }},
    {.name = "Offset", .length = 1.9, .spoil = [](double, Message& m) { displace(m, 10.0); }},
    {.name = "WrongEncoder", .length = 2.0, .spoil = [](double, Message& m) { m.outputs[2] += 0.4; }},
    {.name = "NoPosition", .length = 6.0, .spoil = [](double, Message& m) { m.outputs[0] = m.outputs[1] = nan; }},
    {.name = "WheelsThatSpin", .length = 4.0, .spoil = {}, .lost_speed = 0.5},
};

class LateReceiver : public ::testing::TestWithParam<std::tuple<const char*, Fault>> {
 protected:
  const char* estimator = std::get<0>(GetParam());
  const Fault& fault = std::get<1>(GetParam());
};
INSTANTIATE_TEST_SUITE_P(All, LateReceiver,
                         ::testing::Combine(::testing::Values("ekf", "bank", "rhe"), ::testing::ValuesIn(faults)),
                         [](const auto& about) {
                           return std::get<0>(about.param) + ("_" + std::get<1>(about.param).name);
                         });

/// As fast as if it was not late, but for that.
TEST_P(LateReceiver, RecoversFromFaults) {
  const Result late = drive(estimator, {.lateness = 0.17}, fault);
  const auto first = static_cast<std::size_t>((fault_begins + fault.length + 3.0) / asked_every);
  for (std::size_t k = 0; k < late.samples.size(); ++k) {
    const bool is_after = k >= first, is_before = k * asked_every > 5.0 && k * asked_every < fault_begins;
    SCOPED_TRACE(asked_every * static_cast<double>(k));
    if (is_before || is_after) {
      EXPECT_LT(late.samples[k].error, 0.4);
    }
    if (is_before) {
      EXPECT_EQ(late.samples[k].health, HealthLevel::ok);
    }
  }
  EXPECT_EQ(late.counts.dropped, 0);
}

/// Once all is there, it is where it would be.
TEST_P(LateReceiver, EndsWhereItWouldBeInTime) {
  const Result late = drive(estimator, {.lateness = 0.17}, fault), in_time = drive(estimator, {}, fault);
  const bool is_window = std::string(estimator) == "rhe";
  const double tolerance = is_window ? 0.2 : 1e-6;  // of a standard deviation; a window is solved by single steps
  for (Eigen::Index j = 0; j < late.last.state.size(); ++j)
    EXPECT_NEAR(late.last.state[j], in_time.last.state[j], tolerance * std::sqrt(in_time.last.covariance(j, j))) << j;
  EXPECT_EQ(late.counts.rejected, in_time.counts.rejected);
  EXPECT_EQ(late.last.health.level, in_time.last.health.level);
}

/// A receiver that has moved for good, and is late, is followed after as many of its samples.
TEST(LateReceivers, ThatHaveMovedAreFollowed) {
  for (const char* estimator : {"ekf", "bank", "rhe"}) {
    const Fault fault{.name = "Moved", .length = duration, .spoil = [](double, Message& m) { displace(m, 10.0); }};
    const Result late = drive(estimator, {.lateness = 0.17}, fault);
    const auto error_at = [&](double time) {
      return late.samples[static_cast<std::size_t>(std::lround(time / asked_every))].error;
    };
    EXPECT_LT(error_at(fault_begins + 1.5), 1.0) << estimator << ": not yet";
    EXPECT_NEAR(error_at(fault_begins + 3.5), 10.0, 0.5) << estimator << ": it has moved by 10 m";
    EXPECT_NEAR(late.samples.back().error, 10.0, 0.5) << estimator;
  }
}

/// Whose messages nothing else is in: that the others are silent in these is no reason to follow it.
TEST(QuickEncoders, ThatAreOffAreNotFollowedBesideASlowReceiver) {
  const Fault fault{.name = "Off", .length = 10.0, .spoil = [](double, Message& m) { m.outputs[2] += 0.15; }};
  for (const char* estimator : {"ekf", "bank", "rhe"}) {
    const Result result = drive(estimator, {.lateness = 0.17, .ticks = 100}, fault);
    for (std::size_t k = 150; k < result.samples.size(); ++k) {
      EXPECT_LT(result.samples[k].error, 1.0) << estimator << " " << k;
      EXPECT_EQ(result.samples[k].words.find("moved"), std::string::npos) << estimator << " " << k;
    }
    EXPECT_EQ(result.samples.back().health, HealthLevel::ok) << estimator;
  }
}

/// An encoder at 100 Hz beside a receiver at 1 or 2 Hz: so many of its angles come between two positions that a memory
/// of samples would hold one or two of these, and nothing could be tried anew from before something went wrong.
TEST(QuickEncoders, DoNotMakeTheJudgeForget) {
  const Fault off{.name = "Off", .length = 20.0, .spoil = [](double, Message& m) { m.outputs[2] += 0.15; }};
  const Fault slippery{.name = "Slippery", .length = 10.0, .spoil = {}, .lost_speed = 0.3};
  const std::map<std::string, double> largest{{"Nothing", 0.5}, {"WrongEncoder", 1.0}, {"Off", 1.5}, {"Slippery", 4.0}};
  for (const char* estimator : {"ekf", "bank", "rhe"})
    for (const Fault& fault : {faults[0], faults[3], off, slippery})
      for (const int ticks : {50, 100}) {
        SCOPED_TRACE(fmt::format("{}, {}, every {} s", estimator, fault.name, 0.01 * ticks));
        const Result result = drive(estimator, {.lateness = 0.17, .ticks = ticks, .encoder_ticks = 1}, fault);
        const auto end = static_cast<std::size_t>(std::lround(duration / asked_every));
        for (std::size_t k = 100; k < end; ++k) EXPECT_LT(result.samples[k].error, largest.at(fault.name)) << k;
        for (std::size_t k = 100; k < end && fault.name == "Nothing"; ++k)
          EXPECT_EQ(result.samples[k].words, "ok") << k;
      }
}

/// What happens between two fixes shows in the next one, and hardly in the samples of an encoder that come between: a
/// second of wheels that spin is metres, and turns the vehicle.
TEST(QuickEncoders, DoNotHideSlipThatJumpsBetweenFixes) {
  const Fault spin{.name = "Spin", .length = 4.0, .spoil = {}, .lost_speed = 0.5};
  for (const char* estimator : {"ekf", "bank", "rhe"})
    for (const double lateness : {0.0, 0.17})
      for (const int encoder_ticks : {1, 5}) {
        SCOPED_TRACE(fmt::format("{}, {} s late, an angle every {} s", estimator, lateness, 0.01 * encoder_ticks));
        const Result result =
            drive(estimator, {.lateness = lateness, .ticks = 100, .encoder_ticks = encoder_ticks}, spin);
        const auto after = static_cast<std::size_t>((fault_begins + spin.length + 4.0) / asked_every);
        int ok = 0, samples = 0;
        for (std::size_t k = 100; k < result.samples.size(); ++k) {
          EXPECT_LT(result.samples[k].error, k < after ? 6.0 : 0.5) << k;
          if (k < after) continue;
          ++samples;
          ok += result.samples[k].health == HealthLevel::ok;
        }
        EXPECT_GT(ok, 0.8 * samples);
      }
}

/// Nobody is told how slow a receiver is, nor how late it and the inputs are: that is no reason for doubt.
TEST(SlowReceivers, ThatAreLateAreNoReasonForDoubt) {
  for (const char* estimator : {"ekf", "bank", "rhe"})
    for (const int ticks : {50, 100})
      for (const double lateness : {0.0, 0.35}) {
        SCOPED_TRACE(fmt::format("{}, every {} s, {} s late", estimator, 0.01 * ticks, lateness));
        const Timing timing{.lateness = lateness, .ticks = ticks, .lateness_inputs = 0.5 * lateness};
        const Result slow = drive(estimator, timing, faults[0]);
        for (std::size_t k = 120; k < slow.samples.size(); ++k) EXPECT_EQ(slow.samples[k].words, "ok") << k;
        EXPECT_EQ(slow.counts.dropped, 0);
      }
}

/// What comes now sooner and now later, over a poor network, is missed once it is later than usual, not than its
/// interval.
TEST(InputsOverANetwork, AreNoReasonForDoubt) {
  for (const char* estimator : {"ekf", "bank", "rhe"})
    for (const double jitter : {0.1, 0.2}) {
      const Result result = drive(estimator, {.jitter_inputs = jitter}, faults[0]);
      int ok = 0, samples = 0;
      for (std::size_t k = 120; k < result.samples.size(); ++k, ++samples) {
        ok += result.samples[k].health == HealthLevel::ok;
        EXPECT_LT(result.samples[k].error, 0.5) << k;
      }
      EXPECT_GT(ok, 0.98 * samples) << estimator << ", later by " << jitter << " s";
    }
}

/// A receiver that is so late beside an encoder so quick that hundreds of its angles have come meanwhile is judged as
/// others are.
TEST(VeryLateReceivers, AreWaitedFor) {
  const Fault moved{.name = "Moved", .length = duration, .spoil = [](double, Message& m) { displace(m, 10.0); }};
  const std::map<std::string, double> largest{{"Spikes", 1.2},     {"Offset", 1.2},         {"WrongEncoder", 2.5},
                                              {"NoPosition", 3.0}, {"WheelsThatSpin", 9.0}, {"Moved", 12.0}};
  std::vector<Fault> all(std::begin(faults) + 1, std::end(faults));
  all.push_back(moved);
  for (const char* estimator : {"ekf", "rhe"})
    for (const Fault& fault : all) {
      SCOPED_TRACE(fmt::format("{}, {}", estimator, fault.name));
      const Result late = drive(estimator, {.lateness = 2.0, .encoder_ticks = 1}, fault);
      for (std::size_t k = 60; k < late.samples.size(); ++k)
        EXPECT_LT(late.samples[k].error, largest.at(fault.name)) << k;
      const Sample& last = late.samples.back();
      EXPECT_NEAR(last.error, fault.name == "Moved" ? 10.0 : 0.0, 0.5);
      EXPECT_EQ(last.words, "ok");
      // Between these time stands still, while positions still come: they are less late than was learnt.
      const auto end = static_cast<std::size_t>(std::lround(duration / asked_every)) - 1;
      for (std::size_t k = end - 20; k <= end; ++k) EXPECT_EQ(late.samples[k].words, "ok") << k;
    }
}

/// One that is too late to be waited for is held against its gates, however many samples others have had since.
TEST(VeryLateReceivers, AreGated) {
  for (const char* estimator : {"ekf", "rhe"})
    for (const Fault& fault : {faults[1], faults[2]}) {
      SCOPED_TRACE(fmt::format("{}, {}", estimator, fault.name));
      const Result late = drive(estimator, {.lateness = 2.7, .encoder_ticks = 1}, fault);
      for (std::size_t k = 60; k < late.samples.size(); ++k) EXPECT_LT(late.samples[k].error, 2.0) << k;
      EXPECT_EQ(late.samples.back().words, "ok");
      EXPECT_EQ(late.counts.dropped, 0);
    }
}

/// Late by about as much as an encoder's interval: whether it is waited for or not, it has come.
TEST(SlowReceivers, ThatAreLateByLittleHaveCome) {
  for (const char* estimator : {"ekf", "bank", "rhe"})
    for (const double lateness : {0.03, 0.06, 0.09}) {
      SCOPED_TRACE(fmt::format("{}, {} s late", estimator, lateness));
      const Result slow = drive(estimator, {.lateness = lateness, .ticks = 100, .jitter = 0.02}, faults[0]);
      for (std::size_t k = 120; k < slow.samples.size(); ++k) EXPECT_EQ(slow.samples[k].words, "ok") << k;
    }
}

}  // namespace estimator_late_sensor_test
}  // namespace rhec
