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
/// as L D L' without pivoting, in an order that CHOLMOD chooses (AMD). Variables that are fixed have the identity's row
/// and column in the place of their own, so the pattern never changes. K is equilibrated, and a small regularisation
/// makes it quasi-definite: then any ordering is stable enough for iterative refinement against K itself (Vanderbei
/// 1995; Friedlander and Orban 2012). The reduced Hessian is positive definite if and only if D has as many negative
/// entries as there are constraints.
///
/// Orderings and symbolic factors are kept for every structure that was seen, up to a limit.
class KktFactor {
 public:
  KktFactor();
  ~KktFactor();
  KktFactor(const KktFactor&) = delete;
  KktFactor& operator=(const KktFactor&) = delete;

  /// Chooses the symbolic factor of a structure, made now where it is new. Throws std::bad_alloc.
  void take_structure(const SparseNlp& nlp);
  void forget() noexcept;
  /// The next matrix is scaled as if it were the first.
  void forget_scales() noexcept;
  /// Structures whose symbolic factors are kept: more than any blocking has positions in a window.
  static constexpr int most_structures = 64;
  int symbolic_factors() const noexcept;
  int analyses() const noexcept { return analyses_; }  ///< symbolic factors made so far
  std::int64_t entries() const noexcept;               ///< of L, for the structure taken

  /// The numbers of a matrix, which must stay where they are as long as the factor is used.
  struct Numbers {
    const double* hessian = nullptr;      ///< of SparseNlp::hessian()
    const double* jacobian = nullptr;     ///< of SparseNlp::jacobian()
    const double* primal = nullptr;       ///< n; null: zero
    const double* dual = nullptr;         ///< m; null: zero
    const std::uint8_t* fixed = nullptr;  ///< n flags; null: none
    double regularisation = 1e-9;         ///< relative to the equilibrated matrix
  };
  /// True where the inertia is right (n positive, m negative). False also where a pivot is not finite.
  bool factor(const Numbers& numbers);

  /// x = K^-1 rhs, both of n + m numbers, refined; what is returned is the remaining residual relative to the sizes of
  /// rhs and of K x's terms.
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
  std::vector<std::shared_ptr<Symbolic>> known_;  ///< in the order of use, the newest last
  std::shared_ptr<Symbolic> symbolic_;
  const SparseNlp* nlp_ = nullptr;
  int n_ = 0, m_ = 0, analyses_ = 0;
  Numbers numbers_;
  // In the order of elimination, and scaled.
  std::vector<double> scale_, norm_, diagonal_, right_, solution_, residual_, correction_;
  std::vector<double> values_;  ///< of K's upper triangle, with the regularisation; `diagonal_` is without
  std::vector<double> l_values_, inverse_pivots_;
  std::vector<int> ends_;  ///< of what there is of L's columns
};

}  // namespace rhec::sparse_sqp
