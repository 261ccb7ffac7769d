#include "condensed.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"

namespace rhec::nlopt {

CondensedProblem::CondensedProblem(const Ocp& ocp)
    : point_(ocp.capacity()), adjoint_(ocp.capacity()), qp_(ocp.capacity()), scratch_(ocp.scratch_size()) {}

bool CondensedProblem::add(const Entry& entry, double lower, double upper) {
  if (!(lower <= upper)) return false;
  if (lower == upper) {
    fixed_.push_back(entry);
    fixed_values_.push_back(lower);
    return true;
  }
  if (!entry.is_state) {
    column_of(entry.stage, entry.component) = variables();
  }
  variables_.push_back(entry);
  lower_list_.push_back(lower);
  upper_list_.push_back(upper);
  return true;
}

bool CondensedProblem::take(const Ocp& ocp) {
  ocp_ = &ocp;
  const int N = ocp.intervals();
  for (auto* list : {&variables_, &fixed_, &rows_}) list->clear();
  for (auto* list : {&fixed_values_, &lower_list_, &upper_list_, &row_lower_list_, &row_upper_list_}) list->clear();
  const Capacity capacity = ocp.capacity();
  control_columns_.assign(static_cast<std::size_t>(capacity.intervals) * static_cast<std::size_t>(capacity.controls),
                          -1);
  columns_before_.clear();
  point_.clear_multipliers();
  bool consistent = true;
  if (!ocp.initial_state()) {
    for (int j = 0; j < ocp.state_count(0); ++j)
      consistent = consistent && add({true, 0, j}, ocp.state_lower(0)[j], ocp.state_upper(0)[j]);
  }
  columns_before_.push_back(variables());
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < ocp.control_count(i); ++j)
      consistent = consistent && add({false, i, j}, ocp.control_lower(i)[j], ocp.control_upper(i)[j]);
    columns_before_.push_back(variables());
    for (int j = 0; j < ocp.state_count(i + 1); ++j) {
      const double lower = ocp.state_lower(i + 1)[j], upper = ocp.state_upper(i + 1)[j];
      consistent = consistent && lower <= upper;
      if (!std::isfinite(lower) && !std::isfinite(upper)) continue;
      rows_.push_back({true, i + 1, j});
      row_lower_list_.push_back(lower);
      row_upper_list_.push_back(upper);
    }
  }
  const auto copy = [](const std::vector<double>& from) -> Vector {
    return Eigen::Map<const Vector>(from.data(), static_cast<Eigen::Index>(from.size()));
  };
  lower_ = copy(lower_list_);
  upper_ = copy(upper_list_);
  row_lower_ = copy(row_lower_list_);
  row_upper_ = copy(row_upper_list_);
  is_simulated_ = is_linearised_ = has_gradient_ = has_sensitivities_ = false;
  simulations_ = linearisations_ = 0;
  return consistent;
}

CondensedProblem::Vector CondensedProblem::read(const Iterate& iterate) const {
  Vector x(variables());
  for (int k = 0; k < variables(); ++k) {
    const Entry& e = variables_[static_cast<std::size_t>(k)];
    const double value = e.is_state ? iterate.state(0)[e.component] : iterate.control(e.stage)[e.component];
    x[k] = std::min(std::max(value, lower_[k]), upper_[k]);
  }
  return x;
}

bool CondensedProblem::move_to(const Vector& x) {
  if (is_simulated_ && x == x_) return is_finite_;
  x_ = x;
  is_simulated_ = true;
  is_linearised_ = has_gradient_ = has_sensitivities_ = false;
  ++simulations_;
  if (const double* given = ocp_->initial_state()) std::copy_n(given, ocp_->state_count(0), point_.state(0));
  const auto put = [&](const Entry& e, double value) {
    (e.is_state ? point_.state(0) : point_.control(e.stage))[e.component] = value;
  };
  for (std::size_t k = 0; k < fixed_.size(); ++k) put(fixed_[k], fixed_values_[k]);
  for (std::size_t k = 0; k < variables_.size(); ++k) put(variables_[k], x_[static_cast<Eigen::Index>(k)]);
  ocp_->simulate(point_, scratch_);
  objective_ = ocp_->evaluate(point_, nullptr, scratch_);
  is_finite_ = std::isfinite(objective_) && rhec::is_finite(*ocp_, point_);
  return is_finite_;
}

double CondensedProblem::violation() const noexcept {
  double worst = 0.0;
  for (int k = 0; k < variables(); ++k) worst = std::max({worst, lower_[k] - x_[k], x_[k] - upper_[k]});
  for (int k = 0; k < rows(); ++k)
    worst = std::max({worst, row_lower_[k] - row_value(k), row_value(k) - row_upper_[k]});
  return worst;
}

void CondensedProblem::linearise() {
  if (is_linearised_) return;
  ocp_->linearise(all_stages(*ocp_), point_, Hessian::gauss_newton, qp_, scratch_);
  is_linearised_ = true;
  ++linearisations_;
}

