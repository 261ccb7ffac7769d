// How much less is known because measurements were lacking, against filters that had all of them.
#include "core/estimation/information_loss.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "core/estimation/log_volume.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace information_loss_test {

using namespace rhec::testing;

constexpr double step = 0.1;
const std::vector<double> both{0.3, 1.1}, none{nan, nan}, first_only{0.3, nan};

double log_volume_of(const WalkingFilter& filter) {
  Eigen::MatrixXd factor = filter.covariance();
  return log_volume(filter.covariance(), factor);
}

/// The judge of a boat; beside it one that always gets all outputs.
struct JudgedBoat {
  std::shared_ptr<const Model> model = linear_model<Boat>();
  WalkingFilter::Setup setup{.noise = {.output_variances = {0.04, 0.01},
                                       .input_variances = {1e-4},
                                       .parameter_lower = {-1e3},
                                       .parameter_upper = {1e3}},
                             .walk = {0.01},
                             .step = step,
                             .substeps = 4};
  WalkingFilter judge{model, setup}, complete{model, setup};
  InformationLoss loss{model, setup};
  const std::vector<double> input{0.2};
  double time = 0.0;

  JudgedBoat() {
    for (WalkingFilter* each : {&judge, &complete}) {
      each->mean() = initial_mean(*model);
      each->covariance() = 0.01 * Eigen::MatrixXd::Identity(4, 4);
    }
    for (int k = 0; k < 50; ++k) take(both, both);
  }
  void move(double duration = step, const double* more_sigmas = nullptr) {
    time += duration;
    loss.predict(judge, input.data(), duration, more_sigmas);
    judge.predict(input.data(), duration, more_sigmas);
  }
  void measure(const std::vector<double>& measured, const std::vector<double>& used) {
    loss.note(time, measured.data());
    loss.update(judge, used.data());
    judge.update(used.data());
  }
  /// The same with what was to be expected.
  void take(const std::vector<double>& measured, const std::vector<double>& used) {
    move();
    measure(measured, used);
    complete.predict(input.data(), step);
    complete.update(both.data());
  }
  double excess() const { return log_volume_of(judge) - log_volume_of(complete); }
};

TEST(InformationLoss, IsNoneWhereAllIsUsed) {
  const JudgedBoat boat;
  EXPECT_FALSE(boat.loss.is_active());
  EXPECT_EQ(boat.loss.excess(), 0.0);
}

/// On a linear model covariances do not depend on what is measured.
TEST(InformationLoss, IsWhatAFilterWithAllMeasurementsKnowsMore) {
  JudgedBoat rejected, missing;
  for (int k = 0; k < 10; ++k) {
    rejected.take(both, first_only);
    missing.take(first_only, first_only);
    EXPECT_NEAR(rejected.loss.excess(), rejected.excess(), 1e-9) << k;
    EXPECT_NEAR(missing.loss.excess(), missing.excess(), 1e-9) << k;
  }
  EXPECT_GT(rejected.loss.excess(), 0.2);
  EXPECT_EQ(rejected.loss.samples_since(), 0);
}

TEST(InformationLoss, EndsOnceAsMuchIsKnownAgain) {
  JudgedBoat boat;
  for (int k = 0; k < 10; ++k) boat.take(both, none);
  int samples = 0;
  for (; boat.loss.is_active() && samples < 200; ++samples) {
    EXPECT_NEAR(boat.loss.excess(), boat.excess(), 1e-9) << samples;
    EXPECT_EQ(boat.loss.samples_since(), samples);
    boat.take(both, both);
  }
  EXPECT_GT(samples, 3);
  EXPECT_LT(samples, 200);
  EXPECT_LT(boat.excess(), 0.05);
  EXPECT_EQ(boat.loss.excess(), 0.0);
}

/// In a silence samples are expected where they would have come, however it is gone through.
TEST(InformationLoss, CountsSamplesThatHaveNotCome) {
  JudgedBoat boat;
  constexpr int silent = 8;
  for (int k = 0; k < silent; ++k) {
    boat.move();
    boat.complete.predict(boat.input.data(), step);
    boat.complete.update(both.data());
  }
  boat.measure(both, both);
  EXPECT_TRUE(boat.loss.is_active());
  // The first sample that does not come shows when the next one is late; until then nothing is lacking.
  EXPECT_NEAR(boat.loss.excess(), boat.excess(), 0.15 * boat.excess());
  EXPECT_GT(boat.excess(), std::log(1.5));
}

TEST(InformationLoss, AnUnknownMotionIsOne) {
  JudgedBoat boat;
  const double more = 2.0;
  boat.move(step, &more);
  boat.measure(both, both);
  boat.complete.predict(boat.input.data(), step);
  boat.complete.update(both.data());
  EXPECT_TRUE(boat.loss.is_active());
  EXPECT_NEAR(boat.loss.excess(), boat.excess(), 1e-9);
}

/// A sensor that measures at every third sample lacks nothing in between; one that ceases to does.
TEST(InformationLoss, ASlowSensorIsNotMissing) {
  JudgedBoat boat;
  boat.loss.reset();
  for (int k = 0; k < 60; ++k) {
    const std::vector<double>& all = k % 3 == 0 ? both : first_only;
    boat.take(all, all);
    EXPECT_FALSE(boat.loss.is_active()) << k;
  }
  boat.take(first_only, first_only);
  EXPECT_TRUE(boat.loss.is_active());
}

TEST(InformationLoss, GoesOnFromWhereTheJudgeIs) {
  JudgedBoat boat;
  boat.take(both, none);
  boat.judge.covariance() *= 4.0;
  boat.loss.follow(boat.judge);
  EXPECT_NEAR(boat.loss.excess(), boat.excess(), 1e-9);
  boat.loss.end();
  EXPECT_EQ(boat.loss.excess(), 0.0);
}

/// Of a parameter that is known no volume is.
TEST(InformationLoss, IsNotToldWhereSomethingIsKnown) {
  JudgedBoat boat;
  boat.judge.covariance().row(3).setZero();
  boat.judge.covariance().col(3).setZero();
  boat.setup.walk = {0.0};
  InformationLoss loss(boat.model, boat.setup);
  loss.note(0.1, both.data());
  loss.update(boat.judge, none.data());
  EXPECT_TRUE(loss.is_active());
  EXPECT_EQ(loss.excess(), 0.0);
}

}  // namespace information_loss_test
}  // namespace rhec
