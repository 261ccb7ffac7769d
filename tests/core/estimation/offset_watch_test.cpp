// Sensors that are off by little for long: who finds it, what it does to an estimate, and what is said of it.
#include "core/estimation/offset_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "support/linear_case.hpp"
#include "support/sensor_faults.hpp"

namespace rhec {
namespace offset_watch_test {

using namespace rhec::testing;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double gate = 6.0, offset = 0.3;
constexpr int rate = 1;  // the output that is watched

/// A boat that is measured, by a filter beside which offsets of its second output are watched.
struct WatchedBoat {
  std::shared_ptr<const Model> model = linear_model<Boat>();
  KalmanFilter::Noise noise{
      .output_variances = {0.04, 0.01}, .input_variances = {1e-4}, .parameter_lower = {-1e3}, .parameter_upper = {1e3}};
  WalkingFilter filter;
  OffsetWatch watch{*model, {{.output = rate}}, noise, gate};

  explicit WatchedBoat(double walk = 0.01)
      : filter(model, {.noise = noise, .walk = {walk}, .step = 0.1, .substeps = 4}) {
    filter.mean() = initial_mean(*model);
    filter.covariance() = 0.01 * Eigen::MatrixXd::Identity(4, 4);
    if (walk == 0.0) filter.covariance()(3, 3) = 0.0;
  }
  void take(std::vector<double> outputs, bool counts = true, double input_off = 0.0) {
    double input = 0.2 + input_off;
    watch.correct(outputs.data());
    watch.correct_inputs(&input);
    filter.predict(&input, 0.1, nullptr, &watch.sensitivities());
    filter.expect();
    filter.update(outputs.data());
    watch.take(filter, 1.0, {}, counts);
  }
  Estimate estimate() {
    Estimate estimate;
    estimate.state = filter.mean().head(3);
    estimate.parameters = filter.mean().tail(1);
    estimate.covariance = filter.covariance();
    return estimate;
  }
};

/// What is measured of a boat that moves as its filter expects.
struct TrueBoat {
  WatchedBoat boat;
  std::mt19937_64 random{7};
  std::normal_distribution<double> normal;
  std::vector<double> measure(double noise_factor, double off) {
    const double input = 0.2;
    boat.filter.predict(&input, 0.1);
    boat.filter.expect();
    return {boat.filter.expected(0) + noise_factor * 0.2 * normal(random),
            boat.filter.expected(1) + noise_factor * 0.1 * normal(random) + off};
  }
};

/// Without noise, what is said of the offset, and of what it has done to the estimate, is exact.
TEST(OffsetWatch, TakesOutWhatAnOffsetHasDone) {
  TrueBoat truth;
  WatchedBoat misled, told;
  bool is_found = false;
  for (int k = 0; k < 200 && !is_found; ++k) {
    const double off = k < 30 ? 0.0 : offset;
    std::vector<double> outputs = truth.measure(0.0, off);
    misled.take(outputs);
    outputs[rate] -= off;
    told.take(outputs);
    is_found = misled.watch.has_suspect();
    EXPECT_TRUE(!is_found || k >= 30) << k;
  }
  ASSERT_TRUE(is_found);
  EXPECT_GT((misled.filter.mean() - told.filter.mean()).norm(), 0.05);
  misled.watch.adopt_suspected(misled.filter);
  EXPECT_NEAR(misled.watch.offset(rate), offset, 1e-9);
  EXPECT_LT((misled.filter.mean() - told.filter.mean()).norm(), 1e-9);
  EXPECT_EQ(misled.watch.offset(0), 0.0);
}

/// The same of a measured input: what it has done is taken out at once, and it itself by and by.
TEST(OffsetWatch, TakesOutWhatAnInputIsOffBy) {
  constexpr double input_off = 0.15;
  TrueBoat truth;
  WatchedBoat misled, told;
  for (WatchedBoat* boat : {&misled, &told}) boat->watch = OffsetWatch(*boat->model, {{.input = 0}}, boat->noise, gate);
  int adopted = 0;
  for (int k = 0; k < 600; ++k) {
    const std::vector<double> outputs = truth.measure(0.0, 0.0);
    misled.take(outputs, true, input_off);
    told.take(outputs);
    if (!misled.watch.has_suspect()) continue;
    EXPECT_EQ(misled.watch.suspected(), -1);  // no output
    const double before = (misled.filter.mean() - told.filter.mean()).norm();
    misled.watch.adopt_suspected(misled.filter);
    // No innovation counts as more than three standard deviations, so that what is found is a little less.
    EXPECT_LT((misled.filter.mean() - told.filter.mean()).norm(), before) << k;
    ++adopted;
    EXPECT_LE(misled.watch.input_offset(0), input_off + 1e-9);
  }
  EXPECT_GE(adopted, 2);
  EXPECT_NEAR(misled.watch.input_offset(0), input_off, 0.03);
}

/// An offset that would leave slip where it cannot be is not what is wrong.
TEST(OffsetWatch, FindsNoneThatTakesSlipBeyondItsBounds) {
  const double known = WatchedBoat().filter.mean()[3];
  for (const bool is_within : {true, false}) {
    TrueBoat truth;
    WatchedBoat boat;
    KalmanFilter::Noise bounded = boat.noise;
    bounded.parameter_lower = {known + (is_within ? -1.0 : 1.0)};
    boat.watch = OffsetWatch(*boat.model, {{.output = rate}}, bounded, gate);
    bool is_found = false;
    for (int k = 0; k < 200; ++k) {
      boat.take(truth.measure(0.0, k < 30 ? 0.0 : offset));
      is_found = is_found || boat.watch.has_suspect();
    }
    EXPECT_EQ(is_found, is_within);
  }
}

/// No offset is larger than ten typical magnitudes: one that is known does not grow beyond that.
TEST(OffsetWatch, FindsNoneThatCannotBe) {
  for (const double known : {5.0, 9.9, -9.9}) {
    TrueBoat truth;
    WatchedBoat boat;
    for (int k = 0; k < 30; ++k) boat.take(truth.measure(0.0, 0.0));
    boat.watch.adopt(rate, known, 1e-4);
    bool is_found = false;
    for (int k = 0; k < 100; ++k) {
      boat.take(truth.measure(0.0, known + std::copysign(offset, known)));
      is_found = is_found || boat.watch.has_suspect();
    }
    EXPECT_EQ(is_found, std::abs(known) + offset < 10.0) << known;
  }
}

/// A quick sensor beside others has many samples that say little: time is not counted in these.
TEST(OffsetWatch, AgesBySamplesThatCount) {
  for (const bool counts : {true, false}) {
    TrueBoat truth;
    WatchedBoat boat;
    for (int k = 0; k < 60; ++k) boat.take(truth.measure(0.0, 0.0));
    boat.watch.adopt(rate, offset, 1e-4);
    for (int k = 0; k < 200; ++k) boat.take(truth.measure(0.0, offset), counts);
    EXPECT_TRUE(boat.watch.has_any());
    EXPECT_NE(boat.watch.has_recent(), counts);
  }
}

/// Between two positions a quick gyro that slip stops says what one that is off would say.
TEST(OffsetWatch, WaitsUntilSlipCanBeTold) {
  for (const int every : {1, 12}) {
    TrueBoat truth;
    WatchedBoat boat;
    int found = -1, counted = 0;
    for (int k = 0; k < 200 && found < 0; ++k) {
      const bool counts = k % every == 0;
      boat.take(truth.measure(0.0, k < 36 ? 0.0 : 3.0 * offset), counts);
      counted += k >= 36 && counts;
      if (boat.watch.has_suspect()) found = k;
    }
    EXPECT_GE(found, 36);
    EXPECT_LE(found, every == 1 ? 50 : 36 + 3 * every);
    EXPECT_GE(counted, 3);
  }
}

TEST(OffsetWatch, FindsNoneInWhiteNoise) {
  TrueBoat truth;
  WatchedBoat boat;
  for (int k = 0; k < 20000; ++k) {
    boat.take(truth.measure(1.0, 0.0));
    ASSERT_FALSE(boat.watch.has_suspect()) << k;
  }
}

TEST(OffsetWatch, FindsOneAsFastAsTheDataTell) {
  TrueBoat truth;
  WatchedBoat boat;
  int found = -1;
  for (int k = 0; k < 200 && found < 0; ++k) {
    boat.take(truth.measure(1.0, k < 50 ? 0.0 : offset));
    if (boat.watch.has_suspect()) found = k;
  }
  EXPECT_GE(found, 50);
  EXPECT_LE(found, 110);
}

/// One that was there before the first sample has no onset that shows; where the current is known, positions tell.
TEST(OffsetWatch, FindsOneThatHasAlwaysBeenThere) {
  TrueBoat truth;
  WatchedBoat boat(0.0);
  bool is_found = false;
  for (int k = 0; k < 300 && !is_found; ++k) {
    boat.take(truth.measure(1.0, offset));
    is_found = boat.watch.has_suspect();
    if (k == 20) boat.watch.forget_onsets();
  }
  EXPECT_TRUE(is_found);
}

TEST(OffsetWatch, WithdrawsWhatLaterSamplesDoNotConfirm) {
  TrueBoat truth;
  WatchedBoat boat;
  boat.watch.adopt(rate, offset, 0.05 * 0.05);
  EXPECT_TRUE(boat.watch.has_any());
  EXPECT_NEAR(boat.watch.offset(rate), offset, 1e-12);
  for (int k = 0; k < 300 && boat.watch.has_any(); ++k) {
    boat.take(truth.measure(1.0, 0.0));
    if (boat.watch.has_suspect()) boat.watch.adopt_suspected(boat.filter);
  }
  EXPECT_FALSE(boat.watch.has_any());
  EXPECT_EQ(boat.watch.offset(rate), 0.0);
}

/// What has not been said clearly enough makes the estimate less certain, and moves nothing.
TEST(OffsetWatch, AnOffsetThatIsProbableMakesTheEstimateWider) {
  TrueBoat truth;
  WatchedBoat boat, told;
  int wider = 0, covered = 0;
  for (int k = 0; k < 200 && !boat.watch.has_suspect(); ++k) {
    std::vector<double> outputs = truth.measure(0.0, offset);
    boat.take(outputs);
    outputs[rate] -= offset;
    told.take(outputs);
    if (!boat.watch.is_in_doubt() || boat.watch.has_suspect()) continue;
    Estimate estimate = boat.estimate();
    boat.watch.refine(estimate);
    EXPECT_EQ(estimate.state, boat.filter.mean().head(3));
    const double added = estimate.covariance(1, 1) - boat.filter.covariance()(1, 1);
    EXPECT_GT(added, 0.0);
    const double away = boat.filter.mean()[1] - told.filter.mean()[1];
    EXPECT_LT(added, away * away + 0.01) << "no more than the offset has done, and what is not known of it";
    covered += added > 0.5 * away * away;
    ++wider;
  }
  EXPECT_TRUE(boat.watch.has_suspect());
  EXPECT_GE(wider, 3);
  EXPECT_GE(covered, 1);
}

/// An offset of which half was adopted: what is given out is nearer to the truth than the filter, and says how far it
/// may be off.
TEST(OffsetWatch, GivesOutWhatIsLeftOfAnOffset) {
  TrueBoat truth;
  WatchedBoat boat, told;
  boat.watch.adopt(rate, 0.5 * offset, 1.0);
  EXPECT_FALSE(boat.watch.has_any());  // less than its own uncertainty is none
  boat.watch.adopt(rate, 0.8 * offset, 0.03 * 0.03);
  for (int k = 0; k < 40; ++k) {
    std::vector<double> outputs = truth.measure(0.0, offset);
    boat.take(outputs);
    outputs[rate] -= offset;
    told.take(outputs);
  }
  ASSERT_TRUE(boat.watch.has_any());
  Estimate estimate = boat.estimate();
  const double before = (estimate.state - told.filter.mean().head(3)).norm();
  boat.watch.refine(estimate);
  EXPECT_LT((estimate.state - told.filter.mean().head(3)).norm(), 0.8 * before);
  EXPECT_GT(estimate.covariance(1, 1), boat.filter.covariance()(1, 1));
}

TEST(OffsetWatch, WithdrawsWhatWasAdoptedOfLate) {
  TrueBoat truth;
  WatchedBoat boat, told;
  boat.watch.adopt(rate, offset, 0.03 * 0.03);
  EXPECT_TRUE(boat.watch.has_recent());
  for (int k = 0; k < 60; ++k) {
    const std::vector<double> outputs = truth.measure(0.0, 0.0);
    boat.take(outputs);
    told.take(outputs);
  }
  const double before = (boat.filter.mean() - told.filter.mean()).norm(), variance = boat.filter.covariance()(1, 1);
  EXPECT_GT(before, 0.1);
  boat.watch.withdraw_recent(boat.filter);
  EXPECT_FALSE(boat.watch.has_any());
  EXPECT_LT((boat.filter.mean() - told.filter.mean()).norm(), 0.1 * before);
  EXPECT_GT(boat.filter.covariance()(1, 1), variance);
}

/// An output that is not searched is off by what somebody else says, and then surely: not its rival.
TEST(OffsetWatch, TakesOutWhatIsSaidOfAnOutputThatIsNotSearched) {
  TrueBoat truth;
  WatchedBoat boat;
  boat.watch = OffsetWatch(*boat.model, {{.output = rate, .rival = 0, .is_searched = false}}, boat.noise, gate);
  for (int k = 0; k < 200; ++k) {
    boat.take(truth.measure(1.0, offset));
    ASSERT_FALSE(boat.watch.has_suspect()) << k;
  }
  EXPECT_EQ(boat.watch.rival(rate), 0);
  boat.watch.adopt(rate, offset, 1e-4, true);
  EXPECT_TRUE(boat.watch.is_sure(rate));
  EXPECT_TRUE(boat.watch.has_sure());
  EXPECT_EQ(boat.watch.rival(rate), -1);
  EXPECT_FALSE(boat.watch.has_recent()) << "it is not taken back with what innovations have said";
  EXPECT_FALSE(boat.watch.has_any_but({rate}));
  EXPECT_TRUE(boat.watch.has_any_but({0}));
  Innovation innovation;
  innovation.value.resize(1);
  innovation.covariance = Innovation::OfSensor<Eigen::Dynamic>::Constant(1, 1, 0.01);
  innovation.value[0] = -offset;
  EXPECT_TRUE(boat.watch.is_right_again({rate}, innovation));
  innovation.value[0] = 0.0;
  EXPECT_FALSE(boat.watch.is_right_again({rate}, innovation));
  boat.watch.end({rate}, boat.filter);
  EXPECT_FALSE(boat.watch.has_any());
  boat.watch.adopt(rate, offset, 1e-4, true);
  boat.watch.forget_receivers();
  EXPECT_FALSE(boat.watch.has_any());
}

// ---- an estimator that has it

struct OffsetFaults : SensorFaults {};
INSTANTIATE_TEST_SUITE_P(All, OffsetFaults, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

constexpr double little = 3.0 * std::numbers::pi / 180.0;

/// The size that is said; NaN where none is.
double size_in(const std::string& words) {
  const std::string before = "delta off by about ";
  const std::size_t at = words.find(before);
  return at == std::string::npos ? nan : std::stod(words.substr(at + before.size()));
}

TEST_P(OffsetFaults, AnAngleThatIsOffByLittleIsFoundAndTakenOut) {
  int found = 0, episodes = 0;
  double honest = 0.0, delays = 0.0;
  for (const double size : {little, -little}) {
    const Fault fault{.spoil = [=](Delivery& d) { d.outputs[2] += size; }, .length = 150};
    for (int seed = 1; seed <= seeds; ++seed, ++episodes) {
      SCOPED_TRACE(::testing::Message() << size << ", seed " << seed);
      const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed));
      EXPECT_TRUE(episode.is_finite);
      EXPECT_GE(episode.honest_share(), 0.92);
      honest += episode.honest_share();
      const auto first = std::ranges::find_if(
          episode.during, [](const Episode::Sample& sample) { return !std::isnan(size_in(sample.words)); });
      if (first == episode.during.end()) continue;
      ++found;
      EXPECT_LE(first - episode.during.begin(), 100);
      delays += static_cast<double>(first - episode.during.begin());
      // Beside slip that scales the angle, it is known roughly.
      EXPECT_GT(size_in(first->words) / size, 0.4);
      EXPECT_LT(size_in(first->words) / size, 2.5);
      EXPECT_EQ(first->health, HealthLevel::degraded);
    }
  }
  EXPECT_EQ(found, episodes);
  EXPECT_LE(delays / found, 50.0);
  EXPECT_GE(honest / episodes, 0.95);
}

TEST_P(OffsetFaults, AnAngleThatIsRightAgainIsBelieved) {
  const Fault fault{.spoil = [](Delivery& d) { d.outputs[2] += little; }, .length = 100};
  for (int seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE(seed);
    const Episode episode = drive_with_fault(vehicle, fault, static_cast<std::uint64_t>(seed), 200);
    EXPECT_LE(episode.samples_to_ok(), 120);
  }
}

/// Of two receivers one is off by five of its standard deviations. Which one is not known, unless it has failed its
/// gate when it began: both are named, and what is given out has room for both places.
TEST_P(OffsetFaults, TwoReceiversThatDifferForLongAreBothNamed) {
  for (const char* noise : {"0.3", "0.03"}) {
    SCOPED_TRACE(noise);
    const Robot two = with_two_receivers(GetParam(), noise);
    for (int seed = 1; seed <= seeds; ++seed) {
      SCOPED_TRACE(seed);
      const double size = 5.0 * std::stod(noise);
      const Fault fault{.spoil = [=](Delivery& d) { d.outputs[3] += size; }, .length = 100};
      const Episode episode = drive_with_fault(two, fault, static_cast<std::uint64_t>(seed), 0);
      EXPECT_TRUE(episode.is_finite);
      EXPECT_GE(episode.honest_share(), 0.95);
      std::ptrdiff_t said = 0, rejected = 0;
      for (std::size_t k = 0; k < episode.during.size(); ++k) {
        const Episode::Sample& sample = episode.during[k];
        rejected += sample.words.find("rejected") != std::string::npos;
        if (k < 20) continue;
        if (sample.words.find(" off by about ") == std::string::npos) continue;
        ++said;
        EXPECT_THAT(sample.words, HasSubstr("degraded: x_rough and y_rough "));
        if (rejected < OffsetWatch::for_good) {
          EXPECT_THAT(sample.words, HasSubstr(" m from x_gps and y_gps"));
        }
        EXPECT_EQ(sample.health, HealthLevel::degraded);
        EXPECT_TRUE(sample.inside);
        EXPECT_LT(sample.error, std::max(usual_error, 1.2 * size));
      }
      EXPECT_GE(said, 40) << "in some rides most of its samples fail their gate, and are rejected for some time";
    }
  }
}

TEST_P(OffsetFaults, TwoReceiversThatAgreeAreBelieved) {
  const Fault none{.spoil = [](Delivery&) {}, .length = 200};
  for (const char* noise : {"0.3", "0.03"}) {
    SCOPED_TRACE(noise);
    const Robot two = with_two_receivers(GetParam(), noise);
    for (int seed = 31; seed <= 50; ++seed) {
      SCOPED_TRACE(seed);
      const Episode episode = drive_with_fault(two, none, static_cast<std::uint64_t>(seed), 0);
      for (const Episode::Sample& sample : episode.during) ASSERT_THAT(sample.words, Not(HasSubstr("off")));
    }
  }
}

/// Errors of a cheap receiver last, as by reflections: they are correlated over twenty samples. For some time it is off
/// by as much again and again, and that is no fault of it.
TEST_P(OffsetFaults, AReceiverWhoseErrorsLastIsBelieved) {
  const Robot two = with_two_receivers(GetParam(), "0.3");
  int off = 0, samples = 0;
  for (int seed = 31; seed <= 42; ++seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    std::normal_distribution<double> normal;
    constexpr double correlation = 0.95, sigma = 0.25;
    double error[] = {sigma * normal(random), sigma * normal(random)};
    const auto spoil = [&](Delivery& d) {
      for (const int i : {0, 1}) {
        d.outputs[3 + i] += error[i];
        error[i] = correlation * error[i] + std::sqrt(1.0 - correlation * correlation) * sigma * normal(random);
      }
    };
    const Episode episode = drive_with_fault(two, {.spoil = spoil, .length = 600}, static_cast<std::uint64_t>(seed), 0);
    EXPECT_GE(episode.honest_share(), 0.95) << seed;
    for (const Episode::Sample& sample : episode.during) off += sample.words.find(" off by ") != std::string::npos;
    samples += static_cast<int>(episode.during.size());
  }
  EXPECT_LE(off, 0.12 * samples) << "33 % where innovations are taken for independent";
}

TEST_P(OffsetFaults, NoneIsFoundWhereThereIsNone) {
  const Fault none{.spoil = [](Delivery&) {}, .length = 300};
  for (int seed = 11; seed <= 30; ++seed) {
    SCOPED_TRACE(seed);
    const Episode episode = drive_with_fault(vehicle, none, static_cast<std::uint64_t>(seed));
    for (const Episode::Sample& sample : episode.during) ASSERT_THAT(sample.words, Not(HasSubstr("off")));
  }
}

}  // namespace offset_watch_test
}  // namespace rhec
