#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rhec/core/ocp/sparse_nlp.hpp"

namespace rhec::sparse_sqp {

/// Factors the symmetric matrix of a sparse QP with equality constraints,
///
///     K = [ H + diag(primal)   J'          ]
///         [ J                 -diag(dual)  ]      with primal, dual >= 0,
///
/// as L D L' without pivoting, in an order that CHOLMOD chooses (AMD); docs/method.md, section 7. Rows and columns of
/// fixed variables are replaced by those of the identity, those of constraints that are off by those of the negative
/// identity, so the pattern never changes. K is equilibrated, and a small
/// regularisation makes it quasi-definite: then any ordering is stable enough for iterative refinement against K itself
/// [13, 14]. The reduced Hessian is positive definite if and only if D has as many negative entries as there are
/// constraints.
///
/// Orderings and symbolic factors are cached for each structure seen, up to a limit.
class KktFactor {
 public:
  KktFactor();
  ~KktFactor();
  KktFactor(const KktFactor&) = delete;
  KktFactor& operator=(const KktFactor&) = delete;

  /// Selects the symbolic factor of a structure, and computes it if the structure is new. Throws std::bad_alloc.
  void take_structure(const SparseNlp& nlp);
  void forget() noexcept;
  /// Resets the equilibration: the next matrix is scaled as if it were the first.
  void forget_scales() noexcept;
  /// Number of structures whose symbolic factors are cached: more than any blocking has positions in a window.
  static constexpr int most_structures = 64;
  int symbolic_factors() const noexcept;
  int analyses() const noexcept { return analyses_; }  ///< symbolic factors made so far
  std::int64_t entries() const noexcept;               ///< of L, for the structure taken

  /// The values of a matrix. The arrays must stay valid while the factor is used.
  struct Numbers {
    const double* hessian = nullptr;      ///< in the pattern of SparseNlp::hessian()
    const double* jacobian = nullptr;     ///< in the pattern of SparseNlp::jacobian()
    const double* primal = nullptr;       ///< n; null: zero
    const double* dual = nullptr;         ///< m; null: zero
    const std::uint8_t* fixed = nullptr;  ///< n flags; null: none
    const std::uint8_t* off = nullptr;    ///< m flags; null: none
    double regularisation = 1e-9;         ///< relative to the equilibrated matrix
  };
  /// True if the inertia is right (n positive, m negative pivots). False also if a pivot is zero or not finite.
  bool factor(const Numbers& numbers);

  /// x = K^-1 rhs with iterative refinement, both of n + m numbers. Returns the remaining residual, relative to the sum
  /// of the largest entries of rhs and x, both equilibrated.
  double solve(const double* rhs, double* x);

 private:
  struct Symbolic;
  struct Workspace;
  void scatter() noexcept;
  void equilibrate() noexcept;
  bool eliminate() noexcept;
  void solve_with_factor(double* x) const noexcept;
  double find_residual(const double* x) noexcept;

  std::unique_ptr<Workspace> workspace_;
  std::vector<std::shared_ptr<Symbolic>> known_;  ///< least recently used first
  std::shared_ptr<Symbolic> symbolic_;
  const SparseNlp* nlp_ = nullptr;
  int n_ = 0, m_ = 0, analyses_ = 0;
  Numbers numbers_;
  // In elimination order, and scaled.
  std::vector<double> scale_, norm_, diagonal_, right_, solution_, residual_, correction_;
  std::vector<double> values_;  ///< K's upper triangle with the regularisation; `diagonal_` is without it
  std::vector<double> l_values_, inverse_pivots_;
  std::vector<int> ends_;  ///< where the part of each column of L computed so far ends
};

}  // namespace rhec::sparse_sqp
