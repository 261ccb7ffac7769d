#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "rhec/core/config/options.hpp"
#include "rhec/core/ocp/start_search.hpp"
#include "rhec/core/ocp/tracking_start.hpp"
#include "row_costs.hpp"
#include "sparse_qp.hpp"

namespace rhec::sparse_sqp {

enum class Curvature {
  gauss_newton,
  exact,
  automatic  ///< Gauss-Newton for estimation, exact for control
};

struct SparseSqpOptions {
  Curvature hessian = Curvature::automatic;
  int max_iterations = 200;
  double tolerance = 1e-8;

  static const OptionTable<SparseSqpOptions>& table();
};

/// Sequential quadratic programming on the sparse NLP of an Ocp (docs/method.md, section 7), for horizons of thousands
/// of intervals and for vehicles with many states. The cost of a step is linear in the horizon.
///
/// Every iterate satisfies the bounds. Steps come from a sparse QP (SparseQp) and are accepted by the l1 merit function
/// f + penalty * |c|_1, where f includes the slacks of soft limits, and |c|_1 the violation of hard ones. Step lengths
/// are shorter around stages where the merit would rise, and second-order corrections account for the curvature of the
/// equations. Where the exact Hessian is not convex enough, stages take the Gauss-Newton Hessian (convexify_by_stages).
/// If linearised equations contradict the bounds, they are relaxed (Sl1QP [15]); an iterate at which no step reduces
/// |c|_1 is reported as infeasible. Where all that does not solve a problem, or takes long, it begins again at the
/// trajectory of a regulator (TrackingStart) if there is one that is better than the guess.
class SparseSqp final : public Solver {
 public:
  using Options = SparseSqpOptions;
  explicit SparseSqp(const Options& options) : options_(options) {}

  std::string why_not(const Ocp& ocp) const override;
  void setup(const Ocp& ocp) override;
  void prepare(const Iterate&) noexcept override {}
  using Solver::solve;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override;
  bool covariances(const Iterate& iterate, StageRange nodes, std::span<double> blocks) noexcept override;
  void reset() noexcept override;

 private:
  void take_structure(const Ocp& ocp);
  void linearise(const Ocp& ocp, Hessian hessian);
  void convexify(const Ocp& ocp, int round);
  double merit(const Ocp& ocp, const Iterate& iterate) noexcept;
  void move(const Ocp& ocp);
  bool shorten_locally();
  bool search(const Ocp& ocp, double residual, double& after);
  void polish(const Ocp& ocp, Report& report, Clock::time_point deadline);
  Status converge(const Ocp& ocp, const Iterate& guess, Report& report, Clock::time_point deadline);
  bool find_tracking_start(const Ocp& ocp, const Iterate& guess, Clock::time_point deadline) noexcept;
  void begin_within_bounds(const Ocp& ocp) noexcept;  ///< at `current_`
  void begin_again(const Ocp& ocp, Report& report) noexcept;
  SparseQp::Outcome find_step(const Ocp& ocp, Report& report, Clock::time_point deadline);
  SparseQp::Outcome find_relaxed_step(Clock::time_point deadline);
  SparseQp::Outcome solve_relaxed(double penalty, Clock::time_point deadline);
  SparseQp::Data qp_data() const noexcept;
  void evaluate_limits(const Ocp& ocp, const Iterate& iterate, std::vector<double>& constraints) noexcept;
  void predict() noexcept;
  bool is_futile(SparseQp::Outcome outcome, const Report& report) noexcept;
  /// Of the constraints: the iterates are within their bounds.
  double violation_of(const KktResidual& kkt) const noexcept {
    return rows_.has_limits() ? std::max(kkt.defect, kkt.bound_violation) : kkt.defect;
  }

  Options options_;
  const Ocp* ocp_ = nullptr;
  SparseNlp nlp_;
  SparseQp qp_;
  StageQp stages_, other_stages_;
  Iterate current_, trial_;
  std::vector<double> scratch_, defects_, limit_values_;
  std::vector<double> hessian_, jacobian_, gradient_, constraints_, lower_, upper_;
  std::vector<double> z_, multipliers_, bound_multipliers_;               ///< of `current_`
  std::vector<double> step_, step_multipliers_, step_bound_multipliers_;  ///< solution of the QP
  std::vector<double> correction_, trial_z_, trial_multipliers_, trial_bound_multipliers_, trial_constraints_;
  std::vector<double> lower_z_, upper_z_;
  std::vector<double> relaxed_step_, relaxed_multipliers_, relaxed_bound_multipliers_;
  double objective_ = 0.0;  ///< at `current_`
  bool hessian_is_convex_ = false;
  RowCosts rows_;
  std::vector<int> stage_of_variable_;
  std::vector<double> stage_merits_, merits_before_;  ///< of the last iterate evaluated, and of `current_`
  std::vector<double> merit_sums_;                    ///< prefix sums of their differences
  std::vector<double> lengths_;                       ///< step length of each stage
  double penalty_ = 0.0;
  int penalty_cuts_left_ = 0;
  double predicted_defect_ = 0.0;  ///< |J step + c|_1
  double predicted_slack_cost_ = 0.0;
  bool is_elastic_ = false;  ///< the next QP is relaxed from the start
  StartSearch search_;
  TrackingStart tracking_;
  Iterate tracking_start_;
  bool has_looked_for_tracking_ = false, has_tracking_start_ = false;  ///< in this solve; and it was not used yet
  int futile_ = 0;                                                     ///< relaxed steps since |c|_1 was this:
  double defect_before_ = 0.0;
};

}  // namespace rhec::sparse_sqp
