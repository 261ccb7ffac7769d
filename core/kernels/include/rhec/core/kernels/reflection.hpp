#pragma once

namespace rhec {

/// Of reflected eigenvalues: the least size of the largest, and of all relative to it.
constexpr double least_curvature = 1e-12, least_ratio = 1e-8;

/// A symmetric matrix of two rows.
struct PairMatrix {
  double first = 0.0, beside = 0.0, second = 0.0;
};

/// Reflects the negative eigenvalues of a symmetric matrix of two rows: the sum of |eigenvalue| times the projection on
/// its eigenvector. Most vehicles have two inputs, and the general method takes many times as long. `radius` is half
/// the distance of the eigenvalues. Always inline: units for different instruction sets share nothing.
[[gnu::always_inline]] inline PairMatrix reflect(const PairMatrix& matrix, double radius) {
  const auto size = [](double x) { return x < 0.0 ? -x : x; };
  const auto larger = [](double x, double y) { return x < y ? y : x; };
  const double mean = 0.5 * (matrix.first + matrix.second), upper = mean + radius, lower = mean - radius;
  const double top = larger(larger(size(upper), size(lower)), least_curvature);
  const double of_upper = larger(size(upper), least_ratio * top), of_lower = larger(size(lower), least_ratio * top);
  // M = upper P + lower (1 - P), so |M| = of_lower + (of_upper - of_lower) P.
  const double share = radius > 0.0 ? (of_upper - of_lower) / (2.0 * radius) : 0.0;
  const double left = of_lower - share * lower;
  return {left + share * matrix.first, share * matrix.beside, left + share * matrix.second};
}

}  // namespace rhec
