#pragma once

#include "rhec/core/base/export.hpp"

namespace rhec {

/// The stationary process with the Matern covariance of smoothness nu = 1/2, 3/2 or 5/2, as a Markov process of one,
/// two or three states: the deviation from its mean and its derivatives (Rasmussen and Williams 2006, eq. 4.17;
/// Hartikainen and Särkkä 2010, eq. 13 to 17). With lambda = sqrt(2 nu) / length,
///
///     nu = 1/2:  k(d) = sigma^2 exp(-lambda d)
///     nu = 3/2:  k(d) = sigma^2 exp(-lambda d) (1 + lambda d)
///     nu = 5/2:  k(d) = sigma^2 exp(-lambda d) (1 + lambda d + (lambda d)^2 / 3).
///
/// Matrices are column-major, with `rows` entries from one column to the next; they write the first `states` rows and
/// columns.
struct RHEC_EXPORT Matern {
  int states = 2;       ///< nu + 1/2: 1, 2 or 3
  double length = 1.0;  ///< [s or m]
  double sigma = 1.0;   ///< standard deviation of the process

  double lambda() const noexcept;
  /// Covariance of the states at one place.
  void stationary(double* P, int rows) const noexcept;
  /// exp(A d), and the covariance of the noise that enters over an advance d >= 0, accurate to rounding for every d:
  /// P - F P F' would cancel for small ones.
  void transition(double d, double* F, double* Q, int rows) const noexcept;
};

}  // namespace rhec
