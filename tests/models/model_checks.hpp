#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/padded.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/sim/check/derivative_check.hpp"
#include "rhec/sim/numbers/random.hpp"

// What holds for every model beside what `rhec check` looks at: all instruction sets agree, all that is asked for is
// written and nothing else.

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

/// Stages inside the bounds, with weights for second derivatives.
inline Stages random_stages(const Model& model, int count, bool ramp, unsigned seed) {
  Stages stages(model, count, ramp);
  sim::StagePoints points = sim::random_stages(model.description(), count, seed);
  stages.x = std::move(points.states);
  stages.u = std::move(points.inputs);
  stages.p = std::move(points.parameters);
  stages.p_end = std::move(points.parameters_end);
  stages.durations = std::move(points.durations);
  sim::RandomStream random(seed, "weights");
  for (double& weight : stages.weights) weight = random.uniform(-1.0, 1.0);
  for (double& weight : stages.output_weights) weight = random.uniform(-1.0, 1.0);
  return stages;
}

inline constexpr double tolerance = 2e-8;  ///< of derivatives against differences

/// All derivatives are those of the values, and F is made of Runge-Kutta steps.
inline void expect_derivatives(const Model& model, bool ramp, int substeps, unsigned seed) {
  const ModelDescription& about = model.description();
  const sim::StagePoints stages = sim::random_stages(about, 15, seed);
  const sim::DerivativeErrors errors = sim::derivative_errors(model, about, stages, ramp, substeps);
  EXPECT_EQ(errors.skipped, 0);
  EXPECT_GT(errors.compared, 0);
  for (const sim::WorstEntry* worst : {&errors.first, &errors.second, &errors.output_first, &errors.output_second})
    EXPECT_LE(worst->error, tolerance) << worst->where << ": " << worst->given << ", differences " << worst->expected;
}

