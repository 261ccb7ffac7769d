#include "rhec/sim/world/truth.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "sim/support/bicycle.hpp"

namespace rhec::sim {
namespace truth_test {

Eigen::VectorXd state(double x, double y, double beta, double delta) { return Eigen::Vector4d(x, y, beta, delta); }

TEST(TruthVehicle, DrivesTheCircleOfConstantInputs) {
  const Bicycle model;
  const auto field = constant_field({0.8, 0.6});
  TruthVehicle vehicle(model, *field, state(1.0, 2.0, 0.3, 0.2));
  const std::array<double, 2> inputs{5.0, 0.0};
  for (int i = 0; i < 50; ++i) vehicle.advance(inputs.data(), 0.2);
  const double turn_rate = 0.8 * 5.0 / wheelbase * std::tan(0.6 * 0.2), radius = 0.8 * 5.0 / turn_rate;
  const double heading = 0.3 + turn_rate * 10.0;
  EXPECT_NEAR(vehicle.time(), 10.0, 1e-12);
  EXPECT_NEAR(vehicle.state()[0], 1.0 + radius * (std::sin(heading) - std::sin(0.3)), 1e-7);
  EXPECT_NEAR(vehicle.state()[1], 2.0 - radius * (std::cos(heading) - std::cos(0.3)), 1e-7);
  EXPECT_NEAR(vehicle.state()[2], heading, 1e-9);
  EXPECT_EQ(vehicle.state()[3], 0.2);
}

TEST(TruthVehicle, ConvergesWithFourthOrder) {
  const Bicycle model;
  const auto field = gaussian_random_field({.seed = 2});
  const std::array<double, 2> inputs{6.0, 0.15};
  const auto end = [&](double step) {
    TruthVehicle vehicle(model, *field, state(0, 0, 0, 0), {.step = step});
    for (int i = 0; i < 8; ++i) vehicle.advance(inputs.data(), 0.4);
    return vehicle.state();
  };
  const Eigen::VectorXd exact = end(0.0005);
  const double coarse = (end(0.2) - exact).norm(), fine = (end(0.1) - exact).norm();
  EXPECT_GT(coarse / fine, 10.0) << "slip is looked up at every stage, else the order is lower";
  EXPECT_LT((end(0.01) - exact).norm(), 1e-7);
}

/// A point on a line whose speed follows the input with a lag of a millisecond.
template <class Scalar>
struct Lagging {
  static constexpr int state_count = 3, input_count = 1, parameter_count = 1, output_count = 1;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = p[0] * x[2];
    dxdt[1] = 0.0 * x[2];
    dxdt[2] = (u[0] - x[2]) / 1e-3;
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

TEST(TruthVehicle, IsFollowedHoweverShortItsTimeConstants) {
  ModelDescription about;
  about.name = "lagging";
  about.states = {{.name = "x", .unit = "m", .meaning = "position"},
                  {.name = "y", .unit = "m", .meaning = "position"},
                  {.name = "v", .unit = "m/s", .meaning = "speed"}};
  about.inputs = {{.name = "u", .unit = "m/s", .meaning = "wanted speed"}};
  about.parameters = {{.name = "kappa", .unit = "1", .meaning = "speed factor"}};
  about.outputs = {{.name = "x", .unit = "m", .meaning = "position"}};
  about.roles = {.position_x = 0, .position_y = 1};
  const FormulaModel<Lagging> model(Lagging<double>(), about);
  const auto field = constant_field({1.0});
  TruthVehicle vehicle(model, *field, Eigen::Vector3d(0.0, 0.0, 0.0));
  const double input = 2.0;
  for (int i = 0; i < 5; ++i) vehicle.advance(&input, 0.2);
  EXPECT_NEAR(vehicle.state()[2], 2.0, 1e-9);
  EXPECT_NEAR(vehicle.state()[0], 2.0 * (1.0 - 1e-3), 1e-4);
}

TEST(TruthVehicle, FeelsTheSlipWhereItIs) {
  // kappa = 0.5 + 0.1 x along +x: dx/dt = u1 (0.5 + 0.1 x), so x = 5 (exp(0.1 u1 t) - 1).
  class Ramp final : public SlipField {
   public:
    int channels() const noexcept override { return 2; }

   private:
    void look_up(double x, double, double* values) const noexcept override {
      values[0] = 0.5 + 0.1 * x;
      values[1] = 1.0;
    }
  };
  const Bicycle model;
  const Ramp field;
  TruthVehicle vehicle(model, field, state(0, 0, 0, 0));
  const std::array<double, 2> inputs{2.0, 0.0};
  vehicle.advance(inputs.data(), 1.0);
  const double x = 5.0 * (std::exp(0.2) - 1.0);
  EXPECT_NEAR(vehicle.state()[0], x, 1e-10);
  EXPECT_NEAR(vehicle.parameters()[0], 0.5 + 0.1 * x, 1e-10);
  EXPECT_NEAR(vehicle.mean_parameters()[0], x / 2.0, 1e-10) << "distance = u1 t mean(kappa)";
  EXPECT_NEAR(vehicle.mean_parameters()[1], 1.0, 1e-12);
}

TEST(TruthVehicle, SteeringStopsAtItsStop) {
  const Bicycle model;
  const auto field = constant_field({1.0, 1.0});
  TruthVehicle stopped(model, *field, state(0, 0, 0, 0)),
      free(model, *field, state(0, 0, 0, 0), {.mechanical_stops = false});
  const std::array<double, 2> hard_left{0.0, 1.0}, back{0.0, -0.1};
  for (TruthVehicle* vehicle : {&stopped, &free}) vehicle->advance(hard_left.data(), 1.0);
  EXPECT_EQ(stopped.state()[3], steering_limit);
  EXPECT_NEAR(free.state()[3], 1.0, 1e-12);
  stopped.advance(back.data(), 1.0);
  EXPECT_NEAR(stopped.state()[3], steering_limit - 0.1, 1e-12) << "it leaves the stop at once";
}

TEST(TruthVehicle, IsDisturbedByNoiseOfItsOwn) {
  const Bicycle model;
  const auto field = constant_field({1.0, 1.0});
  const std::array<double, 2> still{0.0, 0.0};
  const auto variance_of = [&](double duration) {
    TruthVehicle vehicle(model, *field, state(0, 0, 0, 0), {.noise = {0.0, 0.3, 0.0, 0.0}, .seed = 5});
    double sum = 0.0, before = 0.0;
    constexpr int steps = 4000;
    for (int k = 0; k < steps; ++k) {
      vehicle.advance(still.data(), duration);
      sum += std::pow(vehicle.state()[1] - before, 2);
      before = vehicle.state()[1];
    }
    EXPECT_EQ(vehicle.state()[0], 0.0);
    return sum / steps;
  };
  EXPECT_NEAR(variance_of(0.1), 0.09 * 0.1, 0.1 * 0.009);
  EXPECT_NEAR(variance_of(0.4), 0.09 * 0.4, 0.1 * 0.036);
}

/// Counts the look-ups in another field, and may hide that it is smooth.
class CountedField final : public SlipField {
 public:
  CountedField(std::unique_ptr<const SlipField> field, bool smooth) : field_(std::move(field)), smooth_(smooth) {}
  int channels() const noexcept override { return field_->channels(); }
  bool is_smooth() const noexcept override { return smooth_; }
  int count() const { return count_; }

