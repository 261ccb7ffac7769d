// Vehicles that are not where they were said to begin, or of which nobody has said where they head.
#include "rhec/core/estimation/sensor_watch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "rhec/core/base/angle.hpp"
#include "support/sensor_faults.hpp"

namespace rhec {
namespace sensor_start_test {

using namespace rhec::testing;

/// Said to begin at the origin, known to half a metre, with a heading known to this [rad].
Robot robot(const std::string& estimator, double heading) {
  Settings settings = watched_settings(estimator, "");
  apply_assignment(settings, "estimator.initial.sigma={x_pos: 0.5, y_pos: 0.5, beta: " + std::to_string(heading) +
                                 ", delta: 0.02, kappa: 0.3, mu: 0.3}");
  return {host(), RobotOptions::table().parse(settings, "robot")};
}

struct Seen {
  double worst = 0.0;         ///< error of the position while health was ok [m]
  double last = 0.0;          ///< at the end [m]
  double worst_sigmas = 0.0;  ///< error by standard deviation, at the end
  bool has_variances = true;  ///< all were positive
  bool was_ok_at_the_end = false;
};

/// Ten seconds, with positions at 5 Hz between the nodes. `first_off`: error of the first one [m].
Seen drive(const Robot& vehicle, double x, double y, double first_off) {
  constexpr double speed = 3.0, wheelbase = 1.4, antenna = 0.4, tick = 0.01;
  const auto estimator = vehicle.make_estimator();
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise;
  Eigen::Vector4d truth(x, y, 0.1, 0.0);
  Seen seen;
  for (int i = 0; i < 1000; ++i) {
    const double time = tick * i, rate = 0.15 * std::cos(0.5 * time);
    if (i % 20 == 0) estimator->push_input(time, std::vector<double>{speed, rate}.data());
    if (i % 5 == 1)
      estimator->push_measurement(time, std::vector<double>{nan, nan, truth[3] + 0.01 * noise(random)}.data());
    if (i % 20 == 13) {
      const double off = i < 20 ? first_off : 0.0;
      estimator->push_measurement(
          time, std::vector<double>{truth[0] - antenna * std::cos(truth[2]) + 0.03 * noise(random) + off,
                                    truth[1] - antenna * std::sin(truth[2]) + 0.03 * noise(random), nan}
                    .data());
    }
    if (i % 10 == 9) {
      const Estimate& now = estimator->estimate(time);
      const double error = (now.state.head<2>() - truth.head<2>()).norm();
      seen.has_variances = seen.has_variances && now.covariance.diagonal().minCoeff() > 0.0;
      if (now.health.level == HealthLevel::ok && i > 40) seen.worst = std::max(seen.worst, error);
      seen.last = error;
      seen.worst_sigmas = error / std::sqrt(now.covariance(0, 0) + now.covariance(1, 1));
      seen.was_ok_at_the_end = now.health.level == HealthLevel::ok;
    }
    truth += tick * Eigen::Vector4d(0.9 * speed * std::cos(truth[2]), 0.9 * speed * std::sin(truth[2]),
                                    0.9 * speed / wheelbase * std::tan(0.9 * truth[3]), rate);
  }
  return seen;
}

class Starts : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(All, Starts, ::testing::Values("ekf", "bank", "rhe"), name_of_estimator);

TEST_P(Starts, AreWhereTheFirstPositionSays) {
  for (const double heading : {0.5, 3.0})
    for (const double far : {0.0, 30.0, 3000.0, 5e6}) {
      SCOPED_TRACE(std::to_string(heading) + " rad, " + std::to_string(far) + " m");
      const Seen seen = drive(robot(GetParam(), heading), 0.1 * far, far, 0.0);
      EXPECT_TRUE(seen.has_variances);
      EXPECT_TRUE(seen.was_ok_at_the_end);
      EXPECT_LT(seen.worst, 1.0);
      EXPECT_LT(seen.last, 0.3);
      EXPECT_LT(seen.worst_sigmas, 4.0);
    }
}

TEST_P(Starts, AreNotWhereAWrongFirstPositionSays) {
  for (const double off : {100.0, 1000.0, 1e6}) {
    SCOPED_TRACE(off);
    const Seen seen = drive(robot(GetParam(), 0.5), 0.0, 0.0, off);
    EXPECT_TRUE(seen.has_variances);
    EXPECT_TRUE(seen.was_ok_at_the_end);
    EXPECT_LT(seen.worst, 1.0);
    EXPECT_LT(seen.last, 0.3);
  }
}

struct Standing {
  int standing_and_lost = 0, standing = 0;  ///< samples
  int honest = 0, samples = 0;              ///< heading and place within three standard deviations, or health not ok
  double known_after = 1e9;                 ///< it drives off, health is ok to the end [s]
  double error = 0.0;                       ///< of the heading at the end [rad]
};

/// Stands for 20 s, and drives for 20 s. Nobody says where it heads; its positions come 0.12 s late beside an encoder
/// of the steering, and are those of an antenna behind the axle. `spikes`: some are 50 m off.
Standing stand_and_drive(const std::string& estimator_name, std::uint64_t seed, bool spikes) {
  constexpr double speed = 2.0, wheelbase = 1.4, antenna = 0.4, tick = 0.01, drives_off = 20.0;
  Settings settings = watched_settings(estimator_name, "");
  apply_assignment(settings, "estimator.initial={parameters: {kappa: 0.8, mu: 0.8}}");
  const auto estimator = Robot(host(), RobotOptions::table().parse(settings, "robot")).make_estimator();
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise;
  Eigen::Vector4d truth(40.0, -30.0, std::uniform_real_distribution<double>(-3.0, 3.0)(random), 0.0);
  std::deque<std::pair<double, std::vector<double>>> on_the_way;
  Standing seen;
  double ok_since = 1e9;
  for (int i = 0; i < 4000; ++i) {
    const double time = tick * i, driven = std::max(0.0, time - drives_off), v = driven > 0.0 ? speed : 0.0,
                 rate = driven > 0.0 ? 0.15 * std::cos(0.5 * driven) : 0.0;
    if (i % 20 == 0) estimator->push_input(time, std::vector<double>{v, rate}.data());
    if (i % 5 == 1)
      estimator->push_measurement(time, std::vector<double>{nan, nan, truth[3] + 0.01 * noise(random)}.data());
    if (i % 20 == 13) {
      const double off = spikes && i % 500 == 13 ? 50.0 : 0.0;
      on_the_way.emplace_back(time,
                              std::vector<double>{truth[0] - antenna * std::cos(truth[2]) + 0.03 * noise(random) + off,
                                                  truth[1] - antenna * std::sin(truth[2]) + 0.03 * noise(random), nan});
    }
    for (; !on_the_way.empty() && on_the_way.front().first + 0.12 <= time; on_the_way.pop_front())
      estimator->push_measurement(on_the_way.front().first, on_the_way.front().second.data());
    if (i % 10 == 9) {
      const Estimate& now = estimator->estimate(time);
      const bool is_ok = now.health.level == HealthLevel::ok;
      const Eigen::Vector2d away = now.state.head<2>() - truth.head<2>();
      const double turned = std::abs(angle_difference(now.state[2], truth[2]));
      const double nis = away.dot(now.covariance.topLeftCorner(2, 2).ldlt().solve(away));
      if (driven == 0.0) {
        ++seen.standing;
        seen.standing_and_lost += now.health.level == HealthLevel::lost;
      }
      ++seen.samples;
      seen.honest += !is_ok || (nis <= 11.83 && turned <= 3.0 * std::sqrt(now.covariance(2, 2)));
      ok_since = is_ok ? std::min(ok_since, driven) : 1e9;
      seen.error = turned;
    }
    truth += tick * Eigen::Vector4d(0.9 * v * std::cos(truth[2]), 0.9 * v * std::sin(truth[2]),
                                    0.9 * v / wheelbase * std::tan(0.9 * truth[3]), rate);
  }
  seen.known_after = ok_since;
  return seen;
}

/// It was sure of a heading after a second, and ok: lever arms are not linear.
TEST_P(Starts, KnowNoHeadingBeforeTheVehicleMoves) {
  for (const bool spikes : {false, true}) {
    int honest = 0, samples = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      SCOPED_TRACE(std::to_string(seed) + (spikes ? ", spikes" : ""));
      const Standing seen = stand_and_drive(GetParam(), seed, spikes);
      EXPECT_EQ(seen.standing_and_lost, seen.standing);
      EXPECT_LT(seen.known_after, spikes ? 20.0 : 6.0);
      EXPECT_LT(seen.error, 0.1);
      honest += seen.honest;
      samples += seen.samples;
    }
    EXPECT_GT(honest, 0.98 * samples);
  }
}

/// A receiver is silent for 30 s; the vehicle is lost meanwhile, stops, and stands there when its fixes come back. They
/// say where it is, and nothing where it heads.
TEST_P(Starts, SayThatAHeadingIsNotKnownAnyMoreWhereThePlaceIs) {
  constexpr double speed = 2.0, wheelbase = 1.4, antenna = 0.4, tick = 0.01, stops = 40.0, returns = 45.0,
                   goes_on = 52.0;
  const auto estimator = robot(GetParam(), 0.1).make_estimator();
  std::mt19937_64 random(6);
  std::normal_distribution<double> noise;
  Eigen::Vector4d truth(0.0, 0.0, 0.0, 0.0);
  double ok_since = 1e9;
  for (int i = 0; i < 6500; ++i) {
    const double time = tick * i, rate = 0.15 * std::cos(0.5 * time);
    const double wheels = time < stops || time > goes_on ? speed : 0.0;
    if (i % 20 == 0) estimator->push_input(time, std::vector<double>{wheels, rate}.data());
    if (i % 5 == 1)
      estimator->push_measurement(time, std::vector<double>{nan, nan, truth[3] + 0.01 * noise(random)}.data());
    if (i % 20 == 13 && (time < 10.0 || time > returns))
      estimator->push_measurement(
          time, std::vector<double>{truth[0] - antenna * std::cos(truth[2]) + 0.03 * noise(random),
                                    truth[1] - antenna * std::sin(truth[2]) + 0.03 * noise(random), nan}
                    .data());
    truth[0] += tick * 0.8 * wheels * std::cos(truth[2]);
    truth[1] += tick * 0.8 * wheels * std::sin(truth[2]);
    truth[2] += tick * 0.8 * wheels / wheelbase * std::tan(0.8 * truth[3]);
    truth[3] += tick * rate;
    if (i % 20 != 19) continue;
    const Health& health = estimator->estimate(time).health;
    SCOPED_TRACE(time);
    const bool is_lost = health.level == HealthLevel::lost, is_sought = (health.reasons & reason::heading) != 0;
    if (time < 9.0 || health.level == HealthLevel::ok) {
      EXPECT_FALSE(is_lost || is_sought);
    } else if (time > stops && time < goes_on && std::abs(time - returns - 0.5) > 0.5) {
      EXPECT_TRUE(is_lost);
      EXPECT_EQ(is_sought, time > returns);
    }
    if (time > goes_on) ok_since = health.level == HealthLevel::ok ? std::min(ok_since, time) : 1e9;
  }
  EXPECT_LT(ok_since, goes_on + 6.0);
}

}  // namespace sensor_start_test
}  // namespace rhec
