#include "rhec/core/model/state_noise_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/plugins/host/host.hpp"
#include "support/error_of.hpp"
#include "support/random_interval.hpp"

namespace rhec {
namespace state_noise_model_test {

std::shared_ptr<const Model> vehicle(const char* name) {
  static const Host host;
  return host.make_model(name);
}

/// With and without ramps: states whose noise is an input, and those whose noise is a parameter.
struct Case {
  bool ramp;
  std::vector<int> states, blocked;
};
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const bool ramp : {false, true})
    for (const auto& [states, blocked] :
         {std::pair<std::vector<int>, std::vector<int>>{{1, 3}, {}}, {{0, 1, 2, 3}, {}}, {{}, {2}}, {{1}, {0, 3}}})
      all.push_back({ramp, states, blocked});
  return all;
}

TEST(StateNoiseModel, AddsNoiseAtTheEndOfAnInterval) {
  const auto plain = vehicle("bicycle_slip");
  const StateNoiseModel noisy(plain, {0, 2});
  ASSERT_EQ(noisy.input_count(), 4);
  EXPECT_EQ(noisy.description().inputs[3].name, "beta_noise");
  EXPECT_EQ(noisy.description().inputs[2].unit, "m/sqrt(s)");
  EXPECT_EQ(noisy.description().noisy_states, (std::vector{0, 2}));
  const RandomInterval at(noisy, 3);
  std::vector<double> with(4), without(4);
  Model::Intervals request = at.request(false);
  request.next_states = with.data();
  noisy.integrate(request);
  request.next_states = without.data();
  plain->integrate(request);
  for (int j = 0; j < 4; ++j) {
    const double noise = j == 0 ? at.u[2] : j == 2 ? at.u[3] : 0.0;
    EXPECT_EQ(with[j], without[j] + std::sqrt(0.3) * noise);
  }
  std::vector<double> state(4), inputs(4, 7.0);
  noisy.straight_motion(2.0, at.p.data(), state.data(), inputs.data());
  EXPECT_EQ(inputs[2], 0.0);
  EXPECT_EQ(inputs[3], 0.0);
}

TEST(StateNoiseModel, TakesNoiseAsAParameterToo) {
  const auto plain = vehicle("bicycle_slip");
  const StateNoiseModel noisy(plain, {0}, {1, 3}), inputs(plain, {0, 1, 3});
  ASSERT_EQ(noisy.input_count(), 3);
  ASSERT_EQ(noisy.parameter_count(), 4);
  EXPECT_EQ(noisy.description().parameters[3].name, "delta_noise");
  EXPECT_EQ(noisy.description().blocked_noises, (std::vector{1, 3}));
  const RandomInterval at(noisy, 4);
  std::vector<double> with(4), as_inputs(4), u(at.u);
  u.insert(u.end(), at.p.begin() + 2, at.p.end());
  Model::Intervals request = at.request(false);
  request.next_states = with.data();
  noisy.integrate(request);
  request.inputs = u.data();
  request.next_states = as_inputs.data();
  inputs.integrate(request);
  EXPECT_EQ(with, as_inputs);
}

TEST(StateNoiseModel, DerivativesAreThoseOfItsValues) {
  for (const char* name : {"bicycle_slip", "tractor_trailer"}) {
    for (const auto& [ramp, states, blocked] : cases()) {
      const StateNoiseModel noisy(vehicle(name), states, blocked);
      expect_derivatives_of_differences(noisy, RandomInterval(noisy, 5), ramp, name);
    }
  }
}

TEST(StateNoiseModel, EvaluatesAnyNumberOfIntervals) {
  for (const auto& [ramp, states, blocked] : cases())
    for (const int count : {1, 7, 8, 19})
      expect_the_same_side_by_side(StateNoiseModel(vehicle("bicycle_slip"), states, blocked), count, ramp);
}

TEST(StateNoiseModel, RowsHoldTheSameNumbers) {
  for (const auto& [ramp, states, blocked] : cases()) {
    const StateNoiseModel noisy(vehicle("bicycle_slip"), states, blocked);
    const int nx = 4, nu = noisy.input_count(), np = noisy.parameter_count(), nz = nx + nu + (ramp ? 2 : 1) * np,
              row = padded(nz);
    const RandomInterval at(noisy, 7);
    std::vector<double> next(nx), J(static_cast<std::size_t>(nx) * nz), H(static_cast<std::size_t>(nz) * nz);
    Model::Intervals dense = at.request(ramp);
    dense.next_states = next.data();
    dense.jacobians = J.data();
    dense.hessians = H.data();
    noisy.integrate(dense);
    std::vector<double> z(at.x), rows(row, 9.0), jacobian(static_cast<std::size_t>(nx) * row, 9.0),
        hessian(static_cast<std::size_t>(nz) * row, 9.0), scratch(noisy.rows_scratch(1));
    z.insert(z.end(), at.p.begin(), at.p.end());
    z.insert(z.end(), at.u.begin(), at.u.end());
    if (ramp) z.insert(z.end(), at.p_end.begin(), at.p_end.end());
    z.resize(row, 5.0);
    noisy.integrate_rows({.count = 1,
                          .z = z.data(),
                          .z_step = row,
                          .ramp = ramp,
                          .durations = &at.duration,
                          .substeps = 2,
                          .next_states = rows.data(),
                          .next_step = row,
                          .jacobians = jacobian.data(),
                          .jacobian_step = nx * row,
                          .jacobian_row = row,
                          .multipliers = at.multipliers.data(),
                          .multiplier_step = nx,
                          .hessians = hessian.data(),
                          .hessian_step = nz * row,
                          .hessian_row = row,
                          .scratch = scratch.data()});
    // [x; u; p; p_end] -> [x; p; u; p_end].
    const auto place = [&](int c) { return c < nx || c >= nx + nu + np ? c : c < nx + nu ? c + np : c - nu; };
    for (int r = 0; r < nx; ++r) EXPECT_NEAR(rows[r], next[r], 1e-14);
    for (int c = 0; c < nz; ++c) {
      for (int r = 0; r < nx; ++r) EXPECT_NEAR(jacobian[r * row + place(c)], J[c * nx + r], 1e-13) << ramp << c << r;
      for (int d = 0; d < nz; ++d) EXPECT_NEAR(hessian[place(c) * row + place(d)], H[c * nz + d], 1e-12) << c << d;
    }
    for (int c = nz; c < row; ++c)
      for (int r = 0; r < nx; ++r) EXPECT_EQ(jacobian[r * row + c], 0.0);
  }
}

TEST(StateNoiseModel, RefusesStatesThatAreNotThere) {
  const auto plain = vehicle("bicycle_slip");
  EXPECT_THROW(StateNoiseModel(plain, {}), Error);
  EXPECT_THROW(StateNoiseModel(plain, {2, 2}), Error);
  EXPECT_NE(error_of([&] { StateNoiseModel(plain, {4}); }).find("indices of 0 .. 3"), std::string::npos);
  EXPECT_THROW(StateNoiseModel(std::make_shared<StateNoiseModel>(plain, std::vector{0}), {1}), Error);
  EXPECT_NE(error_of([&] {
              StateNoiseModel(plain, {1, 2}, {2});
            }).find("as an input and as a parameter"),
            std::string::npos);
}

}  // namespace state_noise_model_test
}  // namespace rhec
