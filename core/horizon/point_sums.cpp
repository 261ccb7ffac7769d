#include "point_sums.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rhec/core/base/scratch.hpp"

namespace rhec {

std::vector<double> PointSums::shares(int points) {
  std::vector<double> shares(static_cast<std::size_t>(points));
  for (int k = 0; k < points; ++k) shares[k] = 0.5 - 0.5 * std::cos(std::numbers::pi * (k + 0.5) / points);
  return shares;
}

void PointSums::write_parts(const double* shares, int points, double share, double* parts) noexcept {
  std::fill_n(parts, row, 0.0);
  double sum = 0.0;
  for (int k = 0; k < points; ++k) {
    const double distance = share - shares[k];
    if (distance == 0.0) {
      std::fill_n(parts, k, 0.0);
      parts[k] = 1.0;
      return;
    }
    // sin((2k + 1) pi / 2n) = 2 sqrt(s (1 - s)) at the share s of a point.
    const double weight = (k % 2 ? -1.0 : 1.0) * std::sqrt(shares[k] * (1.0 - shares[k]));
    parts[k] = weight / distance;
    sum += parts[k];
  }
  for (int k = 0; k < points; ++k) parts[k] /= sum;
}

PointSums::PointSums(int points, int outputs, int width, double* memory) noexcept
    : points_(points), outputs_(outputs), width_(width) {
  Scratch scratch(memory);
  said_ = scratch.take(outputs * row);
  weights_ = scratch.take(outputs * most_points * row);
  pulls_ = scratch.take(outputs * row);
  rows_ = scratch.take(static_cast<std::ptrdiff_t>(most_points) * width);
  reduced_ = scratch.take(row);
}

std::size_t PointSums::size(int outputs, int width) noexcept {
  return static_cast<std::size_t>(outputs * (most_points + 2) * row + most_points * width + row) + 7;
}

void PointSums::begin(const double* outputs, std::ptrdiff_t step) noexcept {
  std::fill_n(said_, outputs_ * row, 0.0);
  for (int j = 0; j < outputs_; ++j)
    for (int k = 0; k < points_; ++k) said_[j * row + k] = outputs[k * step + j];
  std::fill_n(pulls_, outputs_ * row, 0.0);
}

void PointSums::predict(const double* parts, double* outputs) const noexcept {
  for (int j = 0; j < outputs_; ++j) {
    const double* said = said_ + j * row;
    double sums[block] = {};
    for (int k = 0; k < points_; k += block)
      for (int l = 0; l < block; ++l) sums[l] += parts[k + l] * said[k + l];
    outputs[j] = (sums[0] + sums[1]) + (sums[2] + sums[3]);
  }
}

void PointSums::add_pulls(const double* parts, const double* pulls) noexcept {
  for (int j = 0; j < outputs_; ++j) {
    if (pulls[j] == 0.0) continue;
    double* const v = pulls_ + j * row;
    for (int k = 0; k < points_; k += block)
      for (int l = 0; l < block; ++l) v[k + l] += pulls[j] * parts[k + l];
  }
}

void PointSums::begin_weights() noexcept { std::fill_n(weights_, outputs_ * most_points * row, 0.0); }

void PointSums::add_weights(const double* parts, const double* weights) noexcept {
  for (int j = 0; j < outputs_; ++j) {
    if (weights[j] == 0.0) continue;
    double* W = weights_ + j * most_points * row;
    for (int k = 0; k < points_; ++k, W += row) {
      const double weighted = weights[j] * parts[k];
      for (int l = 0; l <= k; l += block)
        for (int e = 0; e < block; ++e) W[l + e] += weighted * parts[l + e];
    }
  }
}

void PointSums::factor(int output, Factors factors) const noexcept {
  const int n = points_;
  const double* const W = weights_ + output * most_points * row;
  double* const pivots = factors.pivots();
  double largest = 0.0;
  for (int k = 0; k < n; ++k) largest = std::max(largest, W[k * row + k]);
  const double least = 1e-14 * largest;
  for (int k = 0; k < n; ++k) {
    const double* const of_k = factors.row(k);
    double pivot = W[k * row + k];
    for (int l = 0; l < k; ++l) pivot -= of_k[l] * of_k[l] * pivots[l];
    const bool is_zero = !(pivot > least);
    pivots[k] = is_zero ? 0.0 : pivot;
    for (int i = k + 1; i < n; ++i) {
      double* const of_i = factors.row(i);
      double sum = W[i * row + k];
      for (int l = 0; l < k; ++l) sum -= of_i[l] * of_k[l] * pivots[l];
      of_i[k] = is_zero ? 0.0 : sum / pivot;
    }
  }
}

PointSums::Rows PointSums::rows(int output, const double* gradients, std::ptrdiff_t step,
                                const Factors* factors) noexcept {
  const int n = points_;
  const double* const v = pulls_ + output * row;
  for (int k = 0; k < n; ++k)
    std::copy_n(gradients + k * step, width_, rows_ + static_cast<std::ptrdiff_t>(k) * width_);
  if (!factors) return {rows_, nullptr, v};
  for (int k = 0; k < n; ++k) {
    double sum = v[k];
    for (int l = 0; l < k; ++l) sum -= factors->row(k)[l] * reduced_[l];
    reduced_[k] = sum;
    double* const to = rows_ + static_cast<std::ptrdiff_t>(k) * width_;
    for (int l = k + 1; l < n; ++l) {
      const double part = factors->row(l)[k];
      const double* const from = rows_ + static_cast<std::ptrdiff_t>(l) * width_;
      for (int e = 0; part != 0.0 && e < width_; ++e) to[e] += part * from[e];
    }
  }
  return {rows_, factors->pivots(), reduced_};
}

}  // namespace rhec
