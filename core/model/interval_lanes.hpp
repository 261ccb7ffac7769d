#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "graph_steps.hpp"
#include "rhec/core/formula/tape.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

// Intervals that are evaluated eight at a time in memory with places of eight lanes each, as StagedSteps and RadauSteps
// do: how a request gets there, and how results get out. A `run` has at(place), the lanes of a place, and
// integrate(durations, count, taken), which calls `taken` when values and Jacobians stand.

/// Numbers of variables, and the places of z = [x; p; u] (or [x; p; u; p_end] with a ramp), multipliers and next
/// states.
struct IntervalLanes {
  static constexpr int lanes = GraphSteps::lanes;
  int nx, np, nu, nz;
  bool ramp;
  std::uint32_t z, weights, next;
};

/// Consecutive places.
inline std::vector<std::uint32_t> numbered(std::uint32_t first, int count) {
  std::vector<std::uint32_t> all(static_cast<std::size_t>(count));
  std::iota(all.begin(), all.end(), first);
  return all;
}

/// Requests on padded rows; results are stored from where `next`, `jacobian` and `hessian` say.
template <class Run>
void integrate_rows_in_lanes(const IntervalRows& q, const IntervalLanes& at, const TapeKernels& kernels, Run& run,
                             const StoredRows& next, const StoredRows& jacobian, const StoredRows& hessian) noexcept {
  constexpr int lanes = IntervalLanes::lanes;
  for (int first = 0; first < q.count; first += lanes) {
    const int count = std::min(lanes, q.count - first);
    kernels.load_rows(q.z + first * q.z_step, q.z_step, count, at.nz, run.at(at.z), lanes, lanes);
    if (q.hessians)
      kernels.load_rows(q.multipliers + first * q.multiplier_step, q.multiplier_step, count, at.nx, run.at(at.weights),
                        lanes, lanes);
    const auto store = [&](const StoredRows& what, const RowPlaces& places) {
      kernels.store_rows(what.all.data(), what.rows, what.eights, run.at(0), lanes, places, count);
    };
    run.integrate(q.durations + first, count, [&] {
      if (q.next_states) store(next, {q.next_states + first * q.next_step, q.next_step, 0});
      if (q.jacobians) store(jacobian, {q.jacobians + first * q.jacobian_step, q.jacobian_step, q.jacobian_row});
    });
    if (q.hessians) store(hessian, {q.hessians + first * q.hessian_step, q.hessian_step, q.hessian_row});
  }
}

/// Dense requests; `moved` and `hessian` are the places of dx/dz and of the Hessian, row by row.
template <class Run>
void integrate_in_lanes(const Model::Intervals& q, const IntervalLanes& at, Run& run,
                        const std::vector<std::uint32_t>& moved, const std::vector<std::uint32_t>& hessian) noexcept {
  constexpr int lanes = IntervalLanes::lanes;
  const int nx = at.nx, np = at.np, nu = at.nu, nz = at.nz;
  // From [x; p; u; p_end] to [x; u; p; p_end].
  const auto column = [&](int c) { return c < nx || c >= nx + np + nu ? c : c < nx + np ? c + nu : c - np; };
  for (int first = 0; first < q.count; first += lanes) {
    const int count = std::min(lanes, q.count - first);
    double* to = run.at(at.z);
    const auto load = [&](const double* rows, int columns) {
      if (columns > 0) load_columns(rows + static_cast<std::ptrdiff_t>(first) * columns, columns, count, to);
      to += static_cast<std::ptrdiff_t>(columns) * lanes;
    };
    load(q.states, nx);
    load(q.parameters, np);
    load(q.inputs, nu);
    if (at.ramp) load(q.parameters_end, np);
    if (q.hessians) {
      to = run.at(at.weights);
      load(q.multipliers, nx);
    }
    run.integrate(q.durations + first, count, [&] {
      for (std::ptrdiff_t i = 0; i < count; ++i) {
        for (int r = 0; q.next_states && r < nx; ++r)
          q.next_states[(first + i) * nx + r] = run.at(at.next)[r * lanes + i];
        for (int r = 0; q.jacobians && r < nx; ++r)
          for (int c = 0; c < nz; ++c)
            q.jacobians[((first + i) * nz + column(c)) * nx + r] =
                run.at(moved[static_cast<std::size_t>(r) * nz + c])[i];
      }
    });
    for (std::ptrdiff_t i = 0; q.hessians && i < count; ++i)
      for (int r = 0; r < nz; ++r)
        for (int c = 0; c < nz; ++c)
          q.hessians[((first + i) * nz + column(r)) * nz + column(c)] =
              run.at(hessian[static_cast<std::size_t>(r) * nz + c])[i];
  }
}

/// Copies a result of a tape to a place. A tape leaves lanes without a row as they were: they repeat the last row.
inline void take_result(const Tape& tape, int which, const double* registers, int count, double* to) noexcept {
  constexpr int lanes = IntervalLanes::lanes;
  const std::ptrdiff_t source = tape.results()[static_cast<std::size_t>(which)];
  if (source < 0) {
    std::fill_n(to, lanes, tape.uniforms()[static_cast<std::size_t>(~source)]);
    return;
  }
  const double* const from = registers + source * lanes;
  std::copy_n(from, lanes, to);
  if (count < lanes) std::fill(to + count, to + lanes, from[count - 1]);
}

}  // namespace rhec