inline void expect_runge_kutta(const Model& model, bool ramp, int substeps) {
  const ModelDescription& about = model.description();
  const sim::WorstEntry worst = sim::integration_error(model, about, sim::random_stages(about, 9, 11), ramp, substeps);
  EXPECT_FALSE(worst.where.empty()) << "nothing was compared";
  EXPECT_LE(worst.error, 1e-13) << worst.where << ": " << worst.given << ", steps of rates " << worst.expected;
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

/// Bit by bit the same results of both, for counts that fill packs and that do not.
inline void expect_same_bits(const Model& one, const Model& other) {
  const auto compare = [](const std::vector<double>& found, const std::vector<double>& expected, const char* what) {
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t k = 0; k < found.size(); ++k)
      EXPECT_EQ(std::bit_cast<std::uint64_t>(found[k]), std::bit_cast<std::uint64_t>(expected[k]))
          << what << ", entry " << k << ": " << found[k] << " and " << expected[k];
  };
  for (const int count : {1, 8, 13}) {
    for (const bool ramp : {false, true}) {
      for (const int substeps : {1, 2}) {
        Stages found = random_stages(one, count, ramp, 40 + count), expected = found;
        found.substeps = expected.substeps = substeps;
        one.integrate(found.intervals(true, true, true));
        other.integrate(expected.intervals(true, true, true));
        compare(found.next, expected.next, "F");
        compare(found.jacobians, expected.jacobians, "dF");
        compare(found.hessians, expected.hessians, "d2F");
        one.observe(found.nodes(true, true, true));
        other.observe(expected.nodes(true, true, true));
        compare(found.outputs, expected.outputs, "h");
        compare(found.output_jacobians, expected.output_jacobians, "dh");
        compare(found.output_hessians, expected.output_hessians, "d2h");
      }
    }
  }
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

/// Rows as they lie in an Iterate and a StageQp hold what `observe` gives of the same nodes: some of the outputs in
/// another order, zeros up to the next multiple of eight, Hessians added to what was there. `by_rows` answers.
template <class Observe>
void same_by_rows(const Model& model, int count, const Observe& by_rows) {
  const bool second = model.has_second_derivatives();
  Stages s = random_stages(model, count, false, 200 + count);
  std::vector<int> chosen;
  for (int j = s.ny - 1; j >= 0; j -= 2) chosen.push_back(j);
  const int some = static_cast<int>(chosen.size()), row = padded(s.nx + 5), output_row = padded(some),
            jacobian_row = padded(s.nx);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> states(static_cast<std::size_t>(count) * row, nan),
      weights(static_cast<std::size_t>(count) * output_row, nan), outputs(weights.size() + Stages::behind, nan),
      jacobians(static_cast<std::size_t>(count) * some * jacobian_row, nan),
      hessians(static_cast<std::size_t>(count) * (s.nx + 2) * row, 3.0), scratch(model.rows_scratch(count));
  std::fill(s.output_weights.begin(), s.output_weights.end(), 0.0);
  for (int i = 0; i < count; ++i) {
    std::copy_n(&s.x[i * s.nx], s.nx, &states[i * row]);
    for (int j = 0; j < some; ++j) weights[i * output_row + j] = s.output_weights[i * s.ny + chosen[j]] = 0.3 * i - j;
  }
  model.observe(s.nodes(true, true, second));
  by_rows({.count = count,
           .states = states.data(),
           .state_step = row,
           .chosen = chosen.data(),
           .chosen_count = some,
           .outputs = outputs.data(),
           .output_step = output_row,
           .jacobians = jacobians.data(),
           .jacobian_row = jacobian_row,
           .multipliers = second ? weights.data() : nullptr,
           .multiplier_step = output_row,
           .hessians = second ? hessians.data() : nullptr,
           .hessian_step = (s.nx + 2) * row,
           .hessian_row = row,
           .scratch = scratch.data()});
  for (int i = 0; i < count; ++i) {
    SCOPED_TRACE("node " + std::to_string(i) + " of " + std::to_string(count));
    for (int j = 0; j < padded(some); ++j)
      EXPECT_NEAR(outputs[i * output_row + j], j < some ? s.outputs[i * s.ny + chosen[j]] : 0.0, 1e-12) << j;
    for (int j = 0; j < some; ++j)
      for (int c = 0; c < jacobian_row; ++c)
        EXPECT_NEAR(jacobians[(i * some + j) * jacobian_row + c],
                    c < s.nx ? s.output_jacobians[(i * s.nx + c) * s.ny + chosen[j]] : 0.0, 1e-12)
            << j << ", " << c;
    for (int r = 0; r < s.nx + 2; ++r)
      for (int c = 0; c < row; ++c)
        EXPECT_NEAR(hessians[(i * (s.nx + 2) + r) * row + c],
                    3.0 + (second && r < s.nx && c < s.nx ? s.output_hessians[(i * s.nx + c) * s.nx + r] : 0.0), 1e-12)
            << r << ", " << c;
  }
  for (int k = 0; k < Stages::behind; ++k) EXPECT_TRUE(std::isnan(outputs[weights.size() + k])) << "past their end";
}

/// The same of steps: [x; p; u], or [x; p; u; p_end] on ramps. All is written, nothing added.
template <class Integrate>
void same_steps_by_rows(const Model& model, int count, bool ramp, int substeps, const Integrate& by_rows) {
  const bool second = model.has_second_derivatives();
  Stages s = random_stages(model, count, ramp, 300 + count);
  s.substeps = substeps;
  model.integrate(s.intervals(true, true, second));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::size_t row = padded(s.nz), state_row = padded(s.nx), stages = count;
  std::vector<double> z(stages * row, nan), weights(stages * state_row, nan), next(stages * state_row, nan),
      jacobians(stages * s.nx * row, nan), hessians(stages * s.nz * row, nan), scratch(model.rows_scratch(count));
  for (int i = 0; i < count; ++i) {
    double* to = &z[i * row];
    to = std::copy_n(&s.x[i * s.nx], s.nx, to);
    to = std::copy_n(s.p.data() + i * s.np, s.np, to);
    to = std::copy_n(s.u.data() + i * s.nu, s.nu, to);
    if (ramp) std::copy_n(s.p_end.data() + i * s.np, s.np, to);
    std::copy_n(&s.weights[i * s.nx], s.nx, &weights[i * state_row]);
  }
  const auto step = [](std::size_t size) { return static_cast<std::ptrdiff_t>(size); };
  by_rows({.count = count,
           .z = z.data(),
           .z_step = step(row),
           .ramp = ramp,
           .durations = s.durations.data(),
           .substeps = substeps,
           .next_states = next.data(),
           .next_step = step(state_row),
           .jacobians = jacobians.data(),
           .jacobian_step = step(s.nx * row),
           .jacobian_row = step(row),
           .multipliers = second ? weights.data() : nullptr,
           .multiplier_step = step(state_row),
           .hessians = second ? hessians.data() : nullptr,
           .hessian_step = step(s.nz * row),
           .hessian_row = step(row),
           .scratch = scratch.data()});
  // Where an entry of [x; p; u; p_end] is in [x; u; p; p_end].
  const auto dense = [&](int k) {
    const bool is_parameter = k >= s.nx && k < s.nx + s.np, is_input = k >= s.nx + s.np && k < s.nx + s.np + s.nu;
    return is_parameter ? k + s.nu : is_input ? k - s.np : k;
  };
  const auto expect_near = [](double found, double expected) {
    EXPECT_NEAR(found, expected, 1e-12 * (1.0 + std::abs(expected)));
  };
  for (int i = 0; i < count; ++i) {
    SCOPED_TRACE("interval " + std::to_string(i) + " of " + std::to_string(count));
    for (int r = 0; r < s.nx; ++r) {
      expect_near(next[i * state_row + r], s.next[i * s.nx + r]);
      for (int c = 0; c < static_cast<int>(row); ++c)
        expect_near(jacobians[(i * s.nx + r) * row + c],
                    c < s.nz ? s.jacobians[(i * s.nz + dense(c)) * s.nx + r] : 0.0);
    }
    for (int r = 0; second && r < s.nz; ++r)
      for (int c = 0; c < static_cast<int>(row); ++c)
        expect_near(hessians[(i * s.nz + r) * row + c],
                    c < s.nz ? s.hessians[(i * s.nz + dense(c)) * s.nz + dense(r)] : 0.0);
  }
}

}  // namespace rhec::checks
