#include "rhec/core/prior/process_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/model/input_walk_model.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace process_model_test {

/// Not linear in anything.
template <class Scalar>
struct Cart {
  static constexpr int state_count = 3, input_count = 2, parameter_count = 2, output_count = 2;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos;
    using std::sin;
    dxdt[0] = u[0] * p[0] * cos(x[2]);
    dxdt[1] = u[0] * p[0] * sin(x[2]);
    dxdt[2] = p[1] * u[1] * p[0];
  }
  void outputs(const Scalar* x, Scalar* y) const {
    using std::sin;
    y[0] = x[0] * x[1];
    y[1] = sin(x[2]);
  }
};

std::shared_ptr<const Model> cart() {
  ModelDescription about;
  about.name = "cart";
  about.states.resize(3);
  about.inputs.resize(2);
  about.parameters.resize(2);
  about.outputs.resize(2);
  about.parameters[0].name = "kappa";
  about.parameters[0].upper = 1.0;
  about.parameters[1].name = "mu";
  about.roles.speed_factor = 0;
  return std::make_shared<FormulaModel<Cart>>(Cart<double>{}, about);
}

/// Nothing slips.
template <class Scalar>
struct Rail {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 0, output_count = 1;
  void dynamics(const Scalar*, const Scalar* u, const Scalar*, Scalar* dxdt) const { dxdt[0] = u[0]; }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

using ::testing::ElementsAre;

TEST(ProcessModel, TakesAVehicleWithoutParameters) {
  ModelDescription about;
  about.states.resize(1);
  about.inputs.resize(1);
  about.outputs.resize(1);
  const ProcessModel model(std::make_shared<FormulaModel<Rail>>(Rail<double>{}, about), {});
  ASSERT_EQ(model.data_count(), 0);
  const double state = 1.0, input = 2.0, duration = 0.5;
  double next = 0.0;
  model.integrate(
      {.count = 1, .states = &state, .inputs = &input, .durations = &duration, .data = nullptr, .next_states = &next});
  EXPECT_DOUBLE_EQ(next, 2.0);
}

/// Three states for kappa, which runs to its next value, and one for mu, which is held.
class ProcessModelTest : public ::testing::Test {
 protected:
  static constexpr int n = 7, inputs = 6, variables = n + inputs;
  const ProcessModel model{cart(), {3, 1}};
  std::mt19937 random{5};
  std::vector<double> numbers(int count) {
    std::uniform_real_distribution<double> uniform(0.2, 1.0);
    std::vector<double> values(count);
    for (double& value : values) value = uniform(random);
    return values;
  }
  std::vector<double> data() {
    std::vector<double> values = numbers(model.data_count());
    *model.process_data(0, values.data()) = 1.0;
    *model.process_data(1, values.data()) = 0.0;
    return values;
  }
};

TEST_F(ProcessModelTest, DescribesTheVehicleWithItsProcesses) {
  EXPECT_EQ(model.state_count(), n);
  EXPECT_EQ(model.input_count(), inputs);
  EXPECT_EQ(model.parameter_count(), 0);
  EXPECT_EQ(model.data_count(), 1 + 2 * 9 + 1 + 2);
  EXPECT_EQ(model.description().parameter_states, (std::vector<int>{3, 6}));
  EXPECT_EQ(model.description().states[3].name, "kappa");
  EXPECT_EQ(model.description().states[3].upper, 1.0);
  EXPECT_EQ(model.description().states[6].name, "mu");
  EXPECT_EQ(model.description().roles.speed_factor, -1);
}

TEST_F(ProcessModelTest, MovesTheVehicleWithParametersThatMove) {
  const auto s = numbers(n), v = numbers(inputs), d = data();
  const double duration = 0.3;
  std::vector<double> next(n);
  model.integrate({.count = 1,
                   .states = s.data(),
                   .inputs = v.data(),
                   .durations = &duration,
                   .data = d.data(),
                   .next_states = next.data()});
  using Matrix = Eigen::Map<const Eigen::Matrix3d>;
  const Eigen::Vector3d z(s[3], s[4], s[5]), w(v[2], v[3], v[4]);
  const Eigen::Vector3d expected = Matrix(d.data() + 1) * z + Matrix(d.data() + 10) * w;
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(next[3 + k], expected[k], 1e-14);
  EXPECT_NEAR(next[6], d[20] * s[6] + d[21] * v[5], 1e-14);
  const double p[] = {s[3], s[6]}, p_end[] = {expected[0], s[6]};  // kappa runs, mu is held
  double x[3];
  cart()->integrate({.count = 1,
                     .states = s.data(),
                     .inputs = v.data(),
                     .parameters = p,
                     .parameters_end = p_end,
                     .durations = &duration,
                     .next_states = x});
  for (int k = 0; k < 3; ++k) EXPECT_EQ(next[k], x[k]);
}

/// The vehicle's own stand behind those of the processes.
TEST_F(ProcessModelTest, GivesDataOfTheIntervalToTheVehicle) {
  const ProcessModel walking(std::make_shared<InputWalkModel>(cart(), std::vector{1}), {3, 1});
  ASSERT_EQ(walking.state_count(), n + 1);
  ASSERT_EQ(walking.data_count(), model.data_count() + 6);
  std::vector<double> s = numbers(3), next(n + 1), expected(n);
  const auto v = numbers(inputs);
  auto d = data();
  s.push_back(0.5);  // of the input that is kept
  for (const double z : numbers(4)) s.push_back(z);
  auto of_plain = d;
  d.resize(walking.data_count(), 0.0);
  InputWalkModel::set_walking(0, 0.25, walking.vehicle_data(d.data()));
  const double duration = 0.3;
  std::vector<double> part(d.size(), 9.0);
  walking.data_of_part(d.data(), 0.5, part.data());
  EXPECT_THAT(std::vector<double>(part.end() - 6, part.end()), ElementsAre(1.0, 0.25, 0.0, 0.0, 0.0, 0.0));
  walking.integrate({.count = 1,
                     .states = s.data(),
                     .inputs = v.data(),
                     .durations = &duration,
                     .data = d.data(),
                     .next_states = next.data()});
  auto state = s;
  state.erase(state.begin() + 3);
  auto acting = v;
  acting[1] = 0.5 + 0.25 * v[1];
  model.integrate({.count = 1,
                   .states = state.data(),
                   .inputs = acting.data(),
                   .durations = &duration,
                   .data = of_plain.data(),
                   .next_states = expected.data()});
  EXPECT_EQ(next[3], acting[1]);
  next.erase(next.begin() + 3);
  EXPECT_EQ(next, expected);
}

TEST_F(ProcessModelTest, HasTheDerivativesOfItsOwnResults) {
  constexpr int count = 40;  // more than are evaluated at once
  std::vector<double> s, v, d, durations(count, 0.2), multipliers;
  const auto append = [](std::vector<double>& to, const std::vector<double>& more) {
    to.insert(to.end(), more.begin(), more.end());
  };
  for (int i = 0; i < count; ++i) append(s, numbers(n)), append(v, numbers(inputs)), append(d, data());
  append(multipliers, numbers(count * n));
  std::vector<double> jacobians(count * n * variables), hessians(count * variables * variables);
  model.integrate({.count = count,
                   .states = s.data(),
                   .inputs = v.data(),
                   .durations = durations.data(),
                   .data = d.data(),
                   .jacobians = jacobians.data(),
                   .multipliers = multipliers.data(),
                   .hessians = hessians.data()});
  const auto jacobian_at = [&](const std::vector<double>& states, const std::vector<double>& controls) {
    std::vector<double> result(jacobians.size());
    model.integrate({.count = count,
                     .states = states.data(),
                     .inputs = controls.data(),
                     .durations = durations.data(),
                     .data = d.data(),
                     .jacobians = result.data()});
    return result;
  };
  const auto next_at = [&](const std::vector<double>& states, const std::vector<double>& controls) {
    std::vector<double> result(count * n);
    model.integrate({.count = count,
                     .states = states.data(),
                     .inputs = controls.data(),
                     .durations = durations.data(),
                     .data = d.data(),
                     .next_states = result.data()});
    return result;
  };
  constexpr double h = 1e-6;
  for (int k = 0; k < variables; ++k) {
    auto s_plus = s, s_minus = s, v_plus = v, v_minus = v;
    for (int i = 0; i < count; ++i) {
      if (k < n)
        s_plus[i * n + k] += h, s_minus[i * n + k] -= h;
      else
        v_plus[i * inputs + k - n] += h, v_minus[i * inputs + k - n] -= h;
    }
    const auto plus = next_at(s_plus, v_plus), minus = next_at(s_minus, v_minus);
    const auto J_plus = jacobian_at(s_plus, v_plus), J_minus = jacobian_at(s_minus, v_minus);
    for (int i = 0; i < count; ++i) {
      for (int r = 0; r < n; ++r)
        ASSERT_NEAR(jacobians[(i * variables + k) * n + r], (plus[i * n + r] - minus[i * n + r]) / (2 * h), 1e-8)
            << i << " " << r << " " << k;
      for (int c = 0; c < variables; ++c) {
        double expected = 0.0;
        for (int r = 0; r < n; ++r)
          expected += multipliers[i * n + r] *
                      (J_plus[(i * variables + c) * n + r] - J_minus[(i * variables + c) * n + r]) / (2 * h);
        ASSERT_NEAR(hessians[(i * variables + k) * variables + c], expected, 1e-7) << i << " " << k << " " << c;
      }
    }
  }
}

TEST_F(ProcessModelTest, SeesWhatTheVehicleSees) {
  const auto s = numbers(2 * n), multipliers = numbers(4);
  std::vector<double> y(4), J(2 * 2 * n), H(2 * n * n), vehicle_y(2), vehicle_J(6), vehicle_H(9);
  model.observe({.count = 2,
                 .states = s.data(),
                 .outputs = y.data(),
                 .jacobians = J.data(),
                 .multipliers = multipliers.data(),
                 .hessians = H.data()});
  for (int i = 0; i < 2; ++i) {
    cart()->observe({.count = 1,
                     .states = s.data() + i * n,
                     .outputs = vehicle_y.data(),
                     .jacobians = vehicle_J.data(),
                     .multipliers = multipliers.data() + 2 * i,
                     .hessians = vehicle_H.data()});
    for (int j = 0; j < 2; ++j) {
      EXPECT_EQ(y[i * 2 + j], vehicle_y[j]);
      for (int c = 0; c < n; ++c) EXPECT_EQ(J[(i * n + c) * 2 + j], c < 3 ? vehicle_J[c * 2 + j] : 0.0);
    }
    for (int c = 0; c < n; ++c)
      for (int r = 0; r < n; ++r) EXPECT_EQ(H[(i * n + c) * n + r], c < 3 && r < 3 ? vehicle_H[c * 3 + r] : 0.0);
  }
}

/// A cart that pulls a row of masses, too wide for a row to fit on the stack.
template <class Scalar>
struct Train {
  static constexpr int state_count = 70, input_count = 2, parameter_count = 2, output_count = 2;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::sin;
    Cart<Scalar>().dynamics(x, u, p, dxdt);
    for (int j = 3; j < state_count; ++j) dxdt[j] = p[0] * sin(x[j - 1]) - x[j] * x[j];
  }
  void outputs(const Scalar* x, Scalar* y) const { Cart<Scalar>().outputs(x, y); }
};

