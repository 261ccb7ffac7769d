// An estimator whose sensors, stamps and inputs fail: what it makes of each fault, and whether it says so.
#include "rhec/core/estimation/sensor_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/error.hpp"
#include "support/sensor_faults.hpp"
#include "support/test_clock.hpp"

namespace rhec {
namespace sensor_watch_test {

using namespace rhec::testing;
using namespace std::chrono_literals;

INSTANTIATE_TEST_SUITE_P(All, SensorFaults, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

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

/// Nothing is said, nothing is asked, and then there is never any time: whenever the estimator looks at the clock, it
/// has gone on by so much, and sometimes the processor was taken away for ten milliseconds.
TEST_P(SensorFaults, AnEstimatorThatIsAlwaysLateComesBackFromASilence) {
  const Fault fault{.spoil =
                        [](Delivery& d) {
                          d.has_outputs = d.has_inputs = false;
                          d.asked = nan;
                        },
                    .length = 100,
                    .is_hurried = true};
  struct Pace {
    std::chrono::nanoseconds look;
    double interrupted;  ///< share of looks
  };
  for (const Pace& pace : {Pace{0ns, 0.0}, Pace{1us, 0.02}, Pace{1us, 0.3}, Pace{100us, 0.0}, Pace{1ms, 0.0}}) {
    for (int seed = 1; seed <= seeds; ++seed) {
      SCOPED_TRACE(::testing::Message() << pace.look.count() << " ns a look, " << pace.interrupted
                                        << " of them interrupted, seed " << seed);
      std::mt19937_64 random(static_cast<std::uint64_t>(seed));
      std::uniform_real_distribution<double> chance;
      const TestClock clock([&] { return pace.look + (chance(random) < pace.interrupted ? 10ms : 0ms); });
      const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed));
      EXPECT_TRUE(episode.is_finite);
      EXPECT_LE(episode.samples_to_recover(usual_error), 10);
      EXPECT_LE(episode.samples_to_ok(), 20);
    }
  }
}

/// The setup of a trolley, which has two states and no parameters.
SensorWatch::Setup trolley_setup(const Model& model) {
  return {.noise = variances_of(model), .walk = {}, .parameter_sigmas = {}};
}

TEST(SensorWatch, RefusesSizesThatAreNotThoseOfItsModel) {
  const auto model = linear_model<Trolley>();
  const auto refusal = [&](const auto& spoil) -> std::string {
    SensorWatch::Setup setup = trolley_setup(*model);
    spoil(setup);
    try {
      SensorWatch(model, setup);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal([](SensorWatch::Setup&) {}), "");
  EXPECT_EQ(refusal([](SensorWatch::Setup& setup) { setup.walk = {0.1}; }),
            "sensor watch: 1 walks and 0 standard deviations of parameters; expected 0 of each");
  EXPECT_EQ(refusal([](SensorWatch::Setup& setup) {
              setup.initial_mean = Eigen::VectorXd::Zero(3);
              setup.initial_covariance = Eigen::MatrixXd::Identity(3, 2);
            }),
            "sensor watch: an initial mean of 3 values, and a covariance of 3 x 2; expected 2");
}

TEST(SensorWatch, JudgesFromTheFirstEstimateOn) {
  const auto model = linear_model<Trolley>();
  SensorWatch watch(model, trolley_setup(*model));
  const auto judge = [&](double time) {
    std::vector<double> outputs(static_cast<std::size_t>(model->output_count()), 1e3);
    watch.begin_innovations();
    watch.judge(time, outputs.data());
    return outputs;
  };
  EXPECT_FALSE(watch.is_active());
  for (const double value : judge(0.0)) EXPECT_EQ(value, 1e3);
  EXPECT_TRUE(watch.innovations().empty());
  watch.restart(initial_mean(*model), initial_covariance(*model));
  EXPECT_TRUE(watch.is_active());
  EXPECT_EQ(watch.mean(), initial_mean(*model));
  EXPECT_EQ(watch.covariance(), initial_covariance(*model));
  for (const double value : judge(0.2)) EXPECT_TRUE(std::isnan(value)) << value;
  ASSERT_EQ(watch.innovations().size(), watch.sensors().size());
  for (const Innovation& each : watch.innovations()) EXPECT_FALSE(each.accepted);
  watch.reset();
  EXPECT_FALSE(watch.is_active());
}

/// A bicycle whose slip is known well, watched on a winding drive.
struct WatchedBicycle {
  explicit WatchedBicycle(const SensorWatch::Setup& its_setup) : setup(its_setup), watch(model, setup) {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(6);
    mean.tail(2) << 0.75, 0.8;
    Eigen::MatrixXd covariance = 1e-3 * Eigen::MatrixXd::Identity(6, 6);
    for (int j = 0; j < 2; ++j) {
      const double sigma = setup.parameter_sigmas[static_cast<std::size_t>(j)];
      covariance(4 + j, 4 + j) = std::min(1e-3, sigma * sigma);
    }
    watch.restart(mean, covariance);
  }
  /// A sample with a speed and a steering angle that are off by so much; the outputs have a share of their noise.
  void advance(double speed_off, double angle_off, double noise_share) {
    const double inputs[] = {3.0, 0.2 * std::cos(0.1 * ++samples)};
    const double parameters[] = {0.75, 0.8}, duration = 0.2;
    model->integrate({.count = 1,
                      .states = state.data(),
                      .inputs = inputs,
                      .parameters = parameters,
                      .durations = &duration,
                      .next_states = next.data()});
    state = next;
    double measured[] = {inputs[0] + speed_off, inputs[1]};
    watch.clean_inputs(measured);
    corrected = inputs[0] + speed_off - measured[0];
    watch.advance(duration, measured);
    model->observe({.count = 1, .states = state.data(), .outputs = outputs.data()});
    for (std::size_t j = 0; j < outputs.size(); ++j)
      outputs[j] += noise_share * std::sqrt(setup.noise.output_variances[j]) * normal(random);
    outputs[2] += angle_off;
    watch.judge(duration * samples, outputs.data());
    estimate.covariance = watch.covariance();
    watch.assess(estimate, std::vector(2, SensorWatch::Presence::present), SensorWatch::Presence::present, 0, health);
  }

  std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  SensorWatch::Setup setup;
  SensorWatch watch;
  std::mt19937_64 random{5};
  std::normal_distribution<double> normal;
  std::vector<double> state = std::vector(4, 0.0), next = state, outputs = std::vector(3, 0.0);
  int samples = 0;
  double corrected = 0.0;  ///< taken out of the speed
  Estimate estimate;
  Health health;
};

/// Of a speed slip takes a share; where that share is known, and stays as it is, the speed itself may be off.
TEST(SensorWatch, TakesOutWhatASpeedIsOffByWhoseSlipIsKnown) {
  for (const double most_kappa : {0.75, 1.0}) {
    WatchedBicycle bicycle({.noise = {.output_variances = {9e-4, 9e-4, 3e-4},
                                      .input_variances = {0.01, 0.01},
                                      .parameter_lower = {0.75, 0.0},
                                      .parameter_upper = {most_kappa, 1.0}},
                            .walk = {0.0, 0.03},
                            .parameter_sigmas = {1e-3, 0.3}});
    const double off = 0.5;
    const Health& health = bicycle.health;
    HealthLevel when_found = HealthLevel::ok;
    for (int k = 1; k <= 150; ++k) {
      const bool was_off = health.off_input >= 0;
      bicycle.advance(off, 0.0, 1.0);
      if (health.off_input == 0 && !was_off) when_found = health.level;
    }
    EXPECT_EQ(health.level, HealthLevel::ok);
    if (most_kappa > 0.75) {
      EXPECT_EQ(bicycle.corrected, 0.0);
      EXPECT_EQ(health.inputs.reasons, 0u);
    } else {
      EXPECT_NEAR(bicycle.corrected, off, 0.1);
      EXPECT_EQ(when_found, HealthLevel::degraded);  // until then something else was said of it
      EXPECT_EQ(health.inputs.reasons, reason::off);
      EXPECT_THAT(bicycle.watch.in_words(health), ::testing::StartsWith("ok: input u1 off by about 0."));
    }
  }
}

/// A sensor that is off by what its noise may be is as good as it is said to be.
TEST(SensorWatch, AnOffsetWithinTheNoiseThatIsStatedIsSaidAndDegradesNothing) {
  const double sigma = 0.02;
  for (const double off : {0.8 * sigma, 2.0 * sigma}) {
    SCOPED_TRACE(off);
    WatchedBicycle bicycle({.noise = {.output_variances = {1e-4, 1e-4, sigma * sigma},
                                      .input_variances = {1e-4, 1e-4},
                                      .parameter_lower = {0.0, 0.0},
                                      .parameter_upper = {1.0, 1.0}},
                            .walk = {0.0, 0.0},
                            .parameter_sigmas = {1e-3, 1e-3}});
    const Health& health = bicycle.health;
    HealthLevel when_found = HealthLevel::ok;
    for (int k = 1; k <= 200; ++k) {
      const bool was_off = !health.sensors.empty() && health.sensors.back().reasons != 0;
      bicycle.advance(0.0, off, 0.3);
      if (health.sensors.back().reasons != 0 && !was_off) when_found = health.level;
    }
    ASSERT_EQ(health.sensors.size(), 2u);
    EXPECT_EQ(health.sensors.back().reasons, reason::off);
    EXPECT_NEAR(health.sensors.back().offset, off, 0.3 * off);
    EXPECT_EQ(when_found, HealthLevel::degraded);
    EXPECT_EQ(health.level, off < sigma ? HealthLevel::ok : HealthLevel::degraded);
    EXPECT_THAT(bicycle.watch.in_words(health), ::testing::HasSubstr(": delta off by about 0.0"));
  }
}

}  // namespace sensor_watch_test
}  // namespace rhec
