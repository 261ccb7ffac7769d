#pragma once

// Some measurements between nodes of an RheProblem, with what its model says of them.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "interval_dynamics.hpp"
#include "point_sums.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

namespace rhec {

/// Measurements of some intervals, each with its own integration up to its time. Of an interval that has many, points,
/// between which outputs are interpolated, stand in their place. Rows are those of IntervalRows and NodeRows.
struct RheProblem::BetweenBatch {
  static constexpr int at_once = 32;  ///< so that the model fills the processor's lanes

  BetweenBatch(const RheProblem& problem, double* memory)
      : row(IntervalDynamics::row_length(problem.structure())),
        nx(problem.nx()),
        nz(problem.nx() + problem.np() + problem.nu() + (problem.structure().any_ramp() ? problem.np() : 0)),
        ny(problem.ny_),
        width(padded(nz)),
        said_size(problem.output_row_ + static_cast<std::ptrdiff_t>(problem.ny_) * width),
        point_count(static_cast<int>(problem.between_points_.size())) {
    Scratch scratch(memory);
    const std::ptrdiff_t of_states = padded(nx), data_row = padded(problem.model().data_count());
    const auto take = [&](std::ptrdiff_t each) { return scratch.take(at_once * each); };
    z = take(row);
    next = take(row);
    jacobians = take(static_cast<std::ptrdiff_t>(nx) * row);
    multipliers = take(row);
    hessians = take(static_cast<std::ptrdiff_t>(row) * row);
    durations = take(8);
    data = take(data_row);
    outputs = take(problem.output_row_);
    output_jacobians = take(ny * of_states);
    pulls = take(problem.output_row_);
    weights = take(problem.output_row_);
    curvatures = take(problem.output_row_);
    output_hessians = take(nx * of_states);
    difference = scratch.take(problem.output_row_);
    predicted = scratch.take(problem.output_row_);
    weight = scratch.take(problem.output_row_);
    pull = scratch.take(problem.output_row_);
    curvature = scratch.take(problem.output_row_);
    output_weights = scratch.take(problem.output_row_);
    of_outputs = scratch.take(static_cast<std::ptrdiff_t>(ny) * row);
    gradients =
        scratch.take(std::max({ny, nx, PointSums::most_points}) * static_cast<std::ptrdiff_t>(problem.stride()));
    product = scratch.take(static_cast<std::ptrdiff_t>(nx) * problem.stride());
    said = scratch.take(PointSums::most_points * said_size);
    parts = scratch.take(problem.setup_.most_between * padded(PointSums::most_points));
    known_weights = scratch.take(problem.setup_.most_between * problem.output_row_);
    kept = scratch.take(ny * PointSums::Kept::size);
    sums = PointSums(point_count, ny, scratch.take(static_cast<std::ptrdiff_t>(PointSums::size(ny))));
    rest = scratch.rest();
  }
  static std::size_t size(const RheProblem& problem) noexcept {
    const std::size_t row = IntervalDynamics::row_length(problem.structure()), nx = problem.nx(), ny = problem.ny_,
                      of_states = padded(problem.nx()), stride = problem.stride(), most = PointSums::most_points;
    const std::size_t interval = row * (3 + nx + row) + 8 + padded(problem.model().data_count());
    const std::size_t each = 4 * problem.output_row_ + (ny + nx) * of_states;
    return at_once * (interval + each) + 6 * problem.output_row_ + (std::max({ny, nx, most}) + nx) * stride + ny * row +
           most * (problem.output_row_ + ny * row) + ny * PointSums::Kept::size +
           problem.setup_.most_between * (padded(PointSums::most_points) + problem.output_row_) +
           PointSums::size(problem.ny_) + problem.model().rows_scratch(at_once) + 16;
  }

  /// Requests for the intervals, and for the outputs at their ends, without results.
  IntervalRows along(const RheProblem& problem) const noexcept {
    return {.count = count,
            .z = z,
            .z_step = row,
            .ramp = problem.structure().any_ramp(),
            .durations = durations,
            .data = data,
            .substeps = problem.substeps(),
            .next_states = next,
            .next_step = row,
            .jacobian_step = static_cast<std::ptrdiff_t>(nx) * row,
            .jacobian_row = row,
            .scratch = rest};
  }
  NodeRows there(const RheProblem& problem) const noexcept {
    return {.count = count,
            .states = next,
            .state_step = row,
            .output_step = problem.output_row_,
            .jacobian_row = padded(nx),
            .scratch = rest};
  }
  double* jacobian(int i) const noexcept { return jacobians + static_cast<std::ptrdiff_t>(i) * nx * row; }
  double* hessian(int i) const noexcept { return hessians + static_cast<std::ptrdiff_t>(i) * row * row; }
  /// What the model says at entry i: a row of outputs, then one of `width` with the derivatives dh/dz of each output,
  /// measured or not: one that is not may come later.
  void write_said(int i, std::ptrdiff_t output_row, double* to) const noexcept {
    std::copy_n(outputs + i * output_row, output_row, to);
    write_gradients(i, to + output_row);
  }
  void write_gradients(int i, double* to) const noexcept {
    const double* const J = jacobian(i);
    const double* const C = output_jacobians + static_cast<std::ptrdiff_t>(i) * ny * padded(nx);
    transcription_kernels().multiply_rows(C, padded(nx), J, row, {ny, nx, nz}, width, to);
  }

  /// The same for the points of an interval, the first of which is entry i, to `said`.
  void write_points(int i, std::ptrdiff_t output_row) const noexcept {
    for (int k = 0; k < point_count; ++k) write_said(i + k, output_row, said + k * said_size);
  }
  /// `entries` of that, from `from` on, at a measurement with these parts of the points.
  void combine(const double* of_points, const double* from, std::ptrdiff_t entries, double* to) const noexcept {
    std::fill_n(to, entries, 0.0);
    for (int k = 0; k < point_count; ++k, from += said_size)
      for (std::ptrdiff_t e = 0; e < entries; ++e) to[e] += of_points[k] * from[e];
  }

  const int row, nx, nz, ny, width;
  const std::ptrdiff_t said_size;  ///< of what write_said writes
  const int point_count;           ///< of an interval that has many measurements
  int count = 0;
  std::array<int, at_once> interval{};
  std::array<int, at_once> place{};  ///< of the measurement in its interval, or of the point
  std::array<std::uint8_t, at_once> is_point{};
  std::array<double, at_once> share{};  ///< of the interval's duration
  double *z, *next, *jacobians, *multipliers, *hessians, *durations, *data;
  double *outputs, *output_jacobians, *pulls, *weights, *curvatures, *output_hessians, *difference, *predicted, *weight,
      *pull, *curvature, *output_weights, *of_outputs, *gradients, *product;
  double *said, *parts, *known_weights, *kept;  ///< room for one interval with points: see OfPoints
  PointSums sums;
  double* rest;
};

/// Rows `step` apart.
struct RheProblem::ModelRows {
  const double* first;
  std::ptrdiff_t step;
};

/// What is known of an interval with points: what the model says at each (BetweenBatch::write_said), the measurements'
/// parts of the points and their weights, and the sums of these (PointSums).
struct RheProblem::OfPoints {
  const double* said;
  std::ptrdiff_t said_step;
  const double* parts;
  std::ptrdiff_t parts_step;
  double* weights;  ///< for which there are sums
  std::ptrdiff_t weights_step;
  double* kept;  ///< PointSums::Kept by output
  /// What those of quadratic costs hold for: how many measurements, the outputs' weights, and the measurements. Null:
  /// for nothing.
  double* holds_for = nullptr;
};

}  // namespace rhec
