#include "kkt_factor.hpp"

#include <cholmod.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <new>
#include <numeric>
#include <utility>

namespace rhec::sparse_sqp {
namespace {

constexpr int most_refinements = 6;
// Below this relative residual further refinement gains nothing.
constexpr double refined_enough = 2e-15;
// Limit of equilibration passes. If the largest entry of each row is within this factor of one, another pass gains
// nothing.
constexpr int most_scalings = 3;
constexpr double scaled_enough = 8.0;

double largest_of(const std::vector<double>& numbers) noexcept {
  double largest = 0.0;
  for (const double number : numbers) largest = std::max(largest, std::abs(number));
  return largest;
}

/// The largest power of two not above a positive number.
double power_of_two(double value) noexcept {
  constexpr std::uint64_t exponent = 0x7ff0'0000'0000'0000;
  return std::bit_cast<double>(std::bit_cast<std::uint64_t>(value) & exponent);
}

}  // namespace

/// CHOLMOD's workspace.
struct KktFactor::Workspace {
  cholmod_common common{};

  Workspace() {
    cholmod_start(&common);
    common.print = 0;
    common.error_handler = nullptr;
  }
  ~Workspace() { cholmod_finish(&common); }
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;
};

/// For one structure: the elimination order, the patterns of K and L, and where the values of H and J go in K.
struct KktFactor::Symbolic {
  std::vector<std::int32_t> signature;  ///< of the structure
  std::vector<int> place;               ///< of a variable or constraint in the elimination order
  // K's upper triangle in that order, by columns with rows in order: the diagonal is the last entry of each.
  std::vector<int> starts, rows;
  std::vector<int> hessian_entries, jacobian_entries;
  // L without its diagonal, once by columns and once by rows, indices in order.
  std::vector<int> l_starts, l_rows, l_row_starts, l_columns;

  /// A fill-reducing order. For a chain of stages AMD finds one that eliminates neighbouring stages close to each
  /// other, so a long horizon is traversed in the order in which it lies in memory.
  void choose_order(const SparseNlp& nlp, cholmod_common* common) {
    const int n = nlp.variables(), m = nlp.constraints(), size = n + m;
    const auto &H = nlp.hessian(), &J = nlp.jacobian();
    // K's lower triangle in the original order, without the diagonal of the constraints.
    std::vector<int> column_starts(1, 0), row_indices;
    column_starts.reserve(static_cast<std::size_t>(size) + 1);
    row_indices.reserve(static_cast<std::size_t>(H.entries()) + J.entries());
    for (int c = 0; c < n; ++c) {
      row_indices.insert(row_indices.end(), H.row_indices.begin() + H.starts[c],
                         H.row_indices.begin() + H.starts[c + 1]);
      for (int k = J.starts[c]; k < J.starts[c + 1]; ++k) row_indices.push_back(n + J.row_indices[k]);
      column_starts.push_back(static_cast<int>(row_indices.size()));
    }
    column_starts.resize(static_cast<std::size_t>(size) + 1, column_starts.back());
    cholmod_sparse pattern{};
    pattern.nrow = pattern.ncol = static_cast<std::size_t>(size);
    pattern.nzmax = row_indices.size();
    pattern.p = column_starts.data();
    pattern.i = row_indices.data();
    pattern.stype = -1;
    pattern.itype = CHOLMOD_INT;
    pattern.xtype = CHOLMOD_PATTERN;
    pattern.dtype = CHOLMOD_DOUBLE;
    pattern.sorted = pattern.packed = 1;
    std::vector<int> order(size);
    if (!cholmod_amd(&pattern, nullptr, 0, order.data(), common)) throw std::bad_alloc();
    place.resize(size);
    for (int k = 0; k < size; ++k) place[order[k]] = k;
  }

