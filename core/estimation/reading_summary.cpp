#include "rhec/core/estimation/reading_summary.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <Eigen/Eigenvalues>

namespace rhec {

ReadingSummary::ReadingSummary(std::vector<int> outputs, int output_count, int most, int pieces)
    : outputs_(std::move(outputs)), width_(output_count), pieces_(std::max(1, pieces)) {
  const std::size_t n = static_cast<std::size_t>(width_),
                    room = static_cast<std::size_t>(most) + nodes * outputs_.size() * static_cast<std::size_t>(pieces_);
  times_.assign(room, 0.0);
  values_.assign(room * n, 0.0);
  weights_.assign(room * n, 1.0);
  present_.assign(static_cast<std::size_t>(most), 0);
  polynomials_.assign(static_cast<std::size_t>(most) * nodes, 0.0);
}

MeasuredInterval ReadingSummary::operator()(const MeasuredInterval& interval) noexcept {
  count_ = 0;
  const auto value = [&](int k, int j) { return interval.outputs[static_cast<std::ptrdiff_t>(k) * width_ + j]; };
  const auto weight = [&](int k, int j) { return interval.measured(k, width_).weight(j); };
  for (int j = 0; j < width_; ++j) {
    const bool is_chosen = std::ranges::binary_search(outputs_, j);
    int first = 0;
    for (int piece = 0; piece < pieces_; ++piece) {
      const double end =
          piece + 1 == pieces_ ? std::numeric_limits<double>::infinity() : interval.duration * (piece + 1) / pieces_;
      int last = first, taken = 0;
      for (; last < interval.between && interval.times[last] < end; ++last)
        if (!std::isnan(value(last, j))) present_[taken++] = last;
      if (!is_chosen || taken < least || !summarise(interval, j, taken))
        for (int i = 0; i < taken; ++i)
          add(interval.times[present_[i]], j, value(present_[i], j), weight(present_[i], j));
      first = last;
    }
  }
  return {interval.duration, interval.inputs, count_, times_.data(), values_.data(), weights_.data()};
}

/// The polynomials that are orthonormal over the times, by Stieltjes' procedure: their recurrence is the Jacobi matrix,
/// whose eigenvalues are the nodes, and whose eigenvectors hold the polynomials at the nodes. False, and nothing done,
/// if the times are too few different ones.
bool ReadingSummary::summarise(const MeasuredInterval& interval, int output, int taken) noexcept {
  const auto time = [&](int i) { return interval.times[present_[i]]; };
  constexpr double least_spread = 1e-3;
  const double middle = 0.5 * (time(0) + time(taken - 1)), half = 0.5 * (time(taken - 1) - time(0));
  if (!(half > 0.0)) return false;
  const auto q = [&](int degree) { return polynomials_.data() + static_cast<std::ptrdiff_t>(degree) * taken; };
  Eigen::Matrix<double, nodes, 1> diagonal, coefficients;
  Eigen::Matrix<double, nodes - 1, 1> beside;
  // Orthonormal are the polynomials times the roots of the measurements' weights: those stand in `q`.
  const auto weight_of = [&](int i) { return interval.measured(present_[i], width_).weight(output); };
  const auto root_of = [&](int i) { return interval.weights ? std::sqrt(weight_of(i)) : 1.0; };
  double total = 0.0;
  for (int i = 0; i < taken; ++i) total += weight_of(i);
  for (int i = 0; i < taken; ++i) q(0)[i] = root_of(i) / std::sqrt(total);
  for (int d = 0; d < nodes; ++d) {
    diagonal[d] = coefficients[d] = 0.0;
    for (int i = 0; i < taken; ++i) {
      diagonal[d] += (time(i) - middle) / half * q(d)[i] * q(d)[i];
      coefficients[d] +=
          root_of(i) * q(d)[i] * interval.outputs[static_cast<std::ptrdiff_t>(present_[i]) * width_ + output];
    }
    if (d + 1 == nodes) break;
    double squares = 0.0;
    for (int i = 0; i < taken; ++i) {
      q(d + 1)[i] = ((time(i) - middle) / half - diagonal[d]) * q(d)[i] - (d > 0 ? beside[d - 1] * q(d - 1)[i] : 0.0);
      squares += q(d + 1)[i] * q(d + 1)[i];
    }
    beside[d] = std::sqrt(squares);
    if (!(beside[d] > least_spread)) return false;
    for (int i = 0; i < taken; ++i) q(d + 1)[i] /= beside[d];
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, nodes, nodes>> solver;
  solver.computeFromTridiagonal(diagonal, beside);
  const auto& vectors = solver.eigenvectors();
  for (int n = 0; n < nodes; ++n) {
    double value = 0.0;
    for (int d = 0; d < nodes; ++d) value += coefficients[d] * vectors(d, n);
    const double first = vectors(0, n);
    add(middle + half * solver.eigenvalues()[n], output, value / (first * std::sqrt(total)), total * first * first);
  }
  return true;
}

/// In the order of times; outputs of one time stand in one row, unless one is measured twice.
void ReadingSummary::add(double time, int output, double value, double weight) noexcept {
  const std::ptrdiff_t n = width_;
  std::ptrdiff_t row = std::lower_bound(times_.begin(), times_.begin() + count_, time) - times_.begin();
  while (row < count_ && times_[row] == time && !std::isnan(values_[row * n + output])) ++row;
  if (row == count_ || times_[row] != time) {
    std::copy_backward(times_.begin() + row, times_.begin() + count_, times_.begin() + count_ + 1);
    for (auto* each : {&values_, &weights_})
      std::copy_backward(each->begin() + row * n, each->begin() + count_ * n, each->begin() + (count_ + 1) * n);
    times_[row] = time;
    std::fill_n(values_.begin() + row * n, n, std::numeric_limits<double>::quiet_NaN());
    std::fill_n(weights_.begin() + row * n, n, 1.0);
    ++count_;
  }
  values_[row * n + output] = value;
  weights_[row * n + output] = weight;
}

}  // namespace rhec
