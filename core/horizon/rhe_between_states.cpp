// The states at measurements between the nodes of an RheProblem, and their derivatives: integrated for each, or, where
// an interval has many, interpolated.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "between_batch.hpp"
#include "cost_view.hpp"
#include "rhec/core/model/parts_of_intervals.hpp"

namespace rhec {
namespace {

/// Values at theta of the polynomials that are 1 at one point and 0 at the others: the barycentric formula for
/// Chebyshev points (Berrut and Trefethen 2004, eq. 5.4 for those of the second kind).
void write_parts(const double* points, int count, double theta, double* parts) noexcept {
  double sum = 0.0;
  for (int k = 0; k <= count; ++k) {
    const double distance = theta - points[k];
    if (distance == 0.0) {
      std::fill_n(parts, count + 1, 0.0);
      parts[k] = 1.0;
      return;
    }
    const double weight = (k % 2 ? -1.0 : 1.0) * (k == 0 || k == count ? 0.5 : 1.0);
    parts[k] = weight / distance;
    sum += parts[k];
  }
  for (int k = 0; k <= count; ++k) parts[k] /= sum;
}

}  // namespace

/// An interval is divided at Chebyshev points of the second kind, its begin first. Steps of a Runge-Kutta method are
/// made so short that a polynomial of fourth degree describes one of them well.
std::vector<double> RheProblem::points_of_interval() const {
  const int count = std::min(BetweenBatch::most_points, 2 + 2 * setup_.substeps);
  std::vector<double> points;
  for (int k = 0; k <= count; ++k) points.push_back(0.5 - 0.5 * std::cos(std::numbers::pi * k / count));
  return points;
}

/// The interval up to a share of its duration, as the model takes it. A ramp ends where it is then.
void RheProblem::write_part(int interval, double share, const Iterate& iterate, const BetweenBatch& batch, double* z,
                            double* data) const noexcept {
  IntervalDynamics{model(), structure(), nullptr, nullptr, substeps()}.gather_rows(iterate, {interval, interval}, z);
  if (structure().any_ramp())
    for (int j = 0; j < np(); ++j) {
      double& end = z[batch.nz - np() + j];
      end = z[nx() + j] + share * (end - z[nx() + j]);
    }
  if (parts_)
    parts_->data_of_part(interval_data(interval), share, data);
  else
    std::copy_n(interval_data(interval), model().data_count(), data);
}

/// Puts one measurement into a batch.
void RheProblem::gather_between(int interval, int place, const Iterate& iterate, BetweenBatch& batch) const noexcept {
  const int at = batch.count++;
  const double time = between(interval).time(place);
  batch.interval[at] = interval;
  batch.place[at] = place;
  batch.share[at] = time / duration(interval);
  if (batch.point_count > 0) {
    write_parts(between_points_.data(), batch.point_count, batch.share[at],
                batch.parts.data() + std::ptrdiff_t{at} * (BetweenBatch::most_points + 1));
    return;
  }
  batch.own.durations[at] = time;
  write_part(interval, batch.share[at], iterate, batch, batch.own.z + static_cast<std::ptrdiff_t>(at) * batch.row,
             batch.own.data + static_cast<std::ptrdiff_t>(at) * model().data_count());
}

/// The points of an interval between which the states at its measurements are interpolated.
void RheProblem::integrate_points(int interval, const Iterate& iterate, BetweenBatch& batch,
                                  bool with_gradients) const noexcept {
  const BetweenBatch::Intervals& points = batch.points;
  batch.point_count = static_cast<int>(between_points_.size()) - 1;
  for (int k = 0; k < batch.point_count; ++k) {
    const double share = between_points_[static_cast<std::size_t>(k) + 1];
    points.durations[k] = share * duration(interval);
    write_part(interval, share, iterate, batch, points.z + static_cast<std::ptrdiff_t>(k) * batch.row,
               points.data + static_cast<std::ptrdiff_t>(k) * model().data_count());
  }
  IntervalRows along = batch.along(*this, points, batch.point_count);
  if (with_gradients) along.jacobians = points.jacobians;
  model().integrate_rows(along);
  if (!with_gradients || !structure().any_ramp()) return;
  for (int k = 0; k < batch.point_count; ++k)
    turn_ramp(batch, between_points_[static_cast<std::size_t>(k) + 1], batch.jacobian(points, k), nullptr);
}

/// The states at the measurements of a batch, and their derivatives, from the points of its interval.
void RheProblem::interpolate(BetweenBatch& batch, bool with_gradients) const noexcept {
  const std::ptrdiff_t row = batch.row, block = nx() * row;
  for (int i = 0; i < batch.count; ++i) {
    const double* const parts = batch.parts.data() + std::ptrdiff_t{i} * (BetweenBatch::most_points + 1);
    double* const x = batch.own.next + i * row;
    for (int r = 0; r < nx(); ++r) x[r] = parts[0] * batch.points.z[r];
    for (int k = 0; k < batch.point_count; ++k)
      for (int r = 0; r < nx(); ++r) x[r] += parts[k + 1] * batch.points.next[k * row + r];
    if (!with_gradients) continue;
    double* const J = batch.jacobian(batch.own, i);
    std::fill_n(J, block, 0.0);
    for (int r = 0; r < nx(); ++r) J[r * row + r] = parts[0];
    for (int k = 0; k < batch.point_count; ++k) {
      const double* const from = batch.jacobian(batch.points, k);
      const double part = parts[k + 1];
      for (std::ptrdiff_t e = 0; e < block; ++e) J[e] += part * from[e];
    }
  }
}

/// The model along the intervals up to the measurements, and its outputs there.
void RheProblem::evaluate_batch(BetweenBatch& batch, bool with_gradients) const noexcept {
  if (batch.point_count > 0) {
    interpolate(batch, with_gradients);
  } else {
    IntervalRows along = batch.along(*this, batch.own, batch.count);
    if (with_gradients) along.jacobians = batch.own.jacobians;
    model().integrate_rows(along);
    for (int i = 0; i < batch.count && with_gradients && structure().any_ramp(); ++i)
      turn_ramp(batch, batch.share[i], batch.jacobian(batch.own, i), nullptr);
  }
  NodeRows there = batch.there(*this);
  there.outputs = batch.outputs;
  if (with_gradients) there.jacobians = batch.output_jacobians;
  model().observe_rows(there);
}

/// Adds second derivatives of the states at the measurements, weighted by `own.multipliers`, to H.
void RheProblem::add_curvature_of_dynamics(BetweenBatch& batch, const CostView& view) const noexcept {
  const std::ptrdiff_t row = batch.row;
  const bool is_dense = batch.point_count > 0;
  const BetweenBatch::Intervals& of = is_dense ? batch.points : batch.own;
  const int count = is_dense ? batch.point_count : batch.count;
  if (is_dense) {
    std::fill_n(of.multipliers, count * row, 0.0);
    for (int i = 0; i < batch.count; ++i) {
      const double* const parts = batch.parts.data() + std::ptrdiff_t{i} * (BetweenBatch::most_points + 1);
      for (int k = 0; k < count; ++k)
        for (int r = 0; r < nx(); ++r) of.multipliers[k * row + r] += parts[k + 1] * batch.own.multipliers[i * row + r];
    }
  }
  IntervalRows along = batch.along(*this, of, count);
  along.next_states = nullptr;
  along.multipliers = of.multipliers;
  along.multiplier_step = row;
  along.hessians = of.hessians;
  along.hessian_step = row * row;
  along.hessian_row = row;
  model().integrate_rows(along);
  const IntervalDynamics dynamics{model(), structure(), nullptr, nullptr, substeps()};
  for (int i = 0; i < count; ++i) {
    double* const curvature = batch.hessian(of, i);
    const double share = is_dense ? between_points_[static_cast<std::size_t>(i) + 1] : batch.share[i];
    const int interval = is_dense ? batch.interval[0] : batch.interval[i];
    if (structure().any_ramp()) turn_ramp(batch, share, nullptr, curvature);
    double* const H = H_of(view, interval);
    for (int c = 0; c < batch.nz; ++c)
      for (int r = 0; r < batch.nz; ++r)
        H[dynamics.column_of(interval, c) * stride() + dynamics.column_of(interval, r)] += curvature[c * row + r];
  }
}

/// Derivatives with respect to the ramp's value at a share of the interval become those with respect to its values at
/// the interval's start and end: q = (1 - share) p + share p_end. Either may be null.
void RheProblem::turn_ramp(const BetweenBatch& batch, double share, double* J, double* H) const noexcept {
  const int start = nx(), end = batch.nz - np();
  const auto turn = [&](double* at_start, double* at_end, std::ptrdiff_t step, int count) {
    for (int k = 0; k < count; ++k) {
      at_start[k * step] += (1.0 - share) * at_end[k * step];
      at_end[k * step] *= share;
    }
  };
  for (int j = 0; j < np(); ++j) {
    if (J) turn(J + start + j, J + end + j, batch.row, nx());
    if (!H) continue;
    turn(H + start + j, H + end + j, batch.row, batch.nz);
    turn(H + std::ptrdiff_t{start + j} * batch.row, H + std::ptrdiff_t{end + j} * batch.row, 1, batch.nz);
  }
}

}  // namespace rhec
