#include "rhec/sim/tuning/precision.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "rhec/core/qp/symmetric_eigen.hpp"
#include "rhec/sim/tuning/search.hpp"

namespace rhec::sim {
namespace {

// First width of a slice, the longest and the shortest, in the coordinate's unit.
constexpr double first_step = 0.1, longest_step = 1.0, shortest_step = 0.002;
constexpr int most_slice_rounds = 4;
// A slice falls by so many times the roughness.
constexpr double rough_drops = 4.0;
// Closer to a bound than this a coordinate counts as at it.
constexpr double at_bound = 0.01;

/// A parabola through the likelihood along one coordinate.
struct Slice {
  double width = 0.0, curvature = 0.0;  ///< curvature: downwards
  double roughness = 0.0;               ///< root mean square distance of the likelihood from the parabola
  Eigen::VectorXd slopes;               ///< of each term, at the middle
  double drop() const { return 0.5 * curvature * width * width; }
};

/// Least squares over points that lie symmetrically, so that the slope depends on nothing else. The middle does not
/// take part: a search has chosen it for being high, by chance too.
Slice measure(const std::function<Eigen::VectorXd(double step)>& terms, double width) {
  constexpr double places[] = {0.25, 0.5, 0.75, 1.0};
  constexpr int count = 4, unknowns = 3;
  Slice slice;
  slice.width = width;
  Eigen::Vector4d squares, even, odd;
  double sum = 0.0;
  for (int k = 0; k < count; ++k) {
    const double step = places[k] * width;
    const Eigen::VectorXd up = terms(step), down = terms(-step);
    if (k == 0) slice.slopes = Eigen::VectorXd::Zero(up.size());
    slice.slopes += step * (up - down);
    squares[k] = step * step;
    even[k] = 0.5 * (up.sum() + down.sum());
    odd[k] = 0.5 * (up.sum() - down.sum());
    sum += 2.0 * step * step;
  }
  slice.slopes /= sum;
  const Eigen::Vector4d centred = squares.array() - squares.mean();
  const double bend = centred.dot(even) / centred.squaredNorm();
  slice.curvature = -2.0 * bend;
  const Eigen::Vector4d steps = squares.cwiseSqrt();
  const double rest = (even.array() - even.mean() - bend * centred.array()).matrix().squaredNorm() +
                      (odd - slice.slopes.sum() * steps).squaredNorm();
  slice.roughness = std::sqrt(2.0 * rest / (2 * count - unknowns));
  return slice;
}

/// The inverse of a symmetric matrix with a diagonal of at least 1. Differences of a rough likelihood make correlations
/// that cannot be: the least eigenvalue, of the matrix scaled to a diagonal of ones, is what roughness leaves of it.
Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& matrix, double least) {
  const Eigen::VectorXd scale = matrix.diagonal().cwiseSqrt().cwiseInverse();
  const SymmetricEigen eigen = symmetric_eigen(scale.asDiagonal() * matrix * scale.asDiagonal());
  const Eigen::MatrixXd rows = scale.asDiagonal() * eigen.vectors;
  return rows * eigen.values.cwiseMax(least).cwiseInverse().asDiagonal() * rows.transpose();
}

}  // namespace

double Precision::error(int coordinate) const noexcept {
  return std::max(std::sqrt(covariance(coordinate, coordinate)), hessian_errors[coordinate]);
}

double Precision::correlation(int a, int b) const noexcept {
  const double product = covariance(a, a) * covariance(b, b);
  return product > 0.0 ? covariance(a, b) / std::sqrt(product) : 0.0;
}

