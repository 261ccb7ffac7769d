#include "rhec/core/model/model.hpp"

#include <algorithm>
#include <cmath>
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/scratch.hpp"

namespace rhec {

std::vector<std::string> names_of(const std::vector<Variable>& variables) {
  std::vector<std::string> names;
  names.reserve(variables.size());
  for (const Variable& variable : variables) names.push_back(variable.name);
  return names;
}

double middle_value(const Variable& parameter) {
  const double middle = 0.5 * (parameter.lower + parameter.upper);
  return std::isfinite(middle) ? middle : parameter.nominal;
}

std::vector<double> nominal_values(const std::vector<Variable>& parameters) {
  std::vector<double> values;
  values.reserve(parameters.size());
  for (const Variable& parameter : parameters) values.push_back(parameter.nominal);
  return values;
}

void Roles::place(double x, double y, double direction, double* state) const noexcept {
  if (position_x >= 0) state[position_x] = x;
  if (position_y >= 0) state[position_y] = y;
  if (heading >= 0) state[heading] = direction;
  for (const int body : other_headings) state[body] = direction;
}

void Roles::turn(double angle, double* state) const noexcept {
  if (heading >= 0) state[heading] += angle;
  for (const int body : other_headings) state[body] += angle;
}

void Model::straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept {
  const Roles& roles = description().roles;
  const double wheel_speed = roles.speed_factor >= 0 ? ground_speed / p[roles.speed_factor] : ground_speed;
  std::fill_n(inputs, input_count(), 0.0);
  if (roles.speed >= 0) inputs[roles.speed] = wheel_speed;
  if (roles.speed_state >= 0) state[roles.speed_state] = wheel_speed;
}

std::size_t Model::rows_scratch(int count) const noexcept {
  const auto nx = static_cast<std::size_t>(state_count()), nu = static_cast<std::size_t>(input_count()),
             np = static_cast<std::size_t>(parameter_count()), ny = static_cast<std::size_t>(output_count());
  const std::size_t nz = nx + nu + 2 * np;
  const std::size_t interval = 2 * nx + nu + 2 * np + nx + nx * nz + nz * nz, node = nx + 2 * ny + nx * ny + nx * nx;
  return static_cast<std::size_t>(count) * std::max(interval, node) + 7;
}

void Model::integrate_rows(const IntervalRows& q) const noexcept {
  const int nx = state_count(), nu = input_count(), np = parameter_count();
  const int nz = nx + nu + np + (q.ramp ? np : 0);
  Scratch scratch(q.scratch);
  double *x = scratch.take(q.count * nx), *u = scratch.take(q.count * nu), *p = scratch.take(q.count * np),
         *p_end = scratch.take(q.count * np), *multipliers = scratch.take(q.count * nx),
         *next = scratch.take(q.count * nx), *jacobians = scratch.take(q.count * nx * nz),
         *hessians = scratch.take(q.count * nz * nz);
  for (int i = 0; i < q.count; ++i) {
    const double* z = q.z + i * q.z_step;
    std::copy_n(z, nx, x + i * nx);
    std::copy_n(z + nx, np, p + i * np);
    std::copy_n(z + nx + np, nu, u + i * nu);
    if (q.ramp) std::copy_n(z + nx + np + nu, np, p_end + i * np);
    if (q.hessians) std::copy_n(q.multipliers + i * q.multiplier_step, nx, multipliers + i * nx);
  }
  Intervals request;
  request.count = q.count;
  request.states = x;
  request.inputs = u;
  request.parameters = p;
  request.parameters_end = q.ramp ? p_end : nullptr;
  request.durations = q.durations;
  request.data = q.data;
  request.substeps = q.substeps;
  request.next_states = q.next_states ? next : nullptr;
  request.jacobians = q.jacobians ? jacobians : nullptr;
  request.multipliers = q.hessians ? multipliers : nullptr;
  request.hessians = q.hessians ? hessians : nullptr;
  integrate(request);
  // From [x; u; p; p_end] to [x; p; u; p_end].
  const auto column = [&](int z) { return z < nx || z >= nx + nu + np ? z : z < nx + nu ? z + np : z - nu; };
  for (int i = 0; i < q.count; ++i) {
    if (q.next_states) {
      std::fill_n(q.next_states + i * q.next_step, padded(nx), 0.0);
      std::copy_n(next + i * nx, nx, q.next_states + i * q.next_step);
    }
    for (int r = 0; q.jacobians && r < nx; ++r) {
      double* row = q.jacobians + i * q.jacobian_step + r * q.jacobian_row;
      std::fill_n(row, padded(nz), 0.0);
      for (int c = 0; c < nz; ++c) row[column(c)] = jacobians[(i * nz + c) * nx + r];
    }
    for (int r = 0; q.hessians && r < nz; ++r) {
      double* row = q.hessians + i * q.hessian_step + column(r) * q.hessian_row;
      std::fill_n(row, padded(nz), 0.0);
      for (int c = 0; c < nz; ++c) row[column(c)] = hessians[(i * nz + c) * nz + r];
    }
  }
}

void Model::observe_rows(const NodeRows& q) const noexcept {
  const int nx = state_count(), all = output_count(), ny = q.chosen ? q.chosen_count : all;
  Scratch scratch(q.scratch);
  double *x = scratch.take(q.count * nx), *outputs = scratch.take(q.count * all),
         *jacobians = scratch.take(q.count * nx * all), *multipliers = scratch.take(q.count * all),
         *hessians = scratch.take(q.count * nx * nx);
  for (int i = 0; i < q.count; ++i) std::copy_n(q.states + i * q.state_step, nx, x + i * nx);
  if (q.hessians) {
    std::fill_n(multipliers, q.count * all, 0.0);
    for (int i = 0; i < q.count; ++i)
      for (int j = 0; j < ny; ++j)
        multipliers[i * all + (q.chosen ? q.chosen[j] : j)] += q.multipliers[i * q.multiplier_step + j];
  }
  Nodes request;
  request.count = q.count;
  request.states = x;
  request.outputs = q.outputs ? outputs : nullptr;
  request.jacobians = q.jacobians ? jacobians : nullptr;
  request.multipliers = q.hessians ? multipliers : nullptr;
  request.hessians = q.hessians ? hessians : nullptr;
  observe(request);
  for (int i = 0; i < q.count; ++i) {
    if (q.outputs) std::fill_n(q.outputs + i * q.output_step, padded(ny), 0.0);
    for (int j = 0; j < ny; ++j) {
      const int from = q.chosen ? q.chosen[j] : j;
      if (q.outputs) q.outputs[i * q.output_step + j] = outputs[i * all + from];
      if (!q.jacobians) continue;
      double* row = q.jacobians + (i * ny + j) * q.jacobian_row;
      std::fill_n(row, padded(nx), 0.0);
      for (int c = 0; c < nx; ++c) row[c] = jacobians[(i * nx + c) * all + from];
    }
    for (int r = 0; q.hessians && r < nx; ++r) {
      double* row = q.hessians + i * q.hessian_step + r * q.hessian_row;
      for (int c = 0; c < nx; ++c) row[c] += hessians[(i * nx + c) * nx + r];
    }
  }
}

}  // namespace rhec
