// The states at measurements between the nodes of an RheProblem, or at points of an interval, and their derivatives.
#include <algorithm>

#include "between_batch.hpp"
#include "cost_view.hpp"
#include "rhec/core/model/parts_of_intervals.hpp"

namespace rhec {

/// Steps of a Runge-Kutta method are made so short that a polynomial of fourth degree describes one of them well.
std::vector<double> RheProblem::points_of_interval() const {
  return PointSums::shares(std::min(PointSums::most_points, 3 + 2 * setup_.substeps));
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

/// Puts a measurement or a point into a batch.
void RheProblem::gather_entry(int interval, int place, bool is_point, double share, const Iterate& iterate,
                              BetweenBatch& batch) const noexcept {
  const int at = batch.count++;
  batch.interval[at] = interval;
  batch.place[at] = place;
  batch.is_point[at] = is_point;
  batch.share[at] = share;
  batch.durations[at] = share * duration(interval);
  write_part(interval, share, iterate, batch, batch.z + static_cast<std::ptrdiff_t>(at) * batch.row,
             batch.data + static_cast<std::ptrdiff_t>(at) * model().data_count());
}

/// The model along the intervals up to the entries of a batch, and its outputs there.
void RheProblem::evaluate_batch(BetweenBatch& batch, bool with_gradients) const noexcept {
  IntervalRows along = batch.along(*this);
  if (with_gradients) along.jacobians = batch.jacobians;
  model().integrate_rows(along);
  for (int i = 0; i < batch.count && with_gradients && structure().any_ramp(); ++i)
    turn_ramp(batch, batch.share[i], batch.jacobian(i), nullptr);
  NodeRows there = batch.there(*this);
  there.outputs = batch.outputs;
  if (with_gradients) there.jacobians = batch.output_jacobians;
  model().observe_rows(there);
}

/// Adds second derivatives of the states at the entries of a batch, weighted by its multipliers, to H.
void RheProblem::add_curvature_of_dynamics(BetweenBatch& batch, const CostView& view) const noexcept {
  const std::ptrdiff_t row = batch.row;
  IntervalRows along = batch.along(*this);
  along.next_states = nullptr;
  along.multipliers = batch.multipliers;
  along.multiplier_step = row;
  along.hessians = batch.hessians;
  along.hessian_step = row * row;
  along.hessian_row = row;
  model().integrate_rows(along);
  const IntervalDynamics dynamics{model(), structure(), nullptr, nullptr, substeps()};
  for (int i = 0; i < batch.count; ++i) {
    const int interval = batch.interval[i];
    double* const curvature = batch.hessian(i);
    if (structure().any_ramp()) turn_ramp(batch, batch.share[i], nullptr, curvature);
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
