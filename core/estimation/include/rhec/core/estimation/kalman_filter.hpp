#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// Extended Kalman filter on z = [x; p], p a random walk: the baseline that estimators are compared with, and the
/// filtering update of the arrival cost. The covariance is kept (not its inverse), so that noise may be singular. What
/// is not a number, or leads to none, is passed over: mean and covariance stay finite. Allocates in its constructor
/// only.
class RHEC_EXPORT KalmanFilter {
 public:
  struct Noise {
    std::vector<double> output_variances;                  ///< n_y
    std::vector<double> input_variances;                   ///< n_u, of a measured input
    std::vector<double> parameter_lower, parameter_upper;  ///< the mean is kept inside
  };
  KalmanFilter(std::shared_ptr<const Model> model, Noise noise, int substeps);

  Eigen::VectorXd mean;        ///< n_x + n_p
  Eigen::MatrixXd covariance;  ///< symmetric positive semidefinite

  /// Takes a measurement y (n_y, NaN where missing) into account. `robust_weights` (n_y, or null) scale the
  /// information.
  void update(const double* y, const double* robust_weights) noexcept;
  /// Moves on by `duration` with a measured input (n_u, NaN where missing: the guess takes its place, with a standard
  /// deviation of a hundred of the variable's typical magnitudes).
  void predict(const double* measured_input, const double* input_guess, double duration) noexcept;
  /// The same where parameters jump or ramp during the interval: variances (n_p, 0 where there is no jump) of the
  /// change.
  void predict(const double* measured_input, const double* input_guess, double duration,
               const double* ramp_variances) noexcept;
  /// Random walk of a parameter.
  void add_parameter_variance(int parameter, double variance) noexcept;
  /// Forgets what is known of a parameter: it keeps its mean, is independent of all else, and has this variance.
  void restart_parameter(int parameter, double variance) noexcept;

  const Model& model() const noexcept { return *model_; }
  const Noise& noise() const noexcept { return noise_; }

 private:
  void differentiate(double duration) noexcept;
  void take_output(int output, double measured, double variance) noexcept;
  void make_symmetric() noexcept;
  void clip() noexcept;

  std::shared_ptr<const Model> model_;
  Noise noise_;
  int substeps_, nx_, nu_, np_, ny_;
  std::vector<double> predicted_, output_jacobian_, next_, jacobian_, input_;
  AlignedDoubles row_, next_row_, jacobian_rows_, scratch_;  ///< for Model::integrate_rows
  Eigen::MatrixXd work_, next_covariance_;
  Eigen::VectorXd gain_, image_, zeros_, correction_;
};

}  // namespace rhec
