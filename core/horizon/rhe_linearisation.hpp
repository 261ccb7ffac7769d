#pragma once

#include "between_cache.hpp"
#include "horizon_linearisation.hpp"
#include "output_cache.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// The linearisation cache of an estimation horizon, which also keeps the outputs at its nodes and between
/// them.
class RheLinearisation final : public HorizonLinearisation {
 public:
  explicit RheLinearisation(const RheProblem& problem);
  void forget() noexcept override;

 private:
  double write_cost(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts) noexcept override;
  void move_nodes(int steps) noexcept override;

  const RheProblem& problem_;
  OutputCache outputs_;
  BetweenCache between_;
};

}  // namespace rhec
