#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>

#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/riccati_kernels.hpp"

namespace rhec {

/// Four independent partial sums.
inline double dot(const double* a, const double* b, int count) noexcept {
  double sums[4] = {};
  int k = 0;
  for (; k + 4 <= count; k += 4)
    for (int j = 0; j < 4; ++j) sums[j] += a[k + j] * b[k + j];
  for (; k < count; ++k) sums[0] += a[k] * b[k];
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/// Calls function(number) for the batches with a non-zero weight.
template <class Weights, class Function>
void for_each_weighted(const Weights& weights, const Function& function) {
  const auto is_zero = [](double weight) { return weight == 0.0; };
  for (std::size_t k = 0; k < weights.size(); ++k)
    if (!std::all_of(weights[k].begin(), weights[k].end(), is_zero)) function(static_cast<int>(k));
}

/// A few places whose values are wanted often while sensitivities are added to them with new weights: their
/// sensitivities, one batch behind the other.
class GatheredPlaces {
 public:
  static constexpr int most = 96, most_batches = 6;
  static constexpr int size = response_batch;

  void clear() noexcept { count_ = batches_ = 0; }
  void add(int place) noexcept {
    if (count_ < most) places_[count_++] = place;
  }
  int count() const noexcept { return count_; }
  /// `values` are a batch's sensitivities at all places; null for one that is empty. There is room for `most_batches`.
  void add_batch(const double* values) noexcept {
    double* to = sensitivities_.data() + static_cast<std::ptrdiff_t>(batches_++) * most * size;
    if (!values) {
      std::fill(to, to + padded() * size, 0.0);
      return;
    }
    for (int k = 0; k < count_; ++k)
      std::memcpy(to + k * size, values + static_cast<std::ptrdiff_t>(places_[k]) * size, size * sizeof(double));
    // Sums are found eight at a time.
    std::fill(to + count_ * size, to + padded() * size, 0.0);
  }
  /// The values are those before and the sensitivities with these weights (null: none).
  template <class Weights>
  void begin(const double* before, const Weights* weights) noexcept {
    for (int k = 0; k < count_; ++k) values_[k] = before[places_[k]];
    std::fill(values_.begin() + count_, values_.begin() + padded(), 0.0);
    if (weights) sum(*weights, values_.data());
  }
  /// The rates of the values where sensitivities are added with these weights.
  template <class Weights>
  void turn(const Weights& weights) noexcept {
    std::fill(rates_.begin(), rates_.begin() + padded(), 0.0);
    sum(weights, rates_.data());
  }
  void advance(double length) noexcept {
    for (int k = 0; k < padded(); ++k) values_[k] += length * rates_[k];
  }
  int place(int k) const noexcept { return places_[k]; }
  double value(int k) const noexcept { return values_[k]; }
  double rate(int k) const noexcept { return rates_[k]; }

 private:
  int padded() const noexcept { return (count_ + size - 1) / size * size; }
  template <class Weights>
  void sum(const Weights& weights, double* sums) const noexcept {
    const double *batches[most_batches], *of_batch[most_batches];
    for (int k = 0; k < batches_; ++k) {
      batches[k] = sensitivities_.data() + static_cast<std::ptrdiff_t>(k) * most * size;
      of_batch[k] = weights[k].data();
    }
    riccati_kernels().combine_batches(batches, of_batch, batches_, sums, padded());
  }

  int count_ = 0, batches_ = 0;
  std::array<int, most> places_;  // NOLINT(*-member-init): set as far as they count
  alignas(64) std::array<double, most> values_, rates_;
  alignas(64) std::array<double, most_batches * most * size> sensitivities_;
};

}  // namespace rhec
