#pragma once

#include <mutex>
#include <set>
#include <string>

#include <IpIpoptApplication.hpp>

#include "ocp_nlp.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec::ipopt {

struct IpoptOptions {
  Curvature hessian = Curvature::exact;
  int max_iterations = 500;
  double tolerance = 1e-8;
  bool warm_start = true;
  Settings native;

  static const OptionTable<IpoptOptions>& table();
};

/// Multiple shooting: all states and controls are variables of one sparse NLP, solved by Ipopt's filter
/// interior-point method.
///
/// Ipopt runs until the core's own residual is within the tolerance and what the barrier adds to the objective is
/// negligible; it never decides itself that it is done. A guess with multipliers is a warm start: its multipliers say
/// which bounds are close, and its residual how small the barrier may begin.
///
/// A run that is lost, or has found nothing after so many iterations that it is likely to be, is followed by others
/// from the guess, in this order: without the guess' multipliers, with Gauss-Newton's curvature in the place of the
/// exact one, and with an adaptive barrier. All of them together make max_iterations at most, and the report says that
/// there was a fallback.
///
/// Ipopt 3.11 counts with a global variable and MUMPS keeps global state, so solves wait for each other, process-wide;
/// the time they wait counts for their deadline. Every solve builds Ipopt's algorithm anew, so nothing is remembered
/// from one to the next but the guess.
class IpoptSolver final : public Solver, private Spectator {
 public:
  using Options = IpoptOptions;
  static const OptionTable<Options>& table() { return Options::table(); }
  /// Throws Error where a native option is unknown or refused.
  explicit IpoptSolver(const Options& options);
  ~IpoptSolver() override;
  IpoptSolver(const IpoptSolver&) = delete;
  IpoptSolver& operator=(const IpoptSolver&) = delete;

  std::string why_not(const Ocp& ocp) const override;
  void setup(const Ocp& ocp) override;
  void prepare(const Iterate&) noexcept override {}
  using Solver::solve;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override;
  void reset() noexcept override {}

  /// Of the last solve, the time within Ipopt, without what its calls back took [us].
  double backend_us() const noexcept { return backend_us_; }

 private:
  /// How a run of Ipopt begins.
  enum class Start {
    warm,          ///< from the guess and its multipliers
    cold,          ///< from the guess alone
    gauss_newton,  ///< the same with that curvature
    adaptive,      ///< the same with the other strategy for the barrier
    polish         ///< from the best iterate so far, near the solution
  };
  enum class Ending { converged, out_of_time, out_of_iterations, infeasible, near, lost };

  bool improve(const Ocp& ocp, Iterate& iterate, Report& report);
  Ending run(Start start, const Iterate& from);
  Start start_after(Start start, Ending ending) const noexcept;
  int iterations_of(Start start) const noexcept;
  void set_run_options(Start start, double barrier);
  bool see(int iteration, const PrimalDual* iterate) noexcept override;
  void see_last(const PrimalDual& iterate) noexcept override;
  void keep_if_better(const PrimalDual& iterate) noexcept;
  bool is_late() const noexcept { return deadline_ != Clock::time_point::max() && Clock::now() > deadline_; }

  // Ours unless the user set the native option of that name.
  void set(const char* name, double value);
  void set(const char* name, int value);
  void set(const char* name, const char* value);

  Options options_;
  std::set<std::string> native_;
  Ipopt::SmartPtr<Ipopt::IpoptApplication> application_;  ///< touched under the lock only
  Ipopt::SmartPtr<OcpNlp> nlp_;
  const Ocp* ocp_ = nullptr;
  StageQp assessed_;
  std::vector<double> scratch_;

  // Of the solve under way.
  Clock::time_point deadline_;
  Iterate guess_, best_;
  KktResidual best_kkt_, seen_kkt_;
  double best_objective_ = 0.0, backend_us_ = 0.0;
  bool stopped_late_ = false;
  int iterations_ = 0;
  int spare_iterations_ = 0;  ///< left for the barrier to become negligible once the residual is within the tolerance
};

}  // namespace rhec::ipopt
