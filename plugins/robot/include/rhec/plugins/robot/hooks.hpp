#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "rhec/core/estimation/smoother.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/place/slip_map.hpp"

namespace rhec {

class MemorySection;

/// Hooks of an application into the estimators and controllers that a robot makes, e.g. to observe or time them: derive
/// from this class. The defaults change nothing. The returned objects replace those passed in, and must not be null.
class RHEC_EXPORT RobotHooks {
 public:
  virtual ~RobotHooks() = default;
  /// Called with the solver of each estimator (kind "rhe") and controller ("rhc").
  virtual std::shared_ptr<Solver> wrap_solver(std::string_view kind, std::shared_ptr<Solver> solver) const;
  /// Called with the method of each estimator.
  virtual std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const;
  /// Called for each estimator that remembers places, with its empty map: a place to fill it from a file, and to keep
  /// it.
  virtual std::shared_ptr<SlipMap> provide_map(const MemorySection& memory, std::shared_ptr<SlipMap> map) const;
};

/// Hooks that record what the robot's estimators are given and what they say, in `log`: each `start` of one begins the
/// log anew.
RHEC_EXPORT std::shared_ptr<const RobotHooks> recording_nodes(std::shared_ptr<NodeLog> log);

/// Nested hooks: the first one added is the innermost.
class RHEC_EXPORT RobotHookChain final : public RobotHooks {
 public:
  void add(std::shared_ptr<const RobotHooks> hooks);
  std::shared_ptr<Solver> wrap_solver(std::string_view kind, std::shared_ptr<Solver> solver) const override;
  std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const override;
  std::shared_ptr<SlipMap> provide_map(const MemorySection& memory, std::shared_ptr<SlipMap> map) const override;

 private:
  std::vector<std::shared_ptr<const RobotHooks>> links_;
};

}  // namespace rhec
