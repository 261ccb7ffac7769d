#pragma once

#include <memory>
#include <vector>

#include "rhec/core/estimation/arrival_cost.hpp"
#include "rhec/core/estimation/smoother.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// Full-information estimation (docs/method.md, section 6): the estimator's problem over a whole run at once, so that
/// every node is estimated from measurements before and after it. Nothing has left the horizon, so the prior of the
/// first node is the only arrival cost. Blocks are marked and linked as in RecedingHorizonEstimation.
class RHEC_EXPORT FullInformationEstimation final : public Smoother {
 public:
  struct Setup {
    RheProblem::Setup problem;                               ///< its max_intervals is replaced by the log's
    std::vector<std::shared_ptr<const Blocking>> blockings;  ///< one per parameter
    std::vector<ParameterWalk> walks;                        ///< one per parameter
    Eigen::VectorXd initial_mean;                            ///< of [x; p] at the first node
    Eigen::MatrixXd initial_covariance;
  };
  FullInformationEstimation(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Setup setup);

  /// Throws Error, too, if a blocking cannot take the horizon.
  SmoothedRun estimate(NodeLog log, Clock::time_point deadline) const override;
  using Smoother::estimate;

 private:
  std::shared_ptr<const Model> model_;
  std::shared_ptr<Solver> solver_;
  Setup setup_;
};

}  // namespace rhec
