#include "limit_variables.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/base/infinity.hpp"

namespace rhec::ipopt {

void LimitVariables::take(const Ocp& ocp, const SparseNlp& nlp) {
  variables_.clear();
  if (ocp.capacity().limits == 0) return;
  for (int i = 0; i <= ocp.intervals(); ++i) {
    for (int r = 0; r < nlp.limit_count(i); ++r) {
      const double lower = ocp.limit_lower(i)[r], upper = ocp.limit_upper(i)[r], linear = ocp.limit_linear(i)[r],
                   quadratic = ocp.limit_quadratic(i)[r];
      const bool is_hard = linear == infinity;
      const auto add = [&](Kind kind, double factor, double least, double most) {
        const bool costs = kind != Kind::value;
        const Variable v{kind,
                         nlp.limit_start(i) + r,
                         factor,
                         least,
                         most,
                         {is_hard ? -infinity : lower, is_hard ? infinity : upper},
                         costs ? linear : 0.0,
                         costs ? quadratic : 0.0};
        variables_.push_back(v);
      };
      if (linear == 0.0) {
        add(Kind::free, -1.0, -infinity, infinity);
        continue;
      }
      add(Kind::value, -1.0, lower, upper);
      if (is_hard) continue;
      if (lower > -infinity) add(Kind::lower, 1.0, 0.0, infinity);
      if (upper < infinity) add(Kind::upper, -1.0, 0.0, infinity);
    }
  }
}

double LimitVariables::Variable::slack(double value) const noexcept {
  if (kind != Kind::free) return value;
  return value - std::min(std::max(value, beyond[0]), beyond[1]);
}

void LimitVariables::bounds(double* lower, double* upper) const noexcept {
  for (const Variable& variable : variables_) {
    *lower++ = variable.lower;
    *upper++ = variable.upper;
  }
}

void LimitVariables::start(const double* c, const double* multipliers, double* values,
                           double* bound_multipliers) const noexcept {
  for (const Variable& of : variables_) {
    const double value = c[of.row], multiplier = multipliers ? multipliers[of.row] : 0.0;
    const double below = std::max(0.0, of.beyond[0] - value), above = std::max(0.0, value - of.beyond[1]);
    double at = 0.0, pull = 0.0;
    switch (of.kind) {
      case Kind::value:
        at = value + below - above;
        pull = multiplier;
        break;
      case Kind::lower:
      case Kind::upper:
        at = of.kind == Kind::lower ? below : above;
        pull = std::min(0.0, of.factor * -multiplier - of.linear - of.quadratic * at);
        break;
      case Kind::free:
        at = value;
        break;
    }
    *values++ = at;
    if (bound_multipliers) *bound_multipliers++ = pull;
  }
}

double LimitVariables::cost(const double* values) const noexcept {
  double sum = 0.0;
  for (const Variable& variable : variables_) {
    const double slack = variable.slack(*values++);
    sum += (variable.linear + 0.5 * variable.quadratic * slack) * slack;
  }
  return sum;
}

void LimitVariables::gradient(const double* values, double* derivatives) const noexcept {
  for (const Variable& variable : variables_)
    *derivatives++ = variable.linear + variable.quadratic * variable.slack(*values++);
}

void LimitVariables::add_to(const double* values, double* c) const noexcept {
  for (const Variable& variable : variables_) c[variable.row] += variable.factor * *values++;
}

void LimitVariables::jacobian_pattern(int first_variable, int* rows, int* columns) const noexcept {
  for (const Variable& variable : variables_) {
    *rows++ = variable.row;
    *columns++ = first_variable++;
  }
}

void LimitVariables::jacobian(double* entries) const noexcept {
  for (const Variable& variable : variables_) *entries++ = variable.factor;
}

void LimitVariables::hessian_pattern(int first_variable, int* rows, int* columns) const noexcept {
  for (int k = 0; k < count(); ++k) rows[k] = columns[k] = first_variable + k;
}

void LimitVariables::hessian(const double* values, double* entries) const noexcept {
  for (const Variable& variable : variables_) {
    const bool has_curvature = variable.kind != Kind::free || variable.slack(*values) != 0.0;
    *entries++ = has_curvature ? variable.quadratic : 0.0;
    ++values;
  }
}

}  // namespace rhec::ipopt
