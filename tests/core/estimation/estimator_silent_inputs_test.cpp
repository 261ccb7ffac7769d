// Vehicles of whose inputs nobody says anything, or no more: their sensors say enough.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "rhec/core/base/angle.hpp"
#include "support/sensor_faults.hpp"

namespace rhec {
namespace estimator_silent_inputs_test {

using namespace rhec::testing;

struct Seen {
  bool is_finite = true, has_covariances = true;
  int honest = 0, samples = 0;      ///< while inputs are silent: position and heading within three standard deviations
  int lost = 0;                     ///< of these
  std::vector<double> errors = {};  ///< likewise: of the position [m]
  double widest = 0.0;              ///< likewise: standard deviation of the position [m]
  HealthLevel last = HealthLevel::lost;
  std::string words = {};  ///< of health, while they are silent
};

/// Forty seconds at about 3 m/s, with positions at 5 Hz and a steering angle at 20 Hz. Inputs come until `from` [s],
/// and again from `to` on. `quiet`: nor do positions, for as long [s] from 20 s on. `late`: how late they come [s].
Seen drive(const Robot& vehicle, std::uint64_t seed, double from, double to, double quiet = 0.0, double late = 0.0) {
  constexpr double wheelbase = 1.4, antenna = 0.4, tick = 0.01, settled = 5.0;
  const auto estimator = vehicle.make_estimator();
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise;
  Eigen::Vector4d truth(0.0, 0.0, 0.1, 0.0);
  std::deque<std::pair<double, std::vector<double>>> on_the_way;
  Seen seen;
  for (int i = 0; i < 4000; ++i) {
    const double time = tick * i, speed = 3.0 + std::sin(0.3 * time), rate = 0.15 * std::cos(0.5 * time);
    const bool is_silent = time >= from && time < to;
    if (i % 20 == 0 && !is_silent) estimator->push_input(time, std::vector<double>{speed, rate}.data());
    if (i % 5 == 1)
      estimator->push_measurement(time, std::vector<double>{nan, nan, truth[3] + 0.01 * noise(random)}.data());
    if (i % 20 == 13 && (time < 20.0 || time >= 20.0 + quiet))
      on_the_way.emplace_back(time,
                              std::vector<double>{truth[0] - antenna * std::cos(truth[2]) + 0.03 * noise(random),
                                                  truth[1] - antenna * std::sin(truth[2]) + 0.03 * noise(random), nan});
    for (; !on_the_way.empty() && on_the_way.front().first + late <= time; on_the_way.pop_front())
      estimator->push_measurement(on_the_way.front().first, on_the_way.front().second.data());
    if (i % 20 == 19) {
      const Estimate& now = estimator->estimate(time);
      seen.is_finite = seen.is_finite && now.state.allFinite() && now.covariance.allFinite();
      if (!seen.is_finite) return seen;
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(now.covariance, Eigen::EigenvaluesOnly);
      seen.has_covariances = seen.has_covariances && eigen.eigenvalues()[0] >= -1e-12 * eigen.eigenvalues().maxCoeff();
      seen.last = now.health.level;
      if (is_silent && time >= from + settled) {
        const Eigen::Vector2d away = now.state.head<2>() - truth.head<2>();
        const double turned = std::abs(angle_difference(now.state[2], truth[2]));
        const double nis = away.dot(now.covariance.topLeftCorner(2, 2).ldlt().solve(away));
        ++seen.samples;
        seen.honest += nis <= 11.83 && turned <= 3.0 * std::sqrt(now.covariance(2, 2));
        seen.lost += now.health.level == HealthLevel::lost;
        seen.errors.push_back(away.norm());
        seen.widest = std::max(seen.widest, std::sqrt(now.covariance(0, 0) + now.covariance(1, 1)));
        seen.words = estimator->watch()->in_words(now.health);
      }
    }
    truth += tick * Eigen::Vector4d(0.9 * speed * std::cos(truth[2]), 0.9 * speed * std::sin(truth[2]),
                                    0.9 * speed / wheelbase * std::tan(0.9 * truth[3]), rate);
  }
  std::ranges::sort(seen.errors);
  return seen;
}

struct SilentInputs : ::testing::TestWithParam<const char*> {
  Robot vehicle = [] {
    const std::string name = GetParam();
    Settings settings = watched_settings(name == "blocks" || name == "full_horizon" ? "rhe" : name, "");
    apply_assignment(settings, "estimator.initial.parameters={kappa: 0.8, mu: 0.8}");
    apply_assignment(settings,
                     "estimator.initial.sigma={x_pos: 0.05, y_pos: 0.05, beta: 0.2, delta: 0.02, kappa: 0.2, mu: 0.2}");
    if (name == "blocks") apply_assignment(settings, "blocking={kappa: {name: structured}, mu: {name: structured}}");
    if (name == "full_horizon")
      apply_assignment(settings, "blocking={kappa: {name: full_horizon}, mu: {name: full_horizon}}");
    return Robot(host(), RobotOptions::table().parse(settings, "robot"));
  }();

