// Nature knows no north, no origin and no metre: a drive that is turned, moved, or measured in another unit of length
// is the same drive.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/control/controller.hpp"
#include "rhec/core/estimation/estimator.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec {
namespace invariance_test {

using Point = std::complex<double>;

constexpr double step = 0.2, speed = 2.0;
constexpr int samples = 100;
constexpr double tolerance = 1e-6;  // [m], [rad], [1]

/// In which coordinates a drive is written down: p' = unit e^(i turn) p + origin.
struct Frame {
  const char* name;
  double turn = 0.0;          ///< [rad]
  Point origin = {0.0, 0.0};  ///< [m]
  double unit = 1.0;          ///< numbers that a metre is
  Point to(Point p) const { return unit * (std::polar(1.0, turn) * p + origin); }
  Point from(Point p) const { return (p / unit - origin) * std::polar(1.0, -turn); }
};
void PrintTo(const Frame& frame, std::ostream* out) { *out << frame.name; }

/// What is estimated and controlled with.
struct Design {
  const char* name;
  const char* blocking;
  const char* estimator;  ///< further keys
};
void PrintTo(const Design& design, std::ostream* out) { *out << design.name; }

const Host& host() {
  static const Host found;
  return found;
}

/// One sample in the first frame's coordinates.
struct Sample {
  Point true_place, place;
  double true_heading, heading, steering;
  std::vector<double> parameters, sigmas, inputs;
  Status estimator, controller;
};

class Drive {
 public:
  Drive(const Frame& frame, const Design& design)
      : frame_(frame), robot_(make_robot(frame, design)), model_(robot_.model()) {
    Controller::Setup setup;
    const double square = frame.unit * frame.unit;
    setup.problem.state_weights = {1.0 / square, 1.0 / square, 0.0, 0.0};
    setup.problem.terminal_weights = {10.0 / square, 10.0 / square, 0.0, 0.0};
    setup.problem.input_weights = {5.0 / square, 5.0};
    setup.interval = step;
    setup.speed_bound_factor = 1.2;
    setup.speed_bound_offset = 0.5 * frame.unit;
    setup.search = {.ahead = 8.0 * frame.unit,
                    .behind = frame.unit,
                    .place = {.turn_length = 2.0 * frame.unit, .margin = frame.unit}};
    controller_ = std::make_unique<Controller>(model_, host().make_solver("gn_rti", solver()), path(), setup);
    estimator_ = robot_.make_estimator();
  }

  std::vector<Sample> run() {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    Eigen::VectorXd truth(4);
    const Point start = frame_.to(Point(0.0, 0.5));
    truth << start.real(), start.imag(), 0.2 + frame_.turn, 0.0;
    std::vector<Sample> found;
    std::vector<double> outputs(3);
    for (int k = 0; k < samples; ++k) {
      model_->observe({.count = 1, .states = truth.data(), .outputs = outputs.data()});
      // The noise is one of places: drawn in the first frame, turned and measured like all else.
      const double right = 0.05 * normal(random), up = 0.05 * normal(random);
      const Point noise = frame_.unit * std::polar(1.0, frame_.turn) * Point(right, up);
      outputs[0] += noise.real();
      outputs[1] += noise.imag();
      outputs[2] += 0.01 * normal(random);
      if (k % 9 == 4) outputs[0] = outputs[1] = std::nan("");
      estimator_->push_measurement(k * step, outputs.data());
      const Estimate& estimate = estimator_->estimate(k * step);
      const Controller::Command& command = controller_->control(estimate);
      found.push_back(sample(truth, estimate, command));
      advance(truth, command.inputs);
      std::vector<double> measured = command.inputs;
      measured[0] += 0.02 * frame_.unit * normal(random);
      measured[1] += 0.01 * normal(random);
      estimator_->push_input(k * step, measured.data());
      estimator_->prepare();
      controller_->prepare();
    }
    return found;
  }

