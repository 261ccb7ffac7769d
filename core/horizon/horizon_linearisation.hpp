#pragma once

#include <cstdint>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/core/ocp/linearisation.hpp"

namespace rhec {

struct IntervalDynamics;

/// The linearisation of a horizon that moves on: it remembers the iterate that it was made at, and evaluates only the
/// intervals that it does not find again at the same numbers, be it some intervals earlier. Nobody has to say that the
/// horizon has moved; comparing rows is cheap, and cannot be wrong.
///
/// Where the exact Hessian depends on no data (HorizonProblem::has_constant_cost_hessian), it is kept as well, and the
/// interval behind the horizon is evaluated with the others: with the last inputs, as a controller's plan is moved on.
class HorizonLinearisation : public Linearisation {
 public:
  explicit HorizonLinearisation(const HorizonProblem& problem);

  double linearise(const Iterate& iterate, Hessian hessian) noexcept override;
  double linearise_for_residual(const Iterate& iterate, Hessian next) noexcept override;
  void prepare(const Iterate& iterate, Hessian hessian) noexcept override;
  void refresh(const Iterate& iterate) noexcept override;
  bool is_at(const Iterate& iterate) const noexcept override;
  void forget() noexcept override;

 protected:
  using CostParts = HorizonProblem::CostParts;

  /// Writes the cost of a range of stages, as HorizonProblem::write_cost.
  virtual double write_cost(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts) noexcept {
    return problem_.write_cost(range, iterate, hessian, parts, qp_, scratch_);
  }
  /// What is remembered of nodes is now `steps` earlier; `same_node(i)` says whether node i is still at the same state.
  virtual void move_nodes(int /*steps*/) noexcept {}
  bool same_node(int node) const noexcept { return same_[node] != 0; }
  /// Nodes that are remembered, if anything is: 0 .. N.
  int known_nodes() const noexcept { return known_intervals_ + 1; }
  bool knows_anything() const noexcept { return known_intervals_ >= 0; }

 private:
  IntervalDynamics dynamics() const noexcept;
  double* row(AlignedDoubles& rows, int stage) const noexcept;
  const double* row(const AlignedDoubles& rows, int stage) const noexcept;
  std::uint8_t* starts(int interval) noexcept;
  void linearise_stages(const Iterate& iterate, Hessian hessian) noexcept;
  bool has_structure() const noexcept;
  bool has_lifted_rows() const noexcept;
  void remember(const Iterate& iterate, int first) noexcept;
  void extend_horizon() noexcept;
  bool is_known(int interval, int steps, int count, bool is_exact) const noexcept;
  int find_steps(const Iterate& iterate) const noexcept;
  int match(const Iterate& iterate, int steps, bool is_exact) noexcept;
  bool move_along(const Iterate& iterate, Hessian hessian) noexcept;
  void evaluate_unknown(const Iterate& iterate, Hessian hessian, const int* unknown, int count) noexcept;
  bool has_simulated(int interval, const Iterate& iterate) noexcept;
  void take_simulated(int interval, const Iterate& iterate) noexcept;

  const HorizonProblem& problem_;
  int known_intervals_ = -1;          ///< of the QP; -1: nothing is remembered
  bool is_extended_ = false;          ///< the interval behind the horizon is known: in AB, b and `curvature_behind_`
  bool has_curvature_ = false;        ///< H is that of all costs and of the dynamics, at `costates_`
  AlignedDoubles rows_, costates_;    ///< of the iterate that the QP was made at
  AlignedDoubles curvature_behind_;   ///< H of the interval behind the horizon
  std::vector<double> durations_;     ///< of the intervals
  std::vector<std::uint8_t> starts_;  ///< of each interval's lifted variables
  /// Of nodes: 2 where the whole row was found again, 1 where the state was; of intervals, the same of their costates.
  std::vector<std::uint8_t> same_, same_costate_;
};

}  // namespace rhec
