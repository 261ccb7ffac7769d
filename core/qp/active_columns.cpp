// The bounds of the dual active set that are columns: the sensitivities to their gradients, and the factor of the small
// dense system for their multipliers.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "rhec/core/qp/dual_active_set.hpp"
#include "sensitivity_sums.hpp"

namespace rhec {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
// A bound whose gradient is, to this part of its own curvature, one of the others' depends on them.
constexpr double dependence = 1e-10;

}  // namespace

/// Of one batch, which takes the place of one that no column needs.
bool DualActiveSet::find_sensitivities(const StageQp& qp, Riccati& riccati, const int* places, int count) noexcept {
  const auto choose = [&] {
    int batch = 0;
    while (batch < batch_count && is_needed(batch, places, count)) ++batch;
    return batch;
  };
  int chosen = choose();
  if (chosen == batch_count) {
    // Columns are everywhere: put together, they leave a batch.
    for (int k = 0; k < batch_count; ++k) forget(k);
    if (!find_sensitivities_of_columns(qp, riccati, 0)) return false;
    chosen = choose();
  }
  Batch& batch = batches_[chosen];
  Riccati::Entry gradients[batch_size] = {};
  for (int c = 0; c < count; ++c) gradients[c] = {places[c] / stride_, places[c] % stride_};
  if (!riccati.find_sensitivities(qp, held_, gradients, count, batch.sensitivities)) return false;
  forget(chosen);
  batch.count = count;
  std::copy_n(places, count, batch.of.begin());
  for (int c = 0; c < count; ++c) number_[places[c]] = chosen * batch_size + c;
  return true;
}

/// Whether a column has its sensitivities there, other than those that are asked for anew.
bool DualActiveSet::is_needed(int batch, const int* places, int count) const noexcept {
  for (int c = 0; c < batches_[batch].count; ++c) {
    const int place = batches_[batch].of[c];
    if (hold_[place] == Hold::column && number_[place] == batch * batch_size + c &&
        std::find(places, places + count, place) == places + count)
      return true;
  }
  return false;
}

void DualActiveSet::forget(int batch) noexcept {
  for (int c = 0; c < batches_[batch].count; ++c) {
    int& number = number_[batches_[batch].of[c]];
    if (number == batch * batch_size + c) number = none;
  }
  batches_[batch].count = 0;
}

bool DualActiveSet::find_sensitivities_of_columns(const StageQp& qp, Riccati& riccati, int first) noexcept {
  for (; first < column_count(); first += batch_size)
    if (!find_sensitivities(qp, riccati, columns_.data() + first, std::min(batch_size, column_count() - first)))
      return false;
  return true;
}

/// Of the first ones, and in the same time of those that may be next: the most violated ones, or nearest to being so.
/// `find_violations` has looked at all.
bool DualActiveSet::find_sensitivities_of_next(const StageQp& qp, Riccati& riccati, const int* first,
                                               int count) noexcept {
  std::array<int, batch_size> places{};
  std::copy_n(first, count, places.begin());
  const int given = count;
  double least = -infinity;  // of those that have been chosen, once there is no room
  for (int place = 0; place < places_; ++place) {
    if (!(violation_[place] > least) || number_[place] != none) continue;
    if (std::find(first, first + given, place) != first + given) continue;
    if (count < batch_size) ++count;
    int at = count - 1;
    for (; at > given && violation_[places[at - 1]] < violation_[place]; --at) places[at] = places[at - 1];
    places[at] = place;
    if (count == batch_size) least = violation_[places[batch_size - 1]];
  }
  return find_sensitivities(qp, riccati, places.data(), count);
}

/// Adds to values the sensitivities, each by its weight.
void DualActiveSet::add_sensitivities(const Riccati& riccati, const Weights& weights,
                                      std::vector<double>& sums) const noexcept {
  for_each_weighted(
      weights, [&](int k) { riccati.add_values(batches_[k].sensitivities, weights[k].data(), places_, sums.data()); });
}

/// The row of the factor that a bound would add below `count` others; returns the square of its diagonal entry, or 0
/// where it depends on them.
double DualActiveSet::eliminate(int entering, int count, double* row) const noexcept {
  double left = -sensitivity(entering, entering);
  const double least = dependence * left;
  for (int k = 0; k < count; ++k) {
    const double* above = factor_row(k);
    row[k] = (-sensitivity(entering, columns_[k]) - dot(above, row, k)) * above[k];
    left -= row[k] * row[k];
  }
  return left > least && least > 0.0 ? left : 0.0;
}

/// x := L'^-1 x.
void DualActiveSet::back_substitute(double* x) const noexcept {
  for (int k = column_count() - 1; k >= 0; --k) {
    const double* row = factor_row(k);
    x[k] *= row[k];
    for (int l = 0; l < k; ++l) x[l] -= row[l] * x[k];
  }
}

/// The Cholesky factor of S from row `first` on, with reciprocals on its diagonal. Columns that depend on those before
/// are left out, or make this fail.
bool DualActiveSet::factor_columns(int first, bool may_leave_out) noexcept {
  int kept = first;
  for (int k = first; k < column_count(); ++k) {
    double* row = factor_row(kept);
    const double square = eliminate(columns_[k], kept, row);
    if (square == 0.0) {
      if (!may_leave_out) return false;
      let_go(columns_[k]);
      continue;
    }
    row[kept] = 1.0 / std::sqrt(square);
    columns_[kept] = columns_[k];
    multipliers_[kept++] = multipliers_[k];
  }
  columns_.resize(kept);
  return true;
}

void DualActiveSet::drop_column(int k) noexcept {
  let_go(columns_[k]);
  columns_.erase(columns_.begin() + k);
  std::copy(multipliers_.begin() + k + 1, multipliers_.begin() + column_count() + 1, multipliers_.begin() + k);
  // What is left of a positive definite system is no less so.
  factor_columns(k, true);
}

}  // namespace rhec
