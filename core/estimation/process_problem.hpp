#pragma once

#include <memory>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "rhec/core/estimation/prior_bank.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/prior/process_model.hpp"

namespace rhec {

/// A vehicle whose processes have the states that a bank's have.
std::shared_ptr<const ProcessModel> make_process_model(const std::shared_ptr<const Model>& vehicle,
                                                       const PriorBank& bank);

/// The estimation problem on it: `setup` is that of the vehicle. Bounds of parameters become bounds of states.
RheProblem make_process_problem(std::shared_ptr<const ProcessModel> model, RheProblem::Setup setup);

/// Information matrix of a covariance that may be nearly singular. Allocates in its constructor only.
class InformationOf {
 public:
  explicit InformationOf(Eigen::Index n);
  /// Of a symmetric positive semidefinite covariance (n x n).
  void find(const Eigen::MatrixXd& covariance, Eigen::MatrixXd& information) noexcept;
  /// Standard deviations of the last covariance.
  const Eigen::VectorXd& sigmas() const noexcept { return sigmas_; }

 private:
  Eigen::VectorXd sigmas_;
  Eigen::MatrixXd scaled_, inverse_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

}  // namespace rhec
