#pragma once

#include <mutex>
#include <set>
#include <string>

#include <IpIpoptApplication.hpp>

#include "ocp_nlp.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/ocp/start_search.hpp"

namespace rhec::ipopt {

struct IpoptOptions {
  Curvature hessian = Curvature::exact;
  int max_iterations = 500;
  double tolerance = 1e-8;
  bool warm_start = true;
  Settings native;

  static const OptionTable<IpoptOptions>& table();
};

/// Multiple shooting: all states and controls are variables of one sparse NLP, solved by Ipopt's interior-point filter
/// method [16] (docs/method.md, section 7).
///
/// Ipopt runs until the core's KKT residual is within the tolerance, the barrier's contribution to the objective is
/// negligible, and that of violated constraints small; Ipopt's own convergence test does not decide. A guess with
/// multipliers is a warm start: its multipliers tell which bounds are close, and its residual how small the initial
/// barrier parameter may be.
///
/// If a run fails, or has not converged after so many iterations that it probably will not, further runs start from the
/// guess, in this order: without the guess' multipliers, with the Gauss-Newton instead of the exact Hessian, and with
/// an adaptive barrier parameter. All runs together take at most max_iterations, and the report flags the fallback.
///
/// Where a run says that constraints cannot be met, is in restoration for long, or has not met them from the guess
/// alone, the violation alone is minimised from the guess (ViolationNlp), once, with a budget of its own. The problem
/// is infeasible if that ends where the violation is stationary and not zero; otherwise a run begins at the point that
/// was found, after such a claim or where no other has met them, if there are iterations left. Before a problem is
/// called infeasible, moves of some size are tried (StartSearch).
///
/// Ipopt 3.11 has a global counter and MUMPS keeps global state, so solves are serialised across the process; waiting
/// counts towards the deadline. Every solve builds Ipopt's algorithm anew, so only the guess carries over from one
/// solve to the next.
class IpoptSolver final : public Solver, private Spectator {
 public:
  using Options = IpoptOptions;
  static const OptionTable<Options>& table() { return Options::table(); }
  /// Throws Error if a native option is unknown or Ipopt refuses its value.
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

  /// Time that the last solve spent in Ipopt, without its callbacks [us].
  double backend_us() const noexcept { return backend_us_; }

 private:
  /// How a run of Ipopt begins.
  enum class Start {
    warm,          ///< from the guess and its multipliers
    cold,          ///< from the guess alone
    gauss_newton,  ///< the same with the Gauss-Newton Hessian
    adaptive,      ///< the same with the adaptive barrier strategy
    nearest,       ///< from the point nearest to feasible
    polish         ///< from the best iterate so far, near the solution
  };
  enum class Ending { converged, out_of_time, out_of_iterations, infeasible, near, lost };

  bool improve(const Ocp& ocp, Iterate& iterate, Report& report);
  Ipopt::ApplicationReturnStatus optimize(const Ipopt::SmartPtr<Ipopt::TNLP>& nlp);
  Ending run(Start start);
  bool is_infeasible();
  bool find_other_start();
  Start start_after(Start start, Ending ending) const noexcept;
  int iterations_of(Start start) const noexcept;
  void set_run_options(Start start, double barrier);
  bool see(int iteration, const PrimalDual* iterate) noexcept override;
  void see_last(const PrimalDual& iterate) noexcept override;
  double violation_of(const KktResidual& kkt) const noexcept;
  void keep_if_better(const PrimalDual& iterate) noexcept;
  bool is_late() const noexcept { return deadline_ != Clock::time_point::max() && Clock::now() > deadline_; }

  // Set an option of Ipopt unless the user has set it in `native`.
  void set(const char* name, double value);
  void set(const char* name, int value);
  void set(const char* name, const char* value);

  Options options_;
  std::set<std::string> native_;
  Ipopt::SmartPtr<Ipopt::IpoptApplication> application_;  ///< used under the lock only
  Ipopt::SmartPtr<OcpNlp> nlp_;
  const Ocp* ocp_ = nullptr;
  StageQp assessed_;
  std::vector<double> scratch_;

  // Of the current solve.
  Clock::time_point deadline_;
  Iterate guess_, best_, nearest_;
  KktResidual best_kkt_, seen_kkt_;
  double best_objective_ = 0.0, backend_us_ = 0.0;
  bool stopped_late_ = false;
  StartSearch search_;
  bool has_other_start_ = false;  ///< `nearest_` is one from which no run has begun
  bool is_judged_ = false;        ///< the least violation was looked for
  bool may_be_stuck_ = false;     ///< a restoration that takes long ends the run
  bool is_stuck_ = false;         ///< one has
  int restoring_ = 0;             ///< iterations of the present restoration
  int iterations_ = 0;
  int spare_iterations_ = 0;  ///< left for the barrier to become negligible once the residual is within the tolerance
};

}  // namespace rhec::ipopt
