#pragma once

// Some measurements between nodes of an RheProblem, with what its model says of them.

#include <algorithm>
#include <array>
#include <cstddef>

#include "interval_dynamics.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// Measurements of some intervals, each with its own integration up to its time; or of one interval that has many, with
/// states interpolated between few points of it. Rows are those of IntervalRows and NodeRows.
struct RheProblem::BetweenBatch {
  static constexpr int at_once = 32;  ///< so that the model fills the processor's lanes
  static constexpr int most_points = 8;

  /// Memory for some intervals as the model takes them, and what it says of them.
  struct Intervals {
    double *z, *next, *jacobians, *multipliers, *hessians, *durations, *data;
  };

  BetweenBatch(const RheProblem& problem, double* memory)
      : row(IntervalDynamics::row_length(problem.structure())),
        nx(problem.nx()),
        nz(problem.nx() + problem.np() + problem.nu() + (problem.structure().any_ramp() ? problem.np() : 0)),
        width(padded(nz)) {
    Scratch scratch(memory);
    const std::ptrdiff_t ny = problem.ny_, of_states = padded(nx), data_row = padded(problem.model().data_count());
    const auto take = [&](std::ptrdiff_t intervals) -> Intervals {
      const auto of_each = [&](std::ptrdiff_t each) { return scratch.take(intervals * each); };
      return {of_each(row),       of_each(row), of_each(nx * row), of_each(row),
              of_each(row * row), of_each(8),   of_each(data_row)};
    };
    own = take(at_once);
    points = take(most_points);
    outputs = scratch.take(at_once * problem.output_row_);
    output_jacobians = scratch.take(at_once * ny * of_states);
    pulls = scratch.take(at_once * problem.output_row_);
    weights = scratch.take(at_once * problem.output_row_);
    curvatures = scratch.take(at_once * problem.output_row_);
    output_hessians = scratch.take(at_once * nx * of_states);
    difference = scratch.take(problem.output_row_);
    of_outputs = scratch.take(ny * row);
    gradients = scratch.take(std::max<std::ptrdiff_t>(ny, nx) * problem.stride());
    product = scratch.take(static_cast<std::ptrdiff_t>(nx) * problem.stride());
    rest = scratch.rest();
  }
  static std::size_t size(const RheProblem& problem) noexcept {
    const std::size_t row = IntervalDynamics::row_length(problem.structure()), nx = problem.nx(), ny = problem.ny_,
                      of_states = padded(problem.nx()), stride = problem.stride();
    const std::size_t interval = row * (3 + nx + row) + 8 + padded(problem.model().data_count());
    const std::size_t each = 4 * problem.output_row_ + (ny + nx) * of_states;
    return (at_once + most_points) * interval + at_once * each + problem.output_row_ +
           (std::max(ny, nx) + nx) * stride + ny * row + problem.model().rows_scratch(at_once) + 16;
  }

  /// Requests for so many intervals, and for the outputs at their ends, without results.
  IntervalRows along(const RheProblem& problem, const Intervals& of, int intervals) const noexcept {
    return {.count = intervals,
            .z = of.z,
            .z_step = row,
            .ramp = problem.structure().any_ramp(),
            .durations = of.durations,
            .data = of.data,
            .substeps = problem.substeps(),
            .next_states = of.next,
            .next_step = row,
            .jacobian_step = static_cast<std::ptrdiff_t>(nx) * row,
            .jacobian_row = row,
            .scratch = rest};
  }
  NodeRows there(const RheProblem& problem) const noexcept {
    return {.count = count,
            .states = own.next,
            .state_step = row,
            .output_step = problem.output_row_,
            .jacobian_row = padded(nx),
            .scratch = rest};
  }
  double* jacobian(const Intervals& of, int i) const noexcept {
    return of.jacobians + static_cast<std::ptrdiff_t>(i) * nx * row;
  }
  double* hessian(const Intervals& of, int i) const noexcept {
    return of.hessians + static_cast<std::ptrdiff_t>(i) * row * row;
  }
  /// dh/dz of measurement i: a row of `width` for each output, measured or not: one that is not may come later.
  void write_gradients(int i, int ny, double* to) const noexcept {
    const double* const J = jacobian(own, i);
    const double* C = output_jacobians + static_cast<std::ptrdiff_t>(i) * ny * padded(nx);
    for (int j = 0; j < ny; ++j, C += padded(nx), to += width) {
      std::fill_n(to, width, 0.0);
      for (int r = 0; r < nx; ++r)
        if (C[r] != 0.0)
          for (int k = 0; k < nz; ++k) to[k] += C[r] * J[r * row + k];
    }
  }

  const int row, nx, nz, width;
  int count = 0;
  int point_count = 0;  ///< of the one interval whose measurements these are; 0: each is integrated by itself
  std::array<int, at_once> interval{}, place{};
  std::array<double, at_once> share{};  ///< of the interval's duration
  /// By measurement, the shares of the interval's begin and of its points in the state there.
  std::array<double, at_once*(most_points + 1)> parts{};
  Intervals own{}, points{};
  double *outputs, *output_jacobians, *pulls, *weights, *curvatures, *output_hessians, *difference, *of_outputs,
      *gradients, *product, *rest;
};

}  // namespace rhec
