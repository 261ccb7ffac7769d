#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "rhec/core/ocp/sparse_nlp.hpp"

namespace rhec::sparse_sqp {

/// The largest |v_k| of the first n entries. NaN, which nothing is larger than, is left out.
inline double max_abs(const double* v, int n) noexcept {
  double largest = 0.0;
  for (int k = 0; k < n; ++k) largest = std::max(largest, std::abs(v[k]));
  return largest;
}

inline double max_abs(const std::vector<double>& v) noexcept { return max_abs(v.data(), static_cast<int>(v.size())); }

inline bool all_finite(const double* v, int n) noexcept {
  double rest = 0.0;  // stays 0 while all are
  for (int k = 0; k < n; ++k) rest += 0.0 * v[k];
  return rest == 0.0;
}

/// y = H x, with the lower triangle of H.
inline void multiply_symmetric(const SparseNlp::Pattern& H, const double* values, const double* x, double* y) noexcept {
  std::fill_n(y, H.columns, 0.0);
  for (int c = 0; c < H.columns; ++c) {
    double sum = 0.0;
    for (int k = H.starts[c]; k < H.starts[c + 1]; ++k) {
      const int r = H.row_indices[k];
      sum += values[k] * x[r];
      if (r != c) y[r] += values[k] * x[c];
    }
    y[c] += sum;
  }
}

/// y = y + J x.
inline void add_product(const SparseNlp::Pattern& J, const double* values, const double* x, double* y) noexcept {
  for (int c = 0; c < J.columns; ++c)
    for (int k = J.starts[c]; k < J.starts[c + 1]; ++k) y[J.row_indices[k]] += values[k] * x[c];
}

/// x = x + J' y.
inline void add_transposed_product(const SparseNlp::Pattern& J, const double* values, const double* y,
                                   double* x) noexcept {
  for (int c = 0; c < J.columns; ++c)
    for (int k = J.starts[c]; k < J.starts[c + 1]; ++k) x[c] += values[k] * y[J.row_indices[k]];
}

}  // namespace rhec::sparse_sqp
