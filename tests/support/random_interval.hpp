#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/model/model.hpp"

namespace rhec {

/// Random values of all that a request for one interval or one node of a model may ask for.
struct RandomInterval {
  std::vector<double> x, u, p, p_end;
  std::vector<double> multipliers;  ///< of next states
  std::vector<double> weights;      ///< of outputs
  double duration = 0.3;

  RandomInterval(const Model& model, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> number(0.2, 0.8);
    for (auto [values, count] : {std::pair{&x, model.state_count()},
                                 {&u, model.input_count()},
                                 {&p, model.parameter_count()},
                                 {&p_end, model.parameter_count()},
                                 {&multipliers, model.state_count()},
                                 {&weights, model.output_count()}})
      for (int j = 0; j < count; ++j) values->push_back(number(random));
  }

  Model::Intervals request(bool ramp) const {
    return {.count = 1,
            .states = x.data(),
            .inputs = u.data(),
            .parameters = p.data(),
            .parameters_end = ramp ? p_end.data() : nullptr,
            .durations = &duration,
            .substeps = 2,
            .multipliers = multipliers.data()};
  }
};

/// Expects the first and second derivatives of `integrate` at a point to be central differences.
inline void expect_derivatives_of_differences(const Model& model, const RandomInterval& at, bool ramp,
                                              const std::string& of_what) {
  constexpr double step = 1e-5;
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count();
  const int nz = nx + nu + (ramp ? 2 : 1) * np;
  std::vector<double> J(static_cast<std::size_t>(nx) * nz), H(static_cast<std::size_t>(nz) * nz);
  Model::Intervals request = at.request(ramp);
  request.jacobians = J.data();
  request.hessians = H.data();
  model.integrate(request);
  for (int c = 0; c < nz; ++c) {
    std::vector<double> next[2], jacobian[2];
    for (const int side : {0, 1}) {
      RandomInterval moved = at;
      std::vector<double>& of = c < nx ? moved.x : c < nx + nu ? moved.u : c < nx + nu + np ? moved.p : moved.p_end;
      of[c < nx ? c : c < nx + nu ? c - nx : (c - nx - nu) % np] += side == 0 ? -step : step;
      next[side].resize(nx);
      jacobian[side].resize(J.size());
      Model::Intervals there = moved.request(ramp);
      there.next_states = next[side].data();
      there.jacobians = jacobian[side].data();
      model.integrate(there);
    }
    for (int r = 0; r < nx; ++r)
      EXPECT_NEAR(J[c * nx + r], (next[1][r] - next[0][r]) / (2.0 * step), 1e-8) << of_what << ' ' << c << ' ' << r;
    for (int d = 0; d < nz; ++d) {
      double second = 0.0;
      for (int r = 0; r < nx; ++r)
        second += at.multipliers[r] * (jacobian[1][d * nx + r] - jacobian[0][d * nx + r]) / (2.0 * step);
      EXPECT_NEAR(H[c * nz + d], second, 1e-7) << of_what << ' ' << c << ' ' << d;
    }
  }
}

}  // namespace rhec
