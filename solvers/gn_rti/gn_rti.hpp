#pragma once

#include <memory>
#include <vector>

#include "rhec/core/config/options.hpp"
#include "rhec/core/ocp/hessian_choice.hpp"
#include "rhec/core/ocp/linearisation.hpp"
#include "rhec/core/ocp/ocp.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/ocp/start_search.hpp"
#include "rhec/core/ocp/tracking_start.hpp"
#include "rhec/core/qp/stage_qp_solver.hpp"

namespace rhec::gn_rti {

enum class Mode {
  rti,      ///< a fixed number of full steps per sample [9]
  converge  ///< iterates to the tolerance, globalised by a line search
};
enum class Curvature {
  gauss_newton,
  exact,
  automatic  ///< Gauss-Newton for estimation; for control exact, or what HessianChoice says
};

struct GnRtiOptions {
  Mode mode = Mode::rti;
  Curvature hessian = Curvature::automatic;
  int iterations = 1;
  double residual = 0.0;
  int max_iterations = 100;
  double tolerance = 1e-8;

  static const OptionTable<GnRtiOptions>& table();
};

/// Sequential quadratic programming on the stages of an Ocp; the QPs are solved by a Riccati recursion (docs/method.md,
/// section 7 [9]).
///
/// `prepare` linearises at the guess and factorises with the active set that the guess' multipliers imply; `feedback`
/// then needs vector operations only, unless the newest data change the active set. `finish` linearises at the new
/// iterate. The next guess is that iterate shifted by one stage, so `prepare` has at most one interval left to
/// evaluate.
/// Estimation problems have small residuals
/// and use the Gauss-Newton Hessian. Control problems under slip have large residuals, on which Gauss-Newton does not
/// even converge locally; they use the exact Hessian with the guess' costates, convexified inside the recursion.
///
/// From a plan through what has just appeared in its way, as an obstacle head-on, exact steps may end, and stay, at a
/// saddle point, where the plan goes on through it. There a few Gauss-Newton steps are taken in the sample, unless the
/// exact Hessian was asked for.
class GnRti final : public Solver {
 public:
  using Options = GnRtiOptions;
  static const OptionTable<Options>& table() { return Options::table(); }
  explicit GnRti(const Options& options) : options_(options) {}

  std::string why_not(const Ocp& ocp) const override;
  void setup(const Ocp& ocp) override;
  void prepare(const Iterate& guess) noexcept override;
  using Solver::solve;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override;
  Report feedback(Iterate& iterate, Clock::time_point deadline) noexcept override;
  void finish(Iterate& iterate, Report& report) noexcept override;
  bool covariances(const Iterate& iterate, StageRange nodes, std::span<double> blocks) noexcept override;
  void reset() noexcept override;

