// Measurements between the nodes of an RheProblem: y - h(F(s_i, w_i; tau)) at a time tau within interval i.
#include <algorithm>
#include <array>
#include <cmath>

#include "between_cache.hpp"
#include "cost_view.hpp"
#include "interval_dynamics.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"
#include "rhec/core/model/parts_of_intervals.hpp"

namespace rhec {
namespace {

/// Measurements that are evaluated together, so that the model fills the processor's lanes.
constexpr int at_once = 32;

}  // namespace

/// Some measurements, with what the model says of them. Rows are those of IntervalRows and NodeRows.
struct RheProblem::BetweenBatch {
  BetweenBatch(const RheProblem& problem, double* memory)
      : row(IntervalDynamics::row_length(problem.structure())),
        nx(problem.nx()),
        nz(problem.nx() + problem.np() + problem.nu() + (problem.structure().any_ramp() ? problem.np() : 0)),
        width(padded(nz)) {
    Scratch scratch(memory);
    const std::ptrdiff_t ny = problem.ny_, of_states = padded(nx);
    const auto take = [&](std::ptrdiff_t each) { return scratch.take(at_once * each); };
    z = take(row);
    next = take(row);
    jacobians = take(nx * row);
    outputs = take(problem.output_row_);
    output_jacobians = take(ny * of_states);
    pulls = take(problem.output_row_);
    weights = take(problem.output_row_);
    curvatures = take(problem.output_row_);
    multipliers = take(row);
    hessians = take(row * row);
    output_hessians = take(nx * of_states);
    durations = take(8);
    data = take(padded(problem.model().data_count()));
    difference = scratch.take(problem.output_row_);
    of_outputs = scratch.take(ny * row);
    gradients = scratch.take(std::max<std::ptrdiff_t>(ny, nx) * problem.stride());
    product = scratch.take(static_cast<std::ptrdiff_t>(nx) * problem.stride());
    rest = scratch.rest();
  }
  static std::size_t size(const RheProblem& problem) noexcept {
    const std::size_t row = IntervalDynamics::row_length(problem.structure()), nx = problem.nx(), ny = problem.ny_,
                      of_states = padded(problem.nx()), stride = problem.stride();
    const std::size_t each = row * (3 + nx + row) + 4 * problem.output_row_ + (ny + nx) * of_states + 8 +
                             padded(problem.model().data_count());
    return at_once * each + problem.output_row_ + (std::max(ny, nx) + nx) * stride + ny * row +
           problem.model().rows_scratch(at_once) + 16;
  }

