#pragma once

#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Core>

#include "numbers.hpp"
#include "rhec/core/base/with_size.hpp"

namespace rhec {

/// log sqrt(det P) of a covariance P; NaN where it is not positive definite, as of a parameter that is known. `factor`
/// (of the size of P) is overwritten.
inline double log_volume(const Eigen::MatrixXd& covariance, Eigen::MatrixXd& factor) noexcept {
  copy_numbers(covariance, factor);
  return with_size(static_cast<int>(factor.rows()), [&](auto n) {
    double* L = factor.data();
    double sum = 0.0, product = 1.0;
    for (int k = 0; k < n; ++k) {
      const double pivot = L[k * n + k];
      if (!(pivot > 0.0)) return std::numeric_limits<double>::quiet_NaN();
      product *= pivot;
      if (product < 1e-200 || product > 1e200) sum += std::log(std::exchange(product, 1.0));
      const double inverse = 1.0 / pivot;
      for (int c = k + 1; c < n; ++c) {
        const double by = L[k * n + c] * inverse;
        for (int r = c; r < n; ++r) L[c * n + r] -= by * L[k * n + r];
      }
    }
    return 0.5 * (sum + std::log(product));
  });
}

}  // namespace rhec
