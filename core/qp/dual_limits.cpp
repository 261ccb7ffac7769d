// Limits in the dual active-set method: rows of the stage QP's G in place of single entries, and the slacks of soft
// ones.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "qp_view.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/qp/dual_active_set.hpp"
#include "tolerances.hpp"

namespace rhec {

bool DualActiveSet::is_soft(int place) const noexcept { return is_limit(place) && linear(place) < infinity; }

void DualActiveSet::take_limit_claims(const StageQp& qp, const ActiveSet& claimed) noexcept {
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int r = 0; r < qp.limits(i); ++r) {
      const std::int8_t claim = claimed.limit(i)[r];
      if (claim == 0 || !std::isfinite((claim < 0 ? qp.limit_lower(i) : qp.limit_upper(i))[r])) continue;
      const int place = limit_place(i, r);
      const bool is_violated = std::abs(claim) > 1 && qp.limit_linear(i)[r] < infinity;
      if (is_violated && qp.limit_quadratic(i)[r] == 0.0) {
        hold_[place] = Hold::saturated;
        saturated_.push_back(place);
      } else if (column_count() < most_columns_) {
        hold_[place] = Hold::column;
        relaxed_[place] = is_violated ? 1 : 0;
        multipliers_[column_count()] = 0.0;
        columns_.push_back(place);
      } else {
        continue;
      }
      side_[place] = claim < 0 ? std::int8_t{-1} : std::int8_t{1};
    }
  }
}

/// Reads the present bounds and weights of limits behind the bounds of variables; false if a claim no longer fits.
bool DualActiveSet::take_limits(const StageQp& qp) noexcept {
  std::copy_n(lower_, places_, own_lower_.data());
  std::copy_n(upper_, places_, own_upper_.data());
  lower_ = own_lower_.data();
  upper_ = own_upper_.data();
  for (int i = 0; i <= qp.intervals(); ++i) {
    const int first = limit_place(i, 0), count = qp.limits(i);
    std::copy_n(qp.limit_lower(i), limit_row_, own_lower_.data() + first);
    std::copy_n(qp.limit_upper(i), limit_row_, own_upper_.data() + first);
    const double *linears = qp.limit_linear(i), *quadratics = qp.limit_quadratic(i);
    double *linear = linear_.data() + (first - places_), *softness = softness_.data() + (first - places_);
    std::copy_n(linears, count, linear);
    for (int r = 0; r < count; ++r) softness[r] = quadratics[r] > 0.0 ? 1.0 / quadratics[r] : 0.0;
  }
  const bool are_relaxed = std::all_of(columns_.begin(), columns_.end(), [this](int place) {
    return relaxed_[place] == 0 || (is_soft(place) && softness(place) > 0.0);
  });
  return are_relaxed && std::all_of(saturated_.begin(), saturated_.end(), [this](int place) {
           return is_soft(place) && softness(place) == 0.0 && std::isfinite(bound(place));
         });
}

/// From here on the limit's multiplier is constant, and its value must stay beyond the bound.
void DualActiveSet::saturate(int place) noexcept {
  const double edge = bound(place), tolerance = bound_tolerance * (1.0 + std::abs(edge));
  hold_[place] = Hold::saturated;
  least_[place] = side_[place] > 0 ? edge - tolerance : -infinity;
  most_[place] = side_[place] > 0 ? infinity : edge + tolerance;
}

/// h_ += G' multipliers.
void DualActiveSet::add_limit_gradients(const StageQp& qp) noexcept {
  const auto add = [&](int place, double multiplier) {
    const int stage = (place - places_) / limit_row_;
    const double* row = row_of(qp, place);
    double* h = h_.data() + static_cast<std::ptrdiff_t>(stage) * stride_;
    for (int j = 0; j < states_ + qp.controls(stage); ++j) h[j] += multiplier * row[j];
  };
  for (int k = 0; k < column_count(); ++k)
    if (is_limit(columns_[k])) add(columns_[k], multipliers_[k]);
  for (const int place : saturated_) add(place, side_[place] * linear(place));
}

