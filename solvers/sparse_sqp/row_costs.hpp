#pragma once

#include <cstddef>
#include <vector>

#include "limit_rows.hpp"
#include "rhec/core/ocp/sparse_nlp.hpp"

namespace rhec::sparse_sqp {

/// What an iterate's constraints c cost in the l1 merit function: the defect |c|_1, which is that of equations and of
/// what is beyond hard limits, and the slacks of soft limits.
class RowCosts {
 public:
  /// Throws std::bad_alloc.
  void take_structure(const Ocp& ocp, const SparseNlp& nlp);
  /// Takes over the limits as they are. False if the sides of one have crossed.
  bool take_limits(const Ocp& ocp, const SparseNlp& nlp) noexcept;

  bool has_limits() const noexcept { return !limits_.empty(); }
  LimitRows::Data limits() const noexcept {
    return {limits_, lower_.data(), upper_.data(), linear_.data(), quadratic_.data()};
  }

  double defect(const std::vector<double>& c) const noexcept;
  double slack_cost(const std::vector<double>& c) const noexcept;
  /// penalty * defect + slack cost; adds those of each row to its stage's in `stage_costs`.
  double merit(const std::vector<double>& c, double penalty, std::vector<double>& stage_costs) const noexcept;
  /// The largest multiplier among those that the penalty has to exceed.
  double largest_price(const std::vector<double>& multipliers) const noexcept;
  /// A defect belongs to the stage that its interval starts at.
  int stage_of(std::size_t row) const noexcept { return stages_[row]; }

 private:
  double excess(std::size_t row, double value) const noexcept;
  double price(std::size_t row, double excess) const noexcept {
    return (linear_[row] + 0.5 * quadratic_[row] * excess) * excess;
  }

  std::vector<int> limits_, stages_;                        ///< which rows are limits; the stage of each row
  std::vector<double> lower_, upper_, linear_, quadratic_;  ///< of each row, if there are limits
};

}  // namespace rhec::sparse_sqp