 private:
  Hessian hessian() const noexcept;
  double linearise(Iterate& iterate) noexcept;
  void settle(Iterate& iterate, Report& report) noexcept;
  Report real_time(Iterate& iterate, Clock::time_point deadline) noexcept;
  bool is_surprised() const noexcept;
  void clip_active_controls(Iterate& iterate) const noexcept;
  bool assess_step(const Iterate& iterate, Report& report) noexcept;
  void give_up(const Iterate& iterate, Report& report) noexcept;
  Report converge(Iterate& iterate, Clock::time_point deadline) noexcept;
  void add_step(const Iterate& from, double length, Iterate& to) const noexcept;
  void roll_out_step(const Iterate& from, double length, Iterate& to) noexcept;
  double merit(const Iterate& iterate) noexcept;
  LimitCosts costs_of_limits(const Iterate& iterate) noexcept;
  StageQpSolver::Outcome solve_qp(Report& report, Clock::time_point deadline) noexcept;
  void relax_qp(double share) noexcept;
  StageQpSolver::Outcome relax_until_feasible(StageQpSolver::Outcome outcome, Report& report,
                                              Clock::time_point deadline) noexcept;
  void raise(double& penalty, double least) noexcept;
  bool is_futile() noexcept;
  bool refine(Report& report, double residual, Clock::time_point deadline) noexcept;
  void begin_at(const Iterate& guess) noexcept;
  bool find_other_start(const Iterate& guess, bool is_feasible, Clock::time_point deadline) noexcept;
  StageQpSolver::Outcome solve_at_prices(Report& report, double& before, double& after,
                                         Clock::time_point deadline) noexcept;
  StageQpSolver::Outcome solve_elastic(Report& report, Clock::time_point deadline) noexcept;
  bool search_along_step(Report& report, double residual, double& merit_after, Clock::time_point deadline) noexcept;
  bool correct_step(const StageQp& first, Report& report, Clock::time_point deadline) noexcept;
  // priced_steps.cpp
  void begin_priced_at(const Iterate& guess, Clock::time_point deadline) noexcept;
  void begin_priced(double price) noexcept;
  bool is_violation_stuck(int iterations) noexcept;
  bool is_nearly_feasible() noexcept;
  void note_met(const KktResidual& kkt, double objective) noexcept;
  void note_violation(const KktResidual& kkt) noexcept;
  void set_price(double price) noexcept;
  bool raise_price(double merit_after) noexcept;
  StageQpSolver::Outcome solve_priced(Report& report, Clock::time_point deadline) noexcept;
  bool take_priced_step(Report& report, double residual, double& merit_after, Clock::time_point deadline,
                        bool& feasible, bool& late) noexcept;

  Options options_;
  const Ocp* ocp_ = nullptr;
  std::unique_ptr<Linearisation> linearisation_;
  StageQp trial_qp_, relaxed_qp_;
  const StageQp* qp_ = nullptr;  ///< the QP being solved: the linearisation's, or `relaxed_qp_`
  StageQpSolver qp_solver_;
  Iterate step_, trial_, best_, other_trial_, first_step_;
  std::vector<double> scratch_, defects_, limits_;
  bool is_prepared_ = false;
  bool is_pending_ = false;  ///< the last step is not assessed yet; `step_` holds the iterate before it
  bool use_exact_ = false;
  HessianChoice choice_;  ///< of mode rti
  // At the end of the last sample of mode rti.
  LimitCosts expected_limits_;
  double expected_objective_ = 0.0;
  bool evades_ = false;  ///< what has appeared in the way of the guess: with Gauss-Newton steps
  double defect_penalty_ = 0.0, bound_penalty_ = 0.0;
  bool is_elastic_ = false, was_elastic_ = false;  ///< hard limits have a price in the QP, and had in the last step's
  int penalty_cuts_left_ = 0, futile_ = 0;
  double violation_before_ = 0.0;  ///< of the hard limits before the last `futile_` steps
  double asked_share_ = 1.0;       ///< share of the defects and violations that the step must remove
  // Of steps at a price.
  bool is_priced_ = false;
  double price_ = 0.0, damping_ = 0.0;
  int attempts_ = 0;          ///< that began at the guess
  double first_price_ = 0.0;  ///< relative to the gradient
  int futile_prices_ = 0;
  double settled_violation_ = 0.0;                    ///< before the last futile prices
  double step_length_ = 1.0, shortest_length_ = 0.0;  ///< of the last search along a step: accepted, and allowed
  double slope_ = 0.0;                                ///< of the merit along it
  double first_violation_ = 0.0,
         least_violation_ = 0.0;  ///< of the hard limits, and at which iteration it was half of that before
  int least_violation_at_ = 0;
  // Where limits seem impossible to meet.
  StartSearch search_;
  Iterate other_start_;
  TrackingStart tracking_;
  Iterate tracking_start_;
  bool has_tracking_start_ = false;
  // Of the points of this solve that meet all constraints, the one with the least objective; without any, of those that
  // no step leads on from, the one that violates hard limits least.
  Iterate met_;
  double met_objective_ = 0.0, met_violation_ = 0.0;
  bool has_met_ = false;
};

}  // namespace rhec::gn_rti
