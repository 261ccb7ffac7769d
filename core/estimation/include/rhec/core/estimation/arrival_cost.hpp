#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "rhec/core/estimation/kalman_filter.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// How data that have left the horizon are summarised (docs/method.md, section 5). The prior of the first node is the
/// predicted one, before that node's measurement, so that no measurement counts twice.
enum class ArrivalKind {
  ekf,        ///< filtering update: an extended Kalman filter at the start of the horizon, linearised at its own mean
  smoothing,  ///< one QR factorisation of the terms that leave, linearised at the solution (Kuehl et al. 2011)
  constant,   ///< the solution at the next node, always with the initial covariance
  off         ///< no arrival cost
};

/// How a parameter may change outside the horizon and from block to block.
struct ParameterWalk {
  double process_noise = 0.03;  ///< standard deviation per square root of a step, added at each slide
  double restart_sigma = 1.0;   ///< standard deviation with which an unlinked block starts
  /// Standard deviation between an unlinked block inside the horizon and the previous block; infinite: none.
  double block_sigma = 0.25;
  /// Above 0, the parameter is process noise, constant over each block: its blocks know nothing of each other, and each
  /// interval of a block costs (w / noise_sigma)^2. The other numbers do not matter then.
  double noise_sigma = 0.0;
};

/// The prior [xbar; pbar], Pi of the horizon's first node as the horizon slides. Of process noise it contains what the
/// horizon's first interval costs, since a block of which nothing is known would have no covariance. Allocates in its
/// constructor only.
class RHEC_EXPORT ArrivalCost {
 public:
  ArrivalCost(ArrivalKind kind, const RheProblem& like, std::vector<ParameterWalk> walks);

  ArrivalKind kind() const noexcept { return kind_; }
  void reset(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept;
  /// Back to what `mean`, `covariance` and `inputs` were, the latter as saved.
  void restore(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance, const double* inputs) noexcept {
    filter_.mean = mean;
    filter_.covariance = covariance;
    filter_.inputs().restore(inputs);
    filter_.inputs().resume(mean, covariance);
  }
  const InputGuess& inputs() const noexcept { return filter_.inputs(); }
  const Eigen::VectorXd& mean() const noexcept { return filter_.mean; }
  const Eigen::MatrixXd& covariance() const noexcept { return filter_.covariance; }

  /// What happens to one parameter when the horizon's first node reaches a new interval.
  struct Border {
    bool reached = false;  ///< this interval starts a block
    double steps = 0.0;    ///< s_b - s_a: intervals since the start of the previous block
    std::optional<double> neighbour_sigma = std::nullopt;  ///< the link between the blocks, if any
    bool leaves_as_ramp = false;  ///< the interval that leaves was a ramp into its block, with this variance
    double ramp_variance = 0.0;
  };
  /// Moves the prior over the first interval of a problem, given its newest solution. `borders` has n_p entries.
  /// `mean_is_lost`: the filter's own mean is too inaccurate to linearise at, so this slide uses the smoothing update.
  void slide(const RheProblem& problem, const Iterate& solution, const std::vector<Border>& borders,
             bool mean_is_lost = false) noexcept;

  /// Writes mean and information matrix into a problem.
  void write(RheProblem& problem) noexcept;

  /// A filter over a window of which not all inputs were measured, from the prior on: a window by itself would make of
  /// them what it likes, since nothing but the outputs limits them. Goes to the first node, with its outputs; then on
  /// to the next one, interval by interval.
  const KalmanFilter& begin_filtering(const RheProblem& problem) noexcept;
  const KalmanFilter& filter_interval(const RheProblem& problem, int interval) noexcept;

 private:
  void find_weights(const RheProblem& problem, const Iterate& solution) noexcept;
  void filter_first_interval(const RheProblem& problem, const Iterate& solution) noexcept;
  int write_between(const RheProblem& problem, const Iterate& solution, int row) noexcept;
  void smooth_first_interval(const RheProblem& problem, const Iterate& solution) noexcept;
  void factor_covariance() noexcept;
  void invert_factor() noexcept;

  ArrivalKind kind_;
  std::vector<ParameterWalk> walks_;
  KalmanFilter filter_;  ///< holds mean and covariance for every kind
  KalmanFilter ahead_;   ///< of a window without all of its inputs
  InputFactors factors_;
  Eigen::MatrixXd initial_covariance_;
  /// For each measurement between the first two nodes: its weights, and its residuals with their gradients.
  std::vector<double> between_weights_, between_rows_, between_scratch_;
  std::vector<double> weights_, inputs_, ends_, scratch_, ramp_variances_, next_, jacobian_, predicted_,
      output_jacobian_;
  /// Pi = D L L' D with D diagonal, so that the units of one variable do not affect the precision of another.
  Eigen::VectorXd scale_;
  Eigen::MatrixXd factor_;
  Eigen::MatrixXd rows_, map_, spread_, inverse_;
  Eigen::VectorXd shift_, next_mean_;
};

}  // namespace rhec
