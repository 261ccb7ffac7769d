#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec {

/// What a program hangs into the estimators and controllers that a robot makes, to watch them or to take times: derive
/// from it. As it is, it changes nothing. The objects it returns are used in place of those it is given, and are never
/// null.
class RHEC_EXPORT RobotHooks {
 public:
  virtual ~RobotHooks() = default;
  /// Is given the solver of each estimator ("rhe") and controller ("rhc").
  virtual std::shared_ptr<Solver> wrap_solver(std::string_view kind, std::shared_ptr<Solver> solver) const;
  /// Is given the method of each estimator.
  virtual std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const;
};

/// Hooks one round the other: the first one added is the innermost.
class RHEC_EXPORT RobotHookChain final : public RobotHooks {
 public:
  void add(std::shared_ptr<const RobotHooks> hooks);
  std::shared_ptr<Solver> wrap_solver(std::string_view kind, std::shared_ptr<Solver> solver) const override;
  std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const override;

 private:
  std::vector<std::shared_ptr<const RobotHooks>> links_;
};

}  // namespace rhec
