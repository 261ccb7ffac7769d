#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/config/settings.hpp"
#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "rhec/plugins/robot/blocking_section.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// All that a configuration says of an estimator, read and checked: what estimation methods are made of.
struct RHEC_EXPORT EstimatorParts {
  std::shared_ptr<const RobotContext> context;
  Settings section;  ///< `estimator` as it was written, for errors
  int horizon, substeps, heading_starts;
  ArrivalKind arrival;
  std::vector<RobustLoss> robust;
  std::vector<ParameterWalk> walks;    ///< one a parameter
  Eigen::VectorXd initial_mean;        ///< of [x; p]
  Eigen::MatrixXd initial_covariance;  ///< of [x; p]
  BlockingSection blocking;
  std::function<std::shared_ptr<Solver>()> make_solver;  ///< the one that the section names

  /// The problem of a window.
  RheProblem::Setup problem() const;
};

/// An estimator that a configuration can name.
struct EstimatorMaker {
  std::string name;
  std::string meaning;  ///< one phrase
  /// Throws Error where it cannot be made of these parts.
  std::function<std::unique_ptr<EstimationMethod>(const EstimatorParts& parts)> make;
};

/// The estimators that `estimator.name` chooses from: `rhe`, `ekf`, and those that a program adds.
class RHEC_EXPORT EstimatorMakers {
 public:
  EstimatorMakers();
  /// Throws Error where there is one of that name.
  EstimatorMakers& add(EstimatorMaker maker);
  const std::vector<EstimatorMaker>& all() const noexcept { return all_; }
  /// Throws Error where there is none of that name.
  const EstimatorMaker& named(std::string_view name) const;

 private:
  std::vector<EstimatorMaker> all_;
};

}  // namespace rhec
