#include "rhec/core/control/input_rate_model.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/control/slip_ahead_model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace input_rate_model_test {

using testing::ElementsAre;
using testing::HasSubstr;

const Host& host() {
  static const Host found;
  return found;
}

constexpr int nx = 5, nu = 2, np = 2, nz = nx + nu + np;  // of the bicycle with the rate of u2

std::vector<double> next_of(const Model& model, const std::vector<double>& z, double duration) {
  std::vector<double> next(nx);
  model.integrate({.count = 1,
                   .states = z.data(),
                   .inputs = z.data() + nx,
                   .parameters = z.data() + nx + nu,
                   .durations = &duration,
                   .next_states = next.data()});
  return next;
}

TEST(InputRateModel, DescribesInputsAsStatesAndTheirRates) {
  const InputRateModel model(host().make_model("bicycle_slip"), {0, 1});
  EXPECT_THAT(names_of(model.description().states), ElementsAre("x_pos", "y_pos", "beta", "delta", "u1", "u2"));
  EXPECT_THAT(names_of(model.description().inputs), ElementsAre("u1_rate", "u2_rate"));
  const Model& vehicle = model.vehicle();
  EXPECT_EQ(model.description().states[5].upper, vehicle.description().inputs[1].upper);
  EXPECT_EQ(model.description().inputs[1].upper, INFINITY);
  EXPECT_EQ(model.description().inputs[1].unit, vehicle.description().inputs[1].unit + "/s");
  // The wheel speed is a state now.
  EXPECT_EQ(model.description().roles.speed, -1);
  EXPECT_EQ(model.description().roles.speed_state, 4);
  std::vector<double> state(6, 7.0), inputs(2, 7.0);
  const std::vector<double> slip{0.5, 1.0};
  model.straight_motion(2.0, slip.data(), state.data(), inputs.data());
  EXPECT_EQ(state[4], 4.0);
  EXPECT_EQ(state[5], 0.0);
  EXPECT_THAT(inputs, ElementsAre(0.0, 0.0));
}

TEST(InputRateModel, MovesAsTheVehicleDoesWithTheInputThatTheRateLeadsTo) {
  const std::shared_ptr<const Model> vehicle = host().make_model("bicycle_slip");
  const InputRateModel model(vehicle, {1});
  const double duration = 0.3;
  const std::vector<double> z{0.0, 1.0, 0.3, 0.1, 0.2, 2.0, -0.5, 0.8, 0.9};
  const std::vector<double> inputs{2.0, 0.2 - 0.3 * 0.5};
  std::vector<double> expected(4);
  vehicle->integrate({.count = 1,
                      .states = z.data(),
                      .inputs = inputs.data(),
                      .parameters = z.data() + nx + nu,
                      .durations = &duration,
                      .next_states = expected.data()});
  const std::vector<double> next = next_of(model, z, duration);
  for (int j = 0; j < 4; ++j) EXPECT_EQ(next[j], expected[j]);
  EXPECT_DOUBLE_EQ(next[4], inputs[1]);
  // As differential equations: the vehicle moves by the value that is held, which changes by its rate.
  std::vector<double> rates(nx), of_vehicle(4);
  model.rates(z.data(), z.data() + nx, z.data() + nx + nu, rates.data());
  const std::vector<double> held{2.0, 0.2};
  vehicle->rates(z.data(), held.data(), z.data() + nx + nu, of_vehicle.data());
  for (int j = 0; j < 4; ++j) EXPECT_EQ(rates[j], of_vehicle[j]);
  EXPECT_EQ(rates[4], -0.5);
}

TEST(InputRateModel, HasTheDerivativesOfItsDifferences) {
  const InputRateModel model(host().make_model("bicycle_slip"), {1});
  const double duration = 0.3, hair = 1e-5;
  const std::vector<double> z{0.0, 1.0, 0.3, 0.1, 0.2, 2.0, -0.5, 0.8, 0.9}, weights{0.3, -0.7, 1.1, 0.4, 0.9};
  std::vector<double> J(nx * nz), H(nz * nz);
  const auto linearise = [&](const std::vector<double>& at) {
    model.integrate({.count = 1,
                     .states = at.data(),
                     .inputs = at.data() + nx,
                     .parameters = at.data() + nx + nu,
                     .durations = &duration,
                     .jacobians = J.data(),
                     .multipliers = weights.data(),
                     .hessians = H.data()});
  };
  linearise(z);
  const std::vector<double> J_there = J, H_there = H;
  for (int c = 0; c < nz; ++c) {
    std::vector<double> more = z, less = z;
    more[c] += hair;
    less[c] -= hair;
    const std::vector<double> above = next_of(model, more, duration), below = next_of(model, less, duration);
    for (int r = 0; r < nx; ++r) EXPECT_NEAR(J_there[c * nx + r], (above[r] - below[r]) / (2.0 * hair), 1e-9);
    linearise(more);
    const std::vector<double> J_above = J;
    linearise(less);
    for (int k = 0; k < nz; ++k) {
      double change = 0.0;
      for (int r = 0; r < nx; ++r) change += weights[r] * (J_above[k * nx + r] - J[k * nx + r]) / (2.0 * hair);
      EXPECT_NEAR(H_there[c * nz + k], change, 1e-7) << c << ' ' << k;
    }
  }
  EXPECT_GT(std::abs(H_there[4 * nz + 6]), 1e-4) << "else the test would prove less than it says";
}