 private:
  static Settings solver() { return parse_yaml("{mode: converge, tolerance: 1.0e-9, max_iterations: 300}", "solver"); }
  static Robot make_robot(const Frame& frame, const Design& design) {
    const Point start = frame.to({0.0, 0.0});
    const double unit = frame.unit;
    const std::string text = fmt::format(
        "{{model: {{name: bicycle_slip, wheelbase: {:.17g}, gps_offset: {:.17g}}},"
        " noise: {{outputs: {{x_gps: {:.17g}, y_gps: {:.17g}, delta: 0.01}},"
        "          inputs: {{u1: {:.17g}, u2: 0.01}}}},"
        " blocking: {}, step: {},"
        " estimator: {{horizon: 12, {} initial: {{"
        "   state: {{x_pos: {:.17g}, y_pos: {:.17g}, beta: {:.17g}, delta: 0.0}},"
        "   sigma: {{x_pos: {:.17g}, y_pos: {:.17g}, beta: 0.3, delta: 0.05}}}},"
        "   solver: {{name: gn_rti, mode: converge, tolerance: 1.0e-9, max_iterations: 300}}}}}}",
        1.4 * unit, 0.4 * unit, 0.05 * unit, 0.05 * unit, 0.02 * unit, design.blocking, step, design.estimator,
        start.real(), start.imag(), frame.turn, unit, unit);
    return {host(), RobotOptions::table().parse(parse_yaml(text, "robot.yaml"), "robot")};
  }
  /// Zigzag, with corners that take the steering to its limits.
  Path path() const {
    std::vector<Waypoint> waypoints;
    for (int i = 0; i <= 12; ++i) {
      const Point p = frame_.to({5.0 * i, i % 2 == 0 ? 0.0 : 4.0});
      waypoints.push_back({p.real(), p.imag(), speed * frame_.unit});
    }
    return Path(waypoints);
  }
  /// How the ground slips at a place.
  std::vector<double> slip_at(const Eigen::VectorXd& state) const {
    const Point p = frame_.from({state[0], state[1]});
    return {0.75 + 0.15 * std::sin(0.3 * p.real()) * std::cos(0.2 * p.imag()), 0.8 + 0.15 * std::cos(0.25 * p.real())};
  }
  void advance(Eigen::VectorXd& truth, const std::vector<double>& inputs) const {
    constexpr int parts = 10;
    const double part = step / parts;
    Eigen::VectorXd next(4);
    for (int i = 0; i < parts; ++i) {
      const std::vector<double> slip = slip_at(truth);
      model_->integrate({.count = 1,
                         .states = truth.data(),
                         .inputs = inputs.data(),
                         .parameters = slip.data(),
                         .durations = &part,
                         .next_states = next.data()});
      truth = next;
    }
  }
  Sample sample(const Eigen::VectorXd& truth, const Estimate& estimate, const Controller::Command& command) const {
    Sample made;
    made.true_place = frame_.from({truth[0], truth[1]});
    made.place = frame_.from({estimate.state[0], estimate.state[1]});
    made.true_heading = truth[2] - frame_.turn;
    made.heading = estimate.state[2] - frame_.turn;
    made.steering = estimate.state[3];
    const Eigen::VectorXd sigma = estimate.covariance.diagonal().cwiseSqrt();
    for (int j = 0; j < 2; ++j) made.parameters.push_back(estimate.parameters[j]);
    // The covariance of the place turns with it; its trace does not.
    made.sigmas = {std::hypot(sigma[0], sigma[1]) / frame_.unit, sigma[2], sigma[3], sigma[4], sigma[5]};
    made.inputs = {command.inputs[0] / frame_.unit, command.inputs[1]};
    made.estimator = estimate.report.status;
    made.controller = command.report.status;
    return made;
  }

