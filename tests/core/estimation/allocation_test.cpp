// After setup, estimator and controller allocate nothing: every allocation of this program is counted.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/control/controller.hpp"
#include "rhec/core/estimation/bank_history.hpp"
#include "rhec/core/estimation/banked_covariance.hpp"
#include "rhec/core/estimation/estimator.hpp"
#include "rhec/core/estimation/filter_estimation.hpp"
#include "rhec/core/estimation/prior_horizon_estimation.hpp"
#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/world/paths.hpp"
#include "rhec/sim/world/truth.hpp"
#include "support/allocations.hpp"
#include "support/bank_case.hpp"
#include "support/contradicted_car.hpp"
#include "support/turntable.hpp"

namespace rhec {
namespace allocation_test {

const Host& host() {
  static const Host instance;
  return instance;
}

struct Options {
  bool filter = false;
  bool bank = false;    ///< of filters
  bool priors = false;  ///< window with a bank beside it
  bool banked = false;  ///< window of blocks with a bank beside it
  bool place = false;   ///< a memory of places, too
  ArrivalKind arrival = ArrivalKind::ekf;
  const char* blocking = "{size: 5, overlap: 3}";
  const char* solver = "{mode: rti}";
  int heading_starts = 1;
  bool rates = false;    ///< of inputs, which the controller weighs and bounds
  bool watched = false;  ///< measurements are judged, and one of them is off
  /// By how much an angle is off from some sample on, by samples since then, where measurements are judged.
  double (*off)(int since) = [](int) { return 0.06; };
  std::int64_t least_rejected = 0;  ///< measurements of that angle
  bool late = false;                ///< positions come a sample later than angles
  int samples = 40;
};

std::unique_ptr<EstimationMethod> make_method(const std::shared_ptr<Model>& model, const Options& options) {
  RecedingHorizonEstimation::Setup setup;
  setup.problem.output_weights = {1.0 / (0.03 * 0.03), 1.0 / (0.03 * 0.03), 1.0 / (0.01745 * 0.01745)};
  setup.problem.input_weights = {100.0, 100.0};
  setup.arrival = options.arrival;
  setup.blockings = {host().make_blocking("structured", parse_yaml(options.blocking, "test")),
                     host().make_blocking("full_horizon")};
  setup.walks = {{}, {}};
  setup.initial_mean = Eigen::VectorXd::Zero(6);
  setup.initial_mean.tail(2).setConstant(0.5);
  setup.initial_covariance = Eigen::MatrixXd::Identity(6, 6);
  if (options.heading_starts > 1) {
    setup.heading_starts = options.heading_starts;
    setup.initial_covariance(2, 2) = 10.0;
  }
  if (options.bank || options.priors || options.banked) {
    BankEstimation::Setup bank;
    bank.bank.adapts_noise = true;
    bank.bank.robust = {{{0, 1}, 3.0}};
    ModelDescription about = model->description();
    for (Variable& parameter : about.parameters) parameter.lower = 0.0, parameter.upper = 1.0;
    bank.bank.members = standard_bank(about);
    bank.bank.output_variances = {0.0009, 0.0009, 0.0003};
    bank.bank.input_variances = {0.01, 0.01};
    bank.parameter_lower = {0.0, 0.0};
    bank.parameter_upper = {1.0, 1.0};
    bank.initial_state = setup.initial_mean.head(4);
    bank.initial_covariance = setup.initial_covariance.topLeftCorner(4, 4);
    bank.heading_starts = setup.heading_starts;
    if (options.place) {
      SlipMap::Setup map;
      map.parameters = 2;
      map.capacity = 2000;
      map.visit = 5.0;
      bank.place.map = std::make_shared<SlipMap>(map);
      bank.place.least = {0.01, 0.01};
      bank.place.lag = 6;
    }
    const auto solver = [&] { return host().make_solver("gn_rti", parse_yaml(options.solver, "test")); };
    if (options.priors)
      return std::make_unique<PriorHorizonEstimation>(model, solver(),
                                                      PriorHorizonEstimation::Setup{bank, setup.problem});
    if (options.banked)
      return std::make_unique<BankedCovariance>(std::make_unique<RecedingHorizonEstimation>(model, solver(), setup),
                                                bank);
    return std::make_unique<BankEstimation>(model, bank);
  }
  if (!options.filter)
    return std::make_unique<RecedingHorizonEstimation>(
        model, host().make_solver("gn_rti", parse_yaml(options.solver, "test")), setup);
  FilterEstimation::Setup own;
  own.noise.output_variances = {0.0009, 0.0009, 0.0003};
  own.noise.input_variances = {0.01, 0.01};
  own.noise.parameter_lower = {0.0, 0.0};
  own.noise.parameter_upper = {1.0, 1.0};
  own.walk = {0.03, 0.03};
  own.initial_mean = setup.initial_mean;
  own.initial_covariance = setup.initial_covariance;
  own.heading_starts = setup.heading_starts;
  return std::make_unique<FilterEstimation>(model, own);
}

SensorWatch::Setup watch_setup() {
  return {.noise = {.output_variances = {0.0009, 0.0009, 0.0003},
                    .input_variances = {0.01, 0.01},
                    .parameter_lower = {0.0, 0.0},
                    .parameter_upper = {1.0, 1.0}},
          .walk = {0.03, 0.03},
          .parameter_sigmas = {1.0, 1.0}};
}

/// Runs the closed loop; returns the number of allocations, from the first sample on.
long allocations_in_the_loop(const Options& options) {
  const std::shared_ptr<Model> model = host().make_model("bicycle_slip");
  auto watch = options.watched ? std::make_unique<SensorWatch>(model, watch_setup()) : nullptr;
  Estimator estimator =
      watch ? Estimator(make_method(model, options), {}, std::move(watch)) : Estimator(make_method(model, options));
  Controller::Setup setup;
  setup.problem.state_weights = {1.0, 1.0, 0.0, 0.0};
  setup.problem.input_weights = {5.0, 5.0};
  setup.problem.terminal_weights = {10.0, 10.0, 0.0, 0.0};
  if (options.rates) {
    setup.rate_weights = {0.0, 0.02};
    setup.rate_lower = {-3.0, -2.0};
    setup.rate_upper = {3.0, 2.0};
  }
  sim::FigureEight path;
  path.speed = 4.0;
  setup.ahead = estimator.slip_ahead();
  Controller controller(model, host().make_solver("gn_rti"), Path(sim::figure_eight(path)), setup);
  const auto field = sim::gaussian_random_field({});
  sim::TruthVehicle vehicle(*model, *field, Eigen::Vector4d::Zero());
  sim::Sensors sensors(*model, {.outputs = {0.03, 0.03, 0.01745}, .inputs = {0.1, 0.1}}, 1);
  std::array<double, 2> measured{};
  std::array<double, 3> outputs{}, positions{}, nothing{};
  nothing.fill(std::nan(""));
  int fallbacks = 0;
  std::int64_t rejected = 0;
  const long before = allocation_count();
  for (int k = 0; k < options.samples; ++k) {
    const double time = 0.2 * k;
    sensors.observe(vehicle.state().data(), outputs.data());
    if (k % 7 == 6) outputs[k % 3] = std::nan("");
    if (options.watched && k >= 12) outputs[2] += options.off(k - 12);
    if (options.late) {
      if (k > 0) estimator.push_measurement(time - 0.2, positions.data());
      positions = outputs;
      positions[2] = std::nan("");
      outputs[0] = outputs[1] = std::nan("");
      if (k % 11 == 10) positions[0] += 50.0;
    }
    if (k != 20) estimator.push_measurement(time, outputs.data());  // a gap
    const Estimate& estimate = estimator.estimate(time);
    fallbacks += estimate.fallback;
    if (options.watched) rejected = std::max(rejected, estimate.health.sensors.back().rejected);
    const Controller::Command& command = controller.control(estimate);
    if (k % 2) estimator.prepare();
    if (k % 5 == 0) estimator.rehearse();
    if (k % 3) controller.prepare();
    if (k % 5 == 4) estimator.push_measurement(time - 0.4, options.late ? nothing.data() : outputs.data());  // late
    vehicle.advance(command.inputs.data(), 0.2);
    sensors.measure_inputs(command.inputs.data(), measured.data());
    estimator.push_input(time, measured.data());
  }
  const long after = allocation_count();
  EXPECT_EQ(fallbacks, 0);
  EXPECT_GE(rejected, options.least_rejected);
  const double last = 0.2 * (options.samples - 1);
  EXPECT_GT(controller.follower().arc_length(), 15.0);
  EXPECT_LT(std::hypot(estimator.estimate(last).state[0] - vehicle.state()[0],
                       estimator.estimate(last).state[1] - vehicle.state()[1]),
            2.0);
  return after - before;
}

TEST(EstimationAllocation, AllocationsAreCounted) {
  long before = allocation_count();
  const auto memory = std::make_unique<std::vector<double>>(100);
  EXPECT_GE(allocation_count() - before, 2);
  before = allocation_count();
  const AlignedDoubles row(100);
  EXPECT_GE(allocation_count() - before, 1);
  before = allocation_count();
#if !defined(__SANITIZE_ADDRESS__)
  const Eigen::VectorXd vector = Eigen::VectorXd::Zero(100);
  // A pointer that escapes: else the compiler may leave out the allocation.
  [[maybe_unused]] const double* volatile escaped = vector.data();
  EXPECT_GE(allocation_count() - before, 1);
#endif
}

TEST(EstimationAllocation, NoneInTheClosedLoop) {
  for (const ArrivalKind arrival :
       {ArrivalKind::ekf, ArrivalKind::smoothing, ArrivalKind::constant, ArrivalKind::off}) {
    EXPECT_EQ(allocations_in_the_loop({.arrival = arrival}), 0);
    EXPECT_EQ(allocations_in_the_loop({.arrival = arrival, .solver = "{mode: converge}"}), 0);
    EXPECT_EQ(allocations_in_the_loop({.arrival = arrival, .blocking = "{size: 2, overlap: 4, neighbour_sigma: 0.04}"}),
              0);
    EXPECT_EQ(allocations_in_the_loop({.arrival = arrival, .blocking = "{size: 2, transition: ramp}"}), 0);
  }
}

TEST(EstimationAllocation, NoneInTheClosedLoopOfAFilter) { EXPECT_EQ(allocations_in_the_loop({.filter = true}), 0); }

TEST(EstimationAllocation, NoneWhereSensorsAreWatched) {
  EXPECT_EQ(allocations_in_the_loop({.filter = true, .watched = true, .samples = 150}), 0);
  EXPECT_EQ(allocations_in_the_loop({.bank = true, .watched = true, .samples = 150}), 0);
}

TEST(EstimationAllocation, NoneWhereASensorIsSuspected) {
  // It drifts, which may be found, and then flickers, which nothing explains.
  const auto drifts = [](int since) {
    if (since > 90) return since % 2 == 0 ? 0.5 : -0.5;
    return -std::min(0.2, 0.01 * since);
  };
  Options options{.filter = true, .watched = true, .off = drifts, .least_rejected = 20, .samples = 150};
  EXPECT_EQ(allocations_in_the_loop(options), 0);
  options.filter = false;
  options.bank = true;
  EXPECT_EQ(allocations_in_the_loop(options), 0);
}

TEST(EstimationAllocation, NoneWhereAnInputIsContradicted) {
  for (const char* estimator : {"ekf", "bank"}) {
    const auto off = [](testing::SteeringMessage& each) { each.input -= 0.2; };
    const testing::ContradictedRide ride =
        testing::drive_contradicted(testing::contradicted_car(estimator), 1, 20.0, off, allocation_count);
    EXPECT_TRUE(ride.says("input delta rejected")) << estimator;
    EXPECT_EQ(ride.allocations, 0) << estimator;
  }
}

TEST(EstimationAllocation, NoneWherePositionsAreLate) {
  Options options{.filter = true, .watched = true, .off = [](int) { return 0.0; }, .late = true, .samples = 150};
  EXPECT_EQ(allocations_in_the_loop(options), 0);
  options.filter = false;
  options.bank = true;
  EXPECT_EQ(allocations_in_the_loop(options), 0);
  options.priors = true;
  EXPECT_EQ(allocations_in_the_loop(options), 0);
}

TEST(EstimationAllocation, NoneInTheClosedLoopOfABank) { EXPECT_EQ(allocations_in_the_loop({.bank = true}), 0); }

TEST(EstimationAllocation, NoneInTheClosedLoopOfAWindowWithABank) {
  EXPECT_EQ(allocations_in_the_loop({.priors = true}), 0);
  EXPECT_EQ(allocations_in_the_loop({.priors = true, .solver = "{mode: converge}"}), 0);
  EXPECT_EQ(allocations_in_the_loop({.banked = true}), 0);
}

TEST(EstimationAllocation, NoneWherePlacesAreRemembered) {
  EXPECT_EQ(allocations_in_the_loop({.bank = true, .place = true}), 0);
  EXPECT_EQ(allocations_in_the_loop({.priors = true, .place = true}), 0);
}

TEST(EstimationAllocation, NoneWhereRatesOfInputsCount) {
  EXPECT_EQ(allocations_in_the_loop({.rates = true}), 0);
  EXPECT_EQ(allocations_in_the_loop({.bank = true, .place = true, .rates = true}), 0);
}

TEST(EstimationAllocation, NoneWhereTheHeadingIsSearchedFor) {
  EXPECT_EQ(allocations_in_the_loop({.heading_starts = 8}), 0);
  EXPECT_EQ(allocations_in_the_loop({.filter = true, .heading_starts = 8}), 0);
  EXPECT_EQ(allocations_in_the_loop({.bank = true, .heading_starts = 8}), 0);
  EXPECT_EQ(allocations_in_the_loop({.priors = true, .heading_starts = 8}), 0);
}

TEST(EstimationAllocation, NoneWhereOutputsOfMotionAreLinearised) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const testing::TurntableNoise noise;
  PriorBank::Setup setup;
  setup.members = {{testing::prior("walk", "{sigma: 0.1, along: time}")}, {testing::prior("constant", "{}")}};
  setup.output_variances = {noise.angle * noise.angle, noise.gyro * noise.gyro};
  setup.input_variances = {noise.omega * noise.omega};
  setup.motion_outputs = {1};
  setup.most_between = 1;
  BankHistory bank(PriorBank(testing::turntable(), setup), 8);
  bank.bank().reset(Eigen::Vector2d::Zero(), Eigen::Matrix2d::Identity());
  KalmanFilter filter(testing::turntable(), {setup.output_variances, setup.input_variances, {-1.0}, {2.0}, {1}}, 1);
  filter.mean << 0.0, 0.0, 0.75;
  filter.covariance.setIdentity();
  const double nothing[] = {nan, nan}, zero = 0.0, omega = 0.1, time = 0.1, outputs[] = {0.1, 0.07};
  const long before = allocation_count();
  bank.start(nothing);
  for (int k = 0; k < 20; ++k) {
    const MeasuredInterval interval{
        .duration = 0.2, .inputs = &omega, .between = k % 2, .times = &time, .outputs = outputs};
    bank.add(interval, outputs);
    bank.amend(1, outputs);
    filter.predict({.duration = 0.2, .inputs = &omega}, &zero, nullptr, nullptr, outputs);
    filter.update(outputs, nullptr);
  }
  EXPECT_EQ(allocation_count() - before, 0);
}

}  // namespace allocation_test
}  // namespace rhec
