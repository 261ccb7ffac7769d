#include "row_costs.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/base/infinity.hpp"
#include "sparse_products.hpp"

namespace rhec::sparse_sqp {
namespace {

double norm1(const std::vector<double>& v) {
  double sum = 0.0;
  for (const double value : v) sum += std::abs(value);
  return sum;
}

}  // namespace

void RowCosts::take_structure(const Ocp& ocp, const SparseNlp& nlp) {
  limits_.clear();
  stages_.clear();
  for (int i = 0; i <= ocp.intervals(); ++i) {
    if (i < ocp.intervals()) stages_.insert(stages_.end(), ocp.state_count(i + 1), i);
    stages_.insert(stages_.end(), nlp.limit_count(i), i);
    for (int r = 0; r < nlp.limit_count(i); ++r) limits_.push_back(nlp.limit_start(i) + r);
  }
  for (auto* v : {&lower_, &upper_, &linear_, &quadratic_}) v->assign(has_limits() ? nlp.constraints() : 0, 0.0);
}

bool RowCosts::take_limits(const Ocp& ocp, const SparseNlp& nlp) noexcept {
  if (!has_limits()) return true;
  nlp.row_bounds(ocp, lower_.data(), upper_.data(), linear_.data(), quadratic_.data());
  return std::all_of(limits_.begin(), limits_.end(), [&](int r) { return lower_[r] <= upper_[r]; });
}

/// How far a value is beyond the bounds of its row. Keeps NaN.
double RowCosts::excess(std::size_t row, double value) const noexcept {
  if (value < lower_[row]) return lower_[row] - value;
  return value <= upper_[row] ? 0.0 : value - upper_[row];
}

double RowCosts::defect(const std::vector<double>& c) const noexcept {
  if (!has_limits()) return norm1(c);
  double sum = 0.0;
  for (std::size_t r = 0; r < c.size(); ++r)
    if (linear_[r] == infinity) sum += excess(r, c[r]);
  return sum;
}

double RowCosts::slack_cost(const std::vector<double>& c) const noexcept {
  double sum = 0.0;
  for (const int r : limits_)
    if (linear_[r] < infinity) sum += price(r, excess(r, c[r]));
  return sum;
}

double RowCosts::merit(const std::vector<double>& c, double penalty, std::vector<double>& stage_costs) const noexcept {
  if (!has_limits()) {
    for (std::size_t r = 0; r < c.size(); ++r) stage_costs[stages_[r]] += penalty * std::abs(c[r]);
    return penalty * norm1(c);
  }
  double defect = 0.0, costs = 0.0;
  for (std::size_t r = 0; r < c.size(); ++r) {
    const double beyond = excess(r, c[r]);
    if (linear_[r] == infinity) {
      defect += beyond;
      stage_costs[stages_[r]] += penalty * beyond;
    } else {
      costs += price(r, beyond);
      stage_costs[stages_[r]] += price(r, beyond);
    }
  }
  return penalty * defect + costs;
}

double RowCosts::largest_price(const std::vector<double>& multipliers) const noexcept {
  if (!has_limits()) return max_abs(multipliers);
  double largest = 0.0;
  for (std::size_t r = 0; r < multipliers.size(); ++r)
    if (linear_[r] == infinity) largest = std::max(largest, std::abs(multipliers[r]));
  return largest;
}

}  // namespace rhec::sparse_sqp
