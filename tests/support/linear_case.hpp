#pragma once

// Linear models with Gaussian noise, and the textbook Kalman filter that estimators on them are compared with.

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/estimation/kalman_filter.hpp"
#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "rhec/core/estimation/smoother.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::testing {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// A trolley with drift. Measured are its position, and a combination of position and speed.
template <class Scalar>
struct Trolley {
  static constexpr int state_count = 2, input_count = 1, parameter_count = 0, output_count = 2;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = x[1] + 0.3;
    dxdt[1] = u[0] - 0.4 * x[0] - 0.2 * x[1];
  }
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[0] + 0.5 * x[1];
  }
};

/// Three states, the last one without process noise; one parameter.
template <class Scalar>
struct Boat {
  static constexpr int state_count = 3, input_count = 1, parameter_count = 1, output_count = 2;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = x[1] + 0.5 * p[0];
    dxdt[1] = u[0] - 0.1 * x[1] + x[2];
    dxdt[2] = -0.05 * x[2] + 0.1;
  }
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1] - 0.2 * x[2] + 1.0;
  }
};

/// Four states, two inputs and two parameters, each of which enters in a different place.
template <class Scalar>
struct Hovercraft {
  static constexpr int state_count = 4, input_count = 2, parameter_count = 2, output_count = 3;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = x[2] + p[0] + 0.2;
    dxdt[1] = x[3] - 0.3 * p[1];
    dxdt[2] = u[0] - 0.2 * x[2] + 0.1 * x[1];
    dxdt[3] = u[1] + p[1] - 0.4 * x[3];
  }
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1] + 0.1 * x[0];
    y[2] = x[3];
  }
};

/// Of the formulas above.
template <template <class> class Formula>
std::shared_ptr<const Model> linear_model();

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

/// A sample of measurements. Sample 0 has outputs only.
struct Sample {
  double duration = 0.0;
  std::vector<double> inputs = {}, outputs = {};
};

struct Noise {
  std::vector<double> outputs, inputs;  ///< standard deviations
};

Noise noise_of(const Model& model);
/// The same as variances, of parameters without bounds.
KalmanFilter::Noise variances_of(const Model& model);

Eigen::VectorXd initial_mean(const Model& model);
/// With correlations, also between states and parameters.
Eigen::MatrixXd initial_covariance(const Model& model);

/// A run with noise, a varying parameter, intervals of equal or different lengths, and missing measurements: single
/// outputs and whole nodes.
std::vector<Sample> simulate(const Model& model, int steps, bool equal_intervals, unsigned seed);

/// Without estimates.
NodeLog log_of(const Model& model, const std::vector<Sample>& samples);

/// How a parameter moves: at which intervals it changes, by what variance, and whether within the interval.
struct Change {
  int size = 1;           ///< blocks start at multiples of it; 0: never
  double variance = 0.0;  ///< per step
  bool ramp = false;
  double process_noise = 0.0;  ///< variance added at every interval but the first, wherever blocks start
};

/// The textbook filter on z = [x; p], in long double to be the more accurate of the two.
class ReferenceFilter {
 public:
  using Real = long double;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

  ReferenceFilter(const Model& model, Noise noise, std::vector<Change> changes);
  Vector mean;
  Matrix covariance;

  void predict(int interval, const Sample& sample);
  void update(const Sample& sample);

 private:
  const Model& model_;
  Noise noise_;
  std::vector<Change> changes_;
};

/// The largest deviation of an estimate's mean and covariance, relative to the standard deviations.
double deviation(const Estimate& estimate, const ReferenceFilter& reference);

/// The set-up of an estimator for such a run, without bounds.
RecedingHorizonEstimation::Setup linear_setup(const Model& model, int horizon, ArrivalKind arrival,
                                              std::vector<std::shared_ptr<const Blocking>> blockings);

Estimate empty_estimate(const Model& model);

}  // namespace rhec::testing