TEST(ProcessModel, TakesAWideVehicle) {
  constexpr int nx = 70, nz = nx + 2, inputs = 4, z_count = nx + 2 + 4, count = 3;
  ModelDescription about;
  about.name = "train";
  about.states.resize(nx);
  about.inputs.resize(2);
  about.parameters.resize(2);
  about.outputs.resize(2);
  const auto vehicle = std::make_shared<FormulaModel<Train>>(Train<double>{}, about);
  const ProcessModel model(vehicle, {1, 1});
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0.2, 1.0);
  std::vector<double> s(count * nz), v(count * inputs), data(count * model.data_count()), durations(count, 0.2);
  for (auto* values : {&s, &v, &data})
    for (double& value : *values) value = uniform(random);
  std::vector<double> x(count * nx), u(count * 2), p(count * 2);
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < 2; ++j) *model.process_data(j, data.data() + i * model.data_count()) = 0.0;  // held
    std::copy_n(s.data() + i * nz, nx, x.data() + i * nx);
    std::copy_n(s.data() + i * nz + nx, 2, p.data() + i * 2);
    std::copy_n(v.data() + i * inputs, 2, u.data() + i * 2);
  }
  std::vector<double> next(count * nz), jacobians(count * nz * (nz + inputs));
  model.integrate({.count = count,
                   .states = s.data(),
                   .inputs = v.data(),
                   .durations = durations.data(),
                   .data = data.data(),
                   .next_states = next.data(),
                   .jacobians = jacobians.data()});
  std::vector<double> vehicle_next(count * nx), vehicle_jacobians(count * nx * (z_count));
  vehicle->integrate({.count = count,
                      .states = x.data(),
                      .inputs = u.data(),
                      .parameters = p.data(),
                      .parameters_end = p.data(),
                      .durations = durations.data(),
                      .next_states = vehicle_next.data(),
                      .jacobians = vehicle_jacobians.data()});
  for (int i = 0; i < count; ++i) {
    const double *of_ours = jacobians.data() + i * nz * (nz + inputs),
                 *of_vehicle = vehicle_jacobians.data() + i * nx * z_count;
    for (int r = 0; r < nx; ++r) {
      ASSERT_EQ(next[i * nz + r], vehicle_next[i * nx + r]);
      for (int c = 0; c < nx; ++c) ASSERT_EQ(of_ours[c * nz + r], of_vehicle[c * nx + r]);
      for (int j = 0; j < 2; ++j) {
        ASSERT_EQ(of_ours[(nz + j) * nz + r], of_vehicle[(nx + j) * nx + r]) << "by an input";
        ASSERT_NEAR(of_ours[(nx + j) * nz + r], of_vehicle[(nx + 2 + j) * nx + r] + of_vehicle[(nx + 4 + j) * nx + r],
                    1e-15)
            << "by a parameter";
      }
    }
  }
  const auto node = [&](const double* states, double* y) {
    model.observe({.count = 1, .states = states, .outputs = y});
  };
  double y[2], vehicle_y[2];
  node(s.data(), y);
  vehicle->observe({.count = 1, .states = x.data(), .outputs = vehicle_y});
  EXPECT_EQ(y[0], vehicle_y[0]);
  EXPECT_EQ(y[1], vehicle_y[1]);
}

TEST(ProcessModel, RefusesWhatItCannotHold) {
  EXPECT_THAT(error_of([] { ProcessModel(cart(), {1}); }), ::testing::HasSubstr("expected 2, one a parameter"));
  EXPECT_THAT(error_of([] { ProcessModel(cart(), {1, 9}); }), ::testing::HasSubstr("expected 1 to 4"));
  const auto inner = std::make_shared<ProcessModel>(cart(), std::vector<int>{1, 1});
  EXPECT_THAT(error_of([&] { ProcessModel(inner, {}); }), ::testing::HasSubstr("depends on where an interval ends"));
}

}  // namespace process_model_test
}  // namespace rhec