  /// The upper triangle of K, permuted by `place`, and where each value of H and J goes in it. The diagonal is the last
  /// entry of each column.
  void make_matrix(const SparseNlp& nlp) {
    const int n = nlp.variables(), m = nlp.constraints();
    const auto &H = nlp.hessian(), &J = nlp.jacobian();
    const std::size_t size = static_cast<std::size_t>(n) + m;
    // Sorted by rows first, then distributed to columns: that leaves the rows of each column in order.
    std::vector<int> row_starts(size + 1, 0), next;
    const auto for_each_entry = [&](const auto& visit) {
      for (int c = 0; c < n; ++c)
        for (int k = H.starts[c]; k < H.starts[c + 1]; ++k) visit(k, place[H.row_indices[k]], place[c]);
      for (int c = 0; c < n; ++c)
        for (int k = J.starts[c]; k < J.starts[c + 1]; ++k)
          visit(H.entries() + k, place[n + J.row_indices[k]], place[c]);
      for (int r = 0; r < m; ++r) visit(H.entries() + J.entries() + r, place[n + r], place[n + r]);
    };
    const std::size_t entries = static_cast<std::size_t>(H.entries()) + J.entries() + m;
    starts.assign(size + 1, 0);
    for_each_entry([&](int, int a, int b) {
      ++row_starts[std::min(a, b) + 1];
      ++starts[std::max(a, b) + 1];
    });
    for (std::size_t i = 0; i < size; ++i) {
      row_starts[i + 1] += row_starts[i];
      starts[i + 1] += starts[i];
    }
    struct Entry {
      int number, column;
    };
    std::vector<Entry> by_rows(entries);
    next.assign(row_starts.begin(), row_starts.end() - 1);
    for_each_entry([&](int number, int a, int b) { by_rows[next[std::min(a, b)]++] = {number, std::max(a, b)}; });

    rows.resize(entries);
    std::vector<int> entry_of(entries);
    next.assign(starts.begin(), starts.end() - 1);
    for (std::size_t row = 0; row < size; ++row) {
      for (int k = row_starts[row]; k < row_starts[row + 1]; ++k) {
        const int at = next[by_rows[k].column]++;
        rows[at] = static_cast<int>(row);
        entry_of[by_rows[k].number] = at;
      }
    }
    hessian_entries.assign(entry_of.begin(), entry_of.begin() + H.entries());
    jacobian_entries.assign(entry_of.begin() + H.entries(), entry_of.end() - m);
  }

