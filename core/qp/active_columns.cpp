// The columns of the dual active set: the sensitivities to the gradients of these bounds, and the Cholesky factor of
// the small dense system for their multipliers.
#include <algorithm>
#include <array>
#include <cmath>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/qp_kernels.hpp"
#include "rhec/core/qp/dual_active_set.hpp"
#include "sensitivity_sums.hpp"

namespace rhec {
namespace {

// A bound is linearly dependent on the others if at most this fraction of its own curvature is left.
constexpr double dependence = 1e-10;

}  // namespace

/// Finds one batch of sensitivities; it replaces a batch that no column needs.
bool DualActiveSet::find_sensitivities(const StageQp& qp, Riccati& riccati, const int* places, int count) noexcept {
  const auto choose = [&] {
    int batch = 0;
    while (batch < batch_count_ && is_needed(batch, places, count)) ++batch;
    return batch;
  };
  int chosen = choose();
  if (chosen == batch_count_) {
    // Columns are spread over all batches: recomputing them together frees a batch.
    for (int k = 0; k < batch_count_; ++k) forget(k);
    if (!find_sensitivities_of_columns(qp, riccati, false)) return false;
    chosen = choose();
  }
  Batch& batch = batches_[chosen];
  Riccati::Entry gradients[batch_size] = {};
  for (int c = 0; c < count; ++c) {
    if (is_limit(places[c])) {
      gradients[c] = {(places[c] - places_) / limit_row_, 0, row_of(qp, places[c])};
    } else {
      gradients[c] = {places[c] / stride_, places[c] % stride_, nullptr};
    }
  }
  if (!riccati.find_sensitivities(qp, held_, gradients, count, batch.sensitivities)) return false;
  if (has_limits_) find_limit_sensitivities(qp, batch.sensitivities.values.data());
  forget(chosen);
  batch.count = count;
  std::copy_n(places, count, batch.of.begin());
  for (int c = 0; c < count; ++c) number_[places[c]] = chosen * batch_size + c;
  return true;
}

/// Whether a column has its sensitivities in this batch and is not among `places`, which are recomputed.
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

/// Those of the last batch together with those of violated bounds, if these are wanted.
bool DualActiveSet::find_sensitivities_of_columns(const StageQp& qp, Riccati& riccati, bool and_violated) noexcept {
  for (int first = 0; first < column_count(); first += batch_size) {
    const int* const places = columns_.data() + first;
    const int count = std::min(batch_size, column_count() - first);
    const bool found = and_violated && count < batch_size ? find_sensitivities_of_next(qp, riccati, places, count, 0.0)
                                                          : find_sensitivities(qp, riccati, places, count);
    if (!found) return false;
  }
  return true;
}

/// For the given places and, at hardly any extra cost, for the bounds that are likely to follow: the most violated
/// ones, or those closest to violation, as found by `find_violations`, of those that are violated by more than `least`.
bool DualActiveSet::find_sensitivities_of_next(const StageQp& qp, Riccati& riccati, const int* first, int count,
                                               double least) noexcept {
  std::array<int, batch_size> places{};
  std::copy_n(first, count, places.begin());
  const int given = count;
  // `least` is the smallest violation among the chosen ones, once the batch is full.
  const auto take = [&](int place) {
    if (!(violation_[place] > least) || number_[place] != none) return;
    if (std::find(first, first + given, place) != first + given) return;
    if (count < batch_size) ++count;
    int at = count - 1;
    for (; at > given && violation_[places[at - 1]] < violation_[place]; --at) places[at] = places[at - 1];
    places[at] = place;
    if (count == batch_size) least = violation_[places[batch_size - 1]];
  };
  // Rows are padded to multiples of eight, and few of them have one that is chosen.
  constexpr int eight = 8;
  qp_kernels().largest_of_eight(violation_.data(), all_places_, largest_.data());
  for (int begin = 0; begin < all_places_; begin += eight)
    if (largest_[begin / eight] > least)
      for (int j = 0; j < eight; ++j) take(begin + j);
  return find_sensitivities(qp, riccati, places.data(), count);
}

/// sums += weighted sum of the sensitivities.
void DualActiveSet::add_sensitivities(const Riccati& riccati, const Weights& weights,
                                      std::vector<double>& sums) const noexcept {
  const auto is_zero = [](double weight) { return weight == 0.0; };
  const double *values[most_batches], *of_batch[most_batches];
  int number = 0;
  for (int k = 0; k < batch_count_; ++k) {
    if (batches_[k].count == 0 || std::all_of(weights[k].begin(), weights[k].end(), is_zero)) continue;
    if (!has_limits_) {
      riccati.add_values(batches_[k].sensitivities, weights[k].data(), all_places_, sums.data());
      continue;
    }
    values[number] = batches_[k].sensitivities.values.data();
    of_batch[number++] = weights[k].data();
  }
  riccati_kernels().combine_batches(values, of_batch, number, sums.data(), all_places_);
}

/// Computes the row that a bound would add to the factor below `count` others. Returns the square of its diagonal
/// entry, or 0 if it depends on them linearly.
double DualActiveSet::eliminate(int entering, int count, double* row) const noexcept {
  const unsigned number = static_cast<unsigned>(number_[entering]);
  const double* const sensitivities = sensitivities_at(number / batch_size, 0) + number % batch_size;
  const auto at = [sensitivities](int place) { return sensitivities[static_cast<std::ptrdiff_t>(place) * batch_size]; };
  double left = -at(entering);
  if (has_limits_ && relaxed_[entering] != 0) left += softness(entering);
  const double least = dependence * left;
  for (int k = 0; k < count; ++k) {
    const double* above = factor_row(k);
    row[k] = (-at(columns_[k]) - dot(above, row, k)) * above[k];
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

/// Changes the multipliers of the columns so that their bounds are met. The values do not follow yet.
void DualActiveSet::return_to_bounds() noexcept {
  double change[max_columns_with_limits];
  const int count = column_count();
  for (int k = 0; k < count; ++k) {
    const double* row = factor_row(k);
    change[k] = (value_[columns_[k]] - target(columns_[k], multipliers_[k]) - dot(row, change, k)) * row[k];
  }
  back_substitute(change);
  for (int k = 0; k < count; ++k) {
    multipliers_[k] += change[k];
    weight_of(columns_[k], pending_) = change[k];
  }
  has_pending_ = true;
}

/// The values of all places follow what is pending.
void DualActiveSet::write_pending(const Riccati& riccati) noexcept {
  add_sensitivities(riccati, pending_, value_);
  pending_ = {};
  has_pending_ = false;
}

/// Computes the Cholesky factor of S from row `first` on, with reciprocals on its diagonal. Linearly dependent columns
/// are omitted, or make this fail.
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

/// Without row k the factor has one entry beyond the diagonal in each row that follows; rotations of its columns remove
/// these (Golub & Van Loan 2013, section 6.5.4).
void DualActiveSet::drop_column(int k) noexcept {
  let_go(columns_[k]);
  columns_.erase(columns_.begin() + k);
  const int count = column_count();
  std::copy(multipliers_.begin() + k + 1, multipliers_.begin() + count + 1, multipliers_.begin() + k);
  for (int r = k; r < count; ++r) std::copy_n(factor_row(r + 1), r + 2, factor_row(r));
  for (int j = k; j < count; ++j) {
    double* row = factor_row(j);
    const double left = row[j], diagonal = 1.0 / row[j + 1];
    const double reciprocal = 1.0 / std::sqrt(left * left + diagonal * diagonal);
    const double cosine = left * reciprocal, sine = diagonal * reciprocal;
    row[j] = reciprocal;
    for (int r = j + 1; r < count; ++r) {
      double* pair = factor_row(r) + j;
      const double first = pair[0], second = pair[1];
      pair[0] = cosine * first + sine * second;
      pair[1] = cosine * second - sine * first;
    }
  }
}

}  // namespace rhec
