#pragma once

#include <cstdint>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/core/ocp/linearisation.hpp"

namespace rhec {

struct IntervalDynamics;

/// The linearisation cache of a moving horizon. It keeps the iterate at which it was made and evaluates only intervals
/// whose numbers have changed, even if the horizon has moved by some intervals. It detects this by comparing rows,
/// which is cheap and always correct.
///
/// If the exact Hessian depends on no data (HorizonProblem::has_constant_cost_hessian), it is cached too, and the
/// interval behind the horizon is evaluated in advance, with the last inputs, as a shifted plan of a controller has
/// them. What terms add to it is evaluated anew each time.
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
  using LimitParts = HorizonTerms::LimitParts;

  /// Writes the cost of a range of stages without terms, as HorizonProblem::write_cost.
  virtual double write_cost(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts) noexcept {
    return problem_.write_cost(range, iterate, hessian, parts, qp_, scratch_);
  }
  /// Data kept for nodes move `steps` nodes towards the front; `same_node(i)` says whether node i still has the same
  /// state.
  virtual void move_nodes(int /*steps*/) noexcept {}
  bool same_node(int node) const noexcept { return same_[node] != 0; }
  /// Number of cached nodes, if there are any: 0 .. N.
  int known_nodes() const noexcept { return known_intervals_ + 1; }
  bool knows_anything() const noexcept { return known_intervals_ >= 0; }

 private:
  IntervalDynamics dynamics() const noexcept;
  double* row(AlignedDoubles& rows, int stage) const noexcept;
  const double* row(const AlignedDoubles& rows, int stage) const noexcept;
  std::uint8_t* starts(int interval) noexcept;
  void linearise_stages(const Iterate& iterate, Hessian hessian, LimitParts limits) noexcept;
  double add_terms(const Iterate& iterate, Hessian hessian, CostParts parts) noexcept;
  void keep_curvature() noexcept;
  bool has_structure() const noexcept;
  bool has_lifted_rows() const noexcept;
  void remember(const Iterate& iterate, int first) noexcept;
  void extend_horizon() noexcept;
  bool has_same_data(int interval, int steps, int count) const noexcept;
  bool is_known(int interval, int steps, int count, bool is_exact) const noexcept;
  int find_steps(const Iterate& iterate) const noexcept;
  int match(const Iterate& iterate, int steps, bool is_exact) noexcept;
  bool move_along(const Iterate& iterate, Hessian hessian) noexcept;
  void evaluate_unknown(const Iterate& iterate, Hessian hessian, const int* unknown, int count) noexcept;
  void write_new_limits(const Iterate& iterate, int end, const int* unknown, int count) noexcept;
  bool has_simulated(int interval, const Iterate& iterate) noexcept;
  void take_simulated(int interval, const Iterate& iterate) noexcept;

  const HorizonProblem& problem_;
  int known_intervals_ = -1;         ///< of the QP; -1: the cache is empty
  bool is_extended_ = false;         ///< the interval behind the horizon is cached: in AB, b and `curvature_behind_`
  bool has_curvature_ = false;       ///< H holds all costs and the curvature of the dynamics at `costates_`
  AlignedDoubles rows_, costates_;   ///< of the iterate at which the QP was made
  AlignedDoubles curvature_behind_;  ///< H of the interval behind the horizon
  AlignedDoubles without_terms_;     ///< H without what terms add to it; empty if there are none
  bool has_slopes_ = true;           ///< G is of this iterate, and not of an older one
  std::vector<double> durations_, data_;  ///< of the intervals
  std::vector<std::uint8_t> starts_;      ///< of each interval's lifted variables
  /// Per node: 2 if the whole row matches, 1 if the state does; per interval, the same for costates.
  std::vector<std::uint8_t> same_, same_costate_;
};

}  // namespace rhec