 private:
  void look_up(double x, double y, double* values) const noexcept override {
    ++count_;
    field_->sample(x, y, values);
  }
  std::unique_ptr<const SlipField> field_;
  bool smooth_;
  mutable int count_ = 0;
};

TEST(TruthVehicle, TakesLongerStepsOnSmoothGround) {
  const Bicycle model;
  const CountedField smooth(gaussian_random_field({.seed = 2}), true), rough(gaussian_random_field({.seed = 2}), false);
  TruthVehicle fast(model, smooth, state(0, 0, 0, 0)), slow(model, rough, state(0, 0, 0, 0));
  for (int i = 0; i < 40; ++i) {
    const std::array<double, 2> inputs{8.0, i % 20 < 10 ? 0.02 : -0.02};
    fast.advance(inputs.data(), 0.2);
    slow.advance(inputs.data(), 0.2);
    ASSERT_LE((fast.state() - slow.state()).cwiseAbs().maxCoeff(), 1e-7);
    ASSERT_LE((fast.parameters() - slow.parameters()).cwiseAbs().maxCoeff(), 1e-8);
    ASSERT_LE((fast.mean_parameters() - slow.mean_parameters()).cwiseAbs().maxCoeff(), 1e-7);
  }
  EXPECT_EQ(rough.count(), 1 + 40 * 80);
  EXPECT_LT(2 * smooth.count(), rough.count());
}

TEST(TruthVehicle, TakesShortStepsWhereItReachesAStop) {
  // Constant slip: all error is that of the step in which the steering stops.
  const Bicycle model;
  const CountedField smooth(constant_field({0.8, 0.9}), true), rough(constant_field({0.8, 0.9}), false);
  const auto end = [&](const SlipField& field, double step) {
    TruthVehicle vehicle(model, field, state(0, 0, 0, 0), {.step = step});
    const std::array<double, 2> inputs{8.0, 1.0};
    for (int i = 0; i < 5; ++i) vehicle.advance(inputs.data(), 0.2);
    return vehicle.state();
  };
  const Eigen::VectorXd exact = end(rough, 0.0001);
  const double error = (end(rough, 0.01) - exact).norm(), unseen = (end(rough, 0.05) - exact).norm();
  EXPECT_GT(unseen, 10.0 * error) << "the case shows nothing";
  EXPECT_LE((end(smooth, 0.01) - exact).norm(), 1.1 * error);
}

TEST(TruthVehicle, RefusesWhatDoesNotFit) {
  Bicycle model;
  const auto field = constant_field({1.0, 1.0}), narrow = constant_field({1.0});
  EXPECT_THROW(TruthVehicle(model, *narrow, state(0, 0, 0, 0)), Error);
  EXPECT_THROW(TruthVehicle(model, *field, Eigen::Vector3d::Zero()), Error);
  EXPECT_THROW(TruthVehicle(model, *field, state(0, 0, 0, 1.0)), Error);
  EXPECT_THROW(TruthVehicle(model, *field, state(std::numeric_limits<double>::quiet_NaN(), 0, 0, 0)), Error);
  EXPECT_THROW(TruthVehicle(model, *field, state(0, 0, 0, 0), {.step = 0.0}), Error);
  model.mutable_description().roles.position_x = -1;
  EXPECT_THROW(TruthVehicle(model, *field, state(0, 0, 0, 0)), Error);
}

TEST(Sensors, AddNoiseOfTheGivenSize) {
  const Bicycle model;
  const SensorNoise noise{.outputs = {0.03, 0.3, 0.0}, .inputs = {0.1, 0.2}};
  Sensors sensors(model, noise, 1);
  const Eigen::VectorXd x = state(1.0, 2.0, 0.5, 0.1);
  const std::array<double, 2> u{3.0, 0.4};
  constexpr int count = 20000;
  double mean[5] = {}, square[5] = {};
  for (int i = 0; i < count; ++i) {
    std::array<double, 3> y{};
    std::array<double, 2> measured{};
    sensors.observe(x.data(), y.data());
    sensors.measure_inputs(u.data(), measured.data());
    const double errors[] = {y[0] - (1.0 - antenna * std::cos(0.5)), y[1] - (2.0 - antenna * std::sin(0.5)), y[2] - 0.1,
                             measured[0] - 3.0, measured[1] - 0.4};
    for (int k = 0; k < 5; ++k) {
      mean[k] += errors[k] / count;
      square[k] += errors[k] * errors[k] / count;
    }
  }
  const double sigmas[] = {0.03, 0.3, 0.0, 0.1, 0.2};
  for (int k = 0; k < 5; ++k) {
    EXPECT_NEAR(mean[k], 0.0, 4.0 * sigmas[k] / std::sqrt(count)) << k;
    EXPECT_NEAR(std::sqrt(square[k]), sigmas[k], 4.0 * sigmas[k] / std::sqrt(2.0 * count)) << k;
  }
}

TEST(Sensors, HaveBiasesAndScaleErrorsThatDrift) {
  const Bicycle model;
  constexpr int count = 2000;
  const SensorNoise noise{.outputs = {}, .inputs = {}, .biases = {{}, {}, {0.2, 0.1}}, .scales = {{0.5, 0.0}, {}, {}}};
  const Eigen::VectorXd x = state(1.0, 2.0, 0.5, 0.1);
  double squares[3] = {};
  for (int seed = 0; seed < count; ++seed) {
    Sensors sensors(model, noise, static_cast<std::uint64_t>(seed));
    ASSERT_EQ(sensors.errors().size(), 2);
    const Eigen::Vector2d before = sensors.errors();
    sensors.advance(4.0);
    const Eigen::Vector2d after = sensors.errors();
    EXPECT_EQ(after[1], before[1]);
    std::array<double, 3> y{};
    sensors.observe(x.data(), y.data());
    EXPECT_DOUBLE_EQ(y[2], 0.1 + after[0]);
    EXPECT_DOUBLE_EQ(y[0], (1.0 + after[1]) * (1.0 - antenna * std::cos(0.5)));
    squares[0] += before[0] * before[0] / count;
    squares[1] += (after[0] - before[0]) * (after[0] - before[0]) / count;
    squares[2] += before[1] * before[1] / count;
  }
  const double sigmas[] = {0.2, 0.2, 0.5};
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(std::sqrt(squares[k]), sigmas[k], 4.0 * sigmas[k] / std::sqrt(2.0 * count)) << k;
}

TEST(Sensors, SeeTheMotionThatHasLedToAState) {
  const auto model = Host().make_model("bicycle_slip", parse_yaml("outputs: [yaw_rate, x_gps]", "test"));
  Sensors sensors(*model, {}, 1);
  const Eigen::VectorXd x = state(1.0, 2.0, 0.5, 0.1);
  const std::array<double, 2> u{3.0, 0.4}, p{0.9, 0.7};
  std::array<double, 2> y{};
  sensors.observe(x.data(), y.data());
  EXPECT_TRUE(std::isnan(y[0])) << "nothing has led to the first one";
  const Sensors::Motion motion{u.data(), p.data()};
  sensors.observe(x.data(), y.data(), &motion);
  EXPECT_DOUBLE_EQ(y[0], 0.9 * 3.0 * std::tan(0.7 * 0.1) / 1.4);
}

TEST(Sensors, OneSensorDoesNotShiftTheNoiseOfAnother) {
  const Bicycle model;
  const SensorNoise noise{.outputs = {1, 1, 1}, .inputs = {1, 1}};
  Sensors busy(model, noise, 1), lazy(model, noise, 1);
  const Eigen::VectorXd x = state(0, 0, 0, 0);
  const std::array<double, 2> u{};
  std::array<double, 3> a{}, b{};
  std::array<double, 2> measured{};
  for (int i = 0; i < 10; ++i) {
    busy.observe(x.data(), a.data());
    busy.measure_inputs(u.data(), measured.data());
    lazy.observe(x.data(), b.data());
    ASSERT_EQ(a, b);
  }
  EXPECT_NE(a[0], a[1]);
}

TEST(Sensors, RefuseWrongStandardDeviations) {
  const Bicycle model;
  EXPECT_THROW(Sensors(model, {.outputs = {1, 1}, .inputs = {}}, 1), Error);
  EXPECT_THROW(Sensors(model, {.outputs = {}, .inputs = {1, -1}}, 1), Error);
  EXPECT_NO_THROW(Sensors(model, {}, 1));
}

}  // namespace truth_test
}  // namespace rhec::sim
