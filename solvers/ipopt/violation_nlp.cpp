#include "violation_nlp.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rhec::ipopt {
namespace {

/// Weight of the distance from the start: the violation alone leaves many directions open, such as both slacks of a
/// limit together. With less of it Ipopt takes several times the iterations.
constexpr double proximity = 1e-5;
/// How far from a bound an interior point may end that would be at it.
constexpr double barrier_gap = 1e-5;
constexpr double unbounded = 1e300;

}  // namespace

ViolationNlp::ViolationNlp(OcpNlp& of, Spectator& spectator)
    : of_(of),
      spectator_(spectator),
      largest_(std::numeric_limits<double>::infinity()),
      slope_(std::numeric_limits<double>::infinity()) {
  IndexStyleEnum style = C_STYLE;
  of_.get_nlp_info(variables_, constraints_, jacobian_entries_, hessian_entries_, style);
  for (auto* vector : {&start_, &point_, &lower_, &upper_, &gradient_}) vector->resize(variables_);
  violations_.resize(constraints_);
  jacobian_.resize(jacobian_entries_);
  jacobian_rows_.resize(jacobian_entries_);
  jacobian_columns_.resize(jacobian_entries_);
  of_.get_bounds_info(variables_, lower_.data(), upper_.data(), constraints_, violations_.data(), violations_.data());
  of_.get_starting_point(variables_, true, start_.data(), false, nullptr, nullptr, constraints_, false, nullptr);
  of_.eval_jac_g(variables_, nullptr, false, constraints_, jacobian_entries_, jacobian_rows_.data(),
                 jacobian_columns_.data(), nullptr);
}

bool ViolationNlp::get_nlp_info(Ipopt::Index& n, Ipopt::Index& m, Ipopt::Index& jacobian_entries,
                                Ipopt::Index& hessian_entries, IndexStyleEnum& index_style) {
  n = variables_ + constraints_;
  m = constraints_;
  jacobian_entries = jacobian_entries_ + constraints_;
  hessian_entries = hessian_entries_ + n;
  index_style = C_STYLE;
  return true;
}

bool ViolationNlp::get_bounds_info(Ipopt::Index n, double* lower, double* upper, Ipopt::Index m,
                                   double* constraint_lower, double* constraint_upper) {
  std::copy(lower_.begin(), lower_.end(), lower);
  std::copy(upper_.begin(), upper_.end(), upper);
  std::fill(lower + variables_, lower + n, -unbounded);
  std::fill(upper + variables_, upper + n, unbounded);
  std::fill_n(constraint_lower, m, 0.0);
  std::fill_n(constraint_upper, m, 0.0);
  return true;
}

bool ViolationNlp::get_starting_point(Ipopt::Index, bool, double* x, bool, double*, double*, Ipopt::Index m, bool,
                                      double*) {
  std::copy(start_.begin(), start_.end(), x);
  return of_.eval_g(variables_, x, true, m, x + variables_);
}

bool ViolationNlp::eval_f(Ipopt::Index n, const double* x, bool, double& objective) {
  double squares = 0.0, distance = 0.0;
  for (int j = 0; j < variables_; ++j) distance += (x[j] - start_[j]) * (x[j] - start_[j]);
  for (int j = variables_; j < n; ++j) squares += x[j] * x[j];
  objective = 0.5 * (squares + proximity * distance);
  return true;
}

bool ViolationNlp::eval_grad_f(Ipopt::Index n, const double* x, bool, double* gradient) {
  for (int j = 0; j < variables_; ++j) gradient[j] = proximity * (x[j] - start_[j]);
  std::copy(x + variables_, x + n, gradient + variables_);
  return true;
}

// Every z is passed on as a new one: not all of these functions pass on that a point is new.

bool ViolationNlp::eval_g(Ipopt::Index, const double* x, bool, Ipopt::Index m, double* constraints) {
  if (!of_.eval_g(variables_, x, true, m, constraints)) return false;
  for (int k = 0; k < m; ++k) constraints[k] -= x[variables_ + k];
  return true;
}

