#pragma once

#include <string>

#include "condensed.hpp"
#include "nlopt_options.hpp"
#include "nlopt_run.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec::nlopt {

/// Single shooting on NLopt: the decisions are s_0 (where free) and all controls, states follow by simulation, and so
/// the defect is zero up to rounding whatever NLopt does. Bounds of decisions are NLopt's bounds (or linear
/// constraints, see the option `scaling`); bounds of later states are nonlinear constraints with exact Jacobians.
///
/// NLopt tells neither multipliers nor how far it is from an optimum. So after each run multipliers are recovered from
/// the bounds that are active, the core's residual is computed with them, and the run is repeated from its last iterate
/// (scaled anew) until that residual is met. By default each run is also finished by Newton steps on the condensed
/// problem with its active bounds (`polish`): quasi-Newton methods that compare objectives end where these differ by
/// rounding only, which is about half of the digits. With few decisions, an attempt that gets stuck is followed by one
/// from the guess with longer runs, within the same limit of iterations; the report says that there was a fallback.
///
/// The condensed problem is dense: memory grows with the square of the number of decisions and an iteration of SLSQP
/// with its cube. Evaluation and NLopt allocate while solving.
class NloptSolver final : public Solver {
 public:
  using Options = NloptOptions;
  static const OptionTable<Options>& table() { return Options::table(); }
  explicit NloptSolver(const Options& options);

  std::string why_not(const Ocp& ocp) const override;
  void setup(const Ocp& ocp) override;
  void prepare(const Iterate& guess) noexcept override;
  using Solver::solve;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override;
  void reset() noexcept override;

 private:
  /// An iterate with what it is worth.
  struct Answer {
    Eigen::VectorXd x, multipliers;
    double objective = 0.0, violation = 0.0;
    KktResidual kkt;
    double merit = 0.0;  ///< the objective, and what the violations are worth by their multipliers
  };
  Report optimise(const Ocp& ocp, Iterate& iterate, Clock::time_point deadline);
  Status improve(const Ocp& ocp, Answer& answer, Clock::time_point deadline);
  Status attempt(const Ocp& ocp, Answer& answer, long quota, Clock::time_point deadline);
  Status restore_feasibility(const Ocp& ocp, Answer& answer, Clock::time_point deadline);
  bool find_start(const Ocp& ocp, const Iterate& iterate);
  Eigen::VectorXd within_bounds(const Eigen::VectorXd& x) const;
  Answer assess(const Eigen::VectorXd& x);
  /// What there is at the problem's present iterate with given multipliers.
  Answer answer_with(const Eigen::VectorXd& multipliers);
  bool is_better(const Answer& one, const Answer& other) const noexcept;
  bool polish(const Ocp& ocp, Answer& answer, Clock::time_point deadline);
  Transformation transformation_at(const Ocp& ocp, const Answer& answer);
  long iterations_per_run() const noexcept;
  long iterations_left() const noexcept { return limit_ - iterations_; }
  bool scales_fully() const noexcept;

  Options options_;
  Traits traits_;
  const Ocp* ocp_ = nullptr;
  CondensedProblem problem_;
  std::vector<double> scratch_;
  StageQp qp_;
  int factorisations_ = 0;
  long iterations_ = 0;
  long limit_ = 0;  ///< of the iterations, for the attempt under way
  bool fallback_used_ = false;
};

}  // namespace rhec::nlopt