double CondensedProblem::reduced_gradient(const Entry& e) const noexcept {
  // `adjoint_` has the costates of nodes 1 .. N; the costate of a free node 0 is this gradient.
  const int i = e.stage, N = ocp_->intervals();
  double sum = e.is_state ? qp_.q(0)[e.component] : qp_.r(i)[e.component];
  if (i < N) {
    const double* column = qp_.AB(i) + e.component + (e.is_state ? 0 : qp_.capacity().states);
    for (int j = 0; j < qp_.states(i + 1); ++j) sum += column[j * qp_.stride()] * adjoint_.costate(i + 1)[j];
  }
  return sum;
}

const CondensedProblem::Vector& CondensedProblem::gradient() {
  linearise();
  if (has_gradient_) return gradient_;
  adjoint_.clear_multipliers();
  set_costates(qp_, adjoint_);
  gradient_.resize(variables());
  for (std::size_t k = 0; k < variables_.size(); ++k)
    gradient_[static_cast<Eigen::Index>(k)] = reduced_gradient(variables_[k]);
  has_gradient_ = true;
  return gradient_;
}

void CondensedProblem::compute_sensitivities() {
  linearise();
  if (has_sensitivities_) return;
  const int N = ocp_->intervals();
  sensitivities_.resize(static_cast<std::size_t>(N) + 1);
  const auto columns = [&](int node) { return columns_before_[static_cast<std::size_t>(node)]; };
  Matrix& first = sensitivities_[0];
  first.setZero(qp_.states(0), columns(0));
  for (int k = 0; k < columns(0); ++k) first(variables_[static_cast<std::size_t>(k)].component, k) = 1.0;
  for (int i = 0; i < N; ++i) {
    Matrix& next = sensitivities_[static_cast<std::size_t>(i) + 1];
    next.setZero(qp_.states(i + 1), columns(i + 1));
    next.leftCols(columns(i)).noalias() = A_of(qp_, i) * sensitivities_[static_cast<std::size_t>(i)];
    for (int j = 0; j < qp_.controls(i); ++j) {
      const int column = column_of(i, j);
      if (column >= 0) next.col(column) = B_of(qp_, i).col(j);
    }
  }
  jacobian_.setZero(rows(), variables());
  for (int row = 0; row < rows(); ++row) {
    const Entry& e = rows_[static_cast<std::size_t>(row)];
    const Matrix& node = sensitivities_[static_cast<std::size_t>(e.stage)];
    jacobian_.row(row).head(node.cols()) = node.row(e.component);
  }
  has_sensitivities_ = true;
}

const CondensedProblem::Matrix& CondensedProblem::jacobian() {
  compute_sensitivities();
  return jacobian_;
}

const CondensedProblem::Matrix& CondensedProblem::hessian(Hessian kind) {
  compute_sensitivities();
  // First derivatives do not depend on the kind of Hessian, so what was derived from them stays valid.
  ocp_->linearise(all_stages(*ocp_), point_, kind, qp_, scratch_);
  const int N = ocp_->intervals(), n = variables();
  hessian_.setZero(n, n);
  Matrix product;
  for (int i = 0; i <= N; ++i) {
    const Matrix& G = sensitivities_[static_cast<std::size_t>(i)];
    const Eigen::Index columns = G.cols();
    product.noalias() = Q_of(qp_, i) * G;
    hessian_.topLeftCorner(columns, columns).noalias() += G.transpose() * product;
    if (i == N) break;
    product.noalias() = S_of(qp_, i) * G;
    for (int j = 0; j < qp_.controls(i); ++j) {
      const int row = column_of(i, j);
      if (row < 0) continue;
      hessian_.row(row).head(columns) += product.row(j);
      hessian_.col(row).head(columns) += product.row(j).transpose();
      for (int k = 0; k < qp_.controls(i); ++k) {
        const int column = column_of(i, k);
        if (column >= 0) hessian_(row, column) += R_of(qp_, i)(j, k);
      }
    }
  }
  return hessian_;
}

void CondensedProblem::set_multipliers(const Vector& multipliers) {
  linearise();
  point_.clear_multipliers();
  const auto put = [&](const Entry& e, double value) {
    (e.is_state ? point_.state_bound(e.stage) : point_.control_bound(e.stage))[e.component] = value;
  };
  for (int k = 0; k < rows(); ++k) put(rows_[static_cast<std::size_t>(k)], multipliers[variables() + k]);
  // With the rows' multipliers set, those of fixed variables follow from stationarity.
  adjoint_.clear_multipliers();
  for (int k = 0; k < rows(); ++k) {
    const Entry& e = rows_[static_cast<std::size_t>(k)];
    adjoint_.state_bound(e.stage)[e.component] = multipliers[variables() + k];
  }
  set_costates(qp_, adjoint_);
  for (const Entry& e : fixed_) put(e, -reduced_gradient(e));
  for (int k = 0; k < variables(); ++k) put(variables_[static_cast<std::size_t>(k)], multipliers[k]);
  set_costates(qp_, point_);
}

KktResidual CondensedProblem::residual() {
  linearise();
  return kkt_residual(qp_, point_);
}

}  // namespace rhec::nlopt
