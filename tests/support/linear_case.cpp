#include "support/linear_case.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <random>

#include "rhec/core/model/formula_model.hpp"

namespace rhec::testing {

template <template <class> class Formula>
std::shared_ptr<const Model> linear_model() {
  ModelDescription about;
  about.name = "linear";
  const auto name_all = [](std::vector<Variable>& variables, const std::string& letter, int count) {
    for (int i = 0; i < count; ++i) {
      Variable variable;
      variable.name = letter + std::to_string(i);
      variables.push_back(variable);
    }
  };
  name_all(about.states, "x", Formula<double>::state_count);
  name_all(about.inputs, "u", Formula<double>::input_count);
  name_all(about.parameters, "p", Formula<double>::parameter_count);
  name_all(about.outputs, "y", Formula<double>::output_count);
  return std::make_shared<FormulaModel<Formula>>(Formula<double>{}, about);
}
template std::shared_ptr<const Model> linear_model<Trolley>();
template std::shared_ptr<const Model> linear_model<Boat>();
template std::shared_ptr<const Model> linear_model<Hovercraft>();

Noise noise_of(const Model& model) {
  Noise noise;
  for (int j = 0; j < model.output_count(); ++j) noise.outputs.push_back(0.05 + 0.1 * j);
  for (int j = 0; j < model.input_count(); ++j) noise.inputs.push_back(0.1 + 0.2 * j);
  return noise;
}

KalmanFilter::Noise variances_of(const Model& model) {
  const Noise noise = noise_of(model);
  KalmanFilter::Noise variances;
  for (const double sigma : noise.outputs) variances.output_variances.push_back(sigma * sigma);
  for (const double sigma : noise.inputs) variances.input_variances.push_back(sigma * sigma);
  variances.parameter_lower.assign(model.parameter_count(), -infinity);
  variances.parameter_upper.assign(model.parameter_count(), infinity);
  return variances;
}

Eigen::VectorXd initial_mean(const Model& model) {
  return Eigen::VectorXd::LinSpaced(model.state_count() + model.parameter_count(), 0.3, -0.7);
}

Eigen::MatrixXd initial_covariance(const Model& model) {
  const int n = model.state_count() + model.parameter_count();
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(n, n);
  for (int r = 0; r < n; ++r)
    for (int c = 0; c <= r; ++c) root(r, c) = r == c ? 1.0 + 0.5 * r : 0.3 * std::cos(2.0 * r + c);
  return root * root.transpose();
}

std::vector<Sample> simulate(const Model& model, int steps, bool equal_intervals, unsigned seed) {
  std::mt19937_64 bits(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const Noise noise = noise_of(model);
  const int nx = model.state_count(), np = model.parameter_count();
  std::vector<double> x(nx), p(np), next(nx), outputs(model.output_count());
  for (int j = 0; j < nx; ++j) x[j] = 0.4 * normal(bits);
  for (int j = 0; j < np; ++j) p[j] = 0.5 * normal(bits);
  std::vector<Sample> samples;
  for (int k = 0; k <= steps; ++k) {
    Sample sample;
    if (k > 0) {
      sample.duration = equal_intervals ? 0.2 : 0.05 + 0.3 * uniform(bits);
      std::vector<double> inputs(model.input_count());
      for (std::size_t j = 0; j < inputs.size(); ++j) inputs[j] = std::sin(0.3 * k + static_cast<double>(j));
      Model::Intervals request;
      request.count = 1;
      request.states = x.data();
      request.inputs = inputs.data();
      request.parameters = p.data();
      request.durations = &sample.duration;
      request.next_states = next.data();
      model.integrate(request);
      x = next;
      for (double& value : p) value += 0.1 * normal(bits);
      for (std::size_t j = 0; j < inputs.size(); ++j)
        sample.inputs.push_back(inputs[j] + noise.inputs[j] * normal(bits));
    }
    Model::Nodes request;
    request.count = 1;
    request.states = x.data();
    request.outputs = outputs.data();
    model.observe(request);
    const bool blind = k % 11 == 4 || k % 11 == 5;
    for (std::size_t j = 0; j < outputs.size(); ++j) {
      const double measured = outputs[j] + noise.outputs[j] * normal(bits);
      sample.outputs.push_back(blind || uniform(bits) < 0.25 ? nan : measured);
    }
    samples.push_back(sample);
  }
  return samples;
}

NodeLog log_of(const Model& model, const std::vector<Sample>& samples) {
  NodeLog log;
  for (const Sample& sample : samples) {
    if (sample.duration > 0.0) {
      log.durations.push_back(sample.duration);
      log.inputs.insert(log.inputs.end(), sample.inputs.begin(), sample.inputs.end());
    }
    log.outputs.insert(log.outputs.end(), sample.outputs.begin(), sample.outputs.end());
  }
  log.states.assign(samples.size() * model.state_count(), nan);
  log.parameters.assign(samples.size() * model.parameter_count(), nan);
  return log;
}

ReferenceFilter::ReferenceFilter(const Model& model, Noise noise, std::vector<Change> changes)
    : model_(model), noise_(std::move(noise)), changes_(std::move(changes)) {
  mean = initial_mean(model).cast<Real>();
  covariance = initial_covariance(model).cast<Real>();
}

void ReferenceFilter::predict(int interval, const Sample& sample) {
  const int nx = model_.state_count(), nu = model_.input_count(), np = model_.parameter_count(), n = nx + np;
  // The formula is linear: its Jacobians are constant, and its value at zero is the drift.
  const std::vector<double> zero(n + nu, 0.0);
  std::vector<double> drift(nx), jacobian(nx * (nx + nu + 2 * np));
  Model::Intervals request;
  request.count = 1;
  request.states = request.inputs = request.parameters = request.parameters_end = zero.data();
  request.durations = &sample.duration;
  request.next_states = drift.data();
  request.jacobians = jacobian.data();
  model_.integrate(request);
  const Eigen::Map<const Eigen::MatrixXd> J(jacobian.data(), nx, nx + nu + 2 * np);
  Matrix transition = Matrix::Identity(n, n), by_noise = Matrix::Zero(n, nu + np);
  transition.topLeftCorner(nx, nx) = J.leftCols(nx).cast<Real>();
  transition.topRightCorner(nx, np) = (J.middleCols(nx + nu, np) + J.rightCols(np)).cast<Real>();
  Vector offset = Vector::Zero(n);
  for (int r = 0; r < nx; ++r) offset[r] = drift[r];
  for (int j = 0; j < nu; ++j) {
    by_noise.col(j).head(nx) = J.col(nx + j).cast<Real>();
    offset += by_noise.col(j) * Real(sample.inputs[j]);
    by_noise.col(j) *= Real(noise_.inputs[j]);
  }
  for (int j = 0; j < np; ++j) {
    const Change& change = changes_[j];
    if (interval > 0) covariance(nx + j, nx + j) += change.process_noise;
    if (change.size == 0 || interval == 0 || interval % change.size != 0) continue;
    const Real variance = Real(change.variance) * change.size;
    if (change.ramp) {
      by_noise.col(nu + j).head(nx) = J.col(nx + nu + np + j).cast<Real>() * std::sqrt(variance);
      by_noise(nx + j, nu + j) = std::sqrt(variance);
    } else {
      covariance(nx + j, nx + j) += variance;
    }
  }
  mean = transition * mean + offset;
  covariance = (transition * covariance * transition.transpose() + by_noise * by_noise.transpose()).eval();
}

void ReferenceFilter::update(const Sample& sample) {
  const int nx = model_.state_count(), ny = model_.output_count(), n = static_cast<int>(mean.size());
  const std::vector<double> zero(nx, 0.0);
  std::vector<double> offset(ny), jacobian(ny * nx);
  Model::Nodes request;
  request.count = 1;
  request.states = zero.data();
  request.outputs = offset.data();
  request.jacobians = jacobian.data();
  model_.observe(request);
  std::vector<int> present;
  for (int j = 0; j < ny; ++j)
    if (!std::isnan(sample.outputs[j])) present.push_back(j);
  const int m = static_cast<int>(present.size());
  if (m == 0) return;
  Matrix H = Matrix::Zero(m, n), R = Matrix::Zero(m, m);
  Vector innovation(m);
  for (int i = 0; i < m; ++i) {
    const int j = present[i];
    for (int c = 0; c < nx; ++c) H(i, c) = jacobian[c * ny + j];
    R(i, i) = Real(noise_.outputs[j]) * noise_.outputs[j];
    innovation[i] = Real(sample.outputs[j]) - offset[j];
  }
  innovation -= H * mean;
  const Matrix S = H * covariance * H.transpose() + R;
  const Matrix K = covariance * H.transpose() * S.inverse();
  const Matrix I_KH = Matrix::Identity(n, n) - K * H;
  mean += K * innovation;
  covariance = (I_KH * covariance * I_KH.transpose() + K * R * K.transpose()).eval();
}

double deviation(const Estimate& estimate, const ReferenceFilter& reference) {
  const auto nx = estimate.state.size(), n = reference.mean.size();
  double worst = 0.0;
  const auto add = [&worst](double value) { worst = std::isfinite(value) ? std::max(worst, value) : HUGE_VAL; };
  const auto sigma = [&](Eigen::Index i) { return std::sqrt(static_cast<double>(reference.covariance(i, i))); };
  for (Eigen::Index r = 0; r < n; ++r) {
    const double value = r < nx ? estimate.state[r] : estimate.parameters[r - nx];
    add(std::abs(static_cast<double>(value - reference.mean[r])) / sigma(r));
    for (Eigen::Index c = 0; c < n; ++c)
      add(std::abs(static_cast<double>(estimate.covariance(r, c) - reference.covariance(r, c))) /
          (sigma(r) * sigma(c)));
  }
  return worst;
}

RecedingHorizonEstimation::Setup linear_setup(const Model& model, int horizon, ArrivalKind arrival,
                                              std::vector<std::shared_ptr<const Blocking>> blockings) {
  const double infinity = std::numeric_limits<double>::infinity();
  RecedingHorizonEstimation::Setup setup;
  setup.problem.max_intervals = horizon;
  const Noise noise = noise_of(model);
  for (const double sigma : noise.outputs) setup.problem.output_weights.push_back(1.0 / (sigma * sigma));
  for (const double sigma : noise.inputs) setup.problem.input_weights.push_back(1.0 / (sigma * sigma));
  setup.problem.parameter_lower.assign(model.parameter_count(), -infinity);
  setup.problem.parameter_upper.assign(model.parameter_count(), infinity);
  setup.arrival = arrival;
  setup.blockings = std::move(blockings);
  setup.walks.assign(model.parameter_count(), {.process_noise = 0.0, .restart_sigma = 1.0});
  setup.initial_mean = initial_mean(model);
  setup.initial_covariance = initial_covariance(model);
  return setup;
}

Estimate empty_estimate(const Model& model) {
  const int n = model.state_count() + model.parameter_count();
  Estimate estimate;
  estimate.state = Eigen::VectorXd::Zero(model.state_count());
  estimate.parameters = Eigen::VectorXd::Zero(model.parameter_count());
  estimate.covariance = Eigen::MatrixXd::Zero(n, n);
  return estimate;
}

}  // namespace rhec::testing
