#include "rhec/core/model/dense_rows.hpp"

#include <algorithm>

namespace rhec {

void observe_first_states(const Model& vehicle, int more, const Model::Nodes& request, double* memory) noexcept {
  const std::ptrdiff_t ny = vehicle.output_count(), nx = vehicle.state_count(), n = nx + more;
  // One node at a time in place: the vehicle's state comes first.
  for (std::ptrdiff_t i = 0; i < request.count; ++i) {
    double* const jacobian = request.jacobians ? request.jacobians + i * ny * n : nullptr;
    double* const hessian = request.hessians ? request.hessians + i * n * n : nullptr;
    vehicle.observe({.count = 1,
                     .states = request.states + i * n,
                     .outputs = request.outputs ? request.outputs + i * ny : nullptr,
                     .jacobians = jacobian,
                     .multipliers = hessian ? request.multipliers + i * ny : nullptr,
                     .hessians = hessian ? memory : nullptr});
    if (jacobian) std::fill(jacobian + ny * nx, jacobian + ny * n, 0.0);
    if (!hessian) continue;
    std::fill_n(hessian, n * n, 0.0);
    for (std::ptrdiff_t c = 0; c < nx; ++c) std::copy_n(memory + c * nx, nx, hessian + c * n);
  }
}

}  // namespace rhec
