// The stages that the kernels skip: those with active bounds of the next state, which their controls must satisfy, and
// those whose reduced Hessian is not positive definite.
#include <algorithm>
#include <cmath>
#include <limits>

#include "rhec/core/kernels/reflection.hpp"
#include "rhec/core/kernels/riccati_kernels.hpp"
#include "rhec/core/qp/riccati.hpp"
#include "rhec/core/qp/small_matrix.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "tolerances.hpp"

namespace rhec {
namespace {

// Entries of a constraint row below this fraction of its largest one are rounding errors.
constexpr double pivot_tolerance = 1e-9;

double bound_of(std::int8_t side, double lower, double upper) { return side < 0 ? lower : upper; }

}  // namespace

Riccati::Special Riccati::special(int i) noexcept {
  const std::ptrdiff_t wide = width_, rows = max_rows_, ns = ns_, k = i;
  return {G_.data() + k * wide * wide,      L_.data() + k * wide * ns,
          factor_.data() + k * wide * wide, K_.data() + k * wide * ns,
          T_.data() + k * wide * wide,      Y_.data() + k * wide * ns,
          C_.data() + k * rows * ns,        eliminator_.data() + k * rows * rows,
          pivot_row_.data() + k * rows,     pivot_column_.data() + k * rows,
          left_row_.data() + k * rows};
}

int Riccati::count_active(const StageQp& qp, const ActiveSet& active, int node) const noexcept {
  if (node == 0 && qp.initial_state_is_given) return 0;
  const std::int8_t* sides = active.state(node);
  return static_cast<int>(std::count_if(sides, sides + qp.states(node), [](std::int8_t side) { return side != 0; }));
}

void Riccati::write_active_rows(const StageQp& qp, const ActiveSet& active, int node) noexcept {
  if (node == 0 && qp.initial_state_is_given) return;
  double* C = special(node).C;
  int row = 0;
  for (int j = 0; j < qp.states(node); ++j) {
    if (active.state(node)[j] == 0) continue;
    for (int c = 0; c < ns_; ++c) C[c * max_rows_ + row] = 0.0;
    C[j * max_rows_ + row++] = 1.0;
  }
}

void Riccati::write_active_bounds(const StageQp& qp, const ActiveSet& active, int node) noexcept {
  if (node == 0 && qp.initial_state_is_given) return;
  double* d = d_.data() + static_cast<std::ptrdiff_t>(node) * max_rows_;
  int row = 0;
  for (int j = 0; j < qp.states(node); ++j)
    if (const std::int8_t side = active.state(node)[j])
      d[row++] = bound_of(side, qp.state_lower(node)[j], qp.state_upper(node)[j]);
}

/// Gauss-Jordan elimination with complete pivoting of D w + E s = e on the columns of free controls. Afterwards the
/// pivot rows have a unit column for their control and the remaining rows none; `eliminator` holds the row operations.
void Riccati::eliminate(double* D, double* E, int rows, int width, const bool* fixed, Reduction& reduction,
                        Special& v) noexcept {
  const int ld = max_rows_;
  double* M = v.eliminator;
  for (int c = 0; c < rows; ++c)
    for (int r = 0; r < rows; ++r) M[c * ld + r] = r == c ? 1.0 : 0.0;
  bool done[3 * max_width] = {}, taken[max_width] = {};
  double size[3 * max_width];
  for (int r = 0; r < rows; ++r) {
    size[r] = 0.0;
    for (int c = 0; c < width; ++c) size[r] = std::max(size[r], std::abs(D[c * ld + r]));
    for (int c = 0; c < ns_; ++c) size[r] = std::max(size[r], std::abs(E[c * ld + r]));
  }
  while (reduction.pivots < rows) {
    int row = -1, column = -1;
    double best = pivot_tolerance;
    for (int r = 0; r < rows; ++r) {
      if (done[r] || size[r] == 0.0) continue;
      for (int c = 0; c < width; ++c) {
        if (fixed[c] || taken[c]) continue;
        const double relative = std::abs(D[c * ld + r]) / size[r];
        if (relative > best) best = relative, row = r, column = c;
      }
    }
    if (row < 0) break;
    done[row] = taken[column] = true;
    const double inverse = 1.0 / D[column * ld + row];
    const auto reduce = [&](double* matrix, int columns) {
      for (int c = 0; c < columns; ++c) {
        double* entries = matrix + c * ld;
        entries[row] *= inverse;
        if (entries[row] == 0.0) continue;
        for (int r = 0; r < rows; ++r)
          if (r != row) entries[r] -= D[column * ld + r] * entries[row];
      }
    };
    // The pivot column goes last, since the others need its entries.
    reduce(E, ns_);
    reduce(M, rows);
    for (int c = 0; c < width; ++c) {
      if (c == column) continue;
      double* entries = D + c * ld;
      entries[row] *= inverse;
      for (int r = 0; r < rows; ++r)
        if (r != row) entries[r] -= D[column * ld + r] * entries[row];
    }
    for (int r = 0; r < rows; ++r) D[column * ld + r] = r == row ? 1.0 : 0.0;
    v.pivot_row[reduction.pivots] = row;
    v.pivot_column[reduction.pivots++] = column;
  }
  for (int r = 0; r < rows; ++r) {
    if (done[r]) continue;
    double largest = 0.0;
    for (int c = 0; c < ns_; ++c) largest = std::max(largest, std::abs(E[c * ld + r]));
    // Rows that do not involve s either depend on other rows; whether they are consistent is checked with the
    // right-hand side.
    if (largest > pivot_tolerance * size[r]) v.left_row[reduction.left++] = r;
  }
}

/// T and Y of w = T v + Y s + y0 from the reduced rows.
void Riccati::null_space(const double* D, const double* E, int width, const bool* fixed, const Reduction& reduction,
                         Special& v) noexcept {
  const int ld = max_rows_;
  bool pivot[max_width] = {};
  for (int k = 0; k < reduction.pivots; ++k) pivot[v.pivot_column[k]] = true;
  std::fill_n(v.T, width_ * width_, 0.0);
  std::fill_n(v.Y, width_ * ns_, 0.0);
  int direction = 0;
  for (int c = 0; c < width; ++c) {
    if (fixed[c] || pivot[c]) continue;
    v.T[direction * width_ + c] = 1.0;
    for (int k = 0; k < reduction.pivots; ++k)
      v.T[direction * width_ + v.pivot_column[k]] = -D[c * ld + v.pivot_row[k]];
    ++direction;
  }
  for (int k = 0; k < reduction.pivots; ++k)
    for (int c = 0; c < ns_; ++c) v.Y[c * width_ + v.pivot_column[k]] = -E[c * ld + v.pivot_row[k]];
}

namespace {

/// See `reflect` of two rows.
void reflect_two(double* matrix) noexcept {
  const PairMatrix before{matrix[0], matrix[1], matrix[3]};
  const double radius = std::hypot(0.5 * (before.first - before.second), before.beside);
  const PairMatrix now = rhec::reflect(before, radius);
  matrix[0] = now.first;
  matrix[1] = matrix[2] = now.beside;
  matrix[3] = now.second;
}

/// Turns the vectors x and y of n numbers, `step` apart, by an angle of this sine and cosine.
void turn(double sine, double cosine, int n, int step, double* x, double* y) noexcept {
  for (int k = 0; k < n * step; k += step) {
    const double before = x[k];
    x[k] = cosine * before - sine * y[k];
    y[k] = sine * before + cosine * y[k];
  }
}

/// The same for n rows, column after column. Eigenvalues and eigenvectors are those of Jacobi's method (Golub and Van
/// Loan, Matrix Computations, section 8.5): pairs of rows and columns are turned until nothing is left beside the
/// diagonal. For the few inputs of a vehicle it is as quick as others, and it needs no memory but this.
void reflect(double* matrix, int n) noexcept {
  constexpr int most_sweeps = 30;  // convergence is quadratic: six or so are enough
  double vectors[small::longest * small::longest];
  std::fill_n(vectors, n * n, 0.0);
  for (int j = 0; j < n; ++j) vectors[j * n + j] = 1.0;
  double size = 0.0;
  for (int k = 0; k < n * n; ++k) size = std::max(size, std::abs(matrix[k]));
  bool is_diagonal = false;
  for (int sweep = 0; sweep < most_sweeps && !is_diagonal; ++sweep) {
    is_diagonal = true;
    for (int p = 0; p < n; ++p) {
      for (int q = p + 1; q < n; ++q) {
        const double beside = matrix[q * n + p];
        if (std::abs(beside) <= std::numeric_limits<double>::epsilon() * size) continue;
        is_diagonal = false;
        const double slope = 0.5 * (matrix[q * n + q] - matrix[p * n + p]) / beside;
        const double tangent = std::copysign(1.0 / (std::abs(slope) + std::hypot(1.0, slope)), slope);
        const double cosine = 1.0 / std::hypot(1.0, tangent), sine = tangent * cosine;
        turn(sine, cosine, n, 1, matrix + p * n, matrix + q * n);
        turn(sine, cosine, n, n, matrix + p, matrix + q);
        turn(sine, cosine, n, 1, vectors + p * n, vectors + q * n);
      }
    }
  }
  double values[small::longest], top = least_curvature;
  for (int j = 0; j < n; ++j) top = std::max(top, values[j] = std::abs(matrix[j * (n + 1)]));
  std::fill_n(matrix, n * n, 0.0);
  for (int j = 0; j < n; ++j) {
    const double *const vector = vectors + j * n, value = std::max(values[j], least_ratio * top);
    for (int c = 0; c < n; ++c)
      for (int r = 0; r < n; ++r) matrix[c * n + r] += value * vector[r] * vector[c];
  }
}

}  // namespace

/// Cholesky factor of a reduced Hessian, which is convexified first if necessary.
void Riccati::factor_reduced(double* reduced, int n, double tolerance, double* factor) noexcept {
  for (int j = 0; j < n; ++j) std::copy_n(reduced + j * width_, n, factor + j * width_);
  if (small::factor(factor, width_, n, tolerance)) return;
  convexified_ = true;
  double matrix[max_width * max_width];
  bool finite = true;
  for (int c = 0; c < n; ++c) {
    for (int r = 0; r < n; ++r) {
      const double entry = matrix[c * n + r] = 0.5 * (reduced[c * width_ + r] + reduced[r * width_ + c]);
      finite = finite && std::isfinite(entry);
    }
  }
  if (!finite) {  // no sensible result is possible: the caller will find that the step is not finite
    for (int j = 0; j < n; ++j) factor[j * width_ + j] = std::nan("");
    return;
  }
  if (n == 2)
    reflect_two(matrix);
  else
    reflect(matrix, n);
  for (int c = 0; c < n; ++c) std::copy_n(matrix + c * n, n, factor + c * width_);
  small::factor(factor, width_, n, 0.0);
}

void Riccati::write_convexified(StageQp& qp) noexcept {
  qp.drop_identity_rows();
  for (int i = 0; i < qp.intervals(); ++i)
    if (is_special_[i] != 0) write_change(special(i).G, special(i).factor, i, qp);
}

/// Adds to R what a reduced Hessian has become, given by its Cholesky factor.
void Riccati::write_change(const double* reduced, const double* factor, int i, StageQp& qp) const noexcept {
  const int m = qp.controls(i);
  auto R = R_of(qp, i);
  for (int c = 0; c < m; ++c) {
    for (int r = c; r < m; ++r) {
      double now = 0.0;
      for (int k = 0; k <= c; ++k) now += factor[k * width_ + r] * factor[k * width_ + c];
      const double change = now - reduced[c * width_ + r];
      R(r, c) += change;
      if (r != c) R(c, r) += change;
    }
  }
}

void Riccati::factor_special(const StageQp& qp, const ActiveSet& active, const RiccatiView& all, int i) noexcept {
  Special v = special(i);
  const Special next = special(i + 1);
  const int n = qp.states(i), n_next = qp.states(i + 1), m = qp.controls(i);
  Reduction& reduction = reductions_[i];
  double* formed = work_.data();
  double* A_columns = formed + static_cast<std::ptrdiff_t>(ns_ + nw_) * stride_;
  double* B_columns = A_columns + width_ * width_;
  double* H = P(i);
  kernels_->form(all, i, formed);
  for (int c = 0; c < n; ++c) {
    std::fill_n(H + c * stride_, stride_, 0.0);
    std::copy_n(formed + c * stride_, n, H + c * stride_);
    std::copy_n(formed + c * stride_ + ns_, m, v.L + c * width_);
  }
  for (int c = 0; c < m; ++c) std::copy_n(formed + (ns_ + c) * stride_ + ns_, m, v.G + c * width_);
  const double* dynamics = qp.AB(i);
  for (int r = 0; r < n_next; ++r) {
    for (int c = 0; c < n; ++c) A_columns[c * width_ + r] = dynamics[r * stride_ + c];
    for (int c = 0; c < m; ++c) B_columns[c * width_ + r] = dynamics[r * stride_ + ns_ + c];
  }
  double* drift = drift_.data() + static_cast<std::ptrdiff_t>(i) * stride_;
  std::fill_n(drift, stride_, 0.0);
  small::add_product(P(i + 1), stride_, qp.b(i), drift, n_next, n_next);

  bool fixed[max_width];
  int fixed_count = 0;
  for (int j = 0; j < m; ++j) fixed_count += fixed[j] = active.control(i)[j] != 0;
  reduction.plain = fixed_count == 0 && reduction.rows == 0;
  const double *reduced_G = v.G, *reduced_L = v.L;
  double* own = B_columns + width_ * width_;
  if (reduction.plain) {
    reduction.free = m;
  } else {
    const int rows = reduction.rows;
    double* D = own;
    double* E = D + max_rows_ * width_;
    // C_{i+1} (A s + B w + b) = d
    small::multiply(next.C, max_rows_, B_columns, width_, D, max_rows_, rows, n_next, m);
    small::multiply(next.C, max_rows_, A_columns, width_, E, max_rows_, rows, n_next, n);
    eliminate(D, E, rows, m, fixed, reduction, v);
    null_space(D, E, m, fixed, reduction, v);
    reduction.free = m - fixed_count - reduction.pivots;
    const int offset = count_active(qp, active, i);
    if (offset + reduction.left > max_rows_) {
      reduction.overflow = true;
      reduction.left = max_rows_ - offset;
    }
    for (int k = 0; k < reduction.left; ++k)
      for (int c = 0; c < n; ++c) v.C[c * max_rows_ + offset + k] = E[c * max_rows_ + v.left_row[k]];

    double* GT = own;  // the rows are no longer needed
    double* GY = GT + width_ * width_;
    double* G = GY + width_ * width_;
    double* L = G + width_ * width_;
    const int f = reduction.free;
    small::multiply(v.G, width_, v.T, width_, GT, width_, m, m, f);
    small::multiply(v.G, width_, v.Y, width_, GY, width_, m, m, n);
    for (int c = 0; c < f; ++c) std::fill_n(G + c * width_, f, 0.0);
    small::add_transposed(v.T, width_, GT, width_, G, width_, f, m, f);
    // H += Y'(L + G Y) + L'Y, L_v = T'(L + G Y)
    for (int c = 0; c < n; ++c) {
      std::fill_n(L + c * width_, f, 0.0);
      for (int r = 0; r < m; ++r) GY[c * width_ + r] += v.L[c * width_ + r];
    }
    small::add_transposed(v.Y, width_, GY, width_, H, stride_, n, m, n);
    small::add_transposed(v.L, width_, v.Y, width_, H, stride_, n, m, n);
    small::add_transposed(v.T, width_, GY, width_, L, width_, f, m, n);
    reduced_G = G;
    reduced_L = L;
  }
  const int f = reduction.free;
  factor_reduced(const_cast<double*>(reduced_G), f, definite_tolerance, v.factor);
  for (int c = 0; c < n; ++c) {
    std::copy_n(reduced_L + c * width_, f, v.K + c * width_);
    small::solve(v.factor, width_, f, v.K + c * width_);
  }
  small::add_transposed(reduced_L, width_, v.K, width_, H, stride_, n, f, n, -1.0);
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < c; ++r)
      H[c * stride_ + r] = H[r * stride_ + c] = 0.5 * (H[c * stride_ + r] + H[r * stride_ + c]);
}

