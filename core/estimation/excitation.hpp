#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/horizon/measured_interval.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// How much an interval tells of slip through outputs of motion, and where it is to be linearised if that is little.
///
/// The gradient G of such an output by a parameter is a product of what is measured as well: of yaw_rate = kappa omega
/// it is omega. Given the interval's measurements, G has a variance V of its own. Linearised about the most probable
/// omega, the interval would tell G^2 of kappa, on the average V too much: while a vehicle drives straight on, noise
/// tells that kappa is small, and the covariance shrinks. Of the sums that make an estimate of kappa with errors in
/// both variables, what counts is the omega that is expected of one that was measured, a omega with a = T / (T + V) for
/// omegas of the mean square T (regression calibration: Carroll, Ruppert, Stefanski and Crainiceanu 2006, chapter 4).
/// T is what the last intervals show. Where G is more than four standard deviations from 0, there is nothing to do.
///
/// On a linear vehicle G is known, and nothing is done. Allocates in its constructor only.
class Excitation {
 public:
  /// Of these outputs of motion, for intervals with so many measurements between their nodes.
  Excitation(std::shared_ptr<const Model> model, std::vector<int> outputs, int substeps, int most_between);

  /// What is kept from interval to interval, for every output of motion and parameter: T / V. At the start 0.
  std::size_t history_size() const noexcept { return outputs_.size() * static_cast<std::size_t>(np_); }

  /// What is known before an interval's measurements: [x; p], inputs, and variances of these and of outputs.
  struct Knowledge {
    const Eigen::VectorXd& mean;
    const Eigen::MatrixXd& covariance;
    const double *inputs, *input_variances, *output_variances;
  };
  /// Takes in an interval whose measurements stand for `weights` (rows of n_y) others, and those of its end (n_y, or
  /// null). Whether it is to be linearised at `target`.
  bool find(const MeasuredInterval& interval, const double* weights, Measured end_outputs, const Knowledge& knowledge,
            double* history) noexcept;
  /// [x; u]: given the measurements with the parameters at their means, moved by no more than four standard deviations
  /// to where they tell of slip what may be believed.
  const Eigen::VectorXd& target() const noexcept { return target_; }

 private:
  void begin(const Knowledge& knowledge) noexcept;
  void integrate(int count, const double* seconds, bool is_curved) noexcept;
  void take(int row, int output, double measured, double variance) noexcept;
  bool is_measured(const MeasuredInterval& interval, Measured end_outputs, int output) const noexcept;
  bool move(int row, double* history) noexcept;

  std::shared_ptr<const Model> model_;
  std::vector<int> outputs_;
  int substeps_, nx_, nu_, np_, ny_;
  Eigen::VectorXd start_, mean_, target_, gradient_, image_;  ///< [x; u]
  Eigen::MatrixXd covariance_, joint_;                        ///< of [x; u]; of [x; p]
  std::vector<double> times_, states_, inputs_, parameters_, durations_, next_states_, jacobians_, predicted_,
      output_jacobians_, multipliers_, hessians_;
};

}  // namespace rhec
