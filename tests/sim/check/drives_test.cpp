#include "sim/check/drives.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <string>
#include <vector>

#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace drives_test {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

/// The drives of the unicycle, by name.
class DrivesTest : public testing::Test {
 protected:
  const Drive& named(const std::string& name, const ModelCheckOptions& options = {}) {
    options_ = options;
    const CheckedModel checked{*model_, model_->description(), options_, {0.1, 0.1}, {0.1, 0.1}};
    Drives drives(checked);
    drives_ = drives.all();
    duration_ = drives.duration();
    condition_ = drives.condition_of_jacobians(drives_.front());
    for (const Drive& drive : drives_)
      if (drive.name == name) return drive;
    throw Error("no drive " + name);
  }

  const std::unique_ptr<Model> model_ = unicycle();
  ModelCheckOptions options_;
  std::vector<Drive> drives_;
  double duration_ = 0.0, condition_ = 0.0;
};

TEST_F(DrivesTest, ThereAreFourOverTheWholeHorizon) {
  named("straight");
  std::vector<std::string> names;
  for (const Drive& drive : drives_) {
    names.push_back(drive.name);
    EXPECT_EQ(drive.unusable, "");
    EXPECT_EQ(drive.states.cols(), 16);
    EXPECT_EQ(drive.inputs.cols(), 15);
    EXPECT_EQ(drive.outputs.cols(), 16);
    EXPECT_EQ(drive.jacobians.size(), 15U);
    EXPECT_EQ(drive.output_jacobians.size(), 16U);
  }
  EXPECT_THAT(names, ElementsAre("straight", "turn", "slalom", "standing"));
  EXPECT_DOUBLE_EQ(duration_, 15 * 0.2);
  EXPECT_GE(condition_, 1.0);
  named("straight", {.horizon = 1000});
  EXPECT_EQ(drives_.front().inputs.cols(), ModelCheckOptions::longest_horizon);
}

TEST_F(DrivesTest, StraightAheadIsAtTheSpeedThatWasAskedFor) {
  const Drive& drive = named("straight", {.speed = 1.5});
  EXPECT_THAT(drive.meaning, HasSubstr("at 1.5 m/s"));
  for (Eigen::Index k = 0; k < drive.inputs.cols(); ++k) {
    const Eigen::VectorXd moved = drive.states.col(k + 1) - drive.states.col(k);
    EXPECT_NEAR(std::hypot(moved[0], moved[1]), 1.5 * 0.2, 1e-9);
    EXPECT_NEAR(std::atan2(moved[1], moved[0]), drive.states(2, k), 1e-9);
    EXPECT_NEAR(moved[2], 0.0, 1e-12);
  }
}

TEST_F(DrivesTest, StandingStillNothingMoves) {
  const Drive& drive = named("standing");
  EXPECT_THAT(drive.meaning, Not(HasSubstr("m/s")));
  for (Eigen::Index k = 0; k < drive.states.cols(); ++k)
    EXPECT_NEAR((drive.states.col(k) - drive.states.col(0)).norm(), 0.0, 1e-12) << k;
}

TEST_F(DrivesTest, ATurnGoesOnAndASlalomGoesToBothSides) {
  const Drive turn = named("turn"), slalom = named("slalom");
  EXPECT_NEAR(turn.states(3, 0), turn.states(3, 15), 1e-3) << "the turn is steady from its first node on";
  EXPECT_GT(std::abs(turn.states(3, 0)), 0.1);
  EXPECT_GT(slalom.states.row(3).maxCoeff(), 0.1);
  EXPECT_LT(slalom.states.row(3).minCoeff(), -0.1);
  for (const Drive* drive : {&turn, &slalom}) {
    EXPECT_LE(drive->states.row(3).cwiseAbs().maxCoeff(), 0.8) << "within the bounds of the yaw rate";
    EXPECT_LE(drive->inputs.row(1).cwiseAbs().maxCoeff(), 0.8);
  }
}

TEST_F(DrivesTest, AnInputThatWouldDriveAStateTooFarIsLeftOut) {
  const std::unique_ptr<Model> model = unicycle(Fault::rate_is_commanded);
  const ModelCheckOptions options;
  const CheckedModel checked{*model, model->description(), options, {0.1, 0.1}, {0.1, 0.1}};
  for (const Drive& drive : Drives(checked).all()) {
    if (drive.name != "turn" && drive.name != "slalom") continue;
    EXPECT_LE(drive.states.row(3).cwiseAbs().maxCoeff(), 0.4 + 1e-9) << drive.name << ": the inner half of its bounds";
    EXPECT_GT(drive.states.row(3).cwiseAbs().maxCoeff(), 0.2) << drive.name;
  }
}

TEST_F(DrivesTest, SensitivitiesAreThoseOfTheIntervals) {
  const Drive& drive = named("turn");
  constexpr double step = 1e-6, interval = 0.2;
  const double parameters[] = {0.6, 0.6};
  for (int column = 0; column < 4; ++column) {
    Eigen::VectorXd change = Eigen::VectorXd::Zero(4), ends[2] = {change, change};
    for (const int side : {0, 1}) {
      Eigen::VectorXd from = drive.states.col(7);
      from[column] += side == 0 ? -step : step;
      const Eigen::VectorXd inputs = drive.inputs.col(7);
      model_->integrate({.count = 1,
                         .states = from.data(),
                         .inputs = inputs.data(),
                         .parameters = parameters,
                         .durations = &interval,
                         .substeps = 1,
                         .next_states = ends[side].data()});
    }
    change = (ends[1] - ends[0]) / (2.0 * step);
    EXPECT_LT((drive.jacobians[7].col(column) - change).norm(), 1e-8) << column;
  }
}

TEST_F(DrivesTest, ADriveThatIsNotFiniteSaysSo) {
  Spoilt model;
  model.spoil_node = [](const Model::Nodes& q) {
    if (q.outputs) q.outputs[0] = std::nan("");
  };
  const ModelCheckOptions options;
  const CheckedModel checked{model, model.description(), options, {0.1, 0.1}, {0.1, 0.1}};
  for (const Drive& drive : Drives(checked).all()) EXPECT_THAT(drive.unusable, HasSubstr("not finite")) << drive.name;
}

}  // namespace drives_test
}  // namespace rhec::sim