bool ViolationNlp::eval_jac_g(Ipopt::Index, const double* x, bool, Ipopt::Index m, Ipopt::Index, Ipopt::Index* rows,
                              Ipopt::Index* columns, double* values) {
  if (values) {
    std::fill_n(values + jacobian_entries_, m, -1.0);
    return of_.eval_jac_g(variables_, x, true, m, jacobian_entries_, nullptr, nullptr, values);
  }
  std::copy(jacobian_rows_.begin(), jacobian_rows_.end(), rows);
  std::copy(jacobian_columns_.begin(), jacobian_columns_.end(), columns);
  for (int k = 0; k < m; ++k) {
    rows[jacobian_entries_ + k] = k;
    columns[jacobian_entries_ + k] = variables_ + k;
  }
  return true;
}

bool ViolationNlp::eval_h(Ipopt::Index n, const double* x, bool, double objective_factor, Ipopt::Index m,
                          const double* multipliers, bool, Ipopt::Index, Ipopt::Index* rows, Ipopt::Index* columns,
                          double* values) {
  // That of the objective is left out.
  if (!of_.eval_h(variables_, x, values != nullptr, 0.0, m, multipliers, true, hessian_entries_, rows, columns, values))
    return false;
  for (int j = 0; j < n; ++j) {
    if (values)
      values[hessian_entries_ + j] = objective_factor * (j < variables_ ? proximity : 1.0);
    else
      rows[hessian_entries_ + j] = columns[hessian_entries_ + j] = j;
  }
  return true;
}

void ViolationNlp::finalize_solution(Ipopt::SolverReturn, Ipopt::Index, const double* x, const double*, const double*,
                                     Ipopt::Index, const double*, const double*, double, const Ipopt::IpoptData*,
                                     Ipopt::IpoptCalculatedQuantities*) {
  for (int j = 0; j < variables_; ++j) point_[j] = std::clamp(x[j], lower_[j], upper_[j]);
  judge();
}

/// Violation, gradient and slope at the final point; false if they are not finite.
bool ViolationNlp::evaluate() {
  if (!of_.eval_g(variables_, point_.data(), true, constraints_, violations_.data()) ||
      !of_.eval_jac_g(variables_, point_.data(), true, constraints_, jacobian_entries_, nullptr, nullptr,
                      jacobian_.data()))
    return false;
  std::fill(gradient_.begin(), gradient_.end(), 0.0);
  for (int entry = 0; entry < jacobian_entries_; ++entry)
    gradient_[jacobian_columns_[entry]] += jacobian_[entry] * violations_[jacobian_rows_[entry]];
  double squares = 0.0, steepest = 0.0;
  largest_ = 0.0;
  for (const double violation : violations_) {
    largest_ = std::max(largest_, std::abs(violation));
    squares += violation * violation;
  }
  for (int j = 0; j < variables_; ++j)
    steepest = std::max(steepest, std::abs(point_[j] - std::clamp(point_[j] - gradient_[j], lower_[j], upper_[j])));
  slope_ = squares > 0.0 ? steepest / std::sqrt(squares) : 0.0;
  return true;
}

void ViolationNlp::judge() {
  if (!evaluate()) return;
  // Next to bounds that the violation pulls at, the barrier may be all that keeps the point away from them.
  const std::vector<double> within = point_;
  const double slope_within = slope_;
  for (int j = 0; j < variables_; ++j) {
    if (gradient_[j] > 0.0 && point_[j] - lower_[j] <= barrier_gap) point_[j] = lower_[j];
    if (gradient_[j] < 0.0 && upper_[j] - point_[j] <= barrier_gap) point_[j] = upper_[j];
  }
  if (evaluate() && slope_ <= slope_within) return;
  point_ = within;
  evaluate();
}

bool ViolationNlp::intermediate_callback(Ipopt::AlgorithmMode, Ipopt::Index iteration, double, double, double, double,
                                         double, double, double, double, Ipopt::Index, const Ipopt::IpoptData*,
                                         Ipopt::IpoptCalculatedQuantities*) {
  iterations_ = iteration;
  return spectator_.see(0, nullptr);
}

}  // namespace rhec::ipopt
