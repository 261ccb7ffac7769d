#include "condensed.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"

namespace rhec::nlopt {
namespace {

// Of a slack without a quadratic weight, relative to its linear one.
constexpr double least_slack_curvature = 1e-8;

}  // namespace

CondensedProblem::CondensedProblem(const Ocp& ocp)
    : limit_values_((static_cast<std::size_t>(ocp.capacity().intervals) + 1) * ocp.capacity().limit_row()),
      point_(ocp.capacity()),
      adjoint_(ocp.capacity()),
      qp_(ocp.capacity()),
      scratch_(ocp.scratch_size()) {}

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

/// With a Feedback, bounds of a control are those of a row.
bool CondensedProblem::add_control(int interval, int control) {
  const double lower = ocp_->control_lower(interval)[control], upper = ocp_->control_upper(interval)[control];
  if (!feedback_ || lower == upper || !(lower <= upper)) return add({false, interval, control}, lower, upper);
  add({false, interval, control}, -HUGE_VAL, HUGE_VAL);
  add_row({Row::Of::control, interval, control}, lower, upper);
  return true;
}

void CondensedProblem::add_row(const Row& row, double lower, double upper) {
  if (!std::isfinite(lower) && !std::isfinite(upper)) return;
  rows_.push_back(row);
  row_lower_list_.push_back(lower);
  row_upper_list_.push_back(upper);
}

bool CondensedProblem::take(const Ocp& ocp, std::shared_ptr<const Feedback> feedback) {
  ocp_ = &ocp;
  feedback_ = std::move(feedback);
  const int N = ocp.intervals();
  for (auto* list : {&variables_, &fixed_}) list->clear();
  rows_.clear();
  slacks_.clear();
  penalties_.clear();
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
    for (int j = 0; j < ocp.control_count(i); ++j) consistent = consistent && add_control(i, j);
    columns_before_.push_back(variables());
    for (int j = 0; j < ocp.state_count(i + 1); ++j) {
      const double lower = ocp.state_lower(i + 1)[j], upper = ocp.state_upper(i + 1)[j];
      consistent = consistent && lower <= upper;
      add_row({Row::Of::state, i + 1, j}, lower, upper);
    }
  }
  if (capacity.limits > 0) add_limits();
  for (std::size_t row = 0; row < rows_.size(); ++row)
    consistent = consistent && row_lower_list_[row] <= row_upper_list_[row];
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

/// Rows of limits, with slacks behind the other variables.
void CondensedProblem::add_limits() {
  for (int i = 0; i <= ocp_->intervals(); ++i) {
    for (int r = 0; r < ocp_->limit_count(i); ++r) {
      const double lower = ocp_->limit_lower(i)[r], upper = ocp_->limit_upper(i)[r], linear = ocp_->limit_linear(i)[r];
      if (!std::isfinite(lower) && !std::isfinite(upper)) continue;
      if (linear == 0.0) {
        penalties_.push_back({i, r});
        continue;
      }
      Row row{Row::Of::limit, i, r};
      const auto add_slack = [&](bool is_above) {
        slacks_.push_back({i, r, is_above});
        lower_list_.push_back(0.0);
        upper_list_.push_back(HUGE_VAL);
        return variables() - 1;
      };
      if (std::isfinite(linear) && std::isfinite(lower)) row.below = add_slack(false);
      if (std::isfinite(linear) && std::isfinite(upper)) row.above = add_slack(true);
      add_row(row, lower, upper);
    }
  }
}

double CondensedProblem::excess(int stage, int limit) const noexcept {
  const double value = limit_value(stage, limit);
  if (value > ocp_->limit_upper(stage)[limit]) return value - ocp_->limit_upper(stage)[limit];
  return std::min(0.0, value - ocp_->limit_lower(stage)[limit]);
}

/// What a slack costs at the margin.
double CondensedProblem::slack_weight(const Slack& of, double value) const noexcept {
  return ocp_->limit_linear(of.stage)[of.component] + ocp_->limit_quadratic(of.stage)[of.component] * value;
}

double CondensedProblem::row_value(int number) const noexcept {
  const Row& row = rows_[static_cast<std::size_t>(number)];
  if (row.of == Row::Of::state) return point_.state(row.stage)[row.component];
  if (row.of == Row::Of::control) return point_.control(row.stage)[row.component];
  double value = limit_value(row.stage, row.component);
  if (row.below >= 0) value += x_[row.below];
  if (row.above >= 0) value -= x_[row.above];
  return value;
}

double CondensedProblem::objective_of_iterate() const noexcept {
  double sum = stage_objective_;
  for (int i = 0; i <= ocp_->intervals() && !limit_values_.empty(); ++i)
    sum += limit_costs(*ocp_, i, limit_values_.data() + static_cast<std::ptrdiff_t>(i) * ocp_->capacity().limit_row())
               .slack;
  return sum;
}

CondensedProblem::Vector CondensedProblem::slack_curvature() const {
  Vector curvature = Vector::Zero(variables());
  auto column = static_cast<Eigen::Index>(variables_.size());
  for (const Slack& slack : slacks_) curvature[column++] = slack_weight(slack, 0.0);
  return curvature;
}

CondensedProblem::Vector CondensedProblem::with_fitting_slacks() const {
  Vector x = x_;
  auto column = static_cast<Eigen::Index>(variables_.size());
  for (const Slack& slack : slacks_) {
    const double beyond = excess(slack.stage, slack.component);
    x[column++] = std::max(0.0, slack.is_above ? beyond : -beyond);
  }
  return x;
}

CondensedProblem::Vector CondensedProblem::read(const Iterate& iterate) const {
  Vector x = Vector::Zero(variables());
  for (int k = 0; k < static_cast<int>(variables_.size()); ++k) {
    const Entry& e = variables_[static_cast<std::size_t>(k)];
    double value = e.is_state ? iterate.state(0)[e.component] : iterate.control(e.stage)[e.component];
    if (feedback_ && !e.is_state) value -= feedback_->of(e.stage, e.component, iterate);
    x[k] = std::min(std::max(value, lower_[k]), upper_[k]);
  }
  return x;
}

void CondensedProblem::simulate() {
  if (!feedback_) return ocp_->simulate(point_, scratch_);
  for (int i = 0; i < ocp_->intervals(); ++i) {
    for (int j = 0; j < ocp_->control_count(i); ++j) point_.control(i)[j] += feedback_->of(i, j, point_);
    ocp_->simulate_interval(i, point_, scratch_);
  }
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
  simulate();
  objective_ = stage_objective_ = ocp_->evaluate(point_, nullptr, scratch_);
  is_finite_ = std::isfinite(objective_) && rhec::is_finite(*ocp_, point_);
  if (!limit_values_.empty() && is_finite_) {
    ocp_->evaluate_limits(point_, limit_values_.data(), scratch_);
    auto column = static_cast<Eigen::Index>(variables_.size());
    for (const Slack& slack : slacks_) {
      const double value = x_[column++];
      objective_ += 0.5 * (slack_weight(slack, 0.0) + slack_weight(slack, value)) * value;
    }
    for (const Penalty& penalty : penalties_) {
      const double beyond = excess(penalty.stage, penalty.component);
      objective_ += 0.5 * ocp_->limit_quadratic(penalty.stage)[penalty.component] * beyond * beyond;
    }
    for (const Row& row : rows_)
      if (row.of == Row::Of::limit) is_finite_ = is_finite_ && std::isfinite(limit_value(row.stage, row.component));
    is_finite_ = is_finite_ && std::isfinite(objective_);
  }
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

void CondensedProblem::find_costates(Iterate& multipliers) const noexcept {
  if (!feedback_) return set_costates(qp_, multipliers);
  for (int i = ocp_->intervals(); i >= 0; --i) {
    if (i == 0 && !qp_.initial_state_is_given) {
      std::fill_n(multipliers.costate(0), qp_.states(0), 0.0);
      break;
    }
    for (int j = 0; j < qp_.states(i); ++j) multipliers.costate(i)[j] = reduced_gradient({true, i, j}, multipliers);
  }
}

/// The gradient of the Lagrangian with respect to one state or control, with the costates of the next node; with a
/// Feedback, that of a state includes what the controls do that follow it.
double CondensedProblem::reduced_gradient(const Entry& e, const Iterate& multipliers) const noexcept {
  const int i = e.stage, N = ocp_->intervals();
  double sum = e.is_state ? qp_.q(i)[e.component] : qp_.r(i)[e.component];
  sum += (e.is_state ? multipliers.state_bound(i) : multipliers.control_bound(i))[e.component];
  if (i < N) {
    const double* column = qp_.AB(i) + e.component + (e.is_state ? 0 : qp_.capacity().states);
    for (int j = 0; j < qp_.states(i + 1); ++j) sum += column[j * qp_.stride()] * multipliers.costate(i + 1)[j];
  }
  if (qp_.limits(i) > 0) {
    const double* column = qp_.G(i) + e.component + (e.is_state ? 0 : qp_.capacity().states);
    for (int r = 0; r < qp_.limits(i); ++r) sum += column[r * qp_.stride()] * multipliers.limit_bound(i)[r];
  }
  if (!feedback_ || !e.is_state || i == N) return sum;
  for (int j = 0; j < qp_.controls(i); ++j)
    if (const double gain = feedback_->gains[static_cast<std::size_t>(i)](j, e.component); gain != 0.0)
      sum += gain * reduced_gradient({false, i, j}, multipliers);
  return sum;
}

/// The multipliers of limits whose violation is in f: what it costs at the margin.
void CondensedProblem::write_penalties(Iterate& multipliers) const noexcept {
  for (const Penalty& of : penalties_)
    multipliers.limit_bound(of.stage)[of.component] =
        ocp_->limit_quadratic(of.stage)[of.component] * excess(of.stage, of.component);
}

const CondensedProblem::Vector& CondensedProblem::gradient() {
  linearise();
  if (has_gradient_) return gradient_;
  adjoint_.clear_multipliers();
  write_penalties(adjoint_);
  find_costates(adjoint_);
  gradient_.resize(variables());
  for (std::size_t k = 0; k < variables_.size(); ++k)
    gradient_[static_cast<Eigen::Index>(k)] = reduced_gradient(variables_[k], adjoint_);
  auto column = static_cast<Eigen::Index>(variables_.size());
  for (const Slack& slack : slacks_) {
    gradient_[column] = slack_weight(slack, x_[column]);
    ++column;
  }
  has_gradient_ = true;
  return gradient_;
}

void CondensedProblem::compute_sensitivities() {
  linearise();
  if (has_sensitivities_) return;
  const int N = ocp_->intervals();
  sensitivities_.resize(static_cast<std::size_t>(N) + 1);
  if (feedback_) control_sensitivities_.resize(static_cast<std::size_t>(N));
  const auto columns = [&](int node) { return columns_before_[static_cast<std::size_t>(node)]; };
  Matrix& first = sensitivities_[0];
  first.setZero(qp_.states(0), columns(0));
  for (int k = 0; k < columns(0); ++k) first(variables_[static_cast<std::size_t>(k)].component, k) = 1.0;
  for (int i = 0; i < N; ++i) {
    Matrix& next = sensitivities_[static_cast<std::size_t>(i) + 1];
    next.setZero(qp_.states(i + 1), columns(i + 1));
    next.leftCols(columns(i)).noalias() = A_of(qp_, i) * sensitivities_[static_cast<std::size_t>(i)];
    if (feedback_) {
      Matrix& of_controls = control_sensitivities_[static_cast<std::size_t>(i)];
      of_controls.setZero(qp_.controls(i), columns(i + 1));
      of_controls.leftCols(columns(i)).noalias() =
          feedback_->gains[static_cast<std::size_t>(i)] * sensitivities_[static_cast<std::size_t>(i)];
      for (int j = 0; j < qp_.controls(i); ++j)
        if (const int column = column_of(i, j); column >= 0) of_controls(j, column) = 1.0;
      next.noalias() += B_of(qp_, i) * of_controls;
      continue;
    }
    for (int j = 0; j < qp_.controls(i); ++j) {
      const int column = column_of(i, j);
      if (column >= 0) next.col(column) = B_of(qp_, i).col(j);
    }
  }
  jacobian_.setZero(rows(), variables());
  for (int row = 0; row < rows(); ++row) {
    const Row& of = rows_[static_cast<std::size_t>(row)];
    if (of.of == Row::Of::limit) {
      Eigen::RowVectorXd derivatives = Eigen::RowVectorXd::Zero(variables());
      add_limit_row(of.stage, of.component, derivatives);
      if (of.below >= 0) derivatives[of.below] = 1.0;
      if (of.above >= 0) derivatives[of.above] = -1.0;
      jacobian_.row(row) = derivatives;
    } else {
      const Matrix& entries =
          (of.of == Row::Of::state ? sensitivities_ : control_sensitivities_)[static_cast<std::size_t>(of.stage)];
      jacobian_.row(row).head(entries.cols()) = entries.row(of.component);
    }
  }
  has_sensitivities_ = true;
}

void CondensedProblem::add_limit_row(int stage, int limit, Eigen::Ref<Eigen::RowVectorXd> row) {
  const Matrix& node = sensitivities_[static_cast<std::size_t>(stage)];
  const double* G = qp_.G(stage) + static_cast<std::ptrdiff_t>(limit) * qp_.stride();
  row.head(node.cols()) += Eigen::Map<const Eigen::RowVectorXd>(G, node.rows()) * node;
  if (feedback_ && stage < ocp_->intervals()) {
    const Matrix& of_controls = control_sensitivities_[static_cast<std::size_t>(stage)];
    row.head(of_controls.cols()) +=
        Eigen::Map<const Eigen::RowVectorXd>(G + qp_.capacity().states, of_controls.rows()) * of_controls;
    return;
  }
  for (int j = 0; j < qp_.controls(stage); ++j)
    if (const int column = column_of(stage, j); column >= 0) row[column] += G[qp_.capacity().states + j];
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
    if (feedback_) {
      const Matrix& W = control_sensitivities_[static_cast<std::size_t>(i)];
      const Eigen::Index width = W.cols();
      product.noalias() = R_of(qp_, i) * W;
      hessian_.topLeftCorner(width, width).noalias() += W.transpose() * product;
      product.noalias() = S_of(qp_, i) * G;
      product = Matrix(W.transpose() * product);
      hessian_.topLeftCorner(width, columns) += product;
      hessian_.topLeftCorner(columns, width) += product.transpose();
      continue;
    }
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
  auto column = static_cast<Eigen::Index>(variables_.size());
  for (const Slack& slack : slacks_) {
    // Without any curvature a slack would have no Newton step where its row is not active.
    const double linear = slack_weight(slack, 0.0);
    hessian_(column, column) = std::max(slack_weight(slack, 1.0) - linear, least_slack_curvature * (1.0 + linear));
    ++column;
  }
  for (const Penalty& of : penalties_) {
    if (excess(of.stage, of.component) == 0.0) continue;
    Eigen::RowVectorXd derivatives = Eigen::RowVectorXd::Zero(n);
    add_limit_row(of.stage, of.component, derivatives);
    hessian_ += ocp_->limit_quadratic(of.stage)[of.component] * derivatives.transpose() * derivatives;
  }
  return hessian_;
}

void CondensedProblem::set_multipliers(const Vector& multipliers) {
  linearise();
  point_.clear_multipliers();
  const auto put = [&](const Entry& e, double value) {
    (e.is_state ? point_.state_bound(e.stage) : point_.control_bound(e.stage))[e.component] = value;
  };
  // With the rows' multipliers set, those of fixed variables follow from stationarity. A Feedback leaves these alone.
  adjoint_.clear_multipliers();
  for (Iterate* of : {&point_, &adjoint_}) {
    write_penalties(*of);
    for (int k = 0; k < rows(); ++k) {
      const Row& row = rows_[static_cast<std::size_t>(k)];
      (row.of == Row::Of::limit   ? of->limit_bound(row.stage)
       : row.of == Row::Of::state ? of->state_bound(row.stage)
                                  : of->control_bound(row.stage))[row.component] = multipliers[variables() + k];
    }
  }
  find_costates(adjoint_);
  for (const Entry& e : fixed_) put(e, -reduced_gradient(e, adjoint_));
  for (std::size_t k = 0; k < variables_.size(); ++k)
    if (feedback_ == nullptr || variables_[k].is_state) put(variables_[k], multipliers[static_cast<Eigen::Index>(k)]);
  find_costates(point_);
}

KktResidual CondensedProblem::residual() {
  linearise();
  return kkt_residual(qp_, point_);
}

}  // namespace rhec::nlopt
