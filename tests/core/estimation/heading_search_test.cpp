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
    search.start(mean, covariance);
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
