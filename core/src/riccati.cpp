#include "rhec/core/riccati.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "rhec/core/error.hpp"
#include "small_matrix.hpp"

namespace rhec {
namespace {

// Entries of a constraint row below this part of its largest one are rounding.
constexpr double pivot_tolerance = 1e-9;
// A reduced Hessian with a pivot below this part of its diagonal entry is not positive definite enough.
constexpr double definite_tolerance = 1e-11;
// For the initial state, whose prior may be ill-conditioned for good reasons, only rounding counts as not definite.
constexpr double initial_definite_tolerance = 1e-14;
// Contradiction between active bounds, relative to their size.
constexpr double consistency_tolerance = 1e-9;

}  // namespace

ActiveSet::ActiveSet(const Capacity& capacity)
    : capacity_(capacity),
      states_(static_cast<std::size_t>(capacity.intervals + 1) * capacity.states, 0),
      controls_(static_cast<std::size_t>(capacity.intervals) * capacity.controls, 0) {}

void ActiveSet::clear() noexcept {
  std::fill(states_.begin(), states_.end(), std::int8_t{0});
  std::fill(controls_.begin(), controls_.end(), std::int8_t{0});
}

Riccati::Riccati(const Capacity& capacity)
    : capacity_(capacity),
      ns_(capacity.states),
      nw_(capacity.controls),
      width_(std::max(capacity.states, capacity.controls)),
      max_rows_(3 * capacity.states) {
  if (width_ > max_width)
    throw Error(fmt::format("a stage has {} states and {} controls; the Riccati recursion takes at most {} of each",
                            ns_, nw_, max_width));
  // Node 0 is kept as one more stage, whose 'controls' are the initial state: hence matrices of the larger width.
  const auto stages = static_cast<std::size_t>(capacity.intervals) + 1;
  const std::size_t wide = width_, rows = max_rows_;
  reductions_.resize(stages);
  P_.assign(stages * ns_ * ns_, 0.0);
  for (auto* v : {&G_, &factor_, &T_}) v->assign(stages * wide * wide, 0.0);
  for (auto* v : {&L_, &K_, &Y_}) v->assign(stages * wide * ns_, 0.0);
  C_.assign(stages * rows * ns_, 0.0);
  eliminator_.assign(stages * rows * rows, 0.0);
  for (auto* v : {&pivot_row_, &pivot_column_, &left_row_}) v->assign(stages * rows, 0);
  p_.assign(stages * ns_, 0.0);
  for (auto* v : {&d_, &row_multipliers_}) v->assign(stages * rows, 0.0);
  for (auto* v : {&g_, &y0_, &k_}) v->assign(stages * wide, 0.0);
  work_.assign(2 * rows * (wide + ns_) + 6 * wide * wide + 8 * wide + 4 * rows, 0.0);
}

Riccati::View Riccati::view(int i) noexcept {
  const std::ptrdiff_t wide = width_, rows = max_rows_, ns = ns_, k = i;
  return {P_.data() + k * ns * ns,          G_.data() + k * wide * wide,     L_.data() + k * wide * ns,
          factor_.data() + k * wide * wide, K_.data() + k * wide * ns,       T_.data() + k * wide * wide,
          Y_.data() + k * wide * ns,        C_.data() + k * rows * ns,       eliminator_.data() + k * rows * rows,
          pivot_row_.data() + k * rows,     pivot_column_.data() + k * rows, left_row_.data() + k * rows};
}

int Riccati::count_active(const StageQp& qp, const ActiveSet& active, int node) const noexcept {
  if (node == 0 && qp.initial_state_is_given) return 0;
  const std::int8_t* sides = active.state(node);
  return static_cast<int>(std::count_if(sides, sides + qp.states(node), [](std::int8_t side) { return side != 0; }));
}

void Riccati::write_active_rows(const StageQp& qp, const ActiveSet& active, int node) noexcept {
  if (node == 0 && qp.initial_state_is_given) return;
  double* C = view(node).C;
  int row = 0;
  for (int j = 0; j < qp.states(node); ++j) {
    if (active.state(node)[j] == 0) continue;
    for (int c = 0; c < ns_; ++c) C[c * max_rows_ + row] = 0.0;
    C[j * max_rows_ + row++] = 1.0;
  }
}

void Riccati::factor(const StageQp& qp, const ActiveSet& active, const Diagonals& extra) noexcept {
  const int N = qp.intervals(), n = qp.states(N);
  convexified_ = false;
  double* P = view(N).P;
  for (int c = 0; c < n; ++c) std::copy_n(qp.Q(N) + c * ns_, n, P + c * ns_);
  if (extra.states)
    for (int j = 0; j < n; ++j) P[j * ns_ + j] += extra.states[N * ns_ + j];
  write_active_rows(qp, active, N);
  int rows = count_active(qp, active, N);
  for (int i = N - 1; i >= 0; --i) {
    Reduction& reduction = reductions_[i];
    reduction = {};
    reduction.rows = rows;
    factor_stage(qp, active, extra, i);
    write_active_rows(qp, active, i);
    rows = count_active(qp, active, i) + reduction.left;
  }
  Reduction& initial = reductions_[N];
  initial = {};
  initial.rows = rows;
  if (!qp.initial_state_is_given) factor_initial(qp, active);
}

/// Gauss-Jordan elimination with complete pivoting of D w + F s = e on the columns of w that are not fixed. Afterwards
/// the pivot rows have a unit column for their control and the left rows none; `eliminator` holds the row operations.
void Riccati::eliminate(double* D, double* F, int rows, int width, const bool* fixed, Reduction& reduction,
                        View& v) noexcept {
  const int ld = max_rows_;
  double* M = v.eliminator;
  for (int c = 0; c < rows; ++c)
    for (int r = 0; r < rows; ++r) M[c * ld + r] = r == c ? 1.0 : 0.0;
  bool done[3 * max_width] = {}, taken[max_width] = {};
  double size[3 * max_width];
  for (int r = 0; r < rows; ++r) {
    size[r] = 0.0;
    for (int c = 0; c < width; ++c) size[r] = std::max(size[r], std::abs(D[c * ld + r]));
    for (int c = 0; c < ns_; ++c) size[r] = std::max(size[r], std::abs(F[c * ld + r]));
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
    // The pivot column itself goes last: the others need its entries.
    reduce(F, ns_);
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
    for (int c = 0; c < ns_; ++c) largest = std::max(largest, std::abs(F[c * ld + r]));
    // Rows that say nothing about s either are copies of others; whether they agree is checked with the right-hand
    // side.
    if (largest > pivot_tolerance * size[r]) v.left_row[reduction.left++] = r;
  }
}

/// T and Y of w = T v + Y s + y0 from the reduced rows.
void Riccati::null_space(const double* D, const double* F, int width, const bool* fixed, const Reduction& reduction,
                         View& v) noexcept {
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
    for (int c = 0; c < ns_; ++c) v.Y[c * width_ + v.pivot_column[k]] = -F[c * ld + v.pivot_row[k]];
}

/// Cholesky factor of a reduced Hessian, which is made positive definite first where it is not.
void Riccati::factor_reduced(double* reduced, int n, double tolerance, double* factor) noexcept {
  for (int j = 0; j < n; ++j) std::copy_n(reduced + j * width_, n, factor + j * width_);
  if (small::factor(factor, width_, n, tolerance)) return;
  convexified_ = true;
  using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_width, max_width>;
  Small matrix(n, n);
  bool finite = true;
  for (int c = 0; c < n; ++c) {
    for (int r = 0; r < n; ++r) {
      matrix(r, c) = 0.5 * (reduced[c * width_ + r] + reduced[r * width_ + c]);
      finite = finite && std::isfinite(matrix(r, c));
    }
  }
  if (!finite) {  // nothing sensible can come of it: the caller sees that the step is not finite
    for (int j = 0; j < n; ++j) factor[j * width_ + j] = std::nan("");
    return;
  }
  const Eigen::SelfAdjointEigenSolver<Small> eigen(matrix);
  Small values = Small::Zero(n, n);
  const double top = std::max(eigen.eigenvalues().cwiseAbs().maxCoeff(), 1e-12);
  for (int j = 0; j < n; ++j) values(j, j) = std::max(std::abs(eigen.eigenvalues()[j]), 1e-8 * top);
  Small half(n, n);
  half.noalias() = eigen.eigenvectors().lazyProduct(values);
  matrix.noalias() = half.lazyProduct(eigen.eigenvectors().transpose());
  for (int c = 0; c < n; ++c) std::copy_n(matrix.data() + c * n, n, factor + c * width_);
  small::factor(factor, width_, n, 0.0);
}

void Riccati::write_convexified(StageQp& qp) noexcept {
  for (int i = 0; i < qp.intervals(); ++i) {
    const View v = view(i);
    const int m = qp.controls(i);
    for (int c = 0; c < m; ++c) {
      for (int r = c; r < m; ++r) {
        double now = 0.0;
        for (int k = 0; k <= c; ++k) now += v.factor[k * width_ + r] * v.factor[k * width_ + c];
        const double change = now - v.G[c * width_ + r];
        qp.R(i)[c * nw_ + r] += change;
        if (r != c) qp.R(i)[r * nw_ + c] += change;
      }
    }
  }
}

void Riccati::factor_stage(const StageQp& qp, const ActiveSet& active, const Diagonals& extra, int i) noexcept {
  View v = view(i);
  View next = view(i + 1);
  const int n = qp.states(i), n_next = qp.states(i + 1), m = qp.controls(i);
  Reduction& reduction = reductions_[i];
  double* PA = work_.data();
  double* PB = PA + width_ * width_;
  double* H = v.P;
  small::multiply(next.P, ns_, qp.A(i), ns_, PA, width_, n_next, n_next, n);
  small::multiply(next.P, ns_, qp.B(i), ns_, PB, width_, n_next, n_next, m);
  for (int c = 0; c < n; ++c) {
    std::copy_n(qp.Q(i) + c * ns_, n, H + c * ns_);
    std::copy_n(qp.S(i) + c * nw_, m, v.L + c * width_);
  }
  for (int c = 0; c < m; ++c) std::copy_n(qp.R(i) + c * nw_, m, v.G + c * width_);
  if (extra.states)
    for (int j = 0; j < n; ++j) H[j * ns_ + j] += extra.states[i * ns_ + j];
  if (extra.controls)
    for (int j = 0; j < m; ++j) v.G[j * width_ + j] += extra.controls[i * nw_ + j];
  small::add_transposed(qp.A(i), ns_, PA, width_, H, ns_, n, n_next, n);
  small::add_transposed(qp.B(i), ns_, PA, width_, v.L, width_, m, n_next, n);
  small::add_transposed(qp.B(i), ns_, PB, width_, v.G, width_, m, n_next, m);

  bool fixed[max_width];
  int fixed_count = 0;
  for (int j = 0; j < m; ++j) fixed_count += fixed[j] = active.control(i)[j] != 0;
  reduction.plain = fixed_count == 0 && reduction.rows == 0;
  const double *reduced_G = v.G, *reduced_L = v.L;
  double* own = PB + width_ * width_;
  if (reduction.plain) {
    reduction.free = m;
  } else {
    const int rows = reduction.rows;
    double* D = own;
    double* F = D + max_rows_ * width_;
    // C_{i+1} (A s + B w + b) = d
    small::multiply(next.C, max_rows_, qp.B(i), ns_, D, max_rows_, rows, n_next, m);
    small::multiply(next.C, max_rows_, qp.A(i), ns_, F, max_rows_, rows, n_next, n);
    eliminate(D, F, rows, m, fixed, reduction, v);
    null_space(D, F, m, fixed, reduction, v);
    reduction.free = m - fixed_count - reduction.pivots;
    const int offset = count_active(qp, active, i);
    if (offset + reduction.left > max_rows_) {
      reduction.overflow = true;
      reduction.left = max_rows_ - offset;
    }
    for (int k = 0; k < reduction.left; ++k)
      for (int c = 0; c < n; ++c) v.C[c * max_rows_ + offset + k] = F[c * max_rows_ + v.left_row[k]];

    double* GT = own;  // the rows are done with
    double* GY = GT + width_ * width_;
    double* G = GY + width_ * width_;
    double* L = G + width_ * width_;
    const int f = reduction.free;
    small::multiply(v.G, width_, v.T, width_, GT, width_, m, m, f);
    small::multiply(v.G, width_, v.Y, width_, GY, width_, m, m, n);
    for (int c = 0; c < f; ++c) std::fill_n(G + c * width_, f, 0.0);
    small::add_transposed(v.T, width_, GT, width_, G, width_, f, m, f);
    // H += Y'L + L'Y + Y'GY, L_v = T'(L + G Y)
    small::add_transposed(v.Y, width_, v.L, width_, H, ns_, n, m, n);
    small::add_transposed(v.L, width_, v.Y, width_, H, ns_, n, m, n);
    small::add_transposed(v.Y, width_, GY, width_, H, ns_, n, m, n);
    for (int c = 0; c < n; ++c) {
      std::fill_n(L + c * width_, f, 0.0);
      for (int r = 0; r < m; ++r) GY[c * width_ + r] += v.L[c * width_ + r];
    }
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
  small::add_transposed(reduced_L, width_, v.K, width_, H, ns_, n, f, n, -1.0);
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < c; ++r) H[c * ns_ + r] = H[r * ns_ + c] = 0.5 * (H[c * ns_ + r] + H[r * ns_ + c]);
}

void Riccati::factor_initial(const StageQp& qp, const ActiveSet&) noexcept {
  const int N = qp.intervals(), n = qp.states(0);
  // Node 0 uses the slot of node N for its reduction; the slot's P and C stay those of node N.
  View first = view(0), v = view(N);
  Reduction& reduction = reductions_[N];
  const bool fixed[max_width] = {};
  double* reduced = work_.data();
  reduction.plain = reduction.rows == 0;
  reduction.free = n;
  if (!reduction.plain) {
    double* D = reduced + 3 * width_ * width_;
    double* F = D + max_rows_ * width_;
    for (int c = 0; c < n; ++c) std::copy_n(first.C + c * max_rows_, reduction.rows, D + c * max_rows_);
    for (int c = 0; c < ns_; ++c) std::fill_n(F + c * max_rows_, reduction.rows, 0.0);
    eliminate(D, F, reduction.rows, n, fixed, reduction, v);
    null_space(D, F, n, fixed, reduction, v);
    reduction.free = n - reduction.pivots;
    double* PT = reduced + width_ * width_;
    small::multiply(first.P, ns_, v.T, width_, PT, width_, n, n, reduction.free);
    for (int c = 0; c < reduction.free; ++c) std::fill_n(reduced + c * width_, reduction.free, 0.0);
    small::add_transposed(v.T, width_, PT, width_, reduced, width_, reduction.free, n, reduction.free);
  } else {
    for (int c = 0; c < n; ++c) std::copy_n(first.P + c * ns_, n, reduced + c * width_);
  }
  factor_reduced(reduced, reduction.free, initial_definite_tolerance, v.factor);
}

/// Right-hand sides through the row operations; false where a row that says nothing contradicts itself.
bool Riccati::transform_rows(const double* right_hand_side, const Reduction& reduction, const View& v,
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

Riccati::Outcome Riccati::solve(const StageQp& qp, const ActiveSet& active, Iterate& step, const double* q,
                                const double* r) noexcept {
  const int N = qp.intervals();
  if (!q) q = qp.q(0);
  if (!r) r = qp.r(0);
  const auto bound_of = [](std::int8_t side, double lower, double upper) { return side < 0 ? lower : upper; };
  const auto write_active_bounds = [&](int node) {
    double* d = d_.data() + node * max_rows_;
    int row = 0;
    if (node == 0 && qp.initial_state_is_given) return;
    for (int j = 0; j < qp.states(node); ++j)
      if (const std::int8_t side = active.state(node)[j])
        d[row++] = bound_of(side, qp.state_lower(node)[j], qp.state_upper(node)[j]);
  };
  double right_hand_side[3 * max_width], transformed[3 * max_width];

  std::copy_n(q + N * ns_, qp.states(N), p_.data() + N * ns_);
  write_active_bounds(N);
  for (int i = N - 1; i >= 0; --i) {
    View v = view(i);
    const View next = view(i + 1);
    const Reduction& reduction = reductions_[i];
    const int n = qp.states(i), n_next = qp.states(i + 1), m = qp.controls(i), f = reduction.free;
    if (reduction.overflow) return Outcome::inconsistent;
    double *g = g_.data() + i * width_, *y0 = y0_.data() + i * width_, *k = k_.data() + i * width_;
    double *p = p_.data() + i * ns_, costate[max_width], gy[max_width];
    // Pb + p
    std::copy_n(p_.data() + (i + 1) * ns_, n_next, costate);
    small::add_product(next.P, ns_, qp.b(i), costate, n_next, n_next);
    std::copy_n(r + i * nw_, m, g);
    std::copy_n(q + i * ns_, n, p);
    small::add_transposed_product(qp.B(i), ns_, costate, g, n_next, m);
    small::add_transposed_product(qp.A(i), ns_, costate, p, n_next, n);
    if (reduction.plain) {
      std::copy_n(g, m, k);
    } else {
      std::fill_n(y0, m, 0.0);
      for (int j = 0; j < m; ++j)
        if (const std::int8_t side = active.control(i)[j])
          y0[j] = bound_of(side, qp.control_lower(i)[j], qp.control_upper(i)[j]);
      // d - C (b + B y0), with the fixed controls alone in y0
      double image[max_width], scale = 0.0;
      std::copy_n(qp.b(i), n_next, image);
      small::add_product(qp.B(i), ns_, y0, image, n_next, m);
      for (int row = 0; row < reduction.rows; ++row) {
        const double d = d_[(i + 1) * max_rows_ + row];
        double value = d;
        for (int c = 0; c < n_next; ++c) value -= next.C[c * max_rows_ + row] * image[c];
        right_hand_side[row] = value;
        scale = std::max({scale, std::abs(d), std::abs(value)});
      }
      if (!transform_rows(right_hand_side, reduction, v, transformed, scale)) return Outcome::inconsistent;
      for (int t = 0; t < reduction.pivots; ++t) y0[v.pivot_column[t]] = transformed[v.pivot_row[t]];
      write_active_bounds(i);
      const int offset = count_active(qp, active, i);
      for (int t = 0; t < reduction.left; ++t) d_[i * max_rows_ + offset + t] = transformed[v.left_row[t]];

      std::copy_n(g, m, gy);
      small::add_product(v.G, width_, y0, gy, m, m);
      std::fill_n(k, f, 0.0);
      small::add_transposed_product(v.T, width_, gy, k, m, f);
      small::add_transposed_product(v.L, width_, y0, p, m, n);
      small::add_transposed_product(v.Y, width_, gy, p, m, n);
    }
    // p_i = h - L_v' G_v^-1 g_v = h - K' g_v
    small::add_transposed_product(v.K, width_, k, p, f, n, -1.0);
    small::solve(v.factor, width_, f, k);
    if (reduction.plain) write_active_bounds(i);
  }

  // Node 0.
  const View first = view(0);
  const int n0 = qp.states(0);
  double *s0 = step.state(0), *multipliers = row_multipliers_.data();
  const Reduction& initial = reductions_[N];
  std::fill_n(step.costate(0), n0, 0.0);
  std::fill_n(multipliers, initial.rows, 0.0);
  if (qp.initial_state_is_given) {
    std::copy_n(qp.initial_step(), n0, s0);
    for (int row = 0; row < initial.rows; ++row) {
      double value = d_[row], scale = std::abs(d_[row]);
      for (int c = 0; c < n0; ++c) {
        value -= first.C[c * max_rows_ + row] * s0[c];
        scale = std::max(scale, std::abs(first.C[c * max_rows_ + row] * s0[c]));
      }
      if (std::abs(value) > consistency_tolerance * (1.0 + scale)) return Outcome::inconsistent;
    }
    std::copy_n(p_.data(), n0, step.costate(0));
    small::add_product(first.P, ns_, s0, step.costate(0), n0, n0);
  } else {
    View v = view(N);
    double free_step[max_width], gradient[max_width];
    if (initial.overflow) return Outcome::inconsistent;
    if (initial.plain) {
      for (int j = 0; j < n0; ++j) s0[j] = -p_[j];
      small::solve(v.factor, width_, n0, s0);
    } else {
      double scale = 0.0;
      for (int row = 0; row < initial.rows; ++row) scale = std::max(scale, std::abs(d_[row]));
      if (!transform_rows(d_.data(), initial, v, transformed, scale)) return Outcome::inconsistent;
      std::fill_n(s0, n0, 0.0);
      for (int t = 0; t < initial.pivots; ++t) s0[v.pivot_column[t]] = transformed[v.pivot_row[t]];
      std::copy_n(p_.data(), n0, gradient);
      small::add_product(first.P, ns_, s0, gradient, n0, n0);
      std::fill_n(free_step, initial.free, 0.0);
      small::add_transposed_product(v.T, width_, gradient, free_step, n0, initial.free, -1.0);
      small::solve(v.factor, width_, initial.free, free_step);
      small::add_product(v.T, width_, free_step, s0, n0, initial.free);
      // P s + p + C' nu = 0 gives the multipliers of the pivot rows, and through the row operations those of all.
      std::copy_n(p_.data(), n0, gradient);
      small::add_product(first.P, ns_, s0, gradient, n0, n0);
      double reduced[3 * max_width] = {};
      for (int t = 0; t < initial.pivots; ++t) reduced[v.pivot_row[t]] = -gradient[v.pivot_column[t]];
      small::add_transposed_product(v.eliminator, max_rows_, reduced, multipliers, initial.rows, initial.rows);
    }
  }

  const auto write_bound_multipliers = [&](int node, const double* of_rows) {
    double* bounds = step.state_bound(node);
    std::fill_n(bounds, qp.states(node), 0.0);
    if (node == 0 && qp.initial_state_is_given) return;
    int row = 0;
    for (int j = 0; j < qp.states(node); ++j)
      if (active.state(node)[j]) bounds[j] = of_rows[row++];
  };
  write_bound_multipliers(0, multipliers);

  for (int i = 0; i < N; ++i) {
    View v = view(i);
    const View next = view(i + 1);
    const Reduction& reduction = reductions_[i];
    const int n = qp.states(i), n_next = qp.states(i + 1), m = qp.controls(i);
    const double* s = step.state(i);
    double *w = step.control(i), *s_next = step.state(i + 1), *costate = step.costate(i + 1);
    feedback(qp, i, s, w);
    std::copy_n(qp.b(i), n_next, s_next);
    small::add_product(qp.A(i), ns_, s, s_next, n_next, n);
    small::add_product(qp.B(i), ns_, w, s_next, n_next, m);
    std::copy_n(p_.data() + (i + 1) * ns_, n_next, costate);
    small::add_product(next.P, ns_, s_next, costate, n_next, n_next);
    std::fill_n(step.control_bound(i), m, 0.0);
    double* of_rows = row_multipliers_.data() + (i + 1) * max_rows_;
    if (!reduction.plain) {
      // Gradient by w without the rows: G w + L s + g.
      double gradient[max_width];
      std::copy_n(g_.data() + i * width_, m, gradient);
      small::add_product(v.G, width_, w, gradient, m, m);
      small::add_product(v.L, width_, s, gradient, m, n);
      double reduced[3 * max_width] = {};
      const double* of_node = row_multipliers_.data() + i * max_rows_;
      const int offset = count_active(qp, active, i);
      for (int t = 0; t < reduction.pivots; ++t) reduced[v.pivot_row[t]] = -gradient[v.pivot_column[t]];
      for (int t = 0; t < reduction.left; ++t) reduced[v.left_row[t]] = of_node[offset + t];
      std::fill_n(of_rows, reduction.rows, 0.0);
      small::add_transposed_product(v.eliminator, max_rows_, reduced, of_rows, reduction.rows, reduction.rows);
      double pull[max_width] = {};
      small::add_transposed_product(next.C, max_rows_, of_rows, pull, reduction.rows, n_next);
      for (int j = 0; j < n_next; ++j) costate[j] += pull[j];
      small::add_transposed_product(qp.B(i), ns_, pull, gradient, n_next, m);
      for (int j = 0; j < m; ++j)
        if (active.control(i)[j]) step.control_bound(i)[j] = -gradient[j];
    }
    write_bound_multipliers(i + 1, of_rows);
  }
  return Outcome::done;
}

void Riccati::feedback(const StageQp& qp, int i, const double* s, double* w) noexcept {
  const View v = view(i);
  const Reduction& reduction = reductions_[i];
  const int n = qp.states(i), m = qp.controls(i), f = reduction.free;
  double free_step[max_width];
  const double* k = k_.data() + i * width_;
  for (int j = 0; j < f; ++j) free_step[j] = -k[j];
  for (int c = 0; c < n; ++c)
    for (int j = 0; j < f; ++j) free_step[j] -= v.K[c * width_ + j] * s[c];
  if (reduction.plain) {
    std::copy_n(free_step, m, w);
    return;
  }
  std::copy_n(y0_.data() + i * width_, m, w);
  small::add_product(v.T, width_, free_step, w, m, f);
  small::add_product(v.Y, width_, s, w, m, n);
}

void Riccati::covariances(const StageQp& qp, double* covariance, double* last) noexcept {
  const int N = qp.intervals();
  double* now = work_.data();
  double* closed = now + width_ * width_;
  double* half = closed + width_ * width_;
  double* next_block = half + width_ * width_;
  const int n0 = qp.states(0);
  const View initial = view(N);
  for (int c = 0; c < n0; ++c) {
    std::fill_n(now + c * width_, n0, 0.0);
    now[c * width_ + c] = 2.0;
    small::solve(initial.factor, width_, n0, now + c * width_);
  }
  const auto store = [&](int node, double* target) {
    if (!target) return;
    const int n = qp.states(node);
    for (int c = 0; c < n; ++c)
      for (int r = 0; r < n; ++r) target[c * ns_ + r] = 0.5 * (now[c * width_ + r] + now[r * width_ + c]);
  };
  store(0, covariance);
  for (int i = 0; i < N; ++i) {
    const View v = view(i);
    const int n = qp.states(i), n_next = qp.states(i + 1), m = qp.controls(i);
    // (A - B K) Sigma (A - B K)' + 2 B G^-1 B'
    small::multiply(qp.B(i), ns_, v.K, width_, closed, width_, n_next, m, n);
    for (int c = 0; c < n; ++c)
      for (int r = 0; r < n_next; ++r) closed[c * width_ + r] = qp.A(i)[c * ns_ + r] - closed[c * width_ + r];
    small::multiply(closed, width_, now, width_, half, width_, n_next, n, n);
    for (int c = 0; c < n_next; ++c) {
      double row[max_width] = {};
      for (int j = 0; j < m; ++j) row[j] = 2.0 * qp.B(i)[j * ns_ + c];
      small::solve(v.factor, width_, m, row);
      for (int r = 0; r < n_next; ++r) {
        double sum = 0.0;
        for (int j = 0; j < n; ++j) sum += half[j * width_ + r] * closed[j * width_ + c];
        for (int j = 0; j < m; ++j) sum += qp.B(i)[j * ns_ + r] * row[j];
        next_block[c * width_ + r] = sum;
      }
    }
    for (int c = 0; c < n_next; ++c) std::copy_n(next_block + c * width_, n_next, now + c * width_);
    if (covariance) store(i + 1, covariance + static_cast<std::ptrdiff_t>(i + 1) * ns_ * ns_);
  }
  store(N, last);
}

}  // namespace rhec
