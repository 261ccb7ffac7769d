// Measurements between the nodes of an RheProblem: y - h(F(s_i, w_i; tau)) at a time tau within interval i.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "between_batch.hpp"
#include "between_cache.hpp"
#include "cost_view.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

namespace rhec {
namespace {

constexpr double no_sums = -1.0;       // the weight of measurements whose weights have not been summed up yet
constexpr double nothing_kept = -1.0;  // the number of measurements of sums that are not known yet

int stage_columns(const HorizonProblem& problem, int interval) noexcept {
  return problem.capacity().states + problem.control_count(interval);
}

}  // namespace

bool RheProblem::has_between() const noexcept {
  if (setup_.most_between == 0) return false;
  return std::any_of(between_.begin(), between_.begin() + intervals(),
                     [](const BetweenNodes& each) { return each.count() > 0; });
}

/// Whether an interval has so many measurements that points take their place.
bool RheProblem::has_many(int interval) const noexcept {
  return between(interval).count() >= static_cast<int>(between_points_.size());
}

std::size_t RheProblem::between_scratch_size() const noexcept {
  return setup_.most_between > 0 ? BetweenBatch::size(*this) : 0;
}

/// Puts the measurements of an interval into a batch, or its points if there are more measurements than these, and
/// calls `flush` when it is full.
template <class Flush>
void RheProblem::gather_interval(int interval, const Iterate& iterate, BetweenBatch& batch,
                                 const Flush& flush) const noexcept {
  const bool with_points = has_many(interval);
  const int entries = with_points ? batch.point_count : between(interval).count();
  if (with_points && batch.count + entries > BetweenBatch::at_once) flush();
  for (int k = 0; k < entries; ++k) {
    const double share = with_points ? between_points_[k] : between(interval).time(k) / duration(interval);
    gather_entry(interval, k, with_points, share, iterate, batch);
    if (batch.count == BetweenBatch::at_once) flush();
  }
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
  for (int i = range.first; i <= std::min(range.last, intervals() - 1); ++i) gather_interval(i, iterate, batch, flush);
  flush();
  return total;
}

void RheProblem::linearise_between(int interval, const Iterate& iterate, double* weights, double* rows,
                                   std::span<double> scratch) const noexcept {
  BetweenBatch batch(*this, scratch.data());
  const auto take = [&](int k, const double* gradients) {
    residual(between(interval).outputs(k), batch.predicted, batch.difference);
    losses(batch.difference, weights_between(interval, k, batch.output_weights), batch.weight, nullptr);
    const Measured measured = between(interval).measured(k);
    for (int j = 0; j < ny_; ++j)
      weights[static_cast<std::ptrdiff_t>(k) * ny_ + j] = batch.weight[j] * measured.weight(j);
    for (int j = 0; rows && j < ny_; ++j) {
      *rows++ = batch.difference[j];
      rows = std::copy_n(gradients + j * batch.width, batch.nz, rows);
    }
  };
  const auto flush = [&] {
    if (batch.count == 0) return;
    evaluate_batch(batch, true);
    for (int i = 0; i < batch.count && !batch.is_point[i]; ++i) {
      std::copy_n(batch.outputs + static_cast<std::ptrdiff_t>(i) * output_row_, output_row_, batch.predicted);
      batch.write_gradients(i, batch.of_outputs);
      take(batch.place[i], batch.of_outputs);
    }
    if (batch.is_point[0]) {
      batch.write_points(0, output_row_);
      for (int k = 0; k < between(interval).count(); ++k) {
        double parts[padded(PointSums::most_points)];
        write_parts(interval, k, parts);
        batch.combine(parts, batch.said, output_row_, batch.predicted);
        batch.combine(parts, batch.said + output_row_, batch.said_size - output_row_, batch.of_outputs);
        take(k, batch.of_outputs);
      }
    }
    batch.count = 0;
  };
  gather_interval(interval, iterate, batch, flush);
  flush();
}

/// Weights of the squared residuals of a measurement between nodes; `room`: for a row.
const double* RheProblem::weights_between(int interval, int place, double* room) const noexcept {
  const double* const weights = between(interval).weights(place);
  if (!weights) return output_weights_.data();
  for (int j = 0; j < ny_; ++j) room[j] = output_weights_[j] * weights[j];
  return room;
}

/// Weights of a measurement's outputs in H, and their pulls in h; returns the cost. Writes `batch.difference`.
double RheProblem::weigh(BetweenBatch& batch, int interval, int place, const double* predicted, double* weights,
                         double* pulls, double* curvatures) const noexcept {
  const double *const measured = between(interval).outputs(place), *const output_weights = weights_between(
                                                                       interval, place, batch.output_weights);
  residual(measured, predicted, batch.difference);
  const double cost = losses(batch.difference, output_weights, weights, curvatures);
  for (int j = 0; j < ny_; ++j) {
    weights[j] = std::isnan(measured[j]) ? 0.0 : 2.0 * weights[j] * output_weights[j];
    pulls[j] = weights[j] * batch.difference[j];
  }
  return cost;
}

std::ptrdiff_t RheProblem::between_key_size() const noexcept {
  return IntervalDynamics::row_length(structure()) + 1 + model().data_count();
}

/// Of a measurement in a BetweenCache: what the model says there or at a point, its parts of points, and its weights.
std::ptrdiff_t RheProblem::between_said_size() const noexcept {
  return 2 * output_row_ + static_cast<std::ptrdiff_t>(ny_) * stride() + padded(PointSums::most_points);
}

/// Of an interval: OfPoints::kept, and what it holds for.
std::ptrdiff_t RheProblem::between_kept_size() const noexcept {
  return ny_ * PointSums::Kept::size + 1 + ny_ + static_cast<std::ptrdiff_t>(setup_.most_between) * ny_;
}

/// The same as `add_between` without second derivatives, with a cache, which is read and completed.
double RheProblem::add_known_between(StageRange range, const Iterate& iterate, const CostView& view,
                                     BetweenCache& known, double* memory) const noexcept {
  BetweenBatch batch(*this, memory);
  const auto flush = [&] {
    if (batch.count == 0) return;
    evaluate_batch(batch, true);
    for (int i = 0; i < batch.count; ++i)
      batch.write_said(i, output_row_, known.results(batch.interval[i], batch.place[i]));
    batch.count = 0;
  };
  const int last = std::min(range.last, intervals() - 1);
  const std::ptrdiff_t step = between_said_size(), at_weights = step - output_row_,
                       at_parts = at_weights - padded(PointSums::most_points);
  const IntervalDynamics dynamics{model(), structure(), nullptr, nullptr, substeps()};
  for (int i = range.first; i <= last; ++i) {
    if (between(i).count() == 0) continue;
    double* const key = known.key();
    dynamics.gather_rows(iterate, {i, i}, key);
    key[batch.row] = duration(i);
    std::copy_n(interval_data(i), model().data_count(), key + batch.row + 1);
    if (known.holds(i, between(i))) continue;
    const bool has_parts = known.has_times(i, between(i), batch.row);
    known.begin(i, between(i));
    gather_interval(i, iterate, batch, flush);
    if (!has_many(i) || has_parts) continue;
    for (int k = 0; k < between(i).count(); ++k) {
      write_parts(i, k, known.results(i, k) + at_parts);
      std::fill_n(known.results(i, k) + at_weights, ny_, no_sums);
    }
    known.results_together(i)[ny_ * PointSums::Kept::size] = nothing_kept;
  }
  flush();
  double total = 0.0;
  for (int i = range.first; i <= last; ++i) {
    if (has_many(i)) {
      double* const said = known.results(i, 0);
      const OfPoints points{.said = said,
                            .said_step = step,
                            .parts = said + at_parts,
                            .parts_step = step,
                            .weights = said + at_weights,
                            .weights_step = step,
                            .kept = known.results_together(i),
                            .holds_for = known.results_together(i) + ny_ * PointSums::Kept::size};
      total += add_points(batch, i, points, &view);
      continue;
    }
    for (int k = 0; k < between(i).count(); ++k) {
      const double* const results = known.results(i, k);
      total += weigh(batch, i, k, results, batch.weight, batch.pull, nullptr);
      add_rows(batch, i, results + output_row_, ny_, batch.weight, batch.pull, view);
    }
  }
  return total;
}

void RheProblem::write_parts(int interval, int place, double* parts) const noexcept {
  PointSums::write_parts(between_points_.data(), static_cast<int>(between_points_.size()),
                         between(interval).time(place) / duration(interval), parts);
}

/// The costs of the measurements of an interval that has points.
double RheProblem::add_points(BetweenBatch& batch, int interval, const OfPoints& points,
                              const CostView* view) const noexcept {
  batch.sums.begin(points.said, points.said_step);
  const bool may_know = points.holds_for && view && setup_.robust.empty() && !between(interval).has_weights();
  const double total = may_know ? sum_up_known(batch, interval, points) : sum_up(batch, interval, points, view);
  if (!view) return total;
  for (int j = 0; j < ny_; ++j) {
    const PointSums::Kept kept(points.kept + j * PointSums::Kept::size);
    const double* const v = batch.sums.pulls(j);
    bool is_zero = std::all_of(v, v + batch.point_count, [](double value) { return value == 0.0; });
    for (int k = 0; is_zero && view->H && k < batch.point_count; ++k)
      is_zero = kept.weights()[k * (PointSums::row + 1)] == 0.0;
    if (is_zero) continue;
    const ModelRows rows = in_order_of_stage(
        batch, interval, {points.said + output_row_ + static_cast<std::ptrdiff_t>(j) * batch.width, points.said_step},
        batch.point_count);
    transcription_kernels().add_sums({rows.first, rows.step, batch.point_count, kept.weights(), PointSums::row, v},
                                     stage_columns(*this, interval), stride(), H_of(*view, interval),
                                     h_of(*view, interval));
  }
  return total;
}

/// Sums over the measurements of an interval, those of weights where H is asked for.
double RheProblem::sum_up(BetweenBatch& batch, int interval, const OfPoints& points,
                          const CostView* view) const noexcept {
  double total = 0.0;
  bool has_new_weights = false;
  const BetweenNodes& measured = between(interval);
  for (int m = 0; m < measured.count(); ++m) {
    const double* const parts = points.parts + m * points.parts_step;
    batch.sums.predict(parts, batch.predicted);
    total += weigh(batch, interval, m, batch.predicted, batch.weight, batch.pull, nullptr);
    if (view) batch.sums.add_pulls(parts, batch.pull);
    if (!view || !view->H) continue;
    double* const known = points.weights + m * points.weights_step;
    has_new_weights |= !std::equal(known, known + ny_, batch.weight);
    std::copy_n(batch.weight, ny_, known);
  }
  if (!has_new_weights) return total;
  if (points.holds_for) *points.holds_for = nothing_kept;
  // Without robust losses, and as long as nothing new is measured, weights are those that they were before.
  batch.sums.begin_weights();
  for (int m = 0; m < measured.count(); ++m)
    batch.sums.add_weights(points.parts + m * points.parts_step, points.weights + m * points.weights_step);
  for (int j = 0; j < ny_; ++j) batch.sums.keep_weights(j, PointSums::Kept(points.kept + j * PointSums::Kept::size));
  return total;
}

/// The same of quadratic costs, from the sums that were formed last, or else with all measurements.
double RheProblem::sum_up_known(BetweenBatch& batch, int interval, const OfPoints& points) const noexcept {
  const BetweenNodes& measured = between(interval);
  const auto count = static_cast<std::size_t>(measured.count()) * static_cast<std::size_t>(ny_);
  double* const known_count = points.holds_for;
  double *const known_weights = known_count + 1, *const known_outputs = known_weights + ny_;
  const auto kept = [&](int j) { return PointSums::Kept(points.kept + j * PointSums::Kept::size); };
  bool is_known = *known_count == measured.count() &&
                  std::equal(known_weights, known_weights + ny_, setup_.output_weights.data()) &&
                  std::memcmp(known_outputs, measured.outputs(0), count * sizeof(double)) == 0;
  double total = 0.0;
  for (int j = 0; is_known && j < ny_; ++j) {
    double cost = 0.0;
    is_known = batch.sums.revise(j, kept(j), output_periods_[j], cost);
    total += cost;
  }
  if (is_known) return total;
  batch.sums.begin(points.said, points.said_step);
  batch.sums.begin_weights();
  double *const costs = batch.curvature, *const largest = batch.of_outputs;  // rooms for a row
  std::fill_n(costs, ny_, 0.0);
  std::fill_n(largest, ny_, 0.0);
  for (int m = 0; m < measured.count(); ++m) {
    const double* const parts = points.parts + m * points.parts_step;
    batch.sums.predict(parts, batch.predicted);
    weigh(batch, interval, m, batch.predicted, batch.weight, batch.pull, nullptr);
    batch.sums.add_pulls(parts, batch.pull);
    batch.sums.add_weights(parts, batch.weight);
    for (int j = 0; j < ny_; ++j) {
      costs[j] += 0.5 * batch.pull[j] * batch.difference[j];
      largest[j] = std::max(largest[j], std::abs(batch.difference[j]));
    }
  }
  total = 0.0;
  for (int j = 0; j < ny_; ++j) {
    batch.sums.keep(j, costs[j], largest[j], kept(j));
    total += costs[j];
  }
  points.weights[0] = no_sums;
  *known_count = measured.count();
  std::copy_n(setup_.output_weights.data(), ny_, known_weights);
  std::memcpy(known_outputs, measured.outputs(0), count * sizeof(double));
  return total;
}

double RheProblem::add_batch(BetweenBatch& batch, Hessian hessian, const CostView* view,
                             double* stage_costs) const noexcept {
  const std::ptrdiff_t row = batch.row, width = padded(nx());
  evaluate_batch(batch, view != nullptr);
  double total = 0.0;
  for (int i = 0; i < batch.count; i += batch.is_point[i] ? batch.point_count : 1) {
    const int interval = batch.interval[i];
    const std::ptrdiff_t at = i * output_row_;
    double cost;
    if (batch.is_point[i]) {
      if (view) batch.write_points(i, output_row_);
      const OfPoints points{.said = view ? batch.said : batch.outputs + at,
                            .said_step = view ? batch.said_size : output_row_,
                            .parts = batch.parts,
                            .parts_step = padded(PointSums::most_points),
                            .weights = batch.known_weights,
                            .weights_step = output_row_,
                            .kept = batch.kept};
      for (int m = 0; m < between(interval).count(); ++m) {
        write_parts(interval, m, batch.parts + m * points.parts_step);
        if (view) std::fill_n(batch.known_weights + m * points.weights_step, ny_, no_sums);
      }
      cost = add_points(batch, interval, points, view);
      for (int k = 0; view && k < batch.point_count; ++k)
        for (int j = 0; j < ny_; ++j) batch.pulls[at + k * output_row_ + j] = batch.sums.pulls(j)[k];
    } else {
      cost = weigh(batch, interval, batch.place[i], batch.outputs + at, batch.weights + at, batch.pulls + at,
                   batch.curvatures + at);
      if (view) {
        batch.write_gradients(i, batch.of_outputs);
        add_rows(batch, interval, batch.of_outputs, ny_, batch.weights + at, batch.pulls + at, *view);
      }
    }
    total += cost;
    if (stage_costs) stage_costs[interval] += cost;
  }
  if (!view || hessian != Hessian::exact || !view->H) return total;
  // What Gauss-Newton leaves out.
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
  add_curvature_of_dynamics(batch, *view);
  for (int i = 0; i < batch.count; ++i) add_curvature_between(batch, i, *view);
  if (!setup_.robust.empty()) add_curvature_of_losses(batch, *view);
  return total;
}

/// Rows of gradients by the model's variables, in the order of the stage's. They are valid until the next call.
RheProblem::ModelRows RheProblem::in_order_of_stage(BetweenBatch& batch, int interval, const ModelRows& rows,
                                                    int count) const noexcept {
  // Where no block starts, the orders are the same.
  if (control_count(interval) == nu() && !structure().any_ramp()) return rows;
  const std::ptrdiff_t width = padded(stage_columns(*this, interval));
  const IntervalDynamics dynamics{model(), structure(), nullptr, nullptr, substeps()};
  std::fill_n(batch.gradients, count * width, 0.0);
  for (int z = 0; z < batch.nz; ++z) {
    double* const to = batch.gradients + dynamics.column_of(interval, z);
    for (int j = 0; j < count; ++j) to[j * width] += rows.first[j * rows.step + z];
  }
  return {batch.gradients, width};
}

/// Adds products of rows to H and h. `weights` may be null if H is.
void RheProblem::add_rows(BetweenBatch& batch, int interval, const double* rows, int count, const double* weights,
                          const double* pulls, const CostView& view) const noexcept {
  // The first and the last rows that count.
  int first = 0;
  while (first < count && pulls[first] == 0.0 && (!weights || weights[first] == 0.0)) ++first;
  if (first == count) return;
  while (pulls[count - 1] == 0.0 && (!weights || weights[count - 1] == 0.0)) --count;
  const ModelRows ordered = in_order_of_stage(
      batch, interval, {rows + static_cast<std::ptrdiff_t>(first) * batch.width, batch.width}, count - first);
  transcription_kernels().add_products(ordered.first, weights ? weights + first : nullptr, pulls + first, count - first,
                                       stage_columns(*this, interval), stride(), H_of(view, interval),
                                       h_of(view, interval));
}

/// Second derivatives of robust losses: 4 rho'' (J' W r)(J' W r)' for each measurement.
void RheProblem::add_curvature_of_losses(BetweenBatch& batch, const CostView& view) const noexcept {
  const auto add = [&](int interval, int place, const double* gradients) {
    const int columns = capacity().states + control_count(interval);
    const IntervalDynamics dynamics{model(), structure(), nullptr, nullptr, substeps()};
    weigh(batch, interval, place, batch.predicted, batch.weight, batch.pull, batch.curvature);
    const double* const output_weights = weights_between(interval, place, batch.output_weights);
    double* const H = H_of(view, interval);
    for (const RobustLoss& loss : setup_.robust) {
      std::fill_n(batch.product, padded(columns), 0.0);
      for (const int j : loss.outputs)
        for (int z = 0; z < batch.nz; ++z)
          batch.product[dynamics.column_of(interval, z)] +=
              gradients[j * batch.width + z] * output_weights[j] * batch.difference[j];
      const double scale = 4.0 * batch.curvature[loss.outputs.front()];
      for (int c = 0; c < columns; ++c)
        for (int r = 0; r < columns; ++r) H[c * stride() + r] += scale * batch.product[r] * batch.product[c];
    }
  };
  for (int i = 0; i < batch.count; i += batch.is_point[i] ? batch.point_count : 1) {
    const BetweenNodes& measured = between(batch.interval[i]);
    if (!batch.is_point[i]) {
      batch.write_gradients(i, batch.of_outputs);
      std::copy_n(batch.outputs + static_cast<std::ptrdiff_t>(i) * output_row_, output_row_, batch.predicted);
      add(batch.interval[i], batch.place[i], batch.of_outputs);
      continue;
    }
    batch.write_points(i, output_row_);
    for (int m = 0; m < measured.count(); ++m) {
      double parts[padded(PointSums::most_points)];
      write_parts(batch.interval[i], m, parts);
      batch.combine(parts, batch.said, output_row_, batch.predicted);
      batch.combine(parts, batch.said + output_row_, batch.said_size - output_row_, batch.of_outputs);
      add(batch.interval[i], m, batch.of_outputs);
    }
  }
}

/// Second derivatives of outputs by the states: dF/dz' (sum of multipliers times d2h/dx2) dF/dz.
void RheProblem::add_curvature_between(BetweenBatch& batch, int i, const CostView& view) const noexcept {
  const int interval = batch.interval[i], columns = capacity().states + control_count(interval);
  const std::ptrdiff_t width = padded(columns), row = batch.row;
  double* const H = H_of(view, interval);
  const IntervalDynamics dynamics{model(), structure(), nullptr, nullptr, substeps()};
  const double* const J = batch.jacobian(i);
  const double* const X = batch.output_hessians + static_cast<std::ptrdiff_t>(i) * nx() * padded(nx());
  std::fill_n(batch.gradients, nx() * width, 0.0);
  for (int r = 0; r < nx(); ++r)
    for (int z = 0; z < batch.nz; ++z) batch.gradients[r * width + dynamics.column_of(interval, z)] += J[r * row + z];
  for (int r = 0; r < nx(); ++r) {
    std::fill_n(batch.product, width, 0.0);
    for (int k = 0; k < nx(); ++k)
      for (int c = 0; c < columns; ++c) batch.product[c] += X[r * padded(nx()) + k] * batch.gradients[k * width + c];
    for (int c = 0; c < columns; ++c)
      for (int l = 0; l < columns; ++l) H[c * stride() + l] += batch.gradients[r * width + l] * batch.product[c];
  }
}

}  // namespace rhec
