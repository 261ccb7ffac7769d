#include "kkt_factor.hpp"

#include <cholmod.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <numeric>

namespace rhec::sparse_sqp {
namespace {

constexpr int most_refinements = 6;
// Below this relative residual refinement gains nothing more.
constexpr double refined_enough = 1e-15;

}  // namespace

/// CHOLMOD's workspace and the dense vectors that its solver reuses.
struct KktFactor::Workspace {
  cholmod_common common{};
  cholmod_dense *x = nullptr, *y = nullptr, *e = nullptr;

  Workspace() {
    cholmod_start(&common);
    common.print = 0;
    common.error_handler = nullptr;
    // The simplicial LDL' is of CHOLMOD's Core and Cholesky modules (LGPL) alone.
    common.supernodal = CHOLMOD_SIMPLICIAL;
    common.final_ll = 0;
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_AMD;
    common.postorder = 1;
  }
  ~Workspace() {
    for (cholmod_dense** vector : {&x, &y, &e}) cholmod_free_dense(vector, &common);
    cholmod_finish(&common);
  }
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;
};

/// K's ordering and pattern for one structure: its upper triangle in the order of elimination, and where the numbers of
/// H, J and the diagonals go.
struct KktFactor::Symbolic {
  std::vector<std::int32_t> signature;  ///< of the structure
  cholmod_common* common = nullptr;
  cholmod_sparse* matrix = nullptr;
  cholmod_factor* factor = nullptr;
  std::vector<int> place;  ///< of a variable or constraint in the order of elimination
  std::vector<int> hessian_entries, jacobian_entries, diagonal_entries;

  explicit Symbolic(cholmod_common* workspace) : common(workspace) {}
  ~Symbolic() {
    cholmod_free_sparse(&matrix, common);
    cholmod_free_factor(&factor, common);
  }
  Symbolic(const Symbolic&) = delete;
  Symbolic& operator=(const Symbolic&) = delete;

