#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/config/options.hpp"
#include "rhec/core/estimation/bank_estimation.hpp"
#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "rhec/plugins/robot/blocking_section.hpp"
#include "rhec/plugins/robot/memory_section.hpp"
#include "rhec/plugins/robot/priors_section.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// The keys of `estimator.bank`.
struct RHEC_EXPORT BankOptions {
  double memory = PriorBank::Setup{}.memory;
  static const OptionTable<BankOptions>& table();
};

/// The estimator's configuration, read and checked: the input for making estimation methods.
struct RHEC_EXPORT EstimatorParts {
  std::shared_ptr<const RobotContext> context;
  Settings section;  ///< `estimator` as written, for error messages
  int horizon, substeps, heading_starts;
  int most_between;  ///< measurements between two nodes
  ArrivalKind arrival;
  std::vector<RobustLoss> robust;
  std::vector<ParameterWalk> walks;                             ///< one per parameter
  Eigen::VectorXd initial_mean;                                 ///< of [x; p]
  Eigen::MatrixXd initial_covariance;                           ///< of [x; p]
  std::vector<PriorBank::Setup::Knowledge> initial_parameters;  ///< what the section gives of them
  PriorsSection priors;
  BankOptions bank;
  MemorySection memory;
  bool has_bank_beside_blocks;  ///< for their covariance
  BlockingSection blocking;
  std::function<std::shared_ptr<Solver>()> make_solver;  ///< makes the solver that the section names
  std::function<std::shared_ptr<SlipMap>()> make_map;    ///< the map of an estimator that remembers places

  /// How many nodes a method remembers: those of the horizon, and from where measurements at its first one are used.
  int remembered_nodes() const noexcept { return horizon + 3; }
  /// The estimation problem of a window.
  RheProblem::Setup problem() const;
  /// Of a single Kalman filter.
  KalmanFilter::Noise filter_noise() const;
  /// A bank of filters with the priors.
  BankEstimation::Setup filters() const;
};

/// An estimator that a configuration can name.
struct EstimatorMaker {
  std::string name;
  std::string meaning;  ///< one phrase
  /// Throws Error if it cannot be made from these parts.
  std::function<std::unique_ptr<EstimationMethod>(const EstimatorParts& parts)> make;
  /// Whether its measurements are judged (`estimator.health`).
  bool is_watched = true;
};

/// The estimators that `estimator.name` chooses from: `rhe`, `ekf`, `bank`, and those that the application adds.
class RHEC_EXPORT EstimatorMakers {
 public:
  EstimatorMakers();
  /// Throws Error if that name is taken.
  EstimatorMakers& add(EstimatorMaker maker);
  const std::vector<EstimatorMaker>& all() const noexcept { return all_; }
  /// Throws Error if there is none of that name.
  const EstimatorMaker& named(std::string_view name) const;

 private:
  std::vector<EstimatorMaker> all_;
};

}  // namespace rhec
