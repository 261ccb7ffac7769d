// Measurements between the nodes of an RheProblem: y - h(F(s_i, w_i; tau)) at a time tau within interval i.
#include <algorithm>
#include <cmath>

#include "between_batch.hpp"
#include "between_cache.hpp"
#include "cost_view.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

namespace rhec {
bool RheProblem::has_between() const noexcept {
  if (setup_.most_between == 0) return false;
  return std::any_of(between_.begin(), between_.begin() + intervals(),
                     [](const BetweenNodes& each) { return each.count() > 0; });
}

std::size_t RheProblem::between_scratch_size() const noexcept {
  return setup_.most_between > 0 ? BetweenBatch::size(*this) : 0;
}

/// Puts the measurements of an interval into a batch, and calls `flush` when it is full. Those of an interval with many
/// are evaluated by themselves.
template <class Flush>
void RheProblem::gather_interval(int interval, const Iterate& iterate, BetweenBatch& batch, bool with_gradients,
                                 const Flush& flush) const noexcept {
  const int count = between(interval).count();
  const bool has_many = count >= static_cast<int>(between_points_.size());
  if (has_many) {
    flush();
    integrate_points(interval, iterate, batch, with_gradients);
  }
  for (int k = 0; k < count; ++k) {
    gather_between(interval, k, iterate, batch);
    if (batch.count == BetweenBatch::at_once) flush();
  }
  if (!has_many) return;
  flush();
  batch.point_count = 0;
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
  for (int i = range.first; i <= std::min(range.last, intervals() - 1); ++i)
    gather_interval(i, iterate, batch, view != nullptr, flush);
  flush();
  return total;
}

void RheProblem::linearise_between(int interval, const Iterate& iterate, double* weights, double* rows,
                                   std::span<double> scratch) const noexcept {
  BetweenBatch batch(*this, scratch.data());
  const bool with_gradients = rows != nullptr;
  const auto flush = [&] {
    if (batch.count == 0) return;
    evaluate_batch(batch, with_gradients);
    for (int i = 0; i < batch.count; ++i) {
      const double* const measured = between(interval).outputs(batch.place[i]);
      residual(measured, batch.outputs + static_cast<std::ptrdiff_t>(i) * output_row_, batch.difference);
      losses(batch.difference, batch.weights, nullptr);
      std::copy_n(batch.weights, ny_, weights + static_cast<std::ptrdiff_t>(batch.place[i]) * ny_);
      if (!rows) continue;
      batch.write_gradients(i, ny_, batch.of_outputs);
      for (int j = 0; j < ny_; ++j) {
        *rows++ = batch.difference[j];
        rows = std::copy_n(batch.of_outputs + j * batch.width, batch.nz, rows);
      }
    }
    batch.count = 0;
  };
  gather_interval(interval, iterate, batch, with_gradients, flush);
  flush();
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
    gather_interval(i, iterate, batch, true, flush);
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
    std::fill_n(batch.own.multipliers, batch.count * row, 0.0);
    std::fill_n(batch.output_hessians, batch.count * nx() * width, 0.0);
    for (int i = 0; i < batch.count; ++i)
      for (int j = 0; j < ny_; ++j)
        for (int r = 0; r < nx(); ++r)
          batch.own.multipliers[i * row + r] +=
              batch.pulls[i * output_row_ + j] * batch.output_jacobians[(i * ny_ + j) * width + r];
    NodeRows there = batch.there(*this);
    there.multipliers = batch.pulls;
    there.multiplier_step = output_row_;
    there.hessians = batch.output_hessians;
    there.hessian_step = nx() * width;
    there.hessian_row = width;
    model().observe_rows(there);
    add_curvature_of_dynamics(batch, *view);
  }
  for (int i = 0; i < batch.count; ++i) {
    batch.write_gradients(i, ny_, batch.of_outputs);
    const std::ptrdiff_t at = i * output_row_;
    add_row(batch, batch.interval[i], batch.of_outputs, batch.weights + at, batch.pulls + at, *view);
    if (exact) add_curvature(batch, i, *view);
  }
  return total;
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
    for (int z = 0; z < batch.nz; ++z) {
      double* const to = batch.gradients + dynamics.column_of(interval, z);
      for (int j = 0; j < ny_; ++j) to[j * width] += gradients[j * batch.width + z];
    }
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

/// What Gauss-Newton leaves out: second derivatives of outputs and of robust losses.
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
  // dF/dz' (sum of multipliers times d2h/dx2) dF/dz
  const double* const J = batch.jacobian(batch.own, i);
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
