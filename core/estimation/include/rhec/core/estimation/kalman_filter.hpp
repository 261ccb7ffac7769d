#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/horizon/measured_interval.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// Extended Kalman filter on z = [x; p] with random-walk parameters p (docs/method.md, section 5): the baseline for
/// estimators, and the filtering update of the arrival cost. It stores the covariance, not its inverse, so that noise
/// may be singular. Values that are not finite, or lead to such, are skipped: mean and covariance stay finite.
/// Allocates in its constructor only.
class RHEC_EXPORT KalmanFilter {
 public:
  struct Noise {
    std::vector<double> output_variances;                  ///< n_y
    std::vector<double> input_variances;                   ///< n_u, of measured inputs
    std::vector<double> parameter_lower, parameter_upper;  ///< bounds of the mean
    /// Those outputs of motion, ascending, by which an interval is linearised, see `predict`.
    std::vector<int> motion_outputs = {};
  };
  /// `uses_between`: whether there can be measurements between two nodes.
  KalmanFilter(std::shared_ptr<const Model> model, Noise noise, int substeps, bool uses_between = false);

  Eigen::VectorXd mean;        ///< n_x + n_p
  Eigen::MatrixXd covariance;  ///< symmetric positive semidefinite

  /// Measurement update with y (n_y, NaN where missing). `robust_weights` (n_y, or null) scale the information.
  void update(const double* y, const double* robust_weights) noexcept;
  /// Time update by `duration` [s] with a measured input (n_u). Where it is missing (NaN), the guess replaces it, with
  /// a standard deviation of a hundred times the variable's typical magnitude.
  void predict(const double* measured_input, const double* input_guess, double duration) noexcept;
  /// The same if parameters jump or ramp during the interval: variances (n_p, 0 without a jump) of the change.
  void predict(const double* measured_input, const double* input_guess, double duration,
               const double* ramp_variances) noexcept;
  /// The same, and each measurement between the two nodes is used at its own time. The noise of an input, and the
  /// change of a parameter, is one value over the interval. `robust_weights`: one row for each of them, or null.
  ///
  /// `end_outputs` (n_y, NaN where missing, or null) are those of the interval's end, for `update` to use afterwards.
  /// An output of motion is a product of slip and of an input that is measured as well: about the measured input, the
  /// noise of the input counts as knowledge of slip. So the interval is linearised where its outputs of motion put it
  /// (iterated Kalman filter: Bell and Cathey 1993; docs/method.md, section 5), unless there are others between the
  /// nodes.
  void predict(const MeasuredInterval& interval, const double* input_guess, const double* ramp_variances,
               const double* robust_weights = nullptr, const double* end_outputs = nullptr) noexcept;
  /// Log-likelihood of the measurements between the nodes of the last interval, each given those before it.
  double between_log_likelihood() const noexcept { return between_log_likelihood_; }
  /// Measurement update with the knowledge that a parameter is 0 up to this variance.
  void expect_zero(int parameter, double variance) noexcept;
  /// Adds random-walk variance to a parameter.
  void add_parameter_variance(int parameter, double variance) noexcept;
  /// Restarts a parameter: it keeps its mean and gets this variance, without correlation to anything else.
  void restart_parameter(int parameter, double variance) noexcept;

  /// The noise of a measured input from now on.
  void set_input_variance(int input, double variance) noexcept { noise_.input_variances[input] = variance; }

  const Model& model() const noexcept { return *model_; }
  const Noise& noise() const noexcept { return noise_; }

 private:
  void differentiate(double duration) noexcept;
  void widen(const double* ramp_variances) noexcept;
  void integrate_wide(const Eigen::VectorXd& wide, double seconds, double share) noexcept;
  double expect_wide(int output, double measured) noexcept;
  void linearise_wide(double seconds, const double* y) noexcept;
  bool move_point(const double* y) noexcept;
  void take_between(double seconds, double share, const double* y, const double* robust_weights) noexcept;
  void take_wide(double innovation, double variance) noexcept;
  void narrow() noexcept;
  double input_variance(int input, const double* measured) const noexcept;
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
  /// Within an interval: [x; p; u; change of p], the gradient of an output, and the transition to [x; p] at its end.
  Eigen::VectorXd wide_mean_, wide_gradient_, wide_gain_, wide_image_, wide_end_;
  Eigen::MatrixXd wide_covariance_, transition_, wide_work_;
  /// Where an interval is linearised; images and gradients of the outputs of motion, and their innovations.
  Eigen::VectorXd point_, next_point_, motion_innovations_;
  Eigen::MatrixXd motion_images_, motion_gradients_, motion_covariance_;
  double between_log_likelihood_ = 0.0;
};

}  // namespace rhec
