// An initial guess for smoothing: poses from motions and positions alone, whatever the track's previous headings.
#include "core/estimation/track_alignment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "rhec/plugins/host/host.hpp"

namespace rhec {
namespace track_alignment_test {

constexpr int nodes = 401, gap_start = 200, gap_end = 230;

/// A vehicle, its inputs and its slip.
struct Vehicle {
  const char* model = "bicycle_slip";
  std::vector<double> (*inputs)(int) = [](int k) { return std::vector<double>{3.0, 0.15 * std::cos(0.15 * k)}; };
  std::vector<double> slip = {0.95, 0.9}, believed = {1.0, 1.0};
};

/// A vehicle on a winding drive of 80 s, with a position at every second node, some of them 50 m off, and a gap.
class TrackAlignment : public ::testing::Test {
 protected:
  explicit TrackAlignment(const Vehicle& vehicle = {}) : model_(Host().make_model(vehicle.model)) {
    const Roles& roles = model_->description().roles;
    x_ = roles.position_x;
    y_ = roles.position_y;
    heading_ = roles.heading;
    RheProblem::Setup setup;
    setup.max_intervals = nodes - 1;
    setup.output_weights.assign(model_->output_count(), 400.0);
    setup.input_weights.assign(model_->input_count(), 100.0);
    problem_ = std::make_unique<RheProblem>(model_, setup);
    problem_->set_intervals(nodes - 1);
    const int nx = model_->state_count();
    std::vector<double> state(nx, 0.0), next(nx), outputs(model_->output_count());
    state[heading_] = 2.9;
    for (int k = 0; k < nodes; ++k) {
      truth_.insert(truth_.end(), state.begin(), state.end());
      Model::Nodes observation;
      observation.count = 1;
      observation.states = state.data();
      observation.outputs = outputs.data();
      model_->observe(observation);
      for (int j = 0; j < model_->output_count(); ++j) problem_->output(k)[j] = std::nan("");
      if (k % 2 == 0 && (k < gap_start || k > gap_end)) {
        const double jump = k % 40 == 14 ? 50.0 : 0.0;
        problem_->output(k)[0] = outputs[0] + 0.05 * normal() + jump;
        problem_->output(k)[1] = outputs[1] + 0.05 * normal();
      }
      if (k == nodes - 1) break;
      const std::vector<double> inputs = vehicle.inputs(k);
      const double duration = 0.2;
      problem_->set_duration(k, duration);
      Model::Intervals request;
      request.count = 1;
      request.states = state.data();
      request.inputs = inputs.data();
      request.parameters = vehicle.slip.data();
      request.durations = &duration;
      request.next_states = next.data();
      model_->integrate(request);
      state = next;
      inputs_.insert(inputs_.end(), inputs.begin(), inputs.end());
      parameters_.insert(parameters_.end(), vehicle.believed.begin(), vehicle.believed.end());  // slip is unknown
    }
    states_ = truth_;
  }
  /// Removes the positions of a stretch longer than any piece of track.
  void lose_positions() {
    for (int k = 80; k < nodes - 80; ++k)
      for (int j = 0; j < model_->output_count(); ++j) problem_->output(k)[j] = std::nan("");
  }
  double normal() { return std::normal_distribution<double>()(random_); }
  double& of(std::vector<double>& states, int node, int j) const {
    return states[static_cast<std::size_t>(node) * model_->state_count() + j];
  }
  double distance(int node) {
    return std::hypot(of(states_, node, x_) - of(truth_, node, x_), of(states_, node, y_) - of(truth_, node, y_));
  }
  /// Expects poses near the truth, and headings without jumps by whole turns.
  void expect_truth(const char* what) {
    const double turns = std::round((of(states_, 0, heading_) - of(truth_, 0, heading_)) / (2.0 * std::numbers::pi)) *
                         2.0 * std::numbers::pi;
    for (int k = 0; k < nodes; ++k) {
      const bool in_gap = k > gap_start && k < gap_end;
      ASSERT_LT(distance(k), in_gap ? 2.0 : 0.4) << what << ", node " << k;
      ASSERT_LT(std::abs(of(states_, k, heading_) - turns - of(truth_, k, heading_)), in_gap ? 0.5 : 0.25)
          << what << ", node " << k;
    }
  }