/// The values of limits. Returns whether one of them is violated.
bool DualActiveSet::find_limit_values(const StageQp& qp, const Iterate& step) noexcept {
  return qp_kernels().limit_values(view_of_limits(qp), step.row(0), bound_tolerance, value_.data() + places_);
}

void DualActiveSet::keep_rows(const StageQp& qp) noexcept {
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(stride_) * qp.capacity().limits;
  std::copy_n(qp.G(0), (qp.intervals() + 1) * row, rows_.data());
}

/// Sensitivities to rows of G, and those of the values of these rows, hold for the G with which they were found.
void DualActiveSet::compare_rows(const StageQp& qp) noexcept {
  const std::ptrdiff_t count = static_cast<std::ptrdiff_t>(stride_) * qp.capacity().limits * (qp.intervals() + 1);
  if (std::memcmp(qp.G(0), rows_.data(), static_cast<std::size_t>(count) * sizeof(double)) == 0) return;
  const auto is_of_row = [this](int place) { return is_limit(place); };
  rows_change_ |= std::any_of(columns_.begin(), columns_.end(), is_of_row);
  for (int batch = 0; batch < batch_count_; ++batch) forget(batch);
}

/// Sensitivities of the limits' values, from those of the variables. Held controls do not move.
void DualActiveSet::find_limit_sensitivities(const StageQp& qp, double* values) const noexcept {
  static_assert(batch_size == 8);
  qp_kernels().limit_sensitivities(view_of_limits(qp), qp.control_counts(), states_, held_.row(0), values,
                                   values + static_cast<std::ptrdiff_t>(places_) * batch_size);
}

/// Corrects a soft column whose multiplier is out of its range: one below it is released, one above it is relaxed or
/// saturated. So each column changes at most twice.
bool DualActiveSet::correct_soft_column(int k, Weights& weights) noexcept {
  const int place = columns_[k];
  const double size = side_[place] * multipliers_[k], end = linear(place);
  const bool is_relaxed = relaxed_[place] != 0;
  if (size < (is_relaxed ? end : 0.0) - pull_tolerance_) {
    weight_of(place, weights) = -multipliers_[k];
    drop_column(k);
    return true;
  }
  if (is_relaxed || size <= end + pull_tolerance_) return false;
  if (softness(place) > 0.0) {
    relaxed_[place] = 1;
    factor_columns(k, true);
    return true;
  }
  weight_of(place, weights) = side_[place] * end - multipliers_[k];
  drop_column(k);
  saturated_.push_back(place);
  saturate(place);
  return true;
}

/// A column's multiplier has reached an end of its range. False if the columns that remain are linearly dependent.
bool DualActiveSet::pass_end(int k, bool grows) noexcept {
  const int place = columns_[k];
  if (grows && softness(place) > 0.0) {
    relaxed_[place] = 1;
    return factor_columns(k, false);
  }
  if (!grows && has_limits_ && relaxed_[place] != 0 && linear(place) > 0.0) {
    relaxed_[place] = 0;
    return factor_columns(k, false);
  }
  drop_column(k);
  if (grows) {
    saturated_.push_back(place);
    saturate(place);
  }
  return true;
}

void DualActiveSet::write_limits(const StageQp& qp, ActiveSet& active, Iterate& step) const noexcept {
  std::fill_n(step.limit_bound(0), (qp.intervals() + 1) * limit_row_, 0.0);
  const auto write = [&](int place, std::int8_t state, double multiplier) {
    step.limit_bound(0)[place - places_] = multiplier;
    active.limit(0)[place - places_] = state;
  };
  for (int k = 0; k < column_count(); ++k)
    if (const int place = columns_[k]; is_limit(place))
      write(place, static_cast<std::int8_t>(side_[place] * (relaxed_[place] != 0 ? 2 : 1)), multipliers_[k]);
  for (const int place : saturated_)
    write(place, static_cast<std::int8_t>(2 * side_[place]), side_[place] * linear(place));
}

}  // namespace rhec