  /// Requests for the intervals up to the measurements, and for the outputs there, without results.
  IntervalRows along(const RheProblem& problem) const noexcept {
    return {.count = count,
            .z = z,
            .z_step = row,
            .ramp = problem.structure().any_ramp(),
            .durations = durations,
            .data = data,
            .substeps = problem.substeps(),
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
  /// dh/dz of measurement i: a row of `width` for each output.
  void write_gradients(int i, int ny, double* to) const noexcept {
    const double* const J = jacobians + static_cast<std::ptrdiff_t>(i) * nx * row;
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
  std::array<int, at_once> interval{}, place{};
  std::array<double, at_once> share{};  ///< of the interval's duration
  double *z, *next, *jacobians, *outputs, *output_jacobians, *pulls, *weights, *curvatures, *multipliers, *hessians,
      *output_hessians, *durations, *data, *difference, *of_outputs, *gradients, *product, *rest;
};

bool RheProblem::has_between() const noexcept {
  if (setup_.most_between == 0) return false;
  return std::any_of(between_.begin(), between_.begin() + intervals(),
                     [](const BetweenNodes& each) { return each.count() > 0; });
}

std::size_t RheProblem::between_scratch_size() const noexcept {
  return setup_.most_between > 0 ? BetweenBatch::size(*this) : 0;
}

/// Adds the costs of the measurements between the nodes of a range: to `stage_costs`, and to H and h of the view, where
/// these are given. Returns their sum.
double RheProblem::add_between(StageRange range, const Iterate& iterate, Hessian hessian, const CostView* view,
                               double* stage_costs, double* memory) const noexcept {
  BetweenBatch batch(*this, memory);
  double total = 0.0;
  const auto flush = [&] {
    if (batch.count > 0) total += add_batch(batch, hessian, view, stage_costs);
    batch.count = 0;
  };
  for (int i = range.first; i <= std::min(range.last, intervals() - 1); ++i) {
    for (int k = 0; k < between(i).count(); ++k) {
      gather_between(i, k, iterate, batch);
      if (batch.count == at_once) flush();
    }
  }
  flush();
  return total;
}

/// Puts one measurement into a batch: the interval as the model takes it, up to the measurement's time. A ramp ends
/// where it is then.
void RheProblem::gather_between(int interval, int place, const Iterate& iterate, BetweenBatch& batch) const noexcept {
  const int at = batch.count++;
  double* const z = batch.z + static_cast<std::ptrdiff_t>(at) * batch.row;
  IntervalDynamics{model(), structure(), nullptr, nullptr, substeps()}.gather_rows(iterate, {interval, interval}, z);
  const double time = between(interval).time(place), share = time / duration(interval);
  batch.interval[at] = interval;
  batch.place[at] = place;
  batch.share[at] = share;
  batch.durations[at] = time;
  if (structure().any_ramp())
    for (int j = 0; j < np(); ++j) {
      double& end = z[nx() + np() + nu() + j];
      end = z[nx() + j] + share * (end - z[nx() + j]);
    }
  double* const data = batch.data + static_cast<std::ptrdiff_t>(at) * model().data_count();
  if (parts_)
    parts_->data_of_part(interval_data(interval), share, data);
  else
    std::copy_n(interval_data(interval), model().data_count(), data);
}

/// The model along the intervals up to the measurements, and its outputs there.
void RheProblem::evaluate_batch(BetweenBatch& batch, bool with_gradients) const noexcept {
  IntervalRows along = batch.along(*this);
  along.next_states = batch.next;
  if (with_gradients) along.jacobians = batch.jacobians;
  model().integrate_rows(along);
  NodeRows there = batch.there(*this);
  there.outputs = batch.outputs;
  if (with_gradients) there.jacobians = batch.output_jacobians;
  model().observe_rows(there);
}

void RheProblem::linearise_between(int interval, const Iterate& iterate, double* weights, double* rows,
                                   std::span<double> scratch) const noexcept {
  BetweenBatch batch(*this, scratch.data());
  const int count = between(interval).count();
  for (int first = 0; first < count; first += batch.count) {
    batch.count = 0;
    for (int k = first; k < count && batch.count < at_once; ++k) gather_between(interval, k, iterate, batch);
    evaluate_batch(batch, rows != nullptr);
    for (int i = 0; i < batch.count; ++i) {
      residual(between(interval).outputs(first + i), batch.outputs + static_cast<std::ptrdiff_t>(i) * output_row_,
               batch.difference);
      losses(batch.difference, batch.weights, nullptr);
      std::copy_n(batch.weights, ny_, weights + static_cast<std::ptrdiff_t>(first + i) * ny_);
      if (!rows) continue;
      if (structure().any_ramp()) turn_ramp(batch, i, false);
      batch.write_gradients(i, ny_, batch.of_outputs);
      for (int j = 0; j < ny_; ++j) {
        *rows++ = batch.difference[j];
        rows = std::copy_n(batch.of_outputs + j * batch.width, batch.nz, rows);
      }
    }
  }
}

/// Weights of a measurement's outputs in H, and their pulls in h; returns the cost.
double RheProblem::weigh(const double* measured, const double* predicted, double* difference, double* weights,
                         double* pulls, double* curvatures) const noexcept {
  residual(measured, predicted, difference);
  const double cost = losses(difference, weights, curvatures);
  for (int j = 0; j < ny_; ++j) {
    weights[j] = std::isnan(measured[j]) ? 0.0 : 2.0 * weights[j] * setup_.output_weights[j];
    pulls[j] = weights[j] * difference[j];
  }
  return cost;
}

std::ptrdiff_t RheProblem::between_key_size() const noexcept {
  return IntervalDynamics::row_length(structure()) + 1 + model().data_count();
}

/// The same as `add_between` without second derivatives, with a cache, which is read and completed.
double RheProblem::add_known_between(StageRange range, const Iterate& iterate, const CostView& view,
                                     BetweenCache& known, double* memory) const noexcept {
  BetweenBatch batch(*this, memory);
  const auto flush = [&] {
    if (batch.count == 0) return;
    evaluate_batch(batch, true);
    for (int i = 0; i < batch.count; ++i) {
      if (structure().any_ramp()) turn_ramp(batch, i, false);
      double* const results = known.results(batch.interval[i], batch.place[i]);
      std::copy_n(batch.outputs + static_cast<std::ptrdiff_t>(i) * output_row_, output_row_, results);
      batch.write_gradients(i, ny_, results + output_row_);
    }
    batch.count = 0;
  };
  const int last = std::min(range.last, intervals() - 1);
  const IntervalDynamics dynamics{model(), structure(), nullptr, nullptr, substeps()};
  for (int i = range.first; i <= last; ++i) {
    if (between(i).count() == 0) continue;
    double* const key = known.key();
    dynamics.gather_rows(iterate, {i, i}, key);
    key[batch.row] = duration(i);
    std::copy_n(interval_data(i), model().data_count(), key + batch.row + 1);
    if (known.holds(i, between(i))) continue;
    known.begin(i, between(i));
    for (int k = 0; k < between(i).count(); ++k) {
      gather_between(i, k, iterate, batch);
      if (batch.count == at_once) flush();
    }
  }
  flush();
  double total = 0.0;
  for (int i = range.first; i <= last; ++i) {
    for (int k = 0; k < between(i).count(); ++k) {
      const double* const results = known.results(i, k);
      total += weigh(between(i).outputs(k), results, batch.difference, batch.weights, batch.pulls, nullptr);
      add_row(batch, i, results + output_row_, batch.weights, batch.pulls, view);
    }
  }
  return total;
}

double RheProblem::add_batch(BetweenBatch& batch, Hessian hessian, const CostView* view,
                             double* stage_costs) const noexcept {
  const std::ptrdiff_t row = batch.row, width = padded(nx());
  evaluate_batch(batch, view != nullptr);
  double total = 0.0;
  for (int i = 0; i < batch.count; ++i) {
    const std::ptrdiff_t at = i * output_row_;
    const double cost = weigh(between(batch.interval[i]).outputs(batch.place[i]), batch.outputs + at, batch.difference,
                              batch.weights + at, batch.pulls + at, batch.curvatures + at);
    total += cost;
    if (stage_costs) stage_costs[batch.interval[i]] += cost;
  }
  if (!view) return total;
  const bool exact = hessian == Hessian::exact && view->H;
  if (exact) {
    std::fill_n(batch.multipliers, batch.count * row, 0.0);
    std::fill_n(batch.output_hessians, batch.count * nx() * width, 0.0);
    for (int i = 0; i < batch.count; ++i)
      for (int j = 0; j < ny_; ++j)
        for (int r = 0; r < nx(); ++r)
          batch.multipliers[i * row + r] +=
              batch.pulls[i * output_row_ + j] * batch.output_jacobians[(i * ny_ + j) * width + r];
    NodeRows there = batch.there(*this);
    there.multipliers = batch.pulls;
    there.multiplier_step = output_row_;
    there.hessians = batch.output_hessians;
    there.hessian_step = nx() * width;
    there.hessian_row = width;
    model().observe_rows(there);
    IntervalRows along = batch.along(*this);
    along.multipliers = batch.multipliers;
    along.multiplier_step = row;
    along.hessians = batch.hessians;
    along.hessian_step = row * row;
    along.hessian_row = row;
    model().integrate_rows(along);
  }
  for (int i = 0; i < batch.count; ++i) {
    if (structure().any_ramp()) turn_ramp(batch, i, exact);
    batch.write_gradients(i, ny_, batch.of_outputs);
    const std::ptrdiff_t at = i * output_row_;
    add_row(batch, batch.interval[i], batch.of_outputs, batch.weights + at, batch.pulls + at, *view);
    if (exact) add_curvature(batch, i, *view);
  }
  return total;
}

/// Derivatives with respect to the ramp's value at the measurement become those with respect to its values at the
/// interval's start and end: q = (1 - share) p + share p_end.
void RheProblem::turn_ramp(BetweenBatch& batch, int i, bool exact) const noexcept {
  const int start = nx(), end = nx() + np() + nu();
  const double share = batch.share[i];
  const auto turn = [&](double* at_start, double* at_end, std::ptrdiff_t step, int count) {
    for (int k = 0; k < count; ++k) {
      at_start[k * step] += (1.0 - share) * at_end[k * step];
      at_end[k * step] *= share;
    }
  };
  double *const J = batch.jacobians + static_cast<std::ptrdiff_t>(i) * nx() * batch.row,
                *const H = batch.hessians + static_cast<std::ptrdiff_t>(i) * batch.row * batch.row;
  for (int j = 0; j < np(); ++j) {
    turn(J + start + j, J + end + j, batch.row, nx());
    if (!exact) continue;
    turn(H + start + j, H + end + j, batch.row, batch.nz);
    turn(H + (start + j) * batch.row, H + (end + j) * batch.row, 1, batch.nz);
  }
}

/// Adds one measurement's products to H and h, with its gradients by the model's variables in the order of the stage's.
void RheProblem::add_row(BetweenBatch& batch, int interval, const double* gradients, const double* weights,
                         const double* pulls, const CostView& view) const noexcept {
  const int columns = capacity().states + control_count(interval);
  // Where no block starts, the orders are the same.
  if (control_count(interval) != nu() || structure().any_ramp()) {
    const std::ptrdiff_t width = padded(columns);
    const IntervalDynamics dynamics{model(), structure(), nullptr, nullptr, substeps()};
    std::fill_n(batch.gradients, ny_ * width, 0.0);
    for (int j = 0; j < ny_; ++j)
      for (int z = 0; z < batch.nz; ++z)
        batch.gradients[j * width + dynamics.column_of(interval, z)] += gradients[j * batch.width + z];
    gradients = batch.gradients;
  }
  const double* const end = weights + ny_;
  const auto is_missing = [](double weight) { return weight == 0.0; };
  const auto first = std::find_if_not(weights, end, is_missing) - weights;
  if (first == ny_) return;
  auto last = std::ptrdiff_t{ny_} - 1;
  while (is_missing(weights[last])) --last;
  transcription_kernels().add_products(gradients + first * padded(columns), weights + first, pulls + first,
                                       static_cast<int>(last - first + 1), columns, stride(), H_of(view, interval),
                                       h_of(view, interval));
}

/// What Gauss-Newton leaves out: second derivatives of outputs, of the dynamics up to there, and of robust losses.
void RheProblem::add_curvature(BetweenBatch& batch, int i, const CostView& view) const noexcept {
  const int interval = batch.interval[i], columns = capacity().states + control_count(interval);
  const std::ptrdiff_t width = padded(columns), row = batch.row;
  double* const H = H_of(view, interval);
  const IntervalDynamics dynamics{model(), structure(), nullptr, nullptr, substeps()};
  const auto column = [&](int z) { return dynamics.column_of(interval, z); };
  const auto add = [&](const double* left, const double* right, double scale) {
    for (int c = 0; c < columns; ++c)
      for (int r = 0; r < columns; ++r) H[c * stride() + r] += scale * left[r] * right[c];
  };
  const double* difference = batch.outputs + static_cast<std::ptrdiff_t>(i) * output_row_;
  residual(between(interval).outputs(batch.place[i]), difference, batch.difference);
  for (const RobustLoss& loss : setup_.robust) {
    // 4 rho'' (J' W r)(J' W r)'
    std::fill_n(batch.product, width, 0.0);
    for (const int j : loss.outputs)
      for (int z = 0; z < batch.nz; ++z)
        batch.product[column(z)] +=
            batch.of_outputs[j * batch.width + z] * setup_.output_weights[j] * batch.difference[j];
    add(batch.product, batch.product,
        4.0 * batch.curvatures[static_cast<std::ptrdiff_t>(i) * output_row_ + loss.outputs.front()]);
  }
  const double* const curvature = batch.hessians + static_cast<std::ptrdiff_t>(i) * row * row;
  for (int c = 0; c < batch.nz; ++c)
    for (int r = 0; r < batch.nz; ++r) H[column(c) * stride() + column(r)] += curvature[c * row + r];
  // dF/dz' (sum of multipliers times d2h/dx2) dF/dz
  const double* const J = batch.jacobians + static_cast<std::ptrdiff_t>(i) * nx() * row;
  const double* const X = batch.output_hessians + static_cast<std::ptrdiff_t>(i) * nx() * padded(nx());
  std::fill_n(batch.gradients, nx() * width, 0.0);
  for (int r = 0; r < nx(); ++r)
    for (int z = 0; z < batch.nz; ++z) batch.gradients[r * width + column(z)] += J[r * row + z];
  for (int r = 0; r < nx(); ++r) {
    std::fill_n(batch.product, width, 0.0);
    for (int k = 0; k < nx(); ++k)
      for (int c = 0; c < columns; ++c) batch.product[c] += X[r * padded(nx()) + k] * batch.gradients[k * width + c];
    add(batch.gradients + r * width, batch.product, 1.0);
  }
}

}  // namespace rhec