Precision precision_at(const LikelihoodTerms& terms, const Eigen::VectorXd& at, const PrecisionOptions& options) {
  const auto n = static_cast<int>(at.size());
  const auto stopped = [&] { return options.stop && options.stop(); };
  Precision result;
  result.hessian = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i)
    result.is_free.push_back(at[i] - options.lower[i] > at_bound && options.upper[i] - at[i] > at_bound);
  const auto moved = [&](int i, double step) {
    Eigen::VectorXd to = at;
    to[i] += step;
    return to;
  };
  const auto room = [&](int i) { return std::min({longest_step, at[i] - options.lower[i], options.upper[i] - at[i]}); };

  // As wide as it takes for the likelihood to fall by about 1, and by well more than its roughness.
  std::vector<Slice> slices(static_cast<std::size_t>(n));
  in_parallel(n, options.threads, [&](int i) {
    if (!result.is_free[i]) return;
    Slice& slice = slices[i];
    double width = std::min(first_step, room(i));
    for (int round = 0; round < most_slice_rounds && !stopped(); ++round) {
      slice = measure([&](double step) { return terms(moved(i, step)); }, width);
      const double wanted = std::max(1.0, rough_drops * slice.roughness), drop = slice.drop();
      if (drop > 0.5 * wanted && drop < 3.0 * wanted) break;
      const double next = std::clamp(width * std::clamp(drop > 0.0 ? std::sqrt(wanted / drop) : 3.0, 0.1, 5.0),
                                     std::min(shortest_step, room(i)), room(i));
      if (next == width) break;
      width = next;
    }
  });
  // The median: where a filter is lost for good, one coordinate's slice leaves no scale.
  std::vector<double> roughness;
  for (const Slice& slice : slices)
    if (slice.width > 0.0) roughness.push_back(slice.roughness);
  if (!roughness.empty()) {
    const auto middle = roughness.begin() + std::ssize(roughness) / 2;
    std::nth_element(roughness.begin(), middle, roughness.end());
    result.roughness = *middle;
  }
  std::vector<std::pair<int, int>> pairs;
  for (int i = 0; i < n; ++i) {
    if (slices[i].width == 0.0) continue;
    result.hessian(i, i) = slices[i].curvature;
    for (int j = 0; j < i; ++j)
      if (slices[j].width > 0.0) pairs.emplace_back(i, j);
  }
  in_parallel(static_cast<int>(pairs.size()), options.threads, [&](int k) {
    if (stopped()) return;
    const auto [i, j] = pairs[k];
    double sum = 0.0;
    for (const double a : {-1.0, 1.0}) {
      for (const double b : {-1.0, 1.0}) {
        Eigen::VectorXd to = moved(i, a * slices[i].width);
        to[j] += b * slices[j].width;
        sum += a * b * terms(to).sum();
      }
    }
    result.hessian(i, j) = result.hessian(j, i) = -0.25 * sum / (slices[i].width * slices[j].width);
  });

  // Curvature that is not there, but for roughness, is none.
  Eigen::MatrixXd information = result.hessian;
  information.diagonal() = information.diagonal().cwiseMax(0.0) + Eigen::VectorXd::Ones(n);
  double noise = 0.0;
  int count = 0;
  for (const Slice& slice : slices) {
    if (slice.width == 0.0 || !(slice.drop() > 0.0)) continue;
    noise += std::min(1.0, slice.roughness / slice.drop());
    ++count;
  }
  const Eigen::MatrixXd inverse = inverse_of(information, std::clamp(noise / std::max(count, 1), 1e-6, 0.5));
  result.hessian_errors = inverse.diagonal().cwiseSqrt();
  Eigen::VectorXd inflation = Eigen::VectorXd::Ones(n);
  for (int i = 0; i < n; ++i) {
    const Eigen::VectorXd& slope = slices[i].slopes;
    if (slope.size() == 0) continue;
    Eigen::VectorXd scores = Eigen::VectorXd::Zero(options.blocks);
    for (Eigen::Index term = 0; term < slope.size(); ++term)
      scores[std::min<Eigen::Index>(term * options.blocks / slope.size(), options.blocks - 1)] += slope[term];
    // At the maximum of likelihood and prior the sum of the scores is the coordinate: it belongs to no block.
    scores.array() -= scores.mean();
    inflation[i] = std::sqrt(std::max(1.0, (scores.squaredNorm() + 1.0) / information(i, i)));
  }
  result.covariance = inflation.asDiagonal() * inverse * inflation.asDiagonal();
  result.widths = Eigen::VectorXd::Zero(n);
  for (int i = 0; i < n; ++i) result.widths[i] = slices[i].width;
  return result;
}

}  // namespace rhec::sim