/// Applies the row operations to right-hand sides; false if an empty row has a non-zero right-hand side.
bool Riccati::transform_rows(const double* right_hand_side, const Reduction& reduction, const Special& v,
                             double* transformed, double scale) const noexcept {
  const int rows = reduction.rows;
  std::fill_n(transformed, rows, 0.0);
  small::add_product(v.eliminator, max_rows_, right_hand_side, transformed, rows, rows);
  bool used[3 * max_width] = {};
  for (int k = 0; k < reduction.pivots; ++k) used[v.pivot_row[k]] = true;
  for (int k = 0; k < reduction.left; ++k) used[v.left_row[k]] = true;
  for (int r = 0; r < rows; ++r)
    if (!used[r] && std::abs(transformed[r]) > consistency_tolerance * (1.0 + scale)) return false;
  return true;
}

bool Riccati::solve_special_backward(const StageQp& qp, const ActiveSet& active, const double* h, int i) noexcept {
  const Special v = special(i), next = special(i + 1);
  const Reduction& reduction = reductions_[i];
  const int n = qp.states(i), n_next = qp.states(i + 1), m = qp.controls(i), f = reduction.free;
  if (reduction.overflow) return false;
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(i) * stride_;
  double *g = special_g_.data() + i * width_, *y0 = y0_.data() + i * width_, *k = k_.data() + i * width_;
  double gradient[2 * max_width];
  // h + [A B]'(P b + p)
  std::copy_n(h + row, ns_ + m, gradient);
  const double* AB = qp.AB(i);
  for (int l = 0; l < n_next; ++l) {
    const double costate = p(i + 1)[l] + drift_[row + l];
    for (int c = 0; c < ns_ + m; ++c) gradient[c] += AB[l * stride_ + c] * costate;
  }
  std::fill_n(p(i), stride_, 0.0);
  std::copy_n(gradient, n, p(i));
  std::copy_n(gradient + ns_, m, g);
  if (reduction.plain) {
    std::copy_n(g, m, k);
  } else {
    std::fill_n(y0, m, 0.0);
    for (int j = 0; j < m; ++j)
      if (const std::int8_t side = active.control(i)[j])
        y0[j] = bound_of(side, qp.control_lower(i)[j], qp.control_upper(i)[j]);
    // d - C (b + B y0), with only the fixed controls in y0
    double image[max_width], scale = 0.0, right_hand_side[3 * max_width], transformed[3 * max_width];
    for (int l = 0; l < n_next; ++l) {
      image[l] = qp.b(i)[l];
      for (int j = 0; j < m; ++j) image[l] += AB[l * stride_ + ns_ + j] * y0[j];
    }
    for (int r = 0; r < reduction.rows; ++r) {
      const double d = d_[static_cast<std::ptrdiff_t>(i + 1) * max_rows_ + r];
      double value = d;
      for (int c = 0; c < n_next; ++c) value -= next.C[c * max_rows_ + r] * image[c];
      right_hand_side[r] = value;
      scale = std::max({scale, std::abs(d), std::abs(value)});
    }
    if (!transform_rows(right_hand_side, reduction, v, transformed, scale)) return false;
    for (int t = 0; t < reduction.pivots; ++t) y0[v.pivot_column[t]] = transformed[v.pivot_row[t]];
    const int offset = count_active(qp, active, i);
    for (int t = 0; t < reduction.left; ++t)
      d_[static_cast<std::ptrdiff_t>(i) * max_rows_ + offset + t] = transformed[v.left_row[t]];

    double gy[max_width];
    std::copy_n(g, m, gy);
    small::add_product(v.G, width_, y0, gy, m, m);
    std::fill_n(k, f, 0.0);
    small::add_transposed_product(v.T, width_, gy, k, m, f);
    small::add_transposed_product(v.L, width_, y0, p(i), m, n);
    small::add_transposed_product(v.Y, width_, gy, p(i), m, n);
  }
  // p_i = h - L_v' G_v^-1 g_v = h - K' g_v
  small::add_transposed_product(v.K, width_, k, p(i), f, n, -1.0);
  small::solve(v.factor, width_, f, k);
  return true;
}

