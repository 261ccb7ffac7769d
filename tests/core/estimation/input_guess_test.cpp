#include "rhec/core/estimation/input_guess.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <vector>

#include "support/largest.hpp"

namespace rhec {
namespace input_guess_test {

using testing::largest;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct Inputs : ::testing::Test {
  const std::vector<Variable> about = {
      {.name = "speed", .unit = "m/s", .meaning = "of the wheels", .scale = 2.0},
      {.name = "turning", .unit = "rad/s", .meaning = "of the wheel", .lower = -0.5, .upper = 0.5, .scale = 0.3}};
  InputGuess guess{about, 2};
  const Eigen::Matrix2d P = (Eigen::Matrix2d() << 2.0, 0.3, 0.3, 1.0).finished();
};

TEST_F(Inputs, WalkFromWhereTheyWereMeasured) {
  const double measured[] = {3.0, nan}, missing[] = {nan, nan};
  guess.begin(measured, 0.5, P);
  EXPECT_TRUE(guess.is_any_missing());
  EXPECT_FALSE(guess.is_missing(0));
  EXPECT_EQ(guess.covariance()(0, 0), 0.0);
  EXPECT_NEAR(guess.covariance()(1, 1), 0.5 * 0.5, 1e-15);  // half of the range, not three typical magnitudes
  guess.begin(missing, 0.5, P);
  EXPECT_EQ(guess.mean(0), 3.0);
  EXPECT_NEAR(guess.covariance()(0, 0), 2.0 * 2.0 * 0.5, 1e-15);
  for (int k = 0; k < 100; ++k) guess.begin(missing, 0.5, P);
  EXPECT_NEAR(guess.covariance()(0, 0), 6.0 * 6.0, 1e-12);
  guess.begin(measured, 0.5, P);
  EXPECT_EQ(guess.covariance()(0, 0), 0.0);
}

/// An input that goes from one stop to the other is not known for long.
TEST(InputWalk, WalksByWhatItWasSeenToChange) {
  const Variable about{.name = "rate", .unit = "rad/s", .meaning = "of steering", .scale = 0.3};
  InputWalk walk(about);
  EXPECT_DOUBLE_EQ(walk.growth(0.2), 0.3 * 0.3 * 0.2);
  for (int k = 0; k < 500; ++k) walk.see(k / 10 % 2 == 0 ? 0.6 : -0.6, 0.2);
  EXPECT_NEAR(walk.growth(1.0), 1.2 * 1.2 / 2.0, 0.15) << "by 1.2 every two seconds";
  std::vector<double> saved(InputWalk::state_size);
  walk.save(saved.data());
  const double busy = walk.growth(1.0);
  // What is missing says nothing, and one value behind it neither.
  for (int k = 0; k < 20; ++k) walk.see(nan, 0.2);
  walk.see(100.0, 0.2);
  EXPECT_EQ(walk.growth(1.0), busy);
  for (int k = 0; k < 500; ++k) walk.see(100.0, 0.2);
  EXPECT_DOUBLE_EQ(walk.growth(1.0), 0.3 * 0.3) << "never less than its typical magnitude";
  walk.restore(saved.data());
  EXPECT_EQ(walk.growth(1.0), busy);
  walk.forget();
  EXPECT_DOUBLE_EQ(walk.growth(1.0), 0.3 * 0.3);
}

TEST(InputWalk, DoesNotChangeByMoreThanItCan) {
  const Variable about{
      .name = "rate", .unit = "rad/s", .meaning = "of steering", .lower = -0.5, .upper = 0.5, .scale = 0.3};
  InputWalk walk(about);
  for (const double measured : {0.0, HUGE_VAL, -HUGE_VAL, 1e300, 0.0, 0.0}) {
    walk.see(measured, 1.0);
    EXPECT_LE(walk.growth(1.0), 1.0);
  }
  EXPECT_TRUE(std::isfinite(walk.growth(1.0)));
}

TEST(InputWalk, IsNotMadeOfNoise) {
  const Variable about{.name = "speed", .unit = "m/s", .meaning = "of the wheels", .scale = 0.5};
  InputWalk walk(about);
  for (int k = 0; k < 5000; ++k) walk.see(3.0 + (k % 2 == 0 ? 0.1 : -0.1), 0.01);
  EXPECT_LT(walk.growth(1.0), 1.2 * 0.5 * 0.5);
}

/// An update of the state is one of the joint Gaussian.
TEST_F(Inputs, LearnWithTheState) {
  const double missing[] = {nan, nan};
  guess.begin(missing, 0.2, P);
  const Eigen::Matrix2d V = (Eigen::Matrix2d() << 1.0, 0.05, 0.05, 0.1).finished(),
                        C = (Eigen::Matrix2d() << 0.7, 0.1, -0.2, 0.15).finished();
  for (int j = 0; j < 2; ++j) {
    guess.set(j, 0.1 + 0.1 * j);
    for (int k = 0; k < 2; ++k) guess.set_covariance(j, k, V(j, k));
    for (int r = 0; r < 2; ++r) guess.set_with_state(r, j, C(r, j));
  }
  Eigen::Matrix4d joint;
  joint << P, C, C.transpose(), V;
  Eigen::Vector4d mean(1.0, 2.0, 0.1, 0.2);
  guess.predicted(mean.head<2>(), P);
  for (const Eigen::Vector4d& h : {Eigen::Vector4d(1.0, 0.2, 0.0, 0.0), Eigen::Vector4d(0.1, -1.0, 0.0, 0.0)}) {
    const double S = h.dot(joint * h) + 0.04, innovation = 0.15;
    const Eigen::Vector4d gain = joint * h / S;
    mean += gain * innovation;
    joint -= gain * S * gain.transpose();
    guess.updated(mean.head<2>(), joint.topLeftCorner<2, 2>());
    for (int j = 0; j < 2; ++j) EXPECT_NEAR(guess.mean(j), mean[2 + j], 1e-12);
    EXPECT_LT(largest(guess.covariance() - joint.bottomRightCorner<2, 2>()), 1e-12);
    EXPECT_LT(largest(guess.with_state() - joint.topRightCorner<2, 2>()), 1e-12);
  }
}

/// Somebody knows the state better than the filter did.
TEST_F(Inputs, AreNotKnownByMoreThanThereIs) {
  const double missing[] = {nan, nan};
  guess.begin(missing, 0.2, P);
  guess.set_with_state(0, 0, 5.0);
  guess.set_with_state(1, 0, 1.0);
  guess.predicted(Eigen::Vector2d::Zero(), 10.0 * P);
  const Eigen::Matrix2d less = 0.01 * P;
  guess.begin(missing, 0.2, less);
  Eigen::MatrixXd joint(4, 4);
  joint << less, guess.with_state(), guess.with_state().transpose(), guess.covariance();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(joint);
  EXPECT_GT(eigen.eigenvalues()[0], 0.0);
  EXPECT_GT(guess.with_state()(0, 0), 0.0);
}

TEST_F(Inputs, AreKeptAndTakenUpAgain) {
  const double missing[] = {nan, nan}, measured[] = {1.0, 0.1};
  guess.begin(missing, 0.2, P);
  guess.set(0, 4.0);
  guess.set_with_state(1, 0, 0.2);
  std::vector<double> kept(guess.state_size());
  guess.save(kept.data());
  const Eigen::MatrixXd V = guess.covariance();
  guess.begin(measured, 0.2, P);
  guess.restore(kept.data());
  EXPECT_EQ(guess.mean(0), 4.0);
  EXPECT_EQ(guess.covariance(), V);
  EXPECT_EQ(guess.with_state()(1, 0), 0.2);
}

}  // namespace input_guess_test
}  // namespace rhec