  /// The pattern of L. Row k has an entry in every column on the paths in the elimination tree from the entries of K's
  /// column k up to k.
  void analyse() {
    const int size = static_cast<int>(starts.size()) - 1;
    std::vector<int> parent(size, -1), reached_by(size, -1), ancestor(size, -1), counts(size, 0);
    for (int k = 0; k < size; ++k) {
      for (int at = starts[k]; at < starts[k + 1]; ++at) {
        for (int j = rows[at]; j != -1 && j < k;) {
          const int above = std::exchange(ancestor[j], k);
          if (above == -1) parent[j] = k;
          j = above;
        }
      }
    }
    l_row_starts.assign(1, 0);
    l_row_starts.reserve(static_cast<std::size_t>(size) + 1);
    l_columns.reserve(2 * rows.size());
    for (int k = 0; k < size; ++k) {
      const auto first = static_cast<std::ptrdiff_t>(l_columns.size());
      reached_by[k] = k;
      for (int at = starts[k]; at < starts[k + 1]; ++at) {
        for (int j = rows[at]; reached_by[j] != k; j = parent[j]) {
          reached_by[j] = k;
          l_columns.push_back(j);
          ++counts[j];
        }
      }
      std::sort(l_columns.begin() + first, l_columns.end());
      l_row_starts.push_back(static_cast<int>(l_columns.size()));
    }
    l_starts.assign(static_cast<std::size_t>(size) + 1, 0);
    std::partial_sum(counts.begin(), counts.end(), l_starts.begin() + 1);
    l_rows.resize(l_columns.size());
    std::vector<int> next(l_starts.begin(), l_starts.end() - 1);
    for (int k = 0; k < size; ++k)
      for (int at = l_row_starts[k]; at < l_row_starts[k + 1]; ++at) l_rows[next[l_columns[at]]++] = k;
  }
};

KktFactor::KktFactor() : workspace_(std::make_unique<Workspace>()) {}
KktFactor::~KktFactor() = default;

void KktFactor::forget() noexcept {
  symbolic_.reset();
  known_.clear();
  nlp_ = nullptr;
}

void KktFactor::forget_scales() noexcept { std::fill(scale_.begin(), scale_.end(), 1.0); }

int KktFactor::symbolic_factors() const noexcept { return static_cast<int>(known_.size()); }

std::int64_t KktFactor::entries() const noexcept {
  return static_cast<std::int64_t>(symbolic_->l_rows.size() + symbolic_->place.size());
}

void KktFactor::take_structure(const SparseNlp& nlp) {
  nlp_ = &nlp;
  n_ = nlp.variables();
  m_ = nlp.constraints();
  const auto& signature = nlp.signature();
  const auto at =
      std::find_if(known_.begin(), known_.end(), [&](const auto& one) { return one->signature == signature; });
  if (at != known_.end()) {
    std::rotate(at, at + 1, known_.end());
    symbolic_ = known_.back();
  } else {
    auto made = std::make_shared<Symbolic>();
    made->signature = signature;
    made->choose_order(nlp, &workspace_->common);
    made->make_matrix(nlp);
    made->analyse();
    ++analyses_;
    if (known_.size() >= static_cast<std::size_t>(most_structures)) known_.erase(known_.begin());
    known_.push_back(made);
    symbolic_ = std::move(made);
  }
  const std::size_t size = static_cast<std::size_t>(n_) + static_cast<std::size_t>(m_);
  scale_.resize(size);
  forget_scales();
  for (auto* vector : {&norm_, &diagonal_, &inverse_pivots_, &right_, &solution_, &residual_, &correction_})
    vector->assign(size, 0.0);
  ends_.assign(size, 0);
  values_.assign(symbolic_->rows.size(), 0.0);
  l_values_.assign(symbolic_->l_rows.size(), 0.0);
}

/// Writes the values of K to their places.
void KktFactor::scatter() noexcept {
  const auto &H = nlp_->hessian(), &J = nlp_->jacobian();
  double* values = values_.data();
  const std::uint8_t* fixed = numbers_.fixed;
  for (int c = 0; c < n_; ++c) {
    const bool is_fixed = fixed && fixed[c];
    for (int k = H.starts[c]; k < H.starts[c + 1]; ++k) {
      const int r = H.row_indices[k];
      double value = numbers_.hessian[k] + (r == c && numbers_.primal ? numbers_.primal[c] : 0.0);
      if (is_fixed || (fixed && fixed[r])) value = r == c ? 1.0 : 0.0;
      values[symbolic_->hessian_entries[k]] = value;
    }
    for (int k = J.starts[c]; k < J.starts[c + 1]; ++k)
      values[symbolic_->jacobian_entries[k]] = is_fixed ? 0.0 : numbers_.jacobian[k];
  }
  const int* starts = symbolic_->starts.data();
  for (int r = 0; r < m_; ++r)
    values[starts[symbolic_->place[n_ + r] + 1] - 1] = numbers_.dual ? -numbers_.dual[r] : 0.0;
  if (!numbers_.off) return;
  for (int k = 0; k < J.entries(); ++k)
    if (numbers_.off[J.row_indices[k]]) values[symbolic_->jacobian_entries[k]] = 0.0;
  for (int r = 0; r < m_; ++r)
    if (numbers_.off[r]) values[starts[symbolic_->place[n_ + r] + 1] - 1] = -1.0;
}

/// Scales rows and columns so that their largest entries are close to one (Ruiz 2001), by powers of two, which is
/// exact. Starts with the scales of the last matrix: consecutive matrices of a solver are similar.
void KktFactor::equilibrate() noexcept {
  const int *starts = symbolic_->starts.data(), *rows = symbolic_->rows.data();
  double* values = values_.data();
  const int size = n_ + m_;
  for (int pass = 0; pass < most_scalings; ++pass) {
    std::fill(norm_.begin(), norm_.end(), 0.0);
    for (int c = 0; c < size; ++c) {
      double largest = 0.0;
      for (int k = starts[c]; k < starts[c + 1]; ++k) {
        const double value = std::abs(values[k]) * scale_[c];
        norm_[rows[k]] = std::max(norm_[rows[k]], value);
        largest = std::max(largest, std::abs(values[k]) * scale_[rows[k]]);
      }
      norm_[c] = std::max(norm_[c], largest);
    }
    double most = 1.0;  // largest factor between a row's largest entry and one
    for (int k = 0; k < size; ++k) {
      const double norm = norm_[k] * scale_[k];
      if (!(norm > 0.0) || !std::isfinite(norm)) continue;
      most = std::max({most, norm, 1.0 / norm});
      scale_[k] /= std::sqrt(norm);
    }
    if (most <= scaled_enough) break;
  }
  for (double& scale : scale_) scale = power_of_two(scale);
  for (int c = 0; c < size; ++c) {
    for (int k = starts[c]; k < starts[c + 1]; ++k) values[k] *= scale_[rows[k]] * scale_[c];
    diagonal_[c] = values[starts[c + 1] - 1];
  }
}

/// Computes L row by row, each row from the columns before it. False if a pivot is zero or not finite, or if the number
/// of negative pivots is not that of the constraints.
bool KktFactor::eliminate() noexcept {
  const Symbolic& of = *symbolic_;
  const int *starts = of.starts.data(), *rows = of.rows.data(), *l_starts = of.l_starts.data(),
            *l_rows = of.l_rows.data(), *l_row_starts = of.l_row_starts.data(), *l_columns = of.l_columns.data();
  double *row = correction_.data(), *l_values = l_values_.data();
  std::copy_n(l_starts, ends_.size(), ends_.data());
  std::fill(correction_.begin(), correction_.end(), 0.0);
  int negative = 0;
  for (int k = 0; k < n_ + m_; ++k) {
    const int last = starts[k + 1] - 1;
    for (int at = starts[k]; at < last; ++at) row[rows[at]] = values_[at];
    double pivot = values_[last];
    for (int at = l_row_starts[k]; at < l_row_starts[k + 1]; ++at) {
      const int column = l_columns[at], end = ends_[column]++;
      const double value = std::exchange(row[column], 0.0), entry = value * inverse_pivots_[column];
      for (int entry_at = l_starts[column]; entry_at < end; ++entry_at)
        row[l_rows[entry_at]] -= l_values[entry_at] * value;
      l_values[end] = entry;
      pivot -= entry * value;
    }
    if (!std::isfinite(pivot) || pivot == 0.0) return false;
    negative += pivot < 0.0;
    inverse_pivots_[k] = 1.0 / pivot;
  }
  return negative == m_;
}

bool KktFactor::factor(const Numbers& numbers) {
  numbers_ = numbers;
  scatter();
  equilibrate();
  const int* starts = symbolic_->starts.data();
  for (int k = 0; k < n_ + m_; ++k) {
    if (k < n_ && numbers_.fixed && numbers_.fixed[k]) continue;
    const int place = symbolic_->place[k];
    values_[starts[place + 1] - 1] = diagonal_[place] + (k < n_ ? numbers_.regularisation : -numbers_.regularisation);
  }
  return eliminate();
}

/// x = (L D L')^-1 x
void KktFactor::solve_with_factor(double* x) const noexcept {
  const int *starts = symbolic_->l_starts.data(), *rows = symbolic_->l_rows.data();
  const double* values = l_values_.data();
  const int size = n_ + m_;
  for (int c = 0; c < size; ++c) {
    const double value = x[c];
    for (int k = starts[c]; k < starts[c + 1]; ++k) x[rows[k]] -= values[k] * value;
  }
  for (int c = size - 1; c >= 0; --c) {
    double value = x[c] * inverse_pivots_[c];
    for (int k = starts[c]; k < starts[c + 1]; ++k) value -= values[k] * x[rows[k]];
    x[c] = value;
  }
}

/// residual_ = right_ - K x; returns its largest entry.
double KktFactor::find_residual(const double* x) noexcept {
  const int *starts = symbolic_->starts.data(), *rows = symbolic_->rows.data();
  double* residual = residual_.data();
  for (int c = 0; c < n_ + m_; ++c) {
    double sum = diagonal_[c] * x[c];
    for (int k = starts[c]; k < starts[c + 1] - 1; ++k) {
      sum += values_[k] * x[rows[k]];
      residual[rows[k]] -= values_[k] * x[c];
    }
    residual[c] = right_[c] - sum;
  }
  return largest_of(residual_);
}

double KktFactor::solve(const double* rhs, double* x) {
  const int size = n_ + m_;
  const auto& place = symbolic_->place;
  for (int k = 0; k < size; ++k) right_[place[k]] = rhs[k] * scale_[place[k]];
  std::copy(right_.begin(), right_.end(), residual_.begin());
  std::fill(solution_.begin(), solution_.end(), 0.0);
  const double size_of_rhs = largest_of(right_);
  double best = size_of_rhs == 0.0 ? 0.0 : std::numeric_limits<double>::infinity();
  for (int round = 0; round <= most_refinements && best > refined_enough; ++round) {
    std::copy(residual_.begin(), residual_.end(), correction_.begin());
    solve_with_factor(correction_.data());
    for (int k = 0; k < size; ++k) solution_[k] += correction_[k];
    const double remaining = find_residual(solution_.data()) / (size_of_rhs + largest_of(solution_));
    if (!(remaining < best)) {  // also true for NaN
      for (int k = 0; k < size; ++k) solution_[k] -= correction_[k];
      break;
    }
    best = remaining;
  }
  for (int k = 0; k < size; ++k) x[k] = solution_[place[k]] * scale_[place[k]];
  return best;
}

}  // namespace rhec::sparse_sqp
