#pragma once

#include <string>

#include "condensed.hpp"
#include "feedback.hpp"
#include "nlopt_options.hpp"
#include "nlopt_run.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/ocp/start_search.hpp"
#include "rhec/core/ocp/tracking_start.hpp"

namespace rhec::nlopt {

/// Single shooting with NLopt (docs/method.md, section 7): the decision variables are s_0 (if free) and all controls.
/// States follow by simulation, so the defects are always zero up to rounding. Bounds of decision variables are NLopt's
/// bounds (or linear constraints, see the option `scaling`); bounds of later states, and limits, are nonlinear
/// constraints with exact Jacobians. Soft limits have slacks among the decision variables.
///
/// NLopt returns neither multipliers nor an optimality measure. So after each run the multipliers of the active bounds
/// are recovered and the core's KKT residual is computed with them; runs are repeated from the last iterate, with new
/// scaling, until that residual is within the tolerance. By default each run is followed by Newton steps on the
/// condensed problem with its active bounds (`polish`): quasi-Newton methods that compare objectives stop where these
/// differ by rounding only, which is at about half of the digits. With few decision variables, an attempt that stalls
/// is followed by one from the guess with longer runs, within the same limit of iterations; the report flags the
/// fallback.
///
/// Where that does not solve a problem and deviations grow much over the horizon, as those of unstable dynamics do, the
/// decisions of another attempt are the v_i of a regulator's policy w_i = v_i + K_i (s_i - about_i) about a trajectory
/// (Feedback) in the place of the controls: what a decision leads to decays then, however unstable the dynamics are.
///
/// The condensed problem is dense: memory grows with the square of the number of decision variables, the time of an
/// SLSQP iteration with its cube. Evaluation and NLopt allocate while solving.
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
  /// An iterate and its measures of quality.
  struct Answer {
    std::shared_ptr<const Feedback> feedback;  ///< of which x is made
    Eigen::VectorXd x, multipliers;
    double objective = 0.0, violation = 0.0;
    KktResidual kkt;
    double merit = 0.0;  ///< objective + sum |multiplier| x violation
  };
  Report optimise(const Ocp& ocp, Iterate& iterate, Clock::time_point deadline);
  Status improve(const Ocp& ocp, Answer& answer, Clock::time_point deadline);
  Status attempt(const Ocp& ocp, Answer& answer, long quota, Clock::time_point deadline);
  Status restore_feasibility(const Ocp& ocp, Answer& answer, Clock::time_point deadline);
  bool find_start(const Ocp& ocp, const Iterate& iterate);
  Status improve_from_starts(const Ocp& ocp, Answer& answer, Clock::time_point deadline);
  std::shared_ptr<const Feedback> feedback_about(const Ocp& ocp, const Iterate& start);
  bool begin_at(const Ocp& ocp, const Iterate& start, std::shared_ptr<const Feedback> feedback, Answer& answer);
  void go_back_to(const Answer& answer);
  bool find_other_start(const Ocp& ocp, const Iterate& guess, Answer& answer, Clock::time_point deadline);
  Eigen::VectorXd within_bounds(const Eigen::VectorXd& x) const;
  Answer assess(const Eigen::VectorXd& x);
  /// The Answer at the problem's current iterate with given multipliers.
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
  StartSearch search_;
  TrackingStart tracking_;
  Regulator regulator_;
  int factorisations_ = 0;
  long iterations_ = 0;
  long limit_ = 0;  ///< of the iterations, for the current attempt
  bool fallback_used_ = false;
};

}  // namespace rhec::nlopt