  void expect_found(double from, double to) {
    int honest = 0, samples = 0;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      SCOPED_TRACE(seed);
      const Seen seen = drive(vehicle, seed, from, to);
      ASSERT_TRUE(seen.is_finite);
      EXPECT_TRUE(seen.has_covariances);
      EXPECT_EQ(seen.lost, 0);
      EXPECT_LT(seen.errors[seen.errors.size() / 2], 0.12);
      EXPECT_LT(seen.errors.back(), 0.6);
      EXPECT_LT(seen.widest, 0.6);
      EXPECT_NE(seen.words.find("inputs silent"), std::string::npos) << seen.words;
      honest += seen.honest;
      samples += seen.samples;
      EXPECT_EQ(seen.last, to < 35.0 ? HealthLevel::ok : HealthLevel::degraded);
    }
    EXPECT_GT(honest, 0.93 * samples);
  }
};

TEST_P(SilentInputs, OfAVehicleAreWhatItsPositionsTell) { expect_found(0.0, 1e9); }
TEST_P(SilentInputs, MayBecomeSo) { expect_found(10.0, 1e9); }
TEST_P(SilentInputs, MayComeAgain) { expect_found(8.0, 25.0); }

/// What was known of them goes back with the state.
TEST_P(SilentInputs, AreFoundFromPositionsThatComeLate) {
  std::vector<double> errors;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    const Seen seen = drive(vehicle, seed, 10.0, 1e9, 0.0, 0.5);
    ASSERT_TRUE(seen.is_finite);
    EXPECT_TRUE(seen.has_covariances);
    EXPECT_EQ(seen.lost, 0);
    EXPECT_LT(seen.errors.back(), 1.2);
    EXPECT_GT(seen.honest, 0.9 * seen.samples);
    errors.insert(errors.end(), seen.errors.begin(), seen.errors.end());
  }
  std::ranges::sort(errors);
  EXPECT_LT(errors[errors.size() / 2], 0.25);
}

/// An error of the last speed that was found adds up.
TEST_P(SilentInputs, WithoutPositionsLetTheVehicleBeAnywhere) {
  int honest = 0, samples = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    const Seen seen = drive(vehicle, seed, 10.0, 1e9, 8.0);
    ASSERT_TRUE(seen.is_finite);
    EXPECT_TRUE(seen.has_covariances);
    EXPECT_GT(seen.widest, 5.0);
    EXPECT_LT(seen.errors[seen.errors.size() / 2], 0.2);
    honest += seen.honest;
    samples += seen.samples;
  }
  EXPECT_GT(honest, 0.93 * samples);
}

struct SilentVehicle : ::testing::TestWithParam<const char*> {};

/// Behind a silence of twelve seconds the compass speaks first: it says where the vehicle heads, and not where it is.
TEST_P(SilentVehicle, IsNotMovedByWhatItsCompassSays) {
  constexpr double tick = 0.01, wheel_radius = 0.2, track = 0.6, from = 20.0, to = 32.0;
  Settings settings = with_compass_settings(GetParam());
  apply_assignment(settings, "model.track_width=0.6");
  const Robot vehicle(host(), RobotOptions::table().parse(settings, "robot"));
  const auto estimator = vehicle.make_estimator();
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise;
  Eigen::Vector3d truth = Eigen::Vector3d::Zero();
  Eigen::Vector2d before = Eigen::Vector2d::Zero();
  double moved = 0.0, fixed = 0.0;
  for (int i = 0; i < 3600; ++i) {
    const double time = tick * i, turn = 0.8 * std::sin(0.3 * time), left = 10.0 - turn, right = 10.0 + turn;
    if (!(time >= from && time < to)) {
      if (i % 5 == 0) estimator->push_input(time, std::vector<double>{left, right}.data());
      if (i % 10 == 4)
        estimator->push_measurement(time, std::vector<double>{nan, nan, truth[2] + 0.02 * noise(random)}.data());
      if (i % 100 == 80)
        estimator->push_measurement(
            time, std::vector<double>{truth[0] + 0.03 * noise(random), truth[1] + 0.03 * noise(random), nan}.data());
    }
    if (i % 20 == 19) {
      const Estimate& now = estimator->estimate(time);
      const double error = (now.state.head<2>() - truth.head<2>()).norm();
      const bool is_placed = time < from || time > to + 0.8;
      if (!is_placed) moved = std::max(moved, (now.state.head<2>() - before).norm());
      before = now.state.head<2>();
      if (time > to + 2.0) fixed = std::max(fixed, error);
    }
    const double speed = 0.5 * wheel_radius * (left + right);
    truth += tick * Eigen::Vector3d(speed * std::cos(truth[2]), speed * std::sin(truth[2]),
                                    wheel_radius * (right - left) / track);
  }
  EXPECT_LT(moved, 3.0);
  EXPECT_LT(fixed, 0.5);
}

INSTANTIATE_TEST_SUITE_P(All, SilentVehicle, ::testing::Values("ekf", "bank", "rhe"),
                         [](const auto& each) { return std::string(each.param); });

INSTANTIATE_TEST_SUITE_P(All, SilentInputs, ::testing::Values("ekf", "bank", "rhe", "full_horizon", "blocks"),
                         [](const auto& each) { return std::string(each.param); });

}  // namespace estimator_silent_inputs_test
}  // namespace rhec
