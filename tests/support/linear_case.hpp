#pragma once

// Linear models with Gaussian noise, and the textbook Kalman filter that estimators on them are compared with.

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::testing {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// A trolley with drift whose position is measured, and its position mixed with its speed.
struct Trolley {
  static constexpr int state_count = 2, input_count = 1, parameter_count = 0, output_count = 2;
  template <class Scalar>
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = x[1] + 0.3;
    dxdt[1] = u[0] - 0.4 * x[0] - 0.2 * x[1];
  }
  template <class Scalar>
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[0] + 0.5 * x[1];
  }
};

/// Three states, the last of which no noise drives; one parameter.
struct Boat {
  static constexpr int state_count = 3, input_count = 1, parameter_count = 1, output_count = 2;
  template <class Scalar>
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = x[1] + 0.5 * p[0];
    dxdt[1] = u[0] - 0.1 * x[1] + x[2];
    dxdt[2] = -0.05 * x[2] + 0.1;
  }
  template <class Scalar>
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1] - 0.2 * x[2] + 1.0;
  }
};

/// Four states, two inputs and two parameters, each of which enters at another place.
struct Hovercraft {
  static constexpr int state_count = 4, input_count = 2, parameter_count = 2, output_count = 3;
  template <class Scalar>
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = x[2] + p[0] + 0.2;
    dxdt[1] = x[3] - 0.3 * p[1];
    dxdt[2] = u[0] - 0.2 * x[2] + 0.1 * x[1];
    dxdt[3] = u[1] + p[1] - 0.4 * x[3];
  }
  template <class Scalar>
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1] + 0.1 * x[0];
    y[2] = x[3];
  }
};

template <class Formula>
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
  name_all(about.states, "x", Formula::state_count);
  name_all(about.inputs, "u", Formula::input_count);
  name_all(about.parameters, "p", Formula::parameter_count);
  name_all(about.outputs, "y", Formula::output_count);
  return std::make_shared<FormulaModel<Formula>>(Formula{}, about);
}

inline const Host& host() {
  static const Host instance;
  return instance;
}
inline std::shared_ptr<Blocking> blocking(const std::string& name, const std::string& options = "") {
  return host().make_blocking(name, parse_yaml(options, "test"));
}
inline std::shared_ptr<Solver> gn_rti(const std::string& options = "{mode: rti}") {
  return host().make_solver("gn_rti", parse_yaml(options, "test"));
}

/// What is measured in a run. Sample 0 has outputs only.
struct Sample {
  double duration = 0.0;
  std::vector<double> inputs = {}, outputs = {};
};

struct Noise {
  std::vector<double> outputs, inputs;  ///< standard deviations
};

inline Noise noise_of(const Model& model) {
  Noise noise;
  for (int j = 0; j < model.output_count(); ++j) noise.outputs.push_back(0.05 + 0.1 * j);
  for (int j = 0; j < model.input_count(); ++j) noise.inputs.push_back(0.1 + 0.2 * j);
  return noise;
}

inline Eigen::VectorXd initial_mean(const Model& model) {
  return Eigen::VectorXd::LinSpaced(model.state_count() + model.parameter_count(), 0.3, -0.7);
}
/// With correlations, also between states and parameters.
inline Eigen::MatrixXd initial_covariance(const Model& model) {
  const int n = model.state_count() + model.parameter_count();
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(n, n);
  for (int r = 0; r < n; ++r)
    for (int c = 0; c <= r; ++c) root(r, c) = r == c ? 1.0 + 0.5 * r : 0.3 * std::cos(2.0 * r + c);
  return root * root.transpose();
}

/// A run with noise, a parameter that wanders, intervals of equal or of different lengths, and gaps: single outputs,
/// and whole nodes.
inline std::vector<Sample> simulate(const Model& model, int steps, bool equal_intervals, unsigned seed) {
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

/// How a parameter moves: at which intervals it changes, by what variance, and whether within the interval.
struct Change {
  int size = 1;           ///< blocks start at multiples of it; 0: never
  double variance = 0.0;  ///< a step
  bool ramp = false;
  double process_noise = 0.0;  ///< variance added at every interval but the first, wherever blocks start
};

/// The textbook's filter on z = [x; p], in long double so that it is the more exact of the two.
class ReferenceFilter {
 public:
  using Real = long double;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

  ReferenceFilter(const Model& model, Noise noise, std::vector<Change> changes)
      : model_(model), noise_(std::move(noise)), changes_(std::move(changes)) {
    mean = initial_mean(model).cast<Real>();
    covariance = initial_covariance(model).cast<Real>();
  }
  Vector mean;
  Matrix covariance;

  void predict(int interval, const Sample& sample) {
    const int nx = model_.state_count(), nu = model_.input_count(), np = model_.parameter_count(), n = nx + np;
    // The formula is linear: its jacobians are the same everywhere, and what it gives at zero is the drift.
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

  void update(const Sample& sample) {
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

 private:
  const Model& model_;
  Noise noise_;
  std::vector<Change> changes_;
};

/// The largest deviation of an estimate's mean and covariance, relative to the standard deviations.
inline double deviation(const Estimate& estimate, const ReferenceFilter& reference) {
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

/// The set-up of an estimator for such a run, without bounds.
inline RecedingHorizonEstimation::Setup linear_setup(const Model& model, int horizon, ArrivalKind arrival,
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

inline Estimate empty_estimate(const Model& model) {
  const int n = model.state_count() + model.parameter_count();
  Estimate estimate;
  estimate.state = Eigen::VectorXd::Zero(model.state_count());
  estimate.parameters = Eigen::VectorXd::Zero(model.parameter_count());
  estimate.covariance = Eigen::MatrixXd::Zero(n, n);
  return estimate;
}

}  // namespace rhec::testing
