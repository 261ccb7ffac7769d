#pragma once

#include <memory>
#include <vector>

#include "rhec/core/estimation/bank_estimation.hpp"
#include "rhec/core/estimation/smoother.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// Full-information estimation whose parameters follow priors (docs/method.md, section 8). Banks of filters go through
/// the log, without changes from one law of variation to another: the likelihood of each member's innovations says how
/// probable its law is for the whole log. For each of the most probable laws the problem of all nodes is solved on a
/// ProcessModel, and the estimate is the mixture of their solutions.
///
/// Of a linear problem without bounds the solution for one law is that of the Rauch-Tung-Striebel smoother on [x; z].
class RHEC_EXPORT PriorSmoothing final : public Smoother {
 public:
  struct Setup {
    BankEstimation::Setup filters;         ///< its members learn the noise of outputs
    std::vector<PriorCombination> priors;  ///< by parameter, those to choose from; where none are, laws of all kinds
    RheProblem::Setup problem;             ///< of the vehicle; its max_intervals is replaced by the log's
    int most_laws = 8;
    double least_probability = 0.05;  ///< laws that are less probable, relative to the most probable one, are left out
  };
  /// Throws Error if sizes do not match.
  PriorSmoothing(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Setup setup);

  SmoothedRun estimate(NodeLog log, Clock::time_point deadline) const override;
  using Smoother::estimate;

 private:
  std::shared_ptr<const Model> model_;
  std::shared_ptr<Solver> solver_;
  Setup setup_;
};

}  // namespace rhec