/// The rows and columns of a stage's controls in the covariance of z = [s; w], from w = -K s and G^-1, without active
/// bounds.
void Riccati::add_special_controls(int i, int n, int m, double* covariance) noexcept {
  const Special v = special(i);
  for (int k = 0; k < m; ++k) {
    double* of_control = covariance + (ns_ + k) * stride_;
    for (int j = 0; j < n; ++j) {
      double sum = 0.0;
      for (int l = 0; l < n; ++l) sum -= v.K[l * width_ + k] * covariance[j * stride_ + l];
      of_control[j] = covariance[j * stride_ + ns_ + k] = sum;
    }
  }
  for (int k = 0; k < m; ++k) {
    double unit[max_width] = {};
    unit[k] = 2.0;
    small::solve(v.factor, width_, m, unit);
    for (int l = 0; l < m; ++l) {
      double sum = unit[l];
      for (int j = 0; j < n; ++j) sum -= v.K[j * width_ + l] * covariance[(ns_ + k) * stride_ + j];
      covariance[(ns_ + k) * stride_ + ns_ + l] = sum;
    }
  }
}

void Riccati::write_bound_multipliers(const StageQp& qp, const ActiveSet& active, Iterate& step, int node) noexcept {
  double* bounds = step.state_bound(node);
  std::fill_n(bounds, ns_, 0.0);
  if (node == 0 && qp.initial_state_is_given) return;
  const double* of_rows = row_multipliers_.data() + static_cast<std::ptrdiff_t>(node) * max_rows_;
  for (int j = 0; j < qp.states(node); ++j)
    if (active.state(node)[j] != 0) bounds[j] = *of_rows++;
}

