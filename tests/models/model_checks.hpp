#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "rhec/core/model.hpp"

// What holds for every model: its derivatives are those of its values, all instruction sets agree, all that is asked
// for is written and nothing else.

namespace rhec::checks {

/// A range of stages with everything that can be asked for; results start as NaN, with a few more behind their ends.
struct Stages {
  int count, nx, nu, np, ny, nz;
  bool ramp;
  int substeps = 1;
  std::vector<double> x, u, p, p_end, durations, weights, output_weights;
  std::vector<double> next, jacobians, hessians, outputs, output_jacobians, output_hessians;

  Stages(const Model& model, int stage_count, bool with_ramp)
      : count(stage_count),
        nx(model.state_count()),
        nu(model.input_count()),
        np(model.parameter_count()),
        ny(model.output_count()),
        nz(nx + nu + (with_ramp ? 2 : 1) * np),
        ramp(with_ramp),
        durations(stage_count, 0.2),
        weights(stage_count * nx, 1.0),
        output_weights(stage_count * ny, 1.0) {
    clear();
  }

  static constexpr int behind = 8;  ///< entries behind the end of an array
  void clear() {
    const auto fill = [&](std::vector<double>& array, int size) {
      array.assign(count * size + behind, std::numeric_limits<double>::quiet_NaN());
    };
    fill(next, nx);
    fill(jacobians, nx * nz);
    fill(hessians, nz * nz);
    fill(outputs, ny);
    fill(output_jacobians, ny * nx);
    fill(output_hessians, nx * nx);
  }

