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

PointSums::PointSums(int points, int outputs, double* memory) noexcept : points_(points), outputs_(outputs) {
  Scratch scratch(memory);
  said_ = scratch.take(outputs * row);
  weights_ = scratch.take(outputs * most_points * row);
  pulls_ = scratch.take(outputs * row);
}

std::size_t PointSums::size(int outputs) noexcept {
  return static_cast<std::size_t>(outputs * (most_points + 2) * row) + 7;
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

void PointSums::keep_weights(int output, Kept kept) const noexcept {
  const double* const W = weights_ + output * most_points * row;
  std::fill_n(kept.weights(), points_ * row, 0.0);
  for (int k = 0; k < points_; ++k)
    for (int l = 0; l <= k; ++l) kept.weights()[k * row + l] = kept.weights()[l * row + k] = W[k * row + l];
}

void PointSums::keep(int output, double cost, double largest, Kept kept) const noexcept {
  keep_weights(output, kept);
  std::copy_n(said_ + output * row, row, kept.said());
  std::copy_n(pulls_ + output * row, row, kept.pulls());
  kept.cost() = cost;
  kept.largest() = largest;
}

bool PointSums::revise(int output, Kept kept, double period, double& cost) noexcept {
  // A polynomial is nowhere larger than this, in parts of the largest of its values at up to nine points (Brutman
  // 1997).
  constexpr double lebesgue = 2.4;
  constexpr double least = 1e-3;  // of the cost
  const double* const said = said_ + output * row;
  const int used = (points_ + block - 1) / block * block;
  double change[row], product[row] = {}, largest = 0.0;
  for (int k = 0; k < used; ++k) {
    change[k] = said[k] - kept.said()[k];
    largest = std::max(largest, std::abs(change[k]));
  }
  if (!(largest < 1e300) || (period > 0.0 && !(kept.largest() + lebesgue * largest < 0.5 * period))) return false;
  for (int k = 0; k < used; k += block) {
    double sums[block] = {};
    for (int l = 0; l < points_; ++l)
      for (int e = 0; e < block; ++e) sums[e] += kept.weights()[l * row + k + e] * change[l];
    std::copy_n(sums, block, product + k);
  }
  double sum = kept.cost();
  for (int k = 0; k < points_; ++k) sum += (kept.pulls()[k] + 0.5 * product[k]) * change[k];
  if (!(sum >= least * kept.cost())) return false;
  double* const v = pulls_ + output * row;
  for (int k = 0; k < used; ++k) v[k] = kept.pulls()[k] + product[k];
  cost = sum;
  return true;
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

}  // namespace rhec