void Riccati::solve_special_forward(const StageQp& qp, const ActiveSet& active, Iterate& step, int i) noexcept {
  const Special v = special(i), next = special(i + 1);
  const Reduction& reduction = reductions_[i];
  const int n = qp.states(i), n_next = qp.states(i + 1), m = qp.controls(i);
  const double* s = step.state(i);
  double *w = step.control(i), *s_next = step.state(i + 1), *costate = step.costate(i + 1);
  feedback(qp, i, s, w);
  const double* AB = qp.AB(i);
  for (int l = 0; l < n_next; ++l) {
    double sum = qp.b(i)[l];
    for (int j = 0; j < n; ++j) sum += AB[l * stride_ + j] * s[j];
    for (int j = 0; j < m; ++j) sum += AB[l * stride_ + ns_ + j] * w[j];
    s_next[l] = sum;
  }
  std::fill_n(costate, stride_, 0.0);
  std::copy_n(p(i + 1), n_next, costate);
  small::add_product(P(i + 1), stride_, s_next, costate, n_next, n_next);
  std::fill_n(step.control_bound(i), m, 0.0);
  double* of_rows = row_multipliers_.data() + static_cast<std::ptrdiff_t>(i + 1) * max_rows_;
  if (!reduction.plain) {
    // Gradient with respect to w without the rows: G w + L s + g.
    double gradient[max_width];
    std::copy_n(special_g_.data() + i * width_, m, gradient);
    small::add_product(v.G, width_, w, gradient, m, m);
    small::add_product(v.L, width_, s, gradient, m, n);
    double reduced[3 * max_width] = {};
    const double* of_node = row_multipliers_.data() + static_cast<std::ptrdiff_t>(i) * max_rows_;
    const int offset = count_active(qp, active, i);
    for (int t = 0; t < reduction.pivots; ++t) reduced[v.pivot_row[t]] = -gradient[v.pivot_column[t]];
    for (int t = 0; t < reduction.left; ++t) reduced[v.left_row[t]] = of_node[offset + t];
    std::fill_n(of_rows, reduction.rows, 0.0);
    small::add_transposed_product(v.eliminator, max_rows_, reduced, of_rows, reduction.rows, reduction.rows);
    double pull[max_width] = {};
    small::add_transposed_product(next.C, max_rows_, of_rows, pull, reduction.rows, n_next);
    for (int j = 0; j < n_next; ++j) {
      costate[j] += pull[j];
      for (int k = 0; k < m; ++k) gradient[k] += AB[j * stride_ + ns_ + k] * pull[j];
    }
    for (int j = 0; j < m; ++j)
      if (active.control(i)[j] != 0) step.control_bound(i)[j] = -gradient[j];
  }
  write_bound_multipliers(qp, active, step, i + 1);
}

}  // namespace rhec