  /// Requests for the results of the flags.
  Model::Intervals intervals(bool with_next, bool with_jacobians, bool with_hessians) {
    return {.count = count,
            .states = x.data(),
            .inputs = u.data(),
            .parameters = p.data(),
            .parameters_end = ramp ? p_end.data() : nullptr,
            .durations = durations.data(),
            .substeps = substeps,
            .next_states = with_next ? next.data() : nullptr,
            .jacobians = with_jacobians ? jacobians.data() : nullptr,
            .multipliers = with_hessians ? weights.data() : nullptr,
            .hessians = with_hessians ? hessians.data() : nullptr};
  }
  Model::Nodes nodes(bool with_outputs, bool with_jacobians, bool with_hessians) {
    return {.count = count,
            .states = x.data(),
            .outputs = with_outputs ? outputs.data() : nullptr,
            .jacobians = with_jacobians ? output_jacobians.data() : nullptr,
            .multipliers = with_hessians ? output_weights.data() : nullptr,
            .hessians = with_hessians ? output_hessians.data() : nullptr};
  }
};

/// Stages with values inside the bounds; every third stage has no input, and every fifth no state (zero steering).
inline Stages random_stages(const Model& model, int count, bool ramp, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(0.02, 0.98);
  Stages stages(model, count, ramp);
  const auto draw = [&](const std::vector<Variable>& variables, bool zero, std::vector<double>& into) {
    for (const Variable& v : variables) {
      const double lower = std::max(v.lower, std::min(v.upper, v.scale) - 2 * v.scale);
      const double upper = std::min(v.upper, std::max(v.lower, -v.scale) + 2 * v.scale);
      const double value = lower + (upper - lower) * uniform(engine);
      into.push_back(zero ? std::clamp(0.0, v.lower, v.upper) : value);
    }
  };
  const ModelDescription& d = model.description();
  for (int i = 0; i < count; ++i) {
    draw(d.states, i % 5 == 4, stages.x);
    draw(d.inputs, i % 3 == 2, stages.u);
    draw(d.parameters, false, stages.p);
    draw(d.parameters, false, stages.p_end);
    stages.durations[i] = 0.05 + 0.2 * uniform(engine);
  }
  for (double& weight : stages.weights) weight = 2.0 * uniform(engine) - 1.0;
  for (double& weight : stages.output_weights) weight = 2.0 * uniform(engine) - 1.0;
  return stages;
}

inline std::vector<double> scales(const std::vector<Variable>& variables) {
  std::vector<double> all;
  all.reserve(variables.size());
  for (const Variable& v : variables) all.push_back(v.scale);
  return all;
}

inline std::vector<double> joined(std::vector<double> a, const std::vector<double>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// Where entry j of z = [x; u; p; p_end] of stage i stands.
inline double& entry(Stages& s, int i, int j) {
  if (j < s.nx) return s.x[i * s.nx + j];
  if ((j -= s.nx) < s.nu) return s.u[i * s.nu + j];
  if ((j -= s.nu) < s.np) return s.p[i * s.np + j];
  return s.p_end[i * s.np + j - s.np];
}

/// Of all stages at once, the derivative of what `evaluate` gives (an array with `size` entries a stage) by entry j of
/// z, from five points of a line; their distance is h.
template <class Evaluate>
std::vector<double> difference(const Stages& stages, int j, double h, int size, Evaluate evaluate) {
  std::vector<double> slope(stages.count * size, 0.0);
  for (const auto& [steps, weight] : {std::pair{-2, 1.0}, {-1, -8.0}, {1, 8.0}, {2, -1.0}}) {
    Stages moved = stages;
    for (int i = 0; i < stages.count; ++i) entry(moved, i, j) += steps * h;
    const std::vector<double> values = evaluate(moved);
    for (std::size_t k = 0; k < slope.size(); ++k) slope[k] += weight * values[k] / (12.0 * h);
  }
  return slope;
}

inline constexpr double step = 2e-3;       ///< of the differences, as a part of a variable's scale
inline constexpr double tolerance = 2e-8;  ///< of derivatives against differences, in units of the scales

/// Compares column j of Jacobians (rows x n, column-major) with differences.
inline void expect_column(const std::vector<double>& jacobians, const std::vector<double>& slope, int count, int rows,
                          int n, int j, const std::vector<double>& row_scales, double scale) {
  for (int i = 0; i < count; ++i)
    for (int r = 0; r < rows; ++r)
      EXPECT_NEAR(jacobians[i * rows * n + j * rows + r] * scale / row_scales[r],
                  slope[i * rows + r] * scale / row_scales[r], tolerance)
          << "stage " << i << ", row " << r << ", column " << j;
}

inline std::vector<double> scales_of_z(const Model& model, bool ramp) {
  const ModelDescription& d = model.description();
  auto all = joined(joined(scales(d.states), scales(d.inputs)), scales(d.parameters));
  return ramp ? joined(all, scales(d.parameters)) : all;
}

/// First and second derivatives of F against differences of values and of Jacobians.
inline void derivatives_of_integrate(const Model& model, bool ramp, int substeps, unsigned seed) {
  Stages stages = random_stages(model, 15, ramp, seed);
  stages.substeps = substeps;
  const bool second = model.has_second_derivatives();
  model.integrate(stages.intervals(true, true, second));
  const int nx = stages.nx, nz = stages.nz;
  const std::vector<double> scale = scales_of_z(model, ramp), row_scale = scales(model.description().states);
  for (int j = 0; j < nz; ++j) {
    const auto slope = difference(stages, j, step * scale[j], nx, [&](Stages& s) {
      model.integrate(s.intervals(true, false, false));
      return s.next;
    });
    expect_column(stages.jacobians, slope, stages.count, nx, nz, j, row_scale, scale[j]);
    if (!second) continue;
    const auto curvature = difference(stages, j, step * scale[j], nz, [&](Stages& s) {
      model.integrate(s.intervals(false, true, false));
      std::vector<double> gradients(s.count * nz, 0.0);  // of multipliers' F
      for (int i = 0; i < s.count; ++i)
        for (int m = 0; m < nz; ++m)
          for (int r = 0; r < nx; ++r)
            gradients[i * nz + m] += s.weights[i * nx + r] * s.jacobians[i * nx * nz + m * nx + r];
      return gradients;
    });
    expect_column(stages.hessians, curvature, stages.count, nz, nz, j, std::vector<double>(nz, 1.0), scale[j]);
  }
}

/// The same of h.
inline void derivatives_of_observe(const Model& model, unsigned seed) {
  Stages stages = random_stages(model, 15, false, seed);
  const bool second = model.has_second_derivatives();
  model.observe(stages.nodes(true, true, second));
  const int nx = stages.nx, ny = stages.ny;
  const std::vector<double> scale = scales(model.description().states), row_scale = scales(model.description().outputs);
  for (int j = 0; j < nx; ++j) {
    const auto slope = difference(stages, j, step * scale[j], ny, [&](Stages& s) {
      model.observe(s.nodes(true, false, false));
      return s.outputs;
    });
    expect_column(stages.output_jacobians, slope, stages.count, ny, nx, j, row_scale, scale[j]);
    if (!second) continue;
    const auto curvature = difference(stages, j, step * scale[j], nx, [&](Stages& s) {
      model.observe(s.nodes(false, true, false));
      std::vector<double> gradients(s.count * nx, 0.0);
      for (int i = 0; i < s.count; ++i)
        for (int m = 0; m < nx; ++m)
          for (int r = 0; r < ny; ++r)
            gradients[i * nx + m] += s.output_weights[i * ny + r] * s.output_jacobians[i * ny * nx + m * ny + r];
      return gradients;
    });
    expect_column(stages.output_hessians, curvature, stages.count, nx, nx, j, std::vector<double>(nx, 1.0), scale[j]);
  }
}

/// F against Runge-Kutta steps written down once more, with `rates` alone.
inline void integrate_is_runge_kutta(const Model& model, bool ramp, int substeps) {
  Stages s = random_stages(model, 9, ramp, 11);
  s.substeps = substeps;
  model.integrate(s.intervals(true, false, false));
  const int nx = s.nx;
  for (int i = 0; i < s.count; ++i) {
    const double h = s.durations[i] / substeps;
    const auto rate = [&](const std::vector<double>& x, double steps_done) {
      std::vector<double> p(s.np), dxdt(nx);
      for (int j = 0; j < s.np; ++j) {
        const double from = s.p[i * s.np + j], to = ramp ? s.p_end[i * s.np + j] : from;
        p[j] = from + (to - from) * steps_done / substeps;
      }
      model.rates(x.data(), s.u.data() + i * s.nu, p.data(), dxdt.data());
      return dxdt;
    };
    const auto moved = [&](std::vector<double> x, const std::vector<double>& dxdt, double time) {
      for (int j = 0; j < nx; ++j) x[j] += dxdt[j] * time;
      return x;
    };
    std::vector<double> x(s.x.begin() + i * nx, s.x.begin() + (i + 1) * nx);
    for (int n = 0; n < substeps; ++n) {
      const auto k1 = rate(x, n), k2 = rate(moved(x, k1, h / 2), n + 0.5), k3 = rate(moved(x, k2, h / 2), n + 0.5),
                 k4 = rate(moved(x, k3, h), n + 1);
      for (int j = 0; j < nx; ++j) x[j] += h / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
    }
    for (int j = 0; j < nx; ++j)
      EXPECT_NEAR(s.next[i * nx + j], x[j], 1e-13 * (1.0 + std::abs(x[j]))) << i << ", " << j;
  }
}

/// All entries written and none behind them, and the same as in `expected` to 1e-13 of the largest entry of their
/// stage.
inline void expect_same(const std::vector<double>& found, const std::vector<double>& expected, int count,
                        const std::string& what) {
  const int size = (static_cast<int>(found.size()) - Stages::behind) / std::max(count, 1);
  for (int i = 0; i < count; ++i) {
    double largest = 1.0;
    for (int k = 0; k < size; ++k) largest = std::max(largest, std::abs(expected[i * size + k]));
    for (int k = 0; k < size; ++k) {
      const double difference = std::abs(found[i * size + k] - expected[i * size + k]);
      EXPECT_TRUE(difference <= 1e-13 * largest)  // false of NaN
          << what << ": stage " << i << " of " << count << ", entry " << k << ": " << found[i * size + k] << " and "
          << expected[i * size + k];
    }
  }
  for (int k = 0; k < Stages::behind; ++k) EXPECT_TRUE(std::isnan(found[count * size + k])) << what << ": past its end";
}

/// For counts that fill packs and that do not, and for every choice of what is asked for: the results of `model` are
/// those of `generic`, the same model with the instruction set of that name.
inline void same_as_generic(const Model& model, const Model& generic) {
  for (int count = 0; count <= 17; ++count) {
    for (const bool ramp : {false, true}) {
      Stages expected = random_stages(model, count, ramp, 100 + count);
      expected.substeps = 1 + count % 3;
      const bool second = model.has_second_derivatives();
      generic.integrate(expected.intervals(true, true, second));
      generic.observe(expected.nodes(true, true, second));
      for (int asked = 0; asked < (second ? 8 : 4); ++asked) {
        const bool values = asked & 1, first = asked & 2, hessians = asked & 4;
        Stages s = expected;
        s.clear();
        model.integrate(s.intervals(values, first, hessians));
        model.observe(s.nodes(values, first, hessians));
        if (values) expect_same(s.next, expected.next, count, "next states");
        if (first) expect_same(s.jacobians, expected.jacobians, count, "Jacobians");
        if (hessians) expect_same(s.hessians, expected.hessians, count, "Hessians");
        if (values) expect_same(s.outputs, expected.outputs, count, "outputs");
        if (first) expect_same(s.output_jacobians, expected.output_jacobians, count, "Jacobians of outputs");
        if (hessians) expect_same(s.output_hessians, expected.output_hessians, count, "Hessians of outputs");
      }
    }
  }
}

}  // namespace rhec::checks
