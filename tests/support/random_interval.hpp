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

/// Expects several intervals in one request to have the results that each has in one of its own.
inline void expect_the_same_side_by_side(const Model& model, int count, bool ramp) {
  RandomInterval all(model, 100);
  std::vector<double> durations{all.duration};
  for (int i = 1; i < count; ++i) {
    const RandomInterval next(model, 100 + i);
    for (auto [to, from] : {std::pair{&all.x, &next.x},
                            {&all.u, &next.u},
                            {&all.p, &next.p},
                            {&all.p_end, &next.p_end},
                            {&all.multipliers, &next.multipliers}})
      to->insert(to->end(), from->begin(), from->end());
    durations.push_back(next.duration + 0.01 * i);
  }
  const std::size_t nx = model.state_count(), nz = nx + model.input_count() + (ramp ? 2 : 1) * model.parameter_count();
  struct Results {
    std::vector<double> next, jacobian, hessian;
  };
  const auto integrate = [&](Model::Intervals request, int first, int number) {
    const std::size_t rows = number;
    Results results{std::vector<double>(rows * nx), std::vector<double>(rows * nx * nz),
                    std::vector<double>(rows * nz * nz)};
    request.count = number;
    request.states += first * model.state_count();
    request.inputs += first * model.input_count();
    request.parameters += first * model.parameter_count();
    if (ramp) request.parameters_end += first * model.parameter_count();
    request.multipliers += first * model.state_count();
    request.durations = durations.data() + first;
    request.next_states = results.next.data();
    request.jacobians = results.jacobian.data();
    request.hessians = results.hessian.data();
    model.integrate(request);
    return results;
  };
  const Results together = integrate(all.request(ramp), 0, count);
  for (int i = 0; i < count; ++i) {
    const Results alone = integrate(all.request(ramp), i, 1);
    for (std::size_t e = 0; e < nx; ++e) EXPECT_NEAR(together.next[i * nx + e], alone.next[e], 1e-13) << i;
    for (std::size_t e = 0; e < nx * nz; ++e)
      EXPECT_NEAR(together.jacobian[i * nx * nz + e], alone.jacobian[e], 1e-12) << i;
    for (std::size_t e = 0; e < nz * nz; ++e)
      EXPECT_NEAR(together.hessian[i * nz * nz + e], alone.hessian[e], 1e-11) << i;
  }
}

}  // namespace rhec
