#include "rhec/core/model/sensor_model.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"
#include "support/random_interval.hpp"

namespace rhec {
namespace sensor_model_test {

std::shared_ptr<const Model> vehicle(const std::string& name, const std::string& outputs) {
  static const Host host;
  return host.make_model(name, parse_yaml("outputs: " + outputs, "test"));
}

SensorModel bicycle() {
  // Outputs: x_gps, delta, yaw_rate, ground_speed.
  return {vehicle("bicycle_slip", "[x_gps, delta, yaw_rate, ground_speed]"), {.biased = {1, 2}, .scaled = {0, 3}}};
}

TEST(SensorModel, HasBiasesScaleErrorsAndValuesOfMotionAsStates) {
  const SensorModel model = bicycle();
  EXPECT_EQ(names_of(model.description().states),
            (std::vector<std::string>{"x_pos", "y_pos", "beta", "delta", "delta_bias", "yaw_rate_bias", "x_gps_scale",
                                      "ground_speed_scale", "yaw_rate_at_node", "ground_speed_at_node"}));
  EXPECT_EQ(model.first_bias(), 4);
  EXPECT_EQ(model.first_scale(), 6);
  EXPECT_EQ(model.first_motion(), 8);
}

TEST(SensorModel, ValuesOfMotionAreLimitsFromTheLeft) {
  const SensorModel model = bicycle();
  for (const bool ramp : {false, true}) {
    const RandomInterval at(model, 3);
    std::vector<double> next(10), plain(4), rates(4);
    Model::Intervals request = at.request(ramp);
    request.next_states = next.data();
    model.integrate(request);
    request.next_states = plain.data();
    model.vehicle().integrate(request);
    for (int j = 0; j < 4; ++j) EXPECT_EQ(next[j], plain[j]);
    for (int j = 4; j < 8; ++j) EXPECT_EQ(next[j], at.x[j]);
    const std::vector<double>& end = ramp ? at.p_end : at.p;
    model.vehicle().rates(plain.data(), at.u.data(), end.data(), rates.data());
    EXPECT_NEAR(next[8], rates[2], 1e-14);
    EXPECT_NEAR(next[9], end[0] * at.u[0], 1e-14);
    // y = (1 + k) h + b.
    std::vector<double> y(4), of_state(4);
    model.observe({.count = 1, .states = next.data(), .outputs = y.data()});
    model.vehicle().observe({.count = 1, .states = plain.data(), .outputs = of_state.data()});
    EXPECT_NEAR(y[0], (1.0 + next[6]) * of_state[0], 1e-14);
    EXPECT_NEAR(y[1], of_state[1] + next[4], 1e-14);
    EXPECT_NEAR(y[2], next[8] + next[5], 1e-14);
    EXPECT_NEAR(y[3], (1.0 + next[7]) * next[9], 1e-14);
  }
}

TEST(SensorModel, DerivativesAreThoseOfItsValues) {
  const SensorModel models[] = {bicycle(),
                                {vehicle("tractor_trailer", "[trailer_yaw_rate, x_trailer_gps, articulation]"),
                                 {.biased = {0}, .scaled = {0, 1}}},
                                {vehicle("bicycle_slip", "[x_gps, delta]"), {.biased = {1}, .scaled = {}}}};
  for (const SensorModel& model : models) {
    const int nx = model.state_count(), ny = model.output_count();
    constexpr double step = 1e-5;
    for (const bool ramp : {false, true})
      expect_derivatives_of_differences(model, RandomInterval(model, 5), ramp, model.description().name);
    const RandomInterval at(model, 9);
    std::vector<double> J(static_cast<std::size_t>(ny) * nx), H(static_cast<std::size_t>(nx) * nx);
    model.observe({.count = 1,
                   .states = at.x.data(),
                   .jacobians = J.data(),
                   .multipliers = at.weights.data(),
                   .hessians = H.data()});
    for (int c = 0; c < nx; ++c) {
      std::vector<double> y[2], jacobian[2];
      for (const int side : {0, 1}) {
        RandomInterval moved = at;
        moved.x[c] += side == 0 ? -step : step;
        y[side].resize(ny);
        jacobian[side].resize(J.size());
        model.observe(
            {.count = 1, .states = moved.x.data(), .outputs = y[side].data(), .jacobians = jacobian[side].data()});
      }
      for (int r = 0; r < ny; ++r) EXPECT_NEAR(J[c * ny + r], (y[1][r] - y[0][r]) / (2.0 * step), 1e-8) << c << r;
      for (int d = 0; d < nx; ++d) {
        double second = 0.0;
        for (int r = 0; r < ny; ++r)
          second += at.weights[r] * (jacobian[1][d * ny + r] - jacobian[0][d * ny + r]) / (2.0 * step);
        EXPECT_NEAR(H[c * nx + d], second, 1e-7) << c << ' ' << d;
      }
    }
  }
}

TEST(SensorModel, EvaluatesAnyNumberOfIntervals) {
  for (const bool ramp : {false, true})
    for (const int count : {1, 7, 8, 19}) expect_the_same_side_by_side(bicycle(), count, ramp);
}

TEST(SensorModel, RefusesSensorsThatAreNotThere) {
  const auto plain = vehicle("bicycle_slip", "[x_gps, delta]");
  EXPECT_NE(error_of([&] { SensorModel(plain, {.biased = {2}, .scaled = {}}); }).find("indices of 0 .. 1"),
            std::string::npos);
  EXPECT_THROW(SensorModel(plain, {.biased = {}, .scaled = {1, 1}}), Error);
}

}  // namespace sensor_model_test
}  // namespace rhec
