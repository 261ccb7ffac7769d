#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/estimation/curvature.hpp"
#include "rhec/core/estimation/input_factors.hpp"
#include "rhec/core/estimation/input_guess.hpp"
#include "rhec/core/estimation/reading_summary.hpp"
#include "rhec/core/estimation/scaled_output.hpp"
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
    /// Outputs of which each measurement counts by itself, also if there are many (ReadingSummary).
    std::vector<int> single_outputs = {};
    /// Outputs with scale errors; none of motion. At 0 an output tells nothing of its scale, whatever its noise is.
    std::vector<ScaledOutput> scaled_outputs = {};
    bool operator==(const Noise&) const = default;
  };
  /// `most_between`: measurements that there can be between two nodes.
  KalmanFilter(std::shared_ptr<const Model> model, Noise noise, int substeps, int most_between = 0);

  Eigen::VectorXd mean;        ///< n_x + n_p
  Eigen::MatrixXd covariance;  ///< symmetric positive semidefinite

  /// Measurement update with y (n_y, NaN where missing). `information_weights` (n_y, or null) take the place of those
  /// that y was measured with.
  void update(Measured y, const double* information_weights = nullptr) noexcept;
  /// Outputs at the mean, and their derivatives by the state (n_y x n_x, by columns).
  void expect() noexcept;
  const double* expected_outputs() const noexcept { return predicted_.data(); }
  const double* output_jacobian() const noexcept { return output_jacobian_.data(); }
  /// `update` after `expect`, if the mean is the same.
  void update_as_expected(Measured y) noexcept;
  /// Time update by `duration` [s] with a measured input (n_u). Where it is missing (NaN), the guess (n_u) replaces it,
  /// with the standard deviation `unknown_sigma`; if that is null, what the filter knows of it (InputGuess).
  void predict(const double* measured_input, const double* input_guess, double duration) noexcept;
  /// The same if parameters jump or ramp during the interval: variances (n_p, 0 without a jump) of the change.
  void predict(const double* measured_input, const double* input_guess, double duration,
               const double* ramp_variances) noexcept;
  /// The same, and each measurement between the two nodes is used at its own time. The noise of an input, and the
  /// change of a parameter, is one value over the interval. `information_weights`: one row for each of them, in place
  /// of those that they were measured with, or null.
  ///
  /// Outputs of motion that are read often are summarised (ReadingSummary), unless there are such weights.
  ///
  /// `end_outputs` (n_y, NaN where missing, or null) are those of the interval's end, for `update` to use afterwards.
  /// An output of motion is a product of slip and of an input that is measured as well: about the measured input, the
  /// noise of the input counts as knowledge of slip. So an interval with outputs of motion is linearised, with all that
  /// is measured on it, where its measurements and the outputs of motion at its end put it (iterated Kalman filter:
  /// Bell and Cathey 1993). What is left of a product is not known better than its factors are: their second-order
  /// terms have means and covariances (Curvature; docs/method.md, section 5).
  void predict(const MeasuredInterval& interval, const double* input_guess, const double* ramp_variances,
               const double* information_weights = nullptr, Measured end_outputs = nullptr) noexcept;
  /// Where `predict` would linearise an interval with outputs of motion, and its second-order terms. Mean and
  /// covariance stay. Returns the interval with its measurements as they are used, until the next call.
  MeasuredInterval look_ahead(const MeasuredInterval& interval, const double* input_guess, const double* ramp_variances,
                              const double* information_weights, Measured end_outputs) noexcept;
  const ReadingSummary& summary() const noexcept { return summary_; }
  /// [x; p; u; change of p], and then others.
  const Eigen::VectorXd& point() const noexcept { return point_; }
  /// Of `curved()` at the first measurement, then at the end.
  const Curvature& curvature() const noexcept { return curvature_; }
  /// The states that have second-order terms; none without outputs of motion.
  const std::vector<int>& curved() const noexcept { return curved_; }
  /// Log-likelihood of the measurements between the nodes of the last interval, each given those before it.
  double between_log_likelihood() const noexcept { return between_log_likelihood_; }
  /// Measurement update with the knowledge that a parameter is 0 up to this variance.
  void expect_zero(int parameter, double variance) noexcept;
  /// Adds random-walk variance to a parameter.
  void add_parameter_variance(int parameter, double variance) noexcept;
  /// Restarts a parameter: it keeps its mean and gets this variance, without correlation to anything else.
  void restart_parameter(int parameter, double variance) noexcept;

  /// Small deviations of [x; p], one a column, of which only the first `used` matter.
  struct Deviations {
    using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    Columns columns;
    Columns by_input = {};  ///< (n_u): what a measured input is off by, besides; empty: nothing
    Eigen::Index used = 0;
  };
  /// Moves them on as the last prediction by a duration has moved the mean.
  void carry(Deviations& deviations) noexcept;

  /// How the last update has used an output, after those before it.
  struct Use {
    double innovation = 0.0, variance = 0.0;  ///< of the innovation; 0: it was not used
    const double* gain = nullptr;             ///< n_x + n_p
  };
  Use use(int output) const noexcept {
    return {innovations_[output], innovation_variances_[output], gains_.col(output).data()};
  }

  /// The noise of a measured input, or of an output, from now on.
  void set_input_variance(int input, double variance) noexcept { noise_.input_variances[input] = variance; }
  void set_output_variance(int output, double variance) noexcept { noise_.output_variances[output] = variance; }

  /// What is known of inputs that are not measured, for a filter that takes up the moments of another time.
  InputGuess& inputs() noexcept { return input_guess_; }
  const InputGuess& inputs() const noexcept { return input_guess_; }

  const Model& model() const noexcept { return *model_; }
  const Noise& noise() const noexcept { return noise_; }

 private:
  void differentiate(double duration) noexcept;
  void widen(const double* ramp_variances) noexcept;
  double expect_wide(int output, double measured) noexcept;
  void find_curvature(const MeasuredInterval& interval, int step) noexcept;
  void write_hessians(const MeasuredInterval& interval) noexcept;
  void copy_point(int row, double seconds, double share) noexcept;
  Model::Intervals copied_points(int count) const noexcept;
  static double from_first(const MeasuredInterval& interval, double seconds) noexcept;
  void linearise_times(const MeasuredInterval& interval, int count, const double* seconds) noexcept;
  void use_time(const MeasuredInterval& interval, int which) noexcept;
  void find_next_point(Measured y) noexcept;
  void take_between(const MeasuredInterval& interval, int which, const double* weights) noexcept;
  void take_wide(double innovation, double variance) noexcept;
  void narrow() noexcept;
  void begin_inputs(const double* measured, const double* guess, double duration) noexcept;
  void hold_factors(double* jacobians, int count) const noexcept;
  void add_guessed_inputs(const double* transition) noexcept;
  void take_guessed_inputs() noexcept;
  void take_outputs(Measured y) noexcept;
  void linearise_outputs() noexcept;
  void find_scale_slopes(Measured y) noexcept;
  void take_output(int output, double measured, double variance) noexcept;
  void make_symmetric() noexcept;
  void clip() noexcept;

  std::shared_ptr<const Model> model_;
  Noise noise_;
  int substeps_, nx_, nu_, np_, ny_;
  std::vector<int> curved_outputs_;                         ///< of motion
  Curvature output_curvature_;                              ///< of these, by the state
  std::vector<double> added_;                               ///< n_y: variances of second-order terms
  std::vector<double> kept_rows_;                           ///< of scaled outputs: value and derivatives
  std::vector<double> innovations_, innovation_variances_;  ///< n_y, of the last update
  Eigen::MatrixXd gains_;                                   ///< (n_x + n_p) x n_y, likewise
  Eigen::MatrixXd before_;                                  ///< an update: the covariance
  std::vector<double> predicted_, output_jacobian_, next_, jacobian_;
  InputGuess input_guess_;
  InputFactors input_factors_;
  std::vector<double> input_, input_variances_;  ///< of the interval; without those of `input_guess_`
  Eigen::MatrixXd guessed_;                      ///< n x n_u, of a step: what a guessed input has in the state
  AlignedDoubles row_, next_row_, jacobian_rows_, scratch_;  ///< for Model::integrate_rows
  Eigen::MatrixXd work_, next_covariance_;
  Eigen::VectorXd gain_, image_, zeros_, correction_;
  std::vector<double> carried_;  ///< states of some deviations
  /// Within an interval: [x; p; u; change of p; f], the gradient of an output, and the transition to [x; p] at its end.
  /// f are the factors of the second-order terms (Curvature) of `curved_` states at the first measurement, then of
  /// those at the end.
  Eigen::VectorXd wide_mean_, wide_gradient_, wide_gain_, wide_image_, wide_end_;
  Eigen::MatrixXd wide_covariance_, transition_, wide_work_;
  std::vector<int> curved_;
  bool is_curved_ = false;       ///< whether the interval has second-order terms
  bool guesses_inputs_ = false;  ///< whether some of its inputs are those of `input_guess_`
  Curvature curvature_;
  std::vector<std::uint8_t> is_missing_;  ///< per input
  ReadingSummary summary_;                ///< of outputs of motion
  /// Rows of the model, one for each time, and what it answers.
  std::vector<double> times_, states_, inputs_, parameters_, ends_, durations_, next_states_, jacobians_, outputs_,
      output_jacobians_, multipliers_, hessians_;
  /// Where an interval is linearised; images and gradients of the outputs of motion, and their innovations.
  Eigen::VectorXd point_, next_point_, start_mean_, motion_innovations_;
  Eigen::MatrixXd start_covariance_, posterior_, motion_images_, motion_gradients_, motion_covariance_;
  double between_log_likelihood_ = 0.0;
};

}  // namespace rhec