  Frame frame_;
  Robot robot_;
  std::shared_ptr<const Model> model_;
  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<Controller> controller_;
};

/// The largest difference of anything in two samples.
double distance(const Sample& a, const Sample& b) {
  double largest = std::max({std::abs(a.true_place - b.true_place), std::abs(a.place - b.place),
                             std::abs(angle_difference(a.true_heading, b.true_heading)),
                             std::abs(angle_difference(a.heading, b.heading)), std::abs(a.steering - b.steering)});
  const auto add = [&largest](const std::vector<double>& of_a, const std::vector<double>& of_b) {
    for (std::size_t j = 0; j < of_a.size(); ++j) {
      const double difference = std::abs(of_a[j] - of_b[j]);
      largest = std::isfinite(difference) ? std::max(largest, difference) : HUGE_VAL;
    }
  };
  add(a.parameters, b.parameters);
  add(a.sigmas, b.sigmas);
  add(a.inputs, b.inputs);
  return largest;
}

class Invariance : public ::testing::TestWithParam<std::tuple<Frame, Design>> {};

TEST_P(Invariance, OfAClosedLoopRun) {
  const auto& [frame, design] = GetParam();
  const std::vector<Sample> plain = Drive({"plain"}, design).run(), other = Drive(frame, design).run();
  int at_limit = 0;
  double learnt = 0.0, worst = 0.0;
  for (int k = 0; k < samples; ++k) {
    EXPECT_EQ(plain[k].estimator, Status::solved) << k << ": " << name_of(plain[k].estimator);
    EXPECT_EQ(plain[k].controller, Status::solved) << k << ": " << name_of(plain[k].controller);
    EXPECT_EQ(other[k].estimator, Status::solved) << k << ": " << name_of(other[k].estimator);
    EXPECT_EQ(other[k].controller, Status::solved) << k << ": " << name_of(other[k].controller);
    worst = std::max(worst, distance(plain[k], other[k]));
    ASSERT_LT(worst, tolerance) << "at sample " << k;
    at_limit += std::abs(plain[k].inputs[1]) > 0.61;
    learnt = std::max(learnt, std::abs(plain[k].parameters[0] - plain[0].parameters[0]));
  }
  RecordProperty("largest_difference", fmt::format("{:.1e}", worst));
  EXPECT_GT(at_limit, 3) << "no bound was ever active";
  EXPECT_GT(learnt, 0.1) << "nothing was estimated";
  EXPECT_GT(std::abs(plain.back().true_place), 20.0) << "the vehicle has not moved";
}

constexpr Frame frames[] = {{.name = "turned", .turn = 2.0},
                            {.name = "turned_back", .turn = -3.0},
                            {.name = "moved", .origin = {4000.0, -2500.0}},
                            {.name = "in_feet", .unit = 1.0 / 0.3048},
                            {.name = "in_centimetres", .unit = 100.0},
                            {.name = "in_kilometres", .unit = 0.001},
                            {.name = "all_at_once", .turn = 1.0, .origin = {-300.0, 200.0}, .unit = 10.0}};
constexpr Design designs[] = {
    {"one_block", "{kappa: {name: full_horizon}, mu: {name: full_horizon}}", "covariance: blocks,"},
    {"structured", "{kappa: {name: structured, size: 4, overlap: 1}, mu: {name: structured, size: 6}}",
     "covariance: blocks,"},
    {"robust", "{kappa: {name: full_horizon}, mu: {name: unblocked}}",
     "covariance: blocks, robust: {outputs: [x_gps, y_gps], delta: 1.5},"},
    {"smoothing", "{kappa: {name: full_horizon}, mu: {name: full_horizon}}",
     "covariance: blocks, arrival: {name: smoothing},"}};
// Laws of variation have lengths in metres, so a bank is held to frames alone.
constexpr Frame frames_in_metres[] = {frames[0], frames[1], frames[2]};
constexpr Design priors[] = {{"priors", "{}", ""}};

INSTANTIATE_TEST_SUITE_P(ClosedLoop, Invariance,
                         ::testing::Combine(::testing::ValuesIn(frames), ::testing::ValuesIn(designs)),
                         [](const auto& found) {
                           return std::string(std::get<0>(found.param).name) + "_" + std::get<1>(found.param).name;
                         });
INSTANTIATE_TEST_SUITE_P(Priors, Invariance,
                         ::testing::Combine(::testing::ValuesIn(frames_in_metres), ::testing::ValuesIn(priors)),
                         [](const auto& found) { return std::string(std::get<0>(found.param).name); });

}  // namespace invariance_test
}  // namespace rhec
