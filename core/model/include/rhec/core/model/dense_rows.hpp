#pragma once

#include <cstddef>
#include <utility>

#include "rhec/core/model/model.hpp"

namespace rhec {

/// Dense rows of a vehicle's for some intervals, as in Model::Intervals: where a model that is made of it puts what it
/// asks of it.
struct DenseRows {
  double *x, *u, *p, *p_end, *next, *multipliers, *jacobians, *hessians, *data;

  /// Of one interval, in doubles.
  static std::size_t size(const Model& vehicle) noexcept {
    const Sizes of(vehicle);
    return static_cast<std::size_t>(of.z + 2 * of.nx + of.nx * of.z + of.z * of.z + vehicle.data_count());
  }
  DenseRows(double* memory, std::ptrdiff_t count, const Model& vehicle) noexcept {
    const Sizes of(vehicle);
    const auto take = [&](std::ptrdiff_t size) { return std::exchange(memory, memory + count * size); };
    x = take(of.nx);
    u = take(of.nu);
    p = take(of.np);
    p_end = take(of.np);
    next = take(of.nx);
    multipliers = take(of.nx);
    jacobians = take(of.nx * of.z);
    hessians = take(of.z * of.z);
    data = take(vehicle.data_count());
  }

 private:
  struct Sizes {
    std::ptrdiff_t nx, nu, np, z;  ///< z: of [x; u; p; p_end]
    explicit Sizes(const Model& vehicle) noexcept
        : nx(vehicle.state_count()), nu(vehicle.input_count()), np(vehicle.parameter_count()), z(nx + nu + 2 * np) {}
  };
};

/// Outputs of a model whose state is the vehicle's and `more` states behind it, of which they do not depend. `memory`:
/// room for n_x^2 numbers of the vehicle's, with `request.hessians`.
RHEC_EXPORT void observe_first_states(const Model& vehicle, int more, const Model::Nodes& request,
                                      double* memory) noexcept;

}  // namespace rhec
