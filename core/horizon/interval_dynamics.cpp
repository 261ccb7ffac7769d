#include "interval_dynamics.hpp"

#include <algorithm>

#include "rhec/core/base/scratch.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

namespace rhec {
namespace {

/// Number of intervals integrated at once, so that their rows stay in the cache until the defects are computed.
constexpr int evaluated_at_once = 64;

/// Dense rows for a range of intervals.
struct Rows {
  double *x, *u, *p, *p_end, *next;
  Rows(Scratch scratch, std::ptrdiff_t count, const HorizonStructure& structure)
      : x(scratch.take(count * structure.vehicle_states())),
        u(scratch.take(count * structure.inputs())),
        p(scratch.take(count * structure.parameters())),
        p_end(scratch.take(count * structure.parameters())),
        next(scratch.take(count * structure.vehicle_states())) {}
};

}  // namespace

int IntervalDynamics::row_length(const HorizonStructure& structure) noexcept {
  return Capacity{0, structure.vehicle_states() + structure.parameters(), structure.inputs() + structure.parameters()}
      .row();
}

std::size_t IntervalDynamics::scratch_size(const Model& model, const HorizonStructure& structure,
                                           std::size_t intervals) noexcept {
  const std::size_t nx = structure.vehicle_states(), nu = structure.inputs(), np = structure.parameters();
  const std::size_t row = row_length(structure), dense = 2 * nx + nu + 2 * np, rows = row * (1 + nx + row);
  return intervals * (dense + rows) + model.rows_scratch(static_cast<int>(intervals)) + 8;
}

void IntervalDynamics::gather(const Iterate& iterate, StageRange range, double* x, double* u, double* p,
                              double* p_end) const noexcept {
  const int nx = structure.vehicle_states(), nu = structure.inputs(), np = structure.parameters();
  for (int i = range.first; i <= range.last; ++i) {
    const double *s = iterate.state(i), *w = iterate.control(i);
    for (int j = 0; j < nx; ++j) x[j] = s[j];
    if (structure.is_direct())
      for (int j = 0; j < nu; ++j) u[j] = w[j];
    else
      structure.inputs_on(iterate, i, u);
    for (int j = 0; j < np; ++j) {
      const int control = structure.control_of_lifted(i, j);
      p_end[j] = control >= 0 ? w[control] : s[nx + j];
      p[j] = structure.is_ramp(j) ? s[nx + j] : p_end[j];
    }
    x += nx;
    u += nu;
    p += np;
    p_end += np;
  }
}

void IntervalDynamics::write_defects(const Iterate& iterate, double* defects, double* scratch) const noexcept {
  const int nx = structure.vehicle_states(), lifted = structure.lifted_count(), N = structure.intervals();
  for (int first = 0; first < N; first += evaluated_at_once) {
    const StageRange piece{first, std::min(first + evaluated_at_once, N) - 1};
    const int count = piece.last - first + 1;
    const Rows rows(Scratch(scratch), count, structure);
    gather(iterate, piece, rows.x, rows.u, rows.p, rows.p_end);
    model.integrate({.count = count,
                     .states = rows.x,
                     .inputs = rows.u,
                     .parameters = rows.p,
                     .parameters_end = structure.any_ramp() ? rows.p_end : nullptr,
                     .durations = durations + first,
                     .data = data_of(first),
                     .substeps = substeps,
                     .next_states = rows.next});
    const double* next = rows.next;
    for (int i = first; i <= piece.last; ++i, next += nx) {
      double* defect = defects + static_cast<std::ptrdiff_t>(i) * structure.capacity().states;
      const double *s = iterate.state(i), *w = iterate.control(i), *s_next = iterate.state(i + 1);
      const int* control_of = structure.controls_of_lifted(i);
      for (int j = 0; j < nx; ++j) defect[j] = next[j] - s_next[j];
      for (int c = 0; c < lifted; ++c)
        defect[nx + c] = (control_of[c] >= 0 ? w[control_of[c]] : s[nx + c]) - s_next[nx + c];
    }
  }
}

void IntervalDynamics::simulate(int interval, Iterate& iterate, double* scratch) const noexcept {
  const Rows rows(Scratch(scratch), 1, structure);
  gather(iterate, {interval, interval}, rows.x, rows.u, rows.p, rows.p_end);
  model.integrate({.count = 1,
                   .states = rows.x,
                   .inputs = rows.u,
                   .parameters = rows.p,
                   .parameters_end = structure.any_ramp() ? rows.p_end : nullptr,
                   .durations = durations + interval,
                   .data = data_of(interval),
                   .substeps = substeps,
                   .next_states = iterate.state(interval + 1)});
  structure.carry_lifted(interval, iterate);
}

void IntervalDynamics::write_sizes(StageRange range, bool initial_state_is_given, StageQp& qp) const noexcept {
  const int N = structure.intervals(), ns = structure.capacity().states, free_count = structure.free_input_count();
  qp.set_intervals(N);
  qp.initial_state_is_given = initial_state_is_given;
  for (int i = range.first; i <= range.last; ++i) {
    if (i == N) {
      qp.set_sizes(i, ns, 0);
    } else {
      const bool any_starts = structure.control_count(i) > free_count;
      qp.set_sizes(i, ns, structure.control_count(i), any_starts ? 0 : structure.lifted_count());
    }
  }
}

void IntervalDynamics::gather_rows(const Iterate& iterate, StageRange range, double* rows) const noexcept {
  const int nx = structure.vehicle_states(), nu = structure.inputs(), np = structure.parameters();
  const int row = row_length(structure);
  double* z = rows;
  for (int i = range.first; i <= range.last; ++i, z += row) {
    const double *s = iterate.state(i), *w = iterate.control(i);
    for (int j = 0; j < nx + np; ++j) z[j] = s[j];
    if (structure.is_direct()) {
      for (int j = 0; j < nu; ++j) z[nx + np + j] = w[j];
      if (structure.control_count(i) == nu && !structure.any_ramp()) continue;
    } else {
      structure.inputs_on(iterate, i, z + nx + np);
    }
    for (int j = 0; j < np; ++j) {
      const int control = structure.control_of_lifted(i, j);
      if (structure.any_ramp()) z[nx + np + nu + j] = control >= 0 ? w[control] : z[nx + j];
      if (control >= 0 && !structure.is_ramp(j)) z[nx + j] = w[control];
    }
  }
}

void IntervalDynamics::linearise(StageRange range, const Iterate& iterate, const Options& options, StageQp& qp,
                                 double* scratch) const noexcept {
  const int nx = structure.vehicle_states(), nu = structure.inputs(), ns = structure.capacity().states;
  const int row = row_length(structure), stride = structure.stride();
  const int wide = ns + structure.capacity().controls;
  const std::ptrdiff_t count = range.last - range.first + 1;
  Scratch memory(scratch);
  double *z = memory.take(count * row), *jacobians = memory.take(count * nx * row),
         *hessians = memory.take(count * row * row);
  // Without lifted inputs and ramps, the model's rows are those of the QP, except where blocks start.
  const bool in_place = structure.is_direct() && !structure.any_ramp();
  const bool is_exact = options.hessian == Hessian::exact;
  const Extension* extension = options.extension;
  const double *inputs = z, *seconds = durations + range.first, *known = data_of(range.first),
               *costates = iterate.costate(range.first + 1);
  if (extension) {
    inputs = extension->rows + static_cast<std::ptrdiff_t>(range.first) * stride;
    seconds = extension->durations;
    known = extension->data;
    costates = extension->costates + stride;
  } else if (in_place && !structure.any_start()) {
    inputs = iterate.row(range.first);
  } else {
    gather_rows(iterate, range, z);
  }
  double* const curvature = in_place ? qp.H(range.first) : hessians;
  model.integrate_rows({.count = static_cast<int>(extension ? count + 1 : count),
                        .z = inputs,
                        .z_step = inputs == z ? row : stride,
                        .ramp = structure.any_ramp(),
                        .durations = seconds,
                        .data = known,
                        .substeps = substeps,
                        .next_states = qp.b(range.first),
                        .next_step = stride,
                        .jacobians = in_place ? qp.AB(range.first) : jacobians,
                        .jacobian_step = in_place ? ns * stride : nx * row,
                        .jacobian_row = in_place ? stride : row,
                        .multipliers = is_exact ? costates : nullptr,
                        .multiplier_step = stride,
                        .hessians = is_exact ? curvature : nullptr,
                        .hessian_step = in_place ? wide * stride : row * row,
                        .hessian_row = in_place ? stride : row,
                        .scratch = memory.rest()});

  if (!in_place) {
    std::fill_n(qp.AB(range.first), count * ns * stride, 0.0);
    if (is_exact) std::fill_n(qp.H(range.first), count * wide * stride, 0.0);
  }
  if (extension) {
    const std::ptrdiff_t size = static_cast<std::ptrdiff_t>(wide) * stride;
    double* const behind = qp.H(structure.intervals());
    std::copy_n(behind, size, extension->curvature);
    std::fill_n(behind, size, 0.0);
  }
  complete(range, iterate, options.has_lifted_rows, qp);
  if (in_place && !structure.any_start()) return;
  for (int i = range.first; i <= range.last; ++i) {
    if (!in_place) {
      scatter(i, jacobians + (i - range.first) * nx * row,
              is_exact ? hessians + (i - range.first) * row * row : nullptr, qp);
    } else if (structure.control_count(i) > nu) {
      place_starts(i, options.hessian, qp);
    }
  }
}

void IntervalDynamics::complete(StageRange range, const Iterate& iterate, bool has_lifted_rows,
                                StageQp& qp) const noexcept {
  transcription_kernels().complete_dynamics({.first = range.first,
                                             .last = range.last,
                                             .states = structure.capacity().states,
                                             .stride = structure.stride(),
                                             .vehicle_states = structure.vehicle_states(),
                                             .lifted = structure.lifted_count(),
                                             .control_of = structure.controls_of_lifted(0),
                                             .values = iterate.row(0),
                                             .AB = qp.AB(0),
                                             .b = qp.b(0),
                                             .has_lifted_rows = has_lifted_rows,
                                             .any_start = structure.any_start()});
}

void IntervalDynamics::place_starts(int i, Hessian hessian, StageQp& qp) const noexcept {
  const int nx = structure.vehicle_states(), ns = structure.capacity().states, stride = structure.stride();
  const int width = ns + structure.control_count(i);
  const auto move = [](double& from, double& to) {
    to = from;
    from = 0.0;
  };
  for (int c = 0; c < structure.lifted_count(); ++c) {
    const int control = structure.control_of_lifted(i, c);
    if (control < 0) continue;
    double *AB = qp.AB(i), *H = qp.H(i);
    for (int r = 0; r < nx; ++r) move(AB[r * stride + nx + c], AB[r * stride + ns + control]);
    if (hessian != Hessian::exact) continue;
    for (int r = 0; r < width; ++r) move(H[r * stride + nx + c], H[r * stride + ns + control]);
    for (int k = 0; k < width; ++k) move(H[(nx + c) * stride + k], H[(ns + control) * stride + k]);
  }
}

int IntervalDynamics::column_of(int i, int z) const noexcept {
  const int nx = structure.vehicle_states(), nu = structure.inputs(), np = structure.parameters();
  if (z < nx) return z;
  if (z >= nx + np && z < nx + np + nu) return structure.column_of_input(i, z - nx - np);
  const bool is_end = z >= nx + np + nu;
  const int parameter = z - nx - (is_end ? np + nu : 0), control = structure.control_of_lifted(i, parameter);
  // A jump affects the whole interval; of a ramp, only the end is new.
  return control >= 0 && (is_end || !structure.is_ramp(parameter)) ? structure.capacity().states + control
                                                                   : nx + parameter;
}

/// Copies the model's rows to those of the QP, for any lifted variables.
void IntervalDynamics::scatter(int i, const double* jacobian, const double* hessian, StageQp& qp) const noexcept {
  const int nx = structure.vehicle_states(), nu = structure.inputs(), np = structure.parameters();
  const int row = row_length(structure), stride = structure.stride();
  const int nz = nx + np + nu + (structure.any_ramp() ? np : 0);
  for (int r = 0; r < nx; ++r)
    for (int z = 0; z < nz; ++z) qp.AB(i)[r * stride + column_of(i, z)] += jacobian[r * row + z];
  if (!hessian) return;
  for (int r = 0; r < nz; ++r)
    for (int z = 0; z < nz; ++z) qp.H(i)[column_of(i, r) * stride + column_of(i, z)] += hessian[r * row + z];
}

}  // namespace rhec
