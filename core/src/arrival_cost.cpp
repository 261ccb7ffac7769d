#include "rhec/core/arrival_cost.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/QR>

namespace rhec {
namespace {

KalmanFilter make_filter(const RheProblem& like) {
  const RheProblem::Setup& setup = like.setup();
  KalmanFilter::Noise noise;
  for (const double w : setup.output_weights) noise.output_variances.push_back(w > 0.0 ? 1.0 / w : 1e12);
  for (const double w : setup.input_weights) noise.input_variances.push_back(w > 0.0 ? 1.0 / w : 1e12);
  noise.parameter_lower = setup.parameter_lower;
  noise.parameter_upper = setup.parameter_upper;
  return {like.shared_model(), std::move(noise), like.substeps()};
}

}  // namespace

ArrivalCost::ArrivalCost(ArrivalKind kind, const RheProblem& like, std::vector<ParameterWalk> walks)
    : kind_(kind), walks_(std::move(walks)), filter_(make_filter(like)) {
  const Model& model = like.model();
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count(), ny = model.output_count();
  initial_covariance_ = filter_.covariance;
  robust_.assign(ny, 1.0);
  inputs_.assign(nu, 0.0);
  scratch_.assign(2 * static_cast<std::size_t>(ny), 0.0);
  ramp_variances_.assign(np, 0.0);
  next_.assign(nx, 0.0);
  jacobian_.assign(static_cast<std::size_t>(nx) * (nx + nu + 2 * np), 0.0);
  predicted_.assign(ny, 0.0);
  output_jacobian_.assign(static_cast<std::size_t>(ny) * nx, 0.0);
  const int unknowns = nx + nu + 2 * np;  // x_0, u_0, p_0 and, on a ramp, its change
  rows_ = Eigen::MatrixXd::Zero(unknowns + ny, unknowns);
  right_ = Eigen::VectorXd::Zero(rows_.rows());
  map_ = spread_ = Eigen::MatrixXd::Zero(nx + np, unknowns);
  shift_ = Eigen::VectorXd::Zero(unknowns);
}

void ArrivalCost::reset(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  filter_.mean = mean;
  filter_.covariance = initial_covariance_ = covariance;
}

void ArrivalCost::write(RheProblem& problem) noexcept {
  problem.arrival_mean = filter_.mean;
  if (kind_ == ArrivalKind::off) {
    problem.arrival_information.setZero();
    return;
  }
  // A covariance that rounding has made singular gets the least ridge that lets it be inverted.
  const double size = filter_.covariance.diagonal().cwiseAbs().maxCoeff();
  double ridge = 0.0;
  for (int attempt = 0; attempt < 12; ++attempt) {
    spread_.leftCols(filter_.mean.size()) = filter_.covariance;
    spread_.leftCols(filter_.mean.size()).diagonal().array() += ridge;
    const Eigen::LLT<Eigen::MatrixXd> factor(spread_.leftCols(filter_.mean.size()));
    if (factor.info() == Eigen::Success) {
      problem.arrival_information.setIdentity();
      factor.solveInPlace(problem.arrival_information);
      break;
    }
    ridge = ridge == 0.0 ? 1e-15 * size : 10.0 * ridge;
  }
  problem.arrival_information = 0.5 * (problem.arrival_information + problem.arrival_information.transpose()).eval();
}

void ArrivalCost::slide(const RheProblem& problem, const Iterate& solution, const std::vector<Border>& borders,
                        bool mean_is_lost) noexcept {
  const int nx = problem.model().state_count(), np = problem.model().parameter_count();
  for (int j = 0; j < np; ++j) ramp_variances_[j] = borders[j].leaves_as_ramp ? borders[j].ramp_variance : 0.0;
  switch (kind_ == ArrivalKind::ekf && mean_is_lost ? ArrivalKind::smoothing : kind_) {
    case ArrivalKind::ekf: filter_first_interval(problem, solution); break;
    case ArrivalKind::smoothing: smooth_first_interval(problem, solution); break;
    case ArrivalKind::constant:
    case ArrivalKind::off:
      for (int j = 0; j < nx + np; ++j) filter_.mean[j] = solution.state(1)[j];
      filter_.covariance = initial_covariance_;
      return;
  }
  for (int j = 0; j < np; ++j) {
    const Border& border = borders[j];
    filter_.add_parameter_variance(j, walks_[j].forgetting * walks_[j].forgetting);
    if (!border.reached) continue;
    if (border.neighbour_sigma) {
      filter_.add_parameter_variance(j, *border.neighbour_sigma * *border.neighbour_sigma * border.steps);
    } else {
      filter_.restart_parameter(j, walks_[j].restart_sigma * walks_[j].restart_sigma);
    }
  }
}

void ArrivalCost::filter_first_interval(const RheProblem& problem, const Iterate& solution) noexcept {
  problem.robust_weights(solution, 0, robust_.data(), scratch_);
  filter_.update(problem.output(0), robust_.data());
  problem.inputs_on(solution, 0, inputs_.data());
  const bool ramp = std::any_of(ramp_variances_.begin(), ramp_variances_.end(), [](double v) { return v > 0.0; });
  filter_.predict(problem.measured_input(0), inputs_.data(), problem.duration(0), ramp ? ramp_variances_.data() : nullptr);
}

/// Rows in [dx; du; dp; dramp] about the solution: prior, outputs, measured inputs, ramp. Their QR factor R gives the
/// covariance R^-1 R^-T of what leaves, which the linearised dynamics carry over to the next node.
void ArrivalCost::smooth_first_interval(const RheProblem& problem, const Iterate& solution) noexcept {
  const Model& model = problem.model();
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count(), ny = model.output_count();
  const int n = nx + np, unknowns = nx + nu + 2 * np;
  const double* x = solution.state(0);
  const double* p = x + nx;
  problem.inputs_on(solution, 0, inputs_.data());
  problem.robust_weights(solution, 0, robust_.data(), scratch_);
  Model::Nodes nodes;
  nodes.count = 1;
  nodes.states = x;
  nodes.outputs = predicted_.data();
  nodes.jacobians = output_jacobian_.data();
  model.observe(nodes);
  const double duration = problem.duration(0);
  Model::Intervals step;
  step.count = 1;
  step.states = x;
  step.inputs = inputs_.data();
  step.parameters = step.parameters_end = p;
  step.durations = &duration;
  step.substeps = problem.substeps();
  step.next_states = next_.data();
  step.jacobians = jacobian_.data();
  model.integrate(step);

  rows_.setZero();
  right_.setZero();
  // Prior: L^-1 ([x; p] + [dx; dp] - mean), with Pi = L L'.
  Eigen::MatrixXd whitening = Eigen::MatrixXd::Identity(n, n);
  const double ridge = 1e-15 * filter_.covariance.diagonal().maxCoeff();
  const Eigen::LLT<Eigen::MatrixXd> factor(filter_.covariance + ridge * Eigen::MatrixXd::Identity(n, n));
  factor.matrixL().solveInPlace(whitening);
  const Eigen::VectorXd error = Eigen::Map<const Eigen::VectorXd>(x, n) - filter_.mean;
  rows_.topLeftCorner(n, nx) = whitening.leftCols(nx);
  rows_.block(0, nx + nu, n, np) = whitening.rightCols(np);
  right_.head(n) = -whitening * error;
  int row = n;
  for (int j = 0; j < nu; ++j, ++row) {
    const double measured = problem.measured_input(0)[j];
    const bool missing = std::isnan(measured);
    const double sigma =
        missing ? 100.0 * model.description().inputs[j].scale : std::sqrt(filter_.noise().input_variances[j]);
    rows_(row, nx + j) = 1.0 / sigma;
    right_[row] = missing ? 0.0 : (measured - inputs_[j]) / sigma;
  }
  for (int j = 0; j < np; ++j, ++row) {
    // No ramp: no change, by a row of any weight, since nothing else speaks of that column.
    rows_(row, nx + nu + np + j) = ramp_variances_[j] > 0.0 ? 1.0 / std::sqrt(ramp_variances_[j]) : 1.0;
  }
  for (int j = 0; j < ny; ++j, ++row) {
    const double y = problem.output(0)[j];
    if (std::isnan(y)) continue;
    const double difference = model.description().outputs[j].is_angle ? angle_difference(y, predicted_[j]) : y - predicted_[j];
    const double weight = std::sqrt(robust_[j] / filter_.noise().output_variances[j]);
    for (int c = 0; c < nx; ++c) rows_(row, c) = weight * output_jacobian_[c * ny + j];
    right_[row] = weight * difference;
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(rows_);
  shift_ = qr.solve(right_);

  map_.setZero();
  for (int c = 0; c < nx + nu + np; ++c)
    for (int r = 0; r < nx; ++r) map_(r, c) = jacobian_[c * nx + r];
  for (int c = 0; c < np; ++c) {
    const int change = nx + nu + np + c;
    for (int r = 0; r < nx; ++r) {
      const double by_end = jacobian_[change * nx + r];
      map_(r, nx + nu + c) += by_end;
      map_(r, change) = ramp_variances_[c] > 0.0 ? by_end : 0.0;
    }
    map_(nx + c, nx + nu + c) = 1.0;
    map_(nx + c, change) = ramp_variances_[c] > 0.0 ? 1.0 : 0.0;
  }
  filter_.mean = map_ * shift_;
  for (int r = 0; r < nx; ++r) filter_.mean[r] += next_[r];
  for (int r = 0; r < np; ++r) filter_.mean[nx + r] += p[r];
  // covariance = (M R^-1)(M R^-1)'
  spread_ = map_;
  qr.matrixQR().topRows(unknowns).triangularView<Eigen::Upper>().solveInPlace<Eigen::OnTheRight>(spread_);
  filter_.covariance = spread_ * spread_.transpose();
}

}  // namespace rhec
