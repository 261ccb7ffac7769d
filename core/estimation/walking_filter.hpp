#pragma once

#include <memory>
#include <vector>

#include "filter_memo.hpp"
#include "rhec/core/estimation/health.hpp"
#include "rhec/core/estimation/kalman_filter.hpp"

namespace rhec {

/// A Kalman filter whose parameters walk, for the judgement of sensors: it predicts over any duration, and tells
/// innovations before they are used.
class WalkingFilter {
 public:
  struct Setup {
    KalmanFilter::Noise noise;
    std::vector<double> walk;  ///< n_p, standard deviation of a parameter per square root of a step
    bool has_ramps = false;    ///< as in FilterEstimation::Setup
    double step = 0.2;         ///< longest interval of one prediction [s]
    int substeps = 1;          ///< of a step
  };
  WalkingFilter(std::shared_ptr<const Model> model, const Setup& setup);
  /// What has been calculated from now on, for others.
  std::shared_ptr<const FilterMemo> make_memo();

  Eigen::VectorXd& mean() noexcept { return filter_.mean; }
  Eigen::MatrixXd& covariance() noexcept { return filter_.covariance; }
  const Eigen::VectorXd& mean() const noexcept { return filter_.mean; }
  const Eigen::MatrixXd& covariance() const noexcept { return filter_.covariance; }
  const Model& model() const noexcept { return filter_.model(); }

  /// Predicts by `duration` [s] in parts of at most a step, with an input (n_u) that holds all the while.
  /// `more_sigmas` (n_u, or null): of each part's inputs besides their noise. `deviations` (or null): small
  /// ones of [x; p] that are taken along.
  void predict(const double* inputs, double duration, const double* more_sigmas = nullptr,
               KalmanFilter::Deviations* deviations = nullptr) noexcept;
  /// Uses outputs (n_y, NaN where missing).
  void update(Measured outputs) noexcept { filter_.update(outputs); }
  /// The same after `expect`, if the mean is the same.
  void update_as_expected(Measured outputs) noexcept;
  /// How the last update has used an output.
  KalmanFilter::Use use(int output) const noexcept { return filter_.use(output); }
  /// Makes the parameters anew: their means stay, with these standard deviations (n_p).
  void restart_parameters(const std::vector<double>& sigmas) noexcept {
    for (std::size_t j = 0; j < sigmas.size(); ++j)
      filter_.restart_parameter(static_cast<int>(j), sigmas[j] * sigmas[j]);
  }
  /// Makes the position anew, of a vehicle that has both coordinates: it stays, with these standard deviations [m].
  void forget_place(double sigma_x, double sigma_y) noexcept;

  /// Expected outputs and their derivatives, for `innovation`.
  void expect() noexcept;
  /// Innovation of a sensor's measured outputs by what was expected last, its covariance and NIS. False, and nothing
  /// else, where none is measured.
  bool innovation(const Sensor& sensor, Measured outputs, Innovation& result) noexcept;
  /// What the outputs have said of inputs that were not measured.
  const InputGuess& inputs() const noexcept { return filter_.inputs(); }
  InputGuess& inputs() noexcept { return filter_.inputs(); }
  /// Whether an expected output depends on a state.
  bool depends_on(int output, int state) const noexcept;
  double expected(int output) const noexcept { return filter_.expected_outputs()[output]; }
  /// Of an expected output by a state.
  double derivative(int output, int state) const noexcept {
    return filter_.output_jacobian()[state * outputs_ + output];
  }

 private:
  void limit_states() noexcept;

  Setup setup_;
  KalmanFilter filter_;
  int outputs_;  ///< n_y
  std::shared_ptr<FilterMemo> memo_;
  std::vector<double> ramp_variances_;
  Eigen::MatrixXd image_;  ///< P H'
};

/// Largest value that a chi-square variable of this many degrees of freedom has with the probability of `sigmas`
/// standard deviations on one side (Wilson and Hilferty 1931).
double chi_square_limit(int degrees, double sigmas) noexcept;

}  // namespace rhec
