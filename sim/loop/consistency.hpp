#pragma once

#include <Eigen/Core>

#include "rhec/sim/loop/closed_loop.hpp"

namespace rhec::sim {

/// How an estimate's covariance compares with its error.
class Consistency {
 public:
  explicit Consistency(const ModelDescription& about);
  /// Writes standard deviations and NEES of a sample whose truth and estimate are known; without a covariance (empty)
  /// no standard deviations, and NaN. States of the covariance behind those described are left out. In a direction in
  /// which the covariance is singular, as far as rounding errors allow to tell, it says nothing that an error could be
  /// held against: there NEES has its expectation, 1.
  void write(const Eigen::MatrixXd& covariance, Sample& sample);

 private:
  double nees_with(const Eigen::MatrixXd& covariance);
  double nees_with_singular(const Eigen::MatrixXd& covariance) const;

  const ModelDescription& about_;
  Eigen::VectorXd error_;
  Eigen::MatrixXd factor_;  // L below the diagonal, D on it, L D above
  Eigen::VectorXd solved_;
  Eigen::MatrixXd results_;  // the covariance of what is described
};

}  // namespace rhec::sim