  /// The upper triangle of K with its rows and columns moved to `place`; remembers where each number went.
  void make_matrix(const SparseNlp& nlp) {
    const int n = nlp.variables(), m = nlp.constraints();
    const auto &H = nlp.hessian(), &J = nlp.jacobian();
    std::vector<int> rows, columns;
    const auto add = [&](int r, int c) {
      rows.push_back(std::min(place[r], place[c]));
      columns.push_back(std::max(place[r], place[c]));
    };
    for (int c = 0; c < n; ++c)
      for (int k = H.starts[c]; k < H.starts[c + 1]; ++k) add(H.row_indices[k], c);
    for (int c = 0; c < n; ++c)
      for (int k = J.starts[c]; k < J.starts[c + 1]; ++k) add(n + J.row_indices[k], c);
    for (int r = 0; r < m; ++r) add(n + r, n + r);

    // Sort the entries into columns, and by rows within them: two stable counting passes.
    const std::size_t entries = rows.size();
    const std::size_t size = static_cast<std::size_t>(n) + static_cast<std::size_t>(m);
    std::vector<int> order(entries), next(entries), starts(size + 1, 0);
    for (std::size_t k = 0; k < entries; ++k) order[k] = static_cast<int>(k);
    for (const std::vector<int>* key : {&rows, &columns}) {
      std::fill(starts.begin(), starts.end(), 0);
      for (const int value : *key) ++starts[value + 1];
      for (std::size_t i = 0; i < size; ++i) starts[i + 1] += starts[i];
      std::vector<int> at(starts.begin(), starts.end() - 1);
      for (const int k : order) next[at[(*key)[k]]++] = k;
      std::swap(order, next);
    }
    cholmod_free_sparse(&matrix, common);
    matrix = cholmod_allocate_sparse(size, size, entries, 1, 1, 1, CHOLMOD_REAL, common);
    if (!matrix) throw std::bad_alloc();
    std::copy(starts.begin(), starts.end(), static_cast<int*>(matrix->p));
    std::vector<int> entry_of(entries);
    for (std::size_t k = 0; k < entries; ++k) {
      static_cast<int*>(matrix->i)[k] = rows[order[k]];
      entry_of[order[k]] = static_cast<int>(k);
    }
    std::fill_n(static_cast<double*>(matrix->x), entries, 0.0);
    const auto first_of_j = entry_of.begin() + H.entries(), first_of_diagonal = first_of_j + J.entries();
    hessian_entries.assign(entry_of.begin(), first_of_j);
    jacobian_entries.assign(first_of_j, first_of_diagonal);
    diagonal_entries.assign(first_of_diagonal, entry_of.end());
  }
};

KktFactor::KktFactor() : workspace_(std::make_unique<Workspace>()) {}
KktFactor::~KktFactor() {
  forget();  // before the workspace that they were made with
}

void KktFactor::forget() noexcept {
  symbolic_.reset();
  known_.clear();
  nlp_ = nullptr;
}

int KktFactor::symbolic_factors() const noexcept { return static_cast<int>(known_.size()); }

std::int64_t KktFactor::entries() const noexcept {
  const auto* counts = static_cast<const int*>(symbolic_->factor->ColCount);
  return std::accumulate(counts, counts + symbolic_->factor->n, std::int64_t{0});
}

void KktFactor::take_structure(const SparseNlp& nlp) {
  nlp_ = &nlp;
  n_ = nlp.variables();
  m_ = nlp.constraints();
  const std::size_t size = static_cast<std::size_t>(n_) + static_cast<std::size_t>(m_);
  for (auto* vector : {&scale_, &norm_, &right_, &residual_, &correction_, &terms_}) vector->assign(size, 0.0);
  const auto& signature = nlp.signature();
  const auto at =
      std::find_if(known_.begin(), known_.end(), [&](const auto& one) { return one->signature == signature; });
  if (at != known_.end()) {
    std::rotate(at, at + 1, known_.end());
    symbolic_ = known_.back();
    return;
  }
  auto made = std::make_shared<Symbolic>(&workspace_->common);
  made->signature = signature;
  made->place.resize(size);
  for (std::size_t k = 0; k < size; ++k) made->place[k] = static_cast<int>(k);
  made->make_matrix(nlp);
  // The ordering comes from a first analysis; K is then laid out in that order, so that no factorisation has to move
  // its numbers again.
  cholmod_common& common = workspace_->common;
  common.method[0].ordering = CHOLMOD_AMD;
  cholmod_factor* ordered = cholmod_analyze(made->matrix, &common);
  if (!ordered) throw std::bad_alloc();
  const int* permutation = static_cast<const int*>(ordered->Perm);
  for (std::size_t k = 0; k < size; ++k) made->place[permutation[k]] = static_cast<int>(k);
  cholmod_free_factor(&ordered, &common);
  made->make_matrix(nlp);
  common.method[0].ordering = CHOLMOD_NATURAL;
  common.postorder = 0;
  made->factor = cholmod_analyze(made->matrix, &common);
  common.postorder = 1;
  if (!made->factor) throw std::bad_alloc();
  ++analyses_;
  if (known_.size() >= static_cast<std::size_t>(most_structures)) known_.erase(known_.begin());
  known_.push_back(made);
  symbolic_ = std::move(made);
}

/// Scales rows and columns towards a largest entry of one (Ruiz 2001).
void KktFactor::equilibrate() noexcept {
  const auto &H = nlp_->hessian(), &J = nlp_->jacobian();
  const auto is_fixed = [&](int variable) { return numbers_.fixed && numbers_.fixed[variable]; };
  std::fill(scale_.begin(), scale_.end(), 1.0);
  for (int pass = 0; pass < 3; ++pass) {
    std::fill(norm_.begin(), norm_.end(), 0.0);
    const auto note = [&](int r, int c, double value) {
      const double size = std::abs(value) * scale_[r] * scale_[c];
      norm_[r] = std::max(norm_[r], size);
      norm_[c] = std::max(norm_[c], size);
    };
    for (int c = 0; c < n_; ++c) {
      if (is_fixed(c)) continue;
      for (int k = H.starts[c]; k < H.starts[c + 1]; ++k) {
        const int r = H.row_indices[k];
        if (!is_fixed(r)) note(r, c, numbers_.hessian[k] + (r == c && numbers_.primal ? numbers_.primal[c] : 0.0));
      }
      for (int k = J.starts[c]; k < J.starts[c + 1]; ++k) note(n_ + J.row_indices[k], c, numbers_.jacobian[k]);
    }
    for (int r = 0; r < m_; ++r)
      if (numbers_.dual) note(n_ + r, n_ + r, numbers_.dual[r]);
    for (int k = 0; k < n_ + m_; ++k) {
      if (norm_[k] == 0.0 || !std::isfinite(norm_[k])) continue;
      scale_[k] /= std::sqrt(norm_[k]);
    }
  }
  for (int c = 0; c < n_; ++c)
    if (is_fixed(c)) scale_[c] = 1.0;
}

bool KktFactor::factor(const Numbers& numbers) {
  numbers_ = numbers;
  equilibrate();
  const auto &H = nlp_->hessian(), &J = nlp_->jacobian();
  const auto is_fixed = [&](int variable) { return numbers_.fixed && numbers_.fixed[variable]; };
  auto* values = static_cast<double*>(symbolic_->matrix->x);
  const double regularisation = numbers_.regularisation;
  for (int c = 0; c < n_; ++c) {
    for (int k = H.starts[c]; k < H.starts[c + 1]; ++k) {
      const int r = H.row_indices[k];
      double& value = values[symbolic_->hessian_entries[k]];
      if (is_fixed(r) || is_fixed(c)) {
        value = r == c ? 1.0 : 0.0;
      } else {
        value = numbers.hessian[k] * scale_[r] * scale_[c];
        if (r == c) value += (numbers.primal ? numbers.primal[c] * scale_[c] * scale_[c] : 0.0) + regularisation;
      }
    }
    for (int k = J.starts[c]; k < J.starts[c + 1]; ++k)
      values[symbolic_->jacobian_entries[k]] =
          is_fixed(c) ? 0.0 : numbers.jacobian[k] * scale_[n_ + J.row_indices[k]] * scale_[c];
  }
  for (int r = 0; r < m_; ++r) {
    const double s = scale_[n_ + r];
    values[symbolic_->diagonal_entries[r]] = -(numbers.dual ? numbers.dual[r] * s * s : 0.0) - regularisation;
  }
  cholmod_factorize(symbolic_->matrix, symbolic_->factor, &workspace_->common);
  const cholmod_factor& L = *symbolic_->factor;
  if (L.xtype != CHOLMOD_REAL || L.minor < L.n) return false;
  const auto* starts = static_cast<const int*>(L.p);
  const auto* x = static_cast<const double*>(L.x);
  int negative = 0;
  for (std::size_t k = 0; k < L.n; ++k) {
    const double pivot = x[starts[k]];
    if (!std::isfinite(pivot) || pivot == 0.0) return false;
    negative += pivot < 0.0;
  }
  return negative == m_;
}

/// y = K x, with the numbers as they were given; `terms_` gets the sizes that went into each row.
void KktFactor::multiply(const double* x, double* y) const noexcept {
  const auto &H = nlp_->hessian(), &J = nlp_->jacobian();
  const auto is_fixed = [&](int variable) { return numbers_.fixed && numbers_.fixed[variable]; };
  std::fill_n(y, n_ + m_, 0.0);
  for (int c = 0; c < n_; ++c) {
    if (is_fixed(c)) {
      y[c] = x[c];
      continue;
    }
    double sum = numbers_.primal ? numbers_.primal[c] * x[c] : 0.0;
    for (int k = H.starts[c]; k < H.starts[c + 1]; ++k) {
      const int r = H.row_indices[k];
      if (is_fixed(r)) continue;
      sum += numbers_.hessian[k] * x[r];
      if (r != c) y[r] += numbers_.hessian[k] * x[c];
    }
    for (int k = J.starts[c]; k < J.starts[c + 1]; ++k) {
      const int r = n_ + J.row_indices[k];
      sum += numbers_.jacobian[k] * x[r];
      y[r] += numbers_.jacobian[k] * x[c];
    }
    y[c] += sum;
  }
  for (int r = 0; r < m_; ++r)
    if (numbers_.dual) y[n_ + r] -= numbers_.dual[r] * x[n_ + r];
}

double KktFactor::solve(const double* rhs, double* x) {
  const int size = n_ + m_;
  std::fill_n(x, size, 0.0);
  std::copy_n(rhs, size, residual_.data());
  double best = std::numeric_limits<double>::infinity();
  const auto scaled_norm = [&](const double* v) {
    double largest = 0.0;
    for (int k = 0; k < size; ++k) largest = std::max(largest, std::abs(v[k] * scale_[k]));
    return largest;
  };
  const double size_of_rhs = scaled_norm(rhs);
  if (size_of_rhs == 0.0) return 0.0;
  for (int round = 0; round <= most_refinements; ++round) {
    cholmod_dense b{};
    b.nrow = b.d = b.nzmax = static_cast<std::size_t>(size);
    b.ncol = 1;
    b.xtype = CHOLMOD_REAL;
    b.dtype = CHOLMOD_DOUBLE;
    for (int k = 0; k < size; ++k) right_[symbolic_->place[k]] = residual_[k] * scale_[k];
    b.x = right_.data();
    if (!cholmod_solve2(CHOLMOD_A, symbolic_->factor, &b, nullptr, &workspace_->x, nullptr, &workspace_->y,
                        &workspace_->e, &workspace_->common))
      throw std::bad_alloc();
    const auto* solution = static_cast<const double*>(workspace_->x->x);
    for (int k = 0; k < size; ++k) {
      correction_[k] = solution[symbolic_->place[k]] * scale_[k];
      x[k] += correction_[k];
    }
    multiply(x, terms_.data());
    for (int k = 0; k < size; ++k) terms_[k] = rhs[k] - terms_[k];
    double solution_size = 0.0;
    for (int k = 0; k < size; ++k) solution_size = std::max(solution_size, std::abs(x[k]) / scale_[k]);
    const double remaining = scaled_norm(terms_.data()) / (size_of_rhs + solution_size);
    if (!(remaining < best)) {  // also where it is not a number
      for (int k = 0; k < size; ++k) x[k] -= correction_[k];
      break;
    }
    best = remaining;
    std::swap(residual_, terms_);
    if (best < refined_enough) break;
  }
  return best;
}

}  // namespace rhec::sparse_sqp
