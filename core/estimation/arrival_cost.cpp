#include "rhec/core/estimation/arrival_cost.hpp"
#include "rhec/core/base/angle.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "missing_inputs.hpp"
#include "rhec/core/base/with_size.hpp"
#include "rhec/core/estimation/measurement.hpp"
#include "rhec/core/qp/small_matrix.hpp"

namespace rhec {
namespace {

// Standard deviation of a variable that is known exactly, as a fraction of its typical magnitude.
constexpr double least_sigma = 1e-9;
// Pivots of a correlation matrix below this are rounding errors.
constexpr double least_pivot = 1e-15;

KalmanFilter make_filter(const RheProblem& like) {
  const RheProblem::Setup& setup = like.setup();
  KalmanFilter::Noise noise;
  for (const double w : setup.output_weights) noise.output_variances.push_back(w > 0.0 ? 1.0 / w : 1e12);
  for (const double w : setup.input_weights) noise.input_variances.push_back(w > 0.0 ? 1.0 / w : 1e12);
  noise.parameter_lower = setup.parameter_lower;
  noise.parameter_upper = setup.parameter_upper;
  return {like.shared_model(), std::move(noise), like.substeps(), setup.most_between};
}

/// Householder reduction of the first m rows, of all columns but the last, in place: afterwards the upper triangle
/// holds R, and the last column is multiplied by Q'.
void triangularise(Eigen::MatrixXd& rows, Eigen::Index m) noexcept {
  const Eigen::Index n = rows.cols() - 1;
  for (Eigen::Index k = 0; k < n; ++k) {
    double square = 0.0;
    for (Eigen::Index r = k; r < m; ++r) square += rows(r, k) * rows(r, k);
    if (square == 0.0) continue;
    const double pivot = rows(k, k) > 0.0 ? -std::sqrt(square) : std::sqrt(square);
    // v = a - pivot e_k; 2 / v'v = -1 / (pivot v_k)
    const double top = rows(k, k) - pivot;
    for (Eigen::Index c = k + 1; c <= n; ++c) {
      double sum = top * rows(k, c);
      for (Eigen::Index r = k + 1; r < m; ++r) sum += rows(r, k) * rows(r, c);
      sum /= pivot * top;
      rows(k, c) += sum * top;
      for (Eigen::Index r = k + 1; r < m; ++r) rows(r, c) += sum * rows(r, k);
    }
    rows(k, k) = pivot;
    for (Eigen::Index r = k + 1; r < m; ++r) rows(r, k) = 0.0;
  }
}

}  // namespace

ArrivalCost::ArrivalCost(ArrivalKind kind, const RheProblem& like, std::vector<ParameterWalk> walks)
    : kind_(kind), walks_(std::move(walks)), filter_(make_filter(like)), ahead_(filter_), factors_(like.model()) {
  const Model& model = like.model();
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count(), ny = model.output_count();
  initial_covariance_ = filter_.covariance;
  weights_.assign(ny, 1.0);
  inputs_.assign(nu, 0.0);
  ends_.assign(np, 0.0);
  scratch_.assign(2 * static_cast<std::size_t>(ny), 0.0);
  ramp_variances_.assign(np, 0.0);
  next_.assign(nx, 0.0);
  jacobian_.assign(static_cast<std::size_t>(nx) * (nx + nu + 2 * np), 0.0);
  predicted_.assign(ny, 0.0);
  output_jacobian_.assign(static_cast<std::size_t>(ny) * nx, 0.0);
  scale_ = Eigen::VectorXd::Ones(nx + np);
  factor_ = inverse_ = Eigen::MatrixXd::Identity(nx + np, nx + np);
  const int unknowns = nx + nu + 2 * np;  // x_0, u_0, p_0 and, on a ramp, its change
  const int between = like.setup().most_between * ny;
  between_weights_.assign(between, 1.0);
  between_rows_.assign(static_cast<std::size_t>(between) * (1 + unknowns), 0.0);
  between_scratch_.assign(between > 0 ? like.scratch_size() : 0, 0.0);
  rows_ = Eigen::MatrixXd::Zero(unknowns + ny + between, unknowns + 1);
  map_ = spread_ = Eigen::MatrixXd::Zero(nx + np, unknowns);
  shift_ = Eigen::VectorXd::Zero(unknowns);
  next_mean_ = Eigen::VectorXd::Zero(nx + np);
}

void ArrivalCost::reset(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  filter_.mean = mean;
  filter_.covariance = initial_covariance_ = covariance;
  filter_.inputs().forget();
}

/// If rounding has made the covariance singular, increases its diagonal just enough to factorise it.
void ArrivalCost::factor_covariance() noexcept {
  const ModelDescription& about = filter_.model().description();
  const int n = static_cast<int>(scale_.size()), nx = filter_.model().state_count();
  for (int j = 0; j < n; ++j) {
    const double least = least_sigma * (j < nx ? about.states[j] : about.parameters[j - nx]).scale;
    scale_[j] = std::sqrt(std::max(filter_.covariance(j, j), least * least));
  }
  double ridge = 0.0;
  const auto factor_with_ridge = [&](auto size) {
    const double *covariance = filter_.covariance.data(), *scale = scale_.data();
    double* factor = factor_.data();
    for (int c = 0; c < size; ++c) {
      factor[c * size + c] = 1.0 + ridge;
      for (int r = c + 1; r < size; ++r) factor[c * size + r] = covariance[c * size + r] / (scale[r] * scale[c]);
    }
    return small::factor(factor, size, size, least_pivot);
  };
  while (!with_size(n, factor_with_ridge) && ridge < 10.0) ridge = ridge == 0.0 ? least_pivot : 10.0 * ridge;
}

void ArrivalCost::write(RheProblem& problem) noexcept {
  const int n = static_cast<int>(scale_.size());
  problem.arrival_mean = filter_.mean;
  if (kind_ == ArrivalKind::off) {
    problem.arrival_information.setZero();
    const int nx = filter_.model().state_count();
    for (int j = 0; j < n - nx; ++j)
      if (const double sigma = walks_[j].noise_sigma; sigma > 0.0)
        problem.arrival_information(nx + j, nx + j) = 1.0 / (sigma * sigma);
    return;
  }
  factor_covariance();
  invert_factor();
  // D^-1 L^-T L^-1 D^-1
  with_size(n, [&](auto size) {
    const double *inverse = inverse_.data(), *scale = scale_.data();
    double* information = problem.arrival_information.data();
    for (int c = 0; c < size; ++c) {
      for (int r = c; r < size; ++r) {
        double sum = 0.0;
        for (int k = r; k < size; ++k) sum += inverse[r * size + k] * inverse[c * size + k];
        information[c * size + r] = information[r * size + c] = sum / (scale[r] * scale[c]);
      }
    }
  });
}

/// Inverts the factor L in the lower triangle.
void ArrivalCost::invert_factor() noexcept {
  with_size(static_cast<int>(scale_.size()), [&](auto n) {
    const double* factor = factor_.data();
    double* inverse = inverse_.data();
    for (int c = 0; c < n; ++c) {
      for (int r = c; r < n; ++r) {
        double value = r == c ? 1.0 : 0.0;
        for (int k = c; k < r; ++k) value -= factor[k * n + r] * inverse[c * n + k];
        inverse[c * n + r] = value / factor[r * n + r];
      }
    }
  });
}

void ArrivalCost::slide(const RheProblem& problem, const Iterate& solution, const std::vector<Border>& borders,
                        bool mean_is_lost) noexcept {
  const int nx = problem.model().state_count(), np = problem.model().parameter_count();
  const bool is_guessed = lacks_inputs(problem, 0);
  factors_.begin(problem.measured_input(0));
  if (!is_guessed) filter_.inputs().begin(problem.measured_input(0), problem.duration(0), filter_.covariance);
  // Slip that begins anew, and an input that nobody knows, are a product of which nothing else is known.
  const auto is_known = [&](int j) {
    return !is_guessed || (!factors_.is_held(j) && borders[j].neighbour_sigma.has_value());
  };
  for (int j = 0; j < np; ++j)
    ramp_variances_[j] = borders[j].leaves_as_ramp && is_known(j) ? borders[j].ramp_variance : 0.0;
  ArrivalKind kind = kind_ == ArrivalKind::ekf && mean_is_lost ? ArrivalKind::smoothing : kind_;
  if (kind == ArrivalKind::smoothing && is_guessed) kind = ArrivalKind::ekf;
  switch (kind) {
    case ArrivalKind::ekf:
      filter_first_interval(problem, solution);
      break;
    case ArrivalKind::smoothing:
      smooth_first_interval(problem, solution);
      break;
    case ArrivalKind::constant:
    case ArrivalKind::off:
      for (int j = 0; j < nx + np; ++j)
        filter_.mean[j] = j >= nx && walks_[j - nx].noise_sigma > 0.0 ? 0.0 : solution.state(1)[j];
      filter_.covariance = initial_covariance_;
      return;
  }
  for (int j = 0; j < np; ++j) {
    const Border& border = borders[j];
    if (const double sigma = walks_[j].noise_sigma; sigma > 0.0) {
      if (border.reached) {
        filter_.restart_parameter(j, sigma * sigma);
        filter_.mean[nx + j] = 0.0;
      } else {
        filter_.expect_zero(j, sigma * sigma);
      }
      continue;
    }
    filter_.add_parameter_variance(j, walks_[j].process_noise * walks_[j].process_noise);
    if (!border.reached || !is_known(j)) continue;
    if (border.neighbour_sigma) {
      filter_.add_parameter_variance(j, *border.neighbour_sigma * *border.neighbour_sigma * border.steps);
    } else {
      filter_.restart_parameter(j, walks_[j].restart_sigma * walks_[j].restart_sigma);
    }
  }
}

/// Of the outputs of node 0: how much information each has, relative to its noise.
void ArrivalCost::find_weights(const RheProblem& problem, const Iterate& solution) noexcept {
  if (!problem.setup().robust.empty()) {
    problem.robust_weights(solution, 0, weights_.data(), scratch_);
  } else {
    std::ranges::fill(weights_, 1.0);
  }
  const Measured measured = problem.measured(0);
  for (std::size_t j = 0; measured.weights && j < weights_.size(); ++j) weights_[j] *= measured.weights[j];
}

void ArrivalCost::filter_first_interval(const RheProblem& problem, const Iterate& solution) noexcept {
  find_weights(problem, solution);
  filter_.update(problem.output(0), weights_.data());
  problem.structure().inputs_on(solution, 0, inputs_.data());
  const bool ramp = std::any_of(ramp_variances_.begin(), ramp_variances_.end(), [](double v) { return v > 0.0; });
  const BetweenNodes& between = problem.between(0);
  if (!problem.setup().robust.empty()) {
    problem.linearise_between(0, solution, between_weights_.data(), nullptr, between_scratch_);
  } else {
    auto weight = between_weights_.begin();
    for (int k = 0; k < between.count(); ++k)
      for (int j = 0; j < between.width(); ++j) *weight++ = between.measured(k).weight(j);
  }
  filter_.predict(between.over(problem.duration(0), problem.measured_input(0)),
                  lacks_inputs(problem, 0) ? nullptr : inputs_.data(), ramp ? ramp_variances_.data() : nullptr,
                  between_weights_.data(), problem.measured(1));
}

const KalmanFilter& ArrivalCost::begin_filtering(const RheProblem& problem) noexcept {
  ahead_ = filter_;
  ahead_.update(problem.measured(0));
  return ahead_;
}

const KalmanFilter& ArrivalCost::filter_interval(const RheProblem& problem, int interval) noexcept {
  // Blocks begin as the problem has it, but as in `slide`.
  factors_.begin(problem.measured_input(interval));
  for (int j = 0; j < problem.model().parameter_count(); ++j) {
    if (interval == 0 || factors_.is_held(j) || !problem.structure().starts_block(interval, j)) continue;
    const double variance = problem.link_variance(interval, j);
    if (std::isfinite(variance)) ahead_.add_parameter_variance(j, variance);
  }
  ahead_.predict(problem.between(interval).over(problem.duration(interval), problem.measured_input(interval)), nullptr,
                 nullptr, nullptr, problem.measured(interval + 1));
  for (int j = 0; j < problem.model().parameter_count(); ++j) {
    const ParameterWalk& walk = walks_[static_cast<std::size_t>(j)];
    if (walk.noise_sigma > 0.0) {
      ahead_.expect_zero(j, walk.noise_sigma * walk.noise_sigma);
    } else {
      ahead_.add_parameter_variance(j, walk.process_noise * walk.process_noise);
    }
  }
  ahead_.update(problem.measured(interval + 1));
  return ahead_;
}

/// Rows in [dx; du; dp; dramp] about the solution: prior, outputs, measured inputs, ramp. Their QR factor R gives the
/// covariance R^-1 R^-T of these variables, which the linearised dynamics propagate to the next node.
void ArrivalCost::smooth_first_interval(const RheProblem& problem, const Iterate& solution) noexcept {
  const Model& model = problem.model();
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count(), ny = model.output_count();
  const int n = nx + np, unknowns = nx + nu + 2 * np;
  const double* x = solution.state(0);
  const double* p = x + nx;
  problem.structure().inputs_on(solution, 0, inputs_.data());
  problem.structure().parameters_on(solution, 0, ends_.data());
  for (int j = 0; j < np; ++j)
    if (!(ramp_variances_[j] > 0.0)) ends_[j] = p[j];
  find_weights(problem, solution);
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
  step.parameters = p;
  step.parameters_end = ends_.data();
  step.durations = &duration;
  step.substeps = problem.substeps();
  step.next_states = next_.data();
  step.jacobians = jacobian_.data();
  model.integrate(step);

  rows_.setZero();
  auto right = rows_.col(unknowns);
  // Prior: L^-1 D^-1 ([x; p] + [dx; dp] - mean). The columns of p follow those of u.
  factor_covariance();
  invert_factor();
  const auto column_of = [&](int j) { return j < nx ? j : nu + j; };
  for (int c = 0; c < n; ++c) {
    for (int r = c; r < n; ++r) {
      rows_(r, column_of(c)) = inverse_(r, c) / scale_[c];
      right[r] -= rows_(r, column_of(c)) * (x[c] - filter_.mean[c]);
    }
  }
  int row = n;
  for (int j = 0; j < nu; ++j, ++row) {
    const double measured = problem.measured_input(0)[j];
    const bool missing = std::isnan(measured);
    const double sigma =
        missing ? unknown_sigma(model.description().inputs[j]) : std::sqrt(filter_.noise().input_variances[j]);
    rows_(row, nx + j) = 1.0 / sigma;
    right[row] = missing ? 0.0 : (measured - inputs_[j]) / sigma;
  }
  for (int j = 0; j < np; ++j, ++row) {
    // Without a ramp there is no change: a row of any weight, since nothing else involves that column.
    const double sigma = ramp_variances_[j] > 0.0 ? std::sqrt(ramp_variances_[j]) : 1.0;
    rows_(row, nx + nu + np + j) = 1.0 / sigma;
    right[row] = (p[j] - ends_[j]) / sigma;
  }
  for (int j = 0; j < ny; ++j, ++row) {
    const double y = problem.output(0)[j];
    if (std::isnan(y)) continue;
    const double difference =
        model.description().outputs[j].is_angle ? angle_difference(y, predicted_[j]) : y - predicted_[j];
    const double weight = std::sqrt(weights_[j] / filter_.noise().output_variances[j]);
    for (int c = 0; c < nx; ++c) rows_(row, c) = weight * output_jacobian_[c * ny + j];
    right[row] = weight * difference;
  }
  row = write_between(problem, solution, row);
  triangularise(rows_, row);
  for (int r = unknowns - 1; r >= 0; --r) {
    double value = right[r];
    for (int c = r + 1; c < unknowns; ++c) value -= rows_(r, c) * shift_[c];
    shift_[r] = value / rows_(r, r);
  }

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
  // covariance = (M R^-1)(M R^-1)'
  for (int c = 0; c < unknowns; ++c) {
    for (int r = 0; r < n; ++r) {
      double value = map_(r, c);
      for (int k = 0; k < c; ++k) value -= spread_(r, k) * rows_(k, c);
      spread_(r, c) = value / rows_(c, c);
    }
  }
  inverse_.noalias() = spread_.lazyProduct(spread_.transpose());
  for (int r = 0; r < n; ++r) next_mean_[r] = (r < nx ? next_[r] : ends_[r - nx]) + map_.row(r).dot(shift_);
  if (!next_mean_.allFinite() || !inverse_.allFinite()) {
    // The result is not finite: keep the present mean and restart with the initial covariance.
    filter_.covariance = initial_covariance_;
    return;
  }
  filter_.mean = next_mean_;
  filter_.covariance = inverse_;
}

/// Rows of the measurements between the first two nodes, from this row on; returns the row behind them.
int ArrivalCost::write_between(const RheProblem& problem, const Iterate& solution, int row) noexcept {
  const BetweenNodes& between = problem.between(0);
  if (between.count() == 0) return row;
  const Model& model = problem.model();
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count(), ny = model.output_count();
  const bool ramp = problem.structure().any_ramp();
  problem.linearise_between(0, solution, between_weights_.data(), between_rows_.data(), between_scratch_);
  const double* from = between_rows_.data();
  for (int k = 0; k < between.count(); ++k) {
    for (int j = 0; j < ny; ++j, from += 1 + nx + np + nu + (ramp ? np : 0)) {
      if (std::isnan(between.outputs(k)[j])) continue;
      const double weight = std::sqrt(between_weights_[k * ny + j] / filter_.noise().output_variances[j]);
      // From [x; p; u; p_end] to [dx; du; dp; change].
      const double* const gradient = from + 1;
      for (int c = 0; c < nx; ++c) rows_(row, c) = weight * gradient[c];
      for (int c = 0; c < nu; ++c) rows_(row, nx + c) = weight * gradient[nx + np + c];
      for (int c = 0; c < np; ++c) {
        const double by_end = ramp ? gradient[nx + np + nu + c] : 0.0;
        rows_(row, nx + nu + c) = weight * (gradient[nx + c] + by_end);
        rows_(row, nx + nu + np + c) = ramp_variances_[c] > 0.0 ? weight * by_end : 0.0;
      }
      rows_(row, rows_.cols() - 1) = -weight * from[0];
      ++row;
    }
  }
  return row;
}

}  // namespace rhec
