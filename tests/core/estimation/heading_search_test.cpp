#include "core/estimation/heading_search.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "rhec/core/base/angle.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace heading_search_test {

using namespace rhec::testing;

struct Drive {
  std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  WalkingFilter::Setup setup{.noise = {.output_variances = {9e-4, 9e-4, 3e-4},
                                       .input_variances = {0.01, 0.01},
                                       .parameter_lower = {0.0, 0.0},
                                       .parameter_upper = {1.0, 1.0}},
                             .walk = {0.03, 0.03},
                             .step = 0.2};
  HeadingSearch search{model, setup, 3.0};
  std::vector<Sensor> sensors = sensors_of(model->description(), setup.noise.output_variances);

  /// Starts at a heading that nobody knows; returns after how many samples it was found, or -1.
  int drive(double heading, double speed, std::mt19937& random, double& error) {
    std::normal_distribution<double> noise;
    Eigen::VectorXd x = Eigen::Vector4d(3.0, -2.0, heading, 0.1);
    const std::vector<double> slip{0.8, 0.9}, inputs{speed, 0.05};
    Eigen::VectorXd mean(6);
    mean << x[0], x[1], 0.0, x[3], 0.7, 0.8;
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(6, 6);
    covariance.diagonal() << 1e-3, 1e-3, 10.0, 1e-3, 0.04, 0.04;
    search.start(mean, covariance, nullptr);
    for (int k = 1; k <= 40; ++k) {
      const double duration = 0.2;
      Eigen::VectorXd next(4);
      model->integrate({.count = 1,
                        .states = x.data(),
                        .inputs = inputs.data(),
                        .parameters = slip.data(),
                        .durations = &duration,
                        .substeps = 4,
                        .next_states = next.data()});
      x = next;
      std::vector<double> y(3);
      model->observe({.count = 1, .states = x.data(), .outputs = y.data()});
      for (std::size_t j = 0; j < y.size(); ++j) y[j] += std::sqrt(setup.noise.output_variances[j]) * noise(random);
      search.predict(inputs.data(), duration);
      if (!search.update(sensors, y.data())) continue;
      error = std::abs(angle_difference(search.best().mean()[2], x[2]));
      return k;
    }
    return -1;
  }
};

TEST(HeadingSearch, FindsAnyHeading) {
  Drive drive;
  std::mt19937 random(7);
  for (int i = 0; i < 24; ++i) {
    double error = 0.0;
    const int samples = drive.drive(2.0 * std::numbers::pi * i / 24, 1.0 + i % 4 * 2.0, random, error);
    EXPECT_GT(samples, 1) << i;
    EXPECT_LT(samples, 20) << i;
    EXPECT_LT(error, 0.15) << i;
    EXPECT_FALSE(drive.search.is_active());
  }
}

/// An antenna is not where the vehicle is, and noise is no motion.
TEST(HeadingSearch, OfOneThatStandsForAnHourItKnowsNothing) {
  Drive drive;
  drive.model = host().make_model("bicycle_slip", parse_yaml("{wheelbase: 1.4, gps_offset: 0.5}", "model"));
  HeadingSearch search(drive.model, drive.setup, 3.0);
  std::mt19937 random(11);
  std::normal_distribution<double> noise;
  const auto measured = [&] {
    return std::vector<double>{7.0 + 0.03 * noise(random), 4.0 + 0.03 * noise(random), 0.02 * noise(random)};
  };
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(6);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(6, 6);
  mean.tail(2).setConstant(0.8);
  covariance.diagonal() << 1.0, 1.0, 10.0, 0.01, 0.04, 0.04;
  search.start(mean, covariance, measured().data());
  const std::vector<double> inputs{0.0, 0.0};
  double least = infinity;
  for (int k = 0; k < 18000; ++k) {
    search.predict(inputs.data(), 0.2);
    ASSERT_FALSE(search.update(drive.sensors, measured().data())) << k;
    search.moments(mean, covariance);
    least = std::min(least, covariance(2, 2));
    // Somewhere on a circle around the antenna.
    ASSERT_NEAR(std::hypot(mean[0] - 7.0, mean[1] - 4.0), 0.5, 0.1) << k;
    ASSERT_GT(covariance(0, 0) + covariance(1, 1), 0.04) << k;
  }
  EXPECT_GT(least, 1.0);
}

TEST(HeadingSearch, APositionThatNoHeadingExplainsIsNotUsedUnlessItStays) {
  Drive drive;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(6);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(6, 6);
  mean.tail(2).setConstant(0.8);
  covariance.diagonal() << 1.0, 1.0, 10.0, 0.01, 0.04, 0.04;
  HeadingSearch& search = drive.search;
  const std::vector<double> inputs{0.0, 0.0}, here{0.0, 0.0, 0.0}, far{100.0, 0.0, 0.0};
  search.start(mean, covariance, here.data());
  const auto step = [&](const std::vector<double>& outputs) {
    search.predict(inputs.data(), 0.2);
    search.update(drive.sensors, outputs.data());
    search.moments(mean, covariance);
  };
  for (int k = 0; k < 5; ++k) step(here);
  for (int k = 0; k < 10; ++k) {
    step(far);
    EXPECT_LT(mean[0], 1.0) << k;
  }
  step(here);
  EXPECT_LT(mean[0], 1.0);
  for (int k = 0; k < 15; ++k) step(far);
  EXPECT_NEAR(mean[0], 100.0, 1.0);
  EXPECT_GT(covariance(2, 2), 1.0) << "and nothing is known of where it heads";
}

/// What is known of a heading is no more than that, and no less.
TEST(HeadingSearch, BeginsWithWhatIsKnownOfTheHeading) {
  Drive drive;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(6);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(6, 6);
  for (const double sigma : {0.5, 0.8}) {
    mean.setZero();
    mean[2] = 1.0;
    covariance.setIdentity();
    drive.search.start(mean, covariance, std::vector<double>{0.0, 0.0, 0.0}.data(), sigma);
    drive.search.moments(mean, covariance);
    EXPECT_NEAR(mean[2], 1.0, 1e-12);
    EXPECT_NEAR(std::sqrt(covariance(2, 2)), sigma, 0.1);
  }
}

TEST(HeadingSearch, OfOneThatStandsItKnowsNothing) {
  Drive drive;
  std::mt19937 random(7);
  double error = 0.0;
  EXPECT_EQ(drive.drive(1.0, 0.0, random, error), -1);
  EXPECT_TRUE(drive.search.is_active());
  drive.search.cancel();
  EXPECT_FALSE(drive.search.is_active());
}

}  // namespace heading_search_test
}  // namespace rhec