  std::mt19937 random_{5};
  std::shared_ptr<const Model> model_;
  int x_ = 0, y_ = 0, heading_ = 0;
  std::unique_ptr<RheProblem> problem_;
  std::vector<double> truth_, states_, inputs_, parameters_;
};

TEST_F(TrackAlignment, FindsPosesThatTheTrackHadWrong) {
  for (int k = 0; k < nodes; ++k) {
    of(states_, k, x_) += 20.0 * normal();
    of(states_, k, y_) += 20.0 * normal();
    // Pointing the wrong way in one part, off by whole turns in another.
    if (k > 100 && k < 300) of(states_, k, heading_) += 2.7;
    if (k > 250) of(states_, k, heading_) -= 4.0 * std::numbers::pi;
  }
  align_track(*problem_, problem_->model(), states_, inputs_, parameters_);
  expect_truth("scrambled");
}

TEST_F(TrackAlignment, LeavesWhatIsNoPose) {
  const std::vector<double> before = states_;
  align_track(*problem_, problem_->model(), states_, inputs_, parameters_);
  expect_truth("right from the start");
  for (int k = 0; k < nodes; ++k)
    for (int j = 0; j < model_->state_count(); ++j)
      if (j != x_ && j != y_ && j != heading_) {
        EXPECT_EQ(of(states_, k, j), before[static_cast<std::size_t>(k) * model_->state_count() + j]);
      }
}

TEST_F(TrackAlignment, ChangesNothingWithoutPositions) {
  for (int k = 0; k < nodes; ++k)
    for (int j = 0; j < model_->output_count(); ++j) problem_->output(k)[j] = std::nan("");
  const std::vector<double> before = states_, inputs = inputs_;
  align_track(*problem_, problem_->model(), states_, inputs_, parameters_);
  EXPECT_EQ(states_, before);
  EXPECT_EQ(inputs_, inputs);
}

TEST_F(TrackAlignment, KeepsAStandingVehicleWhereItIs) {
  for (int k = 0; k < nodes; ++k) {
    std::copy_n(truth_.data(), model_->state_count(),
                truth_.data() + static_cast<std::ptrdiff_t>(k) * model_->state_count());
    problem_->output(k)[0] = truth_[x_] + 0.05 * normal();
    problem_->output(k)[1] = truth_[y_] + 0.05 * normal();
  }
  std::fill(inputs_.begin(), inputs_.end(), 0.0);
  states_ = truth_;
  align_track(*problem_, problem_->model(), states_, inputs_, parameters_);
  EXPECT_EQ(states_, truth_) << "no heading can be told from positions that do not move";
}

TEST_F(TrackAlignment, StretchesTheSpeedOfALongGapAlone) {
  lose_positions();
  for (int k = 0; k < nodes - 1; ++k) inputs_[2 * static_cast<std::size_t>(k)] *= 0.75;  // an unknown wheel radius
  const std::vector<double> before = inputs_;
  align_track(*problem_, problem_->model(), states_, inputs_, parameters_);
  const auto middle = 2 * static_cast<std::size_t>(nodes / 2);
  EXPECT_NEAR(inputs_[middle] / before[middle], 0.95 / 0.75, 0.1);
  for (std::size_t k = 0; k + 1 < nodes; ++k)
    EXPECT_EQ(inputs_[2 * k + 1], before[2 * k + 1]) << "the steering rate is no speed; node " << k;
}

/// Neither input is the speed: each side has its own speed.
class SkidSteeredTrack : public TrackAlignment {
 protected:
  static std::vector<double> inputs(int k) {
    const double turn = 0.2 * std::cos(0.15 * k);
    return {21.0 - turn, 21.0 + turn};
  }
  SkidSteeredTrack()
      : TrackAlignment({.model = "skid_steer",
                        .inputs = &SkidSteeredTrack::inputs,
                        .slip = {0.05, 0.05, 0.0},
                        .believed = {0.0, 0.0, 0.0}}) {}
};

TEST_F(SkidSteeredTrack, StretchesTheSpeedsOfBothSidesInALongGap) {
  lose_positions();
  for (double& wheel : inputs_) wheel *= 0.75;
  const std::vector<double> before = inputs_;
  align_track(*problem_, problem_->model(), states_, inputs_, parameters_);
  const auto middle = 2 * static_cast<std::size_t>(nodes / 2);
  EXPECT_NEAR(inputs_[middle] / before[middle], 0.95 / 0.75, 0.1);
  EXPECT_DOUBLE_EQ(inputs_[middle + 1] / before[middle + 1], inputs_[middle] / before[middle]);
}

}  // namespace track_alignment_test
}  // namespace rhec
