#pragma once

#include <vector>

#include "rhec/core/options.hpp"
#include "rhec/core/solver.hpp"
#include "stage_qp_solver.hpp"

namespace rhec::gn_rti {

enum class Mode {
  rti,      ///< a fixed number of full steps a sample (Diehl 2002)
  converge  ///< to the tolerance, globalised by a line search
};
enum class Curvature {
  gauss_newton,
  exact,
  automatic  ///< Gauss-Newton for estimation, exact for control
};

struct GnRtiOptions {
  Mode mode = Mode::rti;
  Curvature hessian = Curvature::automatic;
  int iterations = 1;
  int max_iterations = 60;
  double tolerance = 1e-8;

  static const OptionTable<GnRtiOptions>& table();
};

/// Sequential quadratic programming on the stages of an Ocp, with a Riccati recursion inside.
///
/// `prepare` linearises at the guess and factorises with the active set that the guess' multipliers claim; `feedback`
/// then needs only vectors, unless the newest data change the active set. `finish` linearises at the new point, of
/// which the next guess is the same a stage later: `prepare` has one interval left to evaluate, or none. Estimation
/// problems have small residuals and take Gauss-Newton's Hessian; control problems under slip have large ones, on which
/// Gauss-Newton does not even converge locally, and take the exact one with the guess' costates, convexified inside the
/// recursion.
class GnRti final : public Solver {
 public:
  using Options = GnRtiOptions;
  static const OptionTable<Options>& table() { return Options::table(); }
  explicit GnRti(const Options& options) : options_(options) {}

  std::string why_not(const Ocp& ocp) const override;
  void setup(const Ocp& ocp) override;
  void prepare(const Ocp& ocp, const Iterate& guess) noexcept override;
  Report solve(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept override;
  Report feedback(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept override;
  void finish(const Ocp& ocp, Iterate& point, Report& report) noexcept override;
  bool covariances(const Ocp& ocp, const Iterate& point, StageRange nodes, std::span<double> blocks) noexcept override;
  void reset() noexcept override;

 private:
  Hessian hessian_for(const Ocp& ocp) const noexcept;
  void linearise(const Ocp& ocp, Iterate& point) noexcept;
  bool is_prepared_for(const Ocp& ocp, const Iterate& point) const noexcept;
  void settle(const Ocp& ocp, Iterate& point, Report& report) noexcept;
  Report real_time(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept;
  bool judge_step(const Ocp& ocp, const Iterate& point, Report& report) noexcept;
  void give_up(const Ocp& ocp, const Iterate& point, Report& report) noexcept;
  Report converge(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept;
  void add_step(const Ocp& ocp, const Iterate& from, double length, Iterate& to) const noexcept;
  void roll_out_step(const Ocp& ocp, const Iterate& from, double length, Iterate& to) noexcept;
  double merit(const Ocp& ocp, const Iterate& point) noexcept;
  StageQpSolver::Outcome solve_program(Report& report, Clock::time_point deadline) noexcept;
  void ask_for_less(double share) noexcept;
  bool search_along_step(const Ocp& ocp, double residual, double& merit_after) noexcept;

  Options options_;
  Capacity capacity_;
  StageQp qp_, other_qp_;
  StageQpSolver qp_solver_;
  Iterate prepared_point_, step_, trial_, best_, other_trial_;
  std::vector<double> scratch_, defects_;
  bool remembers_ = false;  ///< `qp_` does, at which point it was made; otherwise `prepared_point_` is that
  bool prepared_ = false;
  const Ocp* prepared_ocp_ = nullptr;  ///< looked at no more, only compared with
  bool is_pending_ = false;            ///< the last step was not judged yet; `step_` is the point before it
  bool use_exact_ = false;
  double defect_penalty_ = 0.0, bound_penalty_ = 0.0;
  double asked_share_ = 1.0;  ///< of the defects and violations that the step is asked to remove
};

}  // namespace rhec::gn_rti