/// The vehicle's own rows, widened, say the same as rows that are put together from the dense form: on ramps too, with
/// the slip that is ahead, and where several inputs are states.
TEST(InputRateModel, HasTheRowsOfItsDenseForm) {
  for (const char* name : {"bicycle_slip", "tractor_trailer", "skid_steer"})
    for (const std::vector<int>& rated : {std::vector{0}, std::vector{1}, std::vector{0, 1}}) {
      const InputRateModel model(std::make_shared<SlipAheadModel>(host().make_model(name)), rated);
      const int states = model.state_count(), inputs = model.input_count(), parameters = model.parameter_count();
      constexpr int count = 11;
      for (const bool ramp : {false, true}) {
        const int all_variables = states + inputs + (ramp ? 2 : 1) * parameters, row = padded(all_variables),
                  next_row = padded(states);
        AlignedDoubles z(static_cast<std::size_t>(count) * row), data(static_cast<std::size_t>(count) * parameters),
            durations(count, 0.2), costates(static_cast<std::size_t>(count) * next_row, 0.3),
            scratch(model.rows_scratch(count));
        for (std::size_t k = 0; k < z.size(); ++k) z[k] = 0.5 + 0.3 * std::sin(static_cast<double>(k));
        for (std::size_t k = 0; k < data.size(); ++k) data[k] = 0.2 * std::cos(static_cast<double>(k));
        const auto results = [&](bool own) {
          // What was there before must not matter.
          AlignedDoubles all(static_cast<std::size_t>(count) * (next_row + states * row + all_variables * row), 9.0);
          const IntervalRows request{.count = count,
                                     .z = z.data(),
                                     .z_step = row,
                                     .ramp = ramp,
                                     .durations = durations.data(),
                                     .data = data.data(),
                                     .next_states = all.data(),
                                     .next_step = next_row,
                                     .jacobians = all.data() + count * next_row,
                                     .jacobian_step = states * row,
                                     .jacobian_row = row,
                                     .multipliers = costates.data(),
                                     .multiplier_step = next_row,
                                     .hessians = all.data() + count * (next_row + states * row),
                                     .hessian_step = all_variables * row,
                                     .hessian_row = row,
                                     .scratch = scratch.data()};
          own ? model.integrate_rows(request) : model.Model::integrate_rows(request);
          return all;
        };
        const AlignedDoubles own = results(true), dense = results(false);
        for (std::size_t k = 0; k < own.size(); ++k)
          ASSERT_NEAR(own[k], dense[k], 1e-11) << name << ' ' << ramp << ' ' << rated.size() << ' ' << k;
      }
    }
}

TEST(InputRateModel, ObservesTheVehicle) {
  const std::shared_ptr<const Model> vehicle = host().make_model("bicycle_slip");
  const InputRateModel model(vehicle, {1});
  const int ny = model.output_count();
  const std::vector<double> states{0.0, 1.0, 0.3, 0.1, 5.0, 2.0, 0.0, -0.2, 0.05, 6.0},
      of_vehicle{0.0, 1.0, 0.3, 0.1, 2.0, 0.0, -0.2, 0.05}, weights(2 * ny, 0.7);
  std::vector<double> y(2 * ny), J(2 * ny * 5), H(2 * 25), y_vehicle(2 * ny), J_vehicle(2 * ny * 4), H_vehicle(2 * 16);
  model.observe({2, states.data(), y.data(), J.data(), weights.data(), H.data()});
  vehicle->observe({2, of_vehicle.data(), y_vehicle.data(), J_vehicle.data(), weights.data(), H_vehicle.data()});
  EXPECT_EQ(y, y_vehicle);
  for (int i = 0; i < 2; ++i) {
    for (int c = 0; c < 5; ++c)
      for (int r = 0; r < ny; ++r) EXPECT_EQ(J[(i * 5 + c) * ny + r], c < 4 ? J_vehicle[(i * 4 + c) * ny + r] : 0.0);
    for (int c = 0; c < 5; ++c)
      for (int r = 0; r < 5; ++r)
        EXPECT_EQ(H[(i * 5 + c) * 5 + r], c < 4 && r < 4 ? H_vehicle[(i * 4 + c) * 4 + r] : 0.0);
  }
}

TEST(InputRateModel, RefusesInputsThatAreNotThere) {
  const auto refused = [](std::vector<int> rated) {
    return error_of([&] { InputRateModel(host().make_model("bicycle_slip"), std::move(rated)); });
  };
  EXPECT_THAT(refused({}), HasSubstr("rates of no input"));
  for (const std::vector<int>& rated : {std::vector{2}, std::vector{-1}, std::vector{1, 0}, std::vector{1, 1}})
    EXPECT_THAT(refused(rated), HasSubstr("expected indices of 0 .. 1 that increase"));
}

}  // namespace input_rate_model_test
}  // namespace rhec
