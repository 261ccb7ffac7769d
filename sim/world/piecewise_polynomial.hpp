#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace rhec::sim {

/// A smooth function of one variable as a table of polynomials on equal pieces of an interval. With sufficiently short
/// pieces it differs from the function only by rounding, at the cost of a dozen multiplications. Arguments must lie in
/// that interval.
class PiecewisePolynomial {
 public:
  template <class Function>
  PiecewisePolynomial(double lower, double upper, int pieces, const Function& function)
      : lower_(lower), upper_(upper), pieces_per_unit_(pieces / (upper - lower)), last_(pieces - 1), table_(pieces) {
    // Interpolates exactly at the middle of a piece and at its other Chebyshev nodes: differences from the middle are
    // small, and so is their rounding error.
    constexpr int unknowns = degree;
    Eigen::Matrix<double, unknowns, unknowns> powers;
    Eigen::Matrix<double, unknowns, 1> nodes, differences;
    for (int k = 0; k < unknowns; ++k) {
      const int number = k < unknowns / 2 ? k : k + 1;  // among degree + 1 nodes, skipping the middle one
      nodes[k] = 0.5 * std::cos(std::numbers::pi * (number + 0.5) / (degree + 1));
      for (int power = 1; power <= degree; ++power) powers(k, power - 1) = std::pow(nodes[k], power);
    }
    const Eigen::PartialPivLU<Eigen::Matrix<double, unknowns, unknowns>> factor(powers);
    for (int piece = 0; piece < pieces; ++piece) {
      const auto value_at = [&](double place) { return function(lower_ + (piece + 0.5 + place) / pieces_per_unit_); };
      const double middle = value_at(0.0);
      for (int k = 0; k < unknowns; ++k) differences[k] = value_at(nodes[k]) - middle;
      const Eigen::Matrix<double, unknowns, 1> coefficients = factor.solve(differences);
      table_[piece][0] = middle;
      for (int power = 1; power <= degree; ++power) table_[piece][power] = coefficients[power - 1];
    }
  }

  double operator()(double x) const noexcept {
    const double place = (x - lower_) * pieces_per_unit_;
    const int piece = std::min(std::max(static_cast<int>(place), 0), last_);
    const double t = place - (piece + 0.5), square = t * t;
    const std::array<double, degree + 2>& c = table_[piece];
    return (c[0] + c[1] * t) + square * ((c[2] + c[3] * t) + square * ((c[4] + c[5] * t) + square * c[6]));
  }

 private:
  static constexpr int degree = 6;
  double lower_, upper_, pieces_per_unit_;
  int last_;
  std::vector<std::array<double, degree + 2>>
      table_;  // coefficients of powers of the position in a piece, plus one for alignment
};

}  // namespace rhec::sim
