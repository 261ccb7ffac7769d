#pragma once

// Products of the small column-major matrices of one stage: plain loops over contiguous columns, which the compiler
// vectorises; no temporaries, no allocation.

namespace rhec::small {

/// The largest number of rows of a matrix to factorise.
inline constexpr int longest = 64;

/// C = A B;  A is m x k (leading dimension lda), B is k x n (ldb), C is m x n (ldc).
inline void multiply(const double* A, int lda, const double* B, int ldb, double* C, int ldc, int m, int k,
                     int n) noexcept {
  for (int j = 0; j < n; ++j) {
    double* c = C + j * ldc;
    for (int r = 0; r < m; ++r) c[r] = 0.0;
    for (int l = 0; l < k; ++l) {
      const double b = B[j * ldb + l];
      if (b == 0.0) continue;
      const double* a = A + l * lda;
      for (int r = 0; r < m; ++r) c[r] += a[r] * b;
    }
  }
}

/// C += sign A' B;  A is k x m, B is k x n, and m is at most `longest`. Works row by row of A, since k, the number of
/// controls, is usually small.
inline void add_transposed(const double* A, int lda, const double* B, int ldb, double* C, int ldc, int m, int k, int n,
                           double sign = 1.0) noexcept {
  double row[longest];
  for (int l = 0; l < k; ++l) {
    for (int i = 0; i < m; ++i) row[i] = sign * A[i * lda + l];
    for (int j = 0; j < n; ++j) {
      const double b = B[j * ldb + l];
      if (b == 0.0) continue;
      double* c = C + j * ldc;
      for (int i = 0; i < m; ++i) c[i] += row[i] * b;
    }
  }
}

/// y += A x.
inline void add_product(const double* A, int lda, const double* x, double* y, int m, int n) noexcept {
  for (int j = 0; j < n; ++j) {
    const double* a = A + j * lda;
    for (int r = 0; r < m; ++r) y[r] += a[r] * x[j];
  }
}

/// y += sign A' x;  A is m x n.
inline void add_transposed_product(const double* A, int lda, const double* x, double* y, int m, int n,
                                   double sign = 1.0) noexcept {
  for (int j = 0; j < n; ++j) {
    const double* a = A + j * lda;
    double sum = 0.0;
    for (int r = 0; r < m; ++r) sum += a[r] * x[r];
    y[j] += sign * sum;
  }
}

/// Cholesky factor of a symmetric matrix in its lower triangle, in place. False if a pivot is not above the fraction
/// `relative` of its own diagonal entry; so the scale of one variable does not affect another.
inline bool factor(double* G, int ld, int n, double relative) noexcept {
  double least[longest];
  for (int j = 0; j < n; ++j) least[j] = relative * G[j * ld + j];
  for (int j = 0; j < n; ++j) {
    double* column = G + j * ld;
    const double pivot = column[j];
    if (!(pivot > least[j] && pivot > 0.0)) return false;
    const double root = __builtin_sqrt(pivot), inverse = 1.0 / root;
    column[j] = root;
    for (int i = j + 1; i < n; ++i) column[i] *= inverse;
    for (int k = j + 1; k < n; ++k)
      for (int i = k; i < n; ++i) G[k * ld + i] -= column[i] * column[k];
  }
  return true;
}

/// x := (G G')^-1 x with the factor G in the lower triangle.
inline void solve(const double* G, int ld, int n, double* x) noexcept {
  double inverse[longest];
  for (int i = 0; i < n; ++i) inverse[i] = 1.0 / G[i * ld + i];
  for (int i = 0; i < n; ++i) {
    x[i] *= inverse[i];
    for (int k = i + 1; k < n; ++k) x[k] -= G[i * ld + k] * x[i];
  }
  for (int i = n - 1; i >= 0; --i) {
    double sum = x[i];
    for (int k = i + 1; k < n; ++k) sum -= G[i * ld + k] * x[k];
    x[i] = sum * inverse[i];
  }
}

}  // namespace rhec::small
