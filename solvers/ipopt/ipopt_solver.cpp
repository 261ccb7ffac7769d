#include "ipopt_solver.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <utility>

#include <IpoptConfig.h>

#include "native_options.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/plugins/kit/sdk.hpp"
#include "violation_nlp.hpp"

namespace rhec::ipopt {
namespace {

/// Ipopt's own tolerance, relative to ours. It limits how small the barrier parameter may become, not when to stop.
constexpr double inner_tolerance = 1e-3;
constexpr double smallest_inner_tolerance = 1e-14;
/// Relative contribution of the barrier to the objective that is negligible, as a multiple of the tolerance.
constexpr double negligible_gap = 1.0;
constexpr int most_spare_iterations = 6;
/// The same and that of the constraints' violation, relative to 1 and the objective, of an iterate that may be far from
/// an optimum whatever its residual says: where limits leave no interior, multipliers grow without bound, and the
/// residual is relative to them.
constexpr double clear_gap = 1e-6;
/// Below this residual another run polishes the best iterate.
constexpr double near_solution = 1e-4;
constexpr int most_polishes = 2;
/// Iterations after which another kind of start is more promising. Runs that take longer are mostly those that wander
/// in directions of negative curvature, or try to meet limits that cannot be met.
constexpr int patience = 150;
/// Iterations of a restoration after which the least violation is looked for instead, by exact derivatives: where
/// limits cannot be met, Ipopt's own restoration wanders on.
constexpr int patience_with_restoration = 25;
/// A violation of the dynamics, or of limits, too large for rounding.
constexpr double clear_violation = 1e-6;
/// A point is stationary for the violation if its slope there, relative to the violation, is at most this.
constexpr double flat = 3e-4;
/// Of all solves of ViolationNlp together, which take up to 120 on the problems of the conformance suite.
constexpr int most_iterations_of_violation = 300;
constexpr int most_solves_of_violation = 5;
constexpr double tolerance_of_violation = 1e-11;
/// Initial barrier parameter of a warm start, relative to the guess' residual, and its limits.
constexpr double warm_barrier_share = 1e-4;
constexpr double smallest_warm_barrier = 1e-8;
constexpr double largest_warm_barrier = 1e-2;
constexpr double polish_barrier = 1e-10;
/// Gradients that L-BFGS keeps. Ipopt's default of 6 takes 50% more iterations.
constexpr int limited_memory_history = 50;

/// Ipopt counts the tags of its objects in a global variable and MUMPS has global state: all code that uses either,
/// destructors included, holds this lock.
std::timed_mutex& backend_lock() {
  static std::timed_mutex lock;
  return lock;
}

/// minimise (x - 1)^2 subject to 0 <= x: tests whether Ipopt can start with its options.
class Trial final : public Ipopt::TNLP {
 public:
  bool get_nlp_info(Ipopt::Index& n, Ipopt::Index& m, Ipopt::Index& jacobian_entries, Ipopt::Index& hessian_entries,
                    IndexStyleEnum& style) override {
    n = hessian_entries = 1;
    m = jacobian_entries = 0;
    style = C_STYLE;
    return true;
  }
  bool get_bounds_info(Ipopt::Index, double* lower, double* upper, Ipopt::Index, double*, double*) override {
    lower[0] = 0.0;
    upper[0] = 2e19;
    return true;
  }
  bool get_starting_point(Ipopt::Index, bool, double* x, bool, double*, double*, Ipopt::Index, bool, double*) override {
    x[0] = 2.0;
    return true;
  }
  bool eval_f(Ipopt::Index, const double* x, bool, double& value) override {
    value = (x[0] - 1.0) * (x[0] - 1.0);
    return true;
  }
  bool eval_grad_f(Ipopt::Index, const double* x, bool, double* gradient) override {
    gradient[0] = 2.0 * (x[0] - 1.0);
    return true;
  }
  bool eval_g(Ipopt::Index, const double*, bool, Ipopt::Index, double*) override { return true; }
  bool eval_jac_g(Ipopt::Index, const double*, bool, Ipopt::Index, Ipopt::Index, Ipopt::Index*, Ipopt::Index*,
                  double*) override {
    return true;
  }
  bool eval_h(Ipopt::Index, const double*, bool, double factor, Ipopt::Index, const double*, bool, Ipopt::Index,
              Ipopt::Index* row, Ipopt::Index* column, double* value) override {
    if (value) {
      value[0] = 2.0 * factor;
    } else {
      row[0] = column[0] = 0;
    }
    return true;
  }
  void finalize_solution(Ipopt::SolverReturn, Ipopt::Index, const double*, const double*, const double*, Ipopt::Index,
                         const double*, const double*, double, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {}
};

/// Whether Ipopt can start with its options.
bool starts(Ipopt::IpoptApplication& application) {
  const Ipopt::SmartPtr<Ipopt::TNLP> trial = new Trial;
  const auto outcome = application.OptimizeTNLP(trial);
  return outcome != Ipopt::Invalid_Option && outcome > Ipopt::Unrecoverable_Exception;
}

}  // namespace

const OptionTable<IpoptOptions>& IpoptOptions::table() {
  static const auto options =
      OptionTable<IpoptOptions>()
          .choice("hessian", &IpoptOptions::hessian,
                  {{"exact", Curvature::exact},
                   {"gauss_newton", Curvature::gauss_newton},
                   {"limited_memory", Curvature::limited_memory}},
                  "curvature: of the Lagrangian, of the squared residuals only, or learnt from gradients (L-BFGS)")
          .integer("max_iterations", &IpoptOptions::max_iterations, "limit of interior-point iterations",
                   between(1, 100000))
          .number("tolerance", &IpoptOptions::tolerance, "KKT residual at which it is content", greater_than(0.0))
          .flag("warm_start", &IpoptOptions::warm_start, "begin at the guess' multipliers, with a small barrier")
          .subtree("native", &IpoptOptions::native, "options of Ipopt's own, by their names; they win over ours");
  return options;
}

IpoptSolver::IpoptSolver(const Options& options) : options_(options) {
  const std::lock_guard hold(backend_lock());
  // Created without a console it prints nothing; as Initialize() is never called it reads no options file.
  application_ = new Ipopt::IpoptApplication(false);
  native_ = set_native_options(options_.native, *application_);
  if (native_.empty() || starts(*application_)) return;
  for (const auto& [name, value] : options_.native.members()) {
    const Ipopt::SmartPtr<Ipopt::IpoptApplication> alone = new Ipopt::IpoptApplication(false);
    Settings one;
    one.add(name, value);
    set_native_options(one, *alone);
    if (!starts(*alone))
      throw value.error("solver 'ipopt': Ipopt cannot start with '" + name + ": " + value.text() +
                        "'; what it asks for may not be installed");
  }
  throw options_.native.error("solver 'ipopt': Ipopt cannot start with these options together");
}

IpoptSolver::~IpoptSolver() {
  const std::lock_guard hold(backend_lock());
  nlp_ = nullptr;
  application_ = nullptr;
}

std::string IpoptSolver::why_not(const Ocp& ocp) const {
  if (options_.hessian == Curvature::exact && !ocp.has_second_derivatives())
    return "the model has no second derivatives; set hessian: gauss_newton or limited_memory";
  return {};
}

void IpoptSolver::setup(const Ocp& ocp) {
  if (const std::string reason = why_not(ocp); !reason.empty()) throw Error("solver 'ipopt': " + reason);
  ocp_ = &ocp;
  scratch_.assign(ocp.scratch_size(), 0.0);
  assessed_ = StageQp(ocp.capacity(), OcpNlp::window);
  guess_ = best_ = nearest_ = Iterate(ocp.capacity());
  if (ocp.capacity().limits > 0) search_.setup(ocp);
  const std::lock_guard hold(backend_lock());
  nlp_ = new OcpNlp(ocp, options_.hessian);
}

void IpoptSolver::set(const char* name, double value) {
  if (!native_.contains(name)) application_->Options()->SetNumericValue(name, value);
}
void IpoptSolver::set(const char* name, int value) {
  if (!native_.contains(name)) application_->Options()->SetIntegerValue(name, value);
}
void IpoptSolver::set(const char* name, const char* value) {
  if (!native_.contains(name)) application_->Options()->SetStringValue(name, value);
}

/// The start of the run after one that failed; `adaptive` is the last.
IpoptSolver::Start IpoptSolver::start_after(Start start, Ending ending) const noexcept {
  if (start == Start::warm) return Start::cold;
  // Another Hessian does not make a problem feasible.
  const bool may_help = options_.hessian == Curvature::exact && ending != Ending::infeasible;
  return start == Start::cold && may_help ? Start::gauss_newton : Start::adaptive;
}

int IpoptSolver::iterations_of(Start start) const noexcept {
  const int left = std::max(options_.max_iterations - iterations_, 0);
  return start == Start::adaptive ? left : std::min(left, patience);
}

void IpoptSolver::set_run_options(Start start, double barrier) {
  const double tolerance = std::max(inner_tolerance * options_.tolerance, smallest_inner_tolerance);
  set("tol", tolerance);
  // The same tolerance for scaled and unscaled quantities; it is the core's residual that stops a run.
  set("dual_inf_tol", tolerance);
  set("constr_viol_tol", tolerance);
  set("compl_inf_tol", tolerance);
  set("acceptable_iter", 0);
  set("max_iter", iterations_of(start));
  set("hessian_approximation", options_.hessian == Curvature::limited_memory ? "limited-memory" : "exact");
  set("limited_memory_max_history", limited_memory_history);
  set("nlp_scaling_method", "none");
  set("bound_relax_factor", 0.0);
  set("mu_strategy", start == Start::adaptive ? "adaptive" : "monotone");
  set("warm_start_init_point", barrier > 0.0 ? "yes" : "no");
  set("mu_init", barrier > 0.0 ? barrier : 0.1);
  // The start is on the central path already: Ipopt must not push it away from its bounds [16].
  for (const char* push : {"warm_start_bound_push", "warm_start_bound_frac", "warm_start_slack_bound_push",
                           "warm_start_slack_bound_frac", "warm_start_mult_bound_push"})
    set(push, 1e-16);
}

/// Keeps the iterate of the smallest residual; of those within the tolerance the last one, whose barrier parameter is
/// smallest.
void IpoptSolver::keep_if_better(const PrimalDual& iterate) noexcept {
  seen_kkt_ = nlp_->residual_at(iterate);
  const double residual = seen_kkt_.largest();
  if (!(residual <= options_.tolerance || residual < best_kkt_.largest())) return;
  best_kkt_ = seen_kkt_;
  best_objective_ = nlp_->objective();
  nlp_->exchange_assessed(best_);
}

bool IpoptSolver::see(int iteration, const PrimalDual* iterate) noexcept {
  if (iteration > 0) ++iterations_;
  restoring_ = iterate ? 0 : restoring_ + 1;
  is_stuck_ = may_be_stuck_ && restoring_ > patience_with_restoration;
  if (is_stuck_) return false;
  if (iterate) {
    keep_if_better(*iterate);
    if (seen_kkt_.largest() <= options_.tolerance) {
      const double gap = nlp_->complementarity_gap(), size = std::abs(nlp_->objective());
      const bool is_enough = gap <= negligible_gap * options_.tolerance * size || --spare_iterations_ <= 0;
      if (is_enough && !(gap + nlp_->violation_gap() > clear_gap * (1.0 + size))) return false;
    }
  }
  stopped_late_ = is_late();
  return !stopped_late_;
}

void IpoptSolver::see_last(const PrimalDual& iterate) noexcept {
  if (best_kkt_.largest() > options_.tolerance) keep_if_better(iterate);
}

/// Of the constraints; Ipopt's iterates are within their bounds.
double IpoptSolver::violation_of(const KktResidual& kkt) const noexcept {
  return ocp_->capacity().limits > 0 ? std::max(kkt.defect, kkt.bound_violation) : kkt.defect;
}

/// Runs Ipopt, and adds its own time to the sum.
Ipopt::ApplicationReturnStatus IpoptSolver::optimize(const Ipopt::SmartPtr<Ipopt::TNLP>& nlp) {
  const auto begin = Clock::now();
  const double ours = nlp_->microseconds();
  const auto outcome = application_->OptimizeTNLP(nlp);
  backend_us_ += microseconds_since(begin) - (nlp_->microseconds() - ours);
  return outcome;
}

IpoptSolver::Ending IpoptSolver::run(Start start) {
  const Iterate& from = start == Start::polish ? best_ : start == Start::nearest ? nearest_ : guess_;
  double barrier = 0.0;
  if (start == Start::warm)
    barrier = std::clamp(warm_barrier_share * best_kkt_.largest(), smallest_warm_barrier, largest_warm_barrier);
  if (start == Start::polish) barrier = polish_barrier;
  set_run_options(start, barrier);
  spare_iterations_ = most_spare_iterations;
  restoring_ = 0;
  may_be_stuck_ = !is_judged_ && start != Start::warm && start != Start::polish;
  is_stuck_ = false;
  nlp_->set_curvature(start == Start::gauss_newton ? Curvature::gauss_newton : options_.hessian);
  nlp_->set_start(from, barrier);
  const auto outcome = optimize(Ipopt::GetRawPtr(nlp_));
  if (best_kkt_.largest() <= options_.tolerance) return Ending::converged;
  if (stopped_late_ || outcome == Ipopt::Maximum_CpuTime_Exceeded) return Ending::out_of_time;
  if (iterations_ >= options_.max_iterations) return Ending::out_of_iterations;
  if (is_stuck_) return Ending::infeasible;
  if ((outcome == Ipopt::Infeasible_Problem_Detected || outcome == Ipopt::Restoration_Failed) &&
      violation_of(seen_kkt_) > clear_violation)
    return Ending::infeasible;
  return best_kkt_.largest() <= near_solution ? Ending::near : Ending::lost;
}

/// Whether the violation of the constraints has a minimum near the guess that is not zero; `nearest_` is that point, or
/// the last one. The iterations are not of the problem itself, and not counted.
bool IpoptSolver::is_infeasible() {
  if (search_.starts() == 0) nearest_ = guess_;
  is_judged_ = true;
  may_be_stuck_ = is_stuck_ = false;
  int left = std::min(options_.max_iterations, most_iterations_of_violation);
  for (int solve = 0; solve < most_solves_of_violation && left > 0; ++solve) {
    set_run_options(Start::cold, 0.0);
    set("tol", tolerance_of_violation);
    set("max_iter", left);
    set("hessian_approximation", "exact");
    nlp_->set_curvature(options_.hessian == Curvature::exact ? Curvature::exact : Curvature::gauss_newton);
    nlp_->set_start(nearest_, 0.0);
    const Ipopt::SmartPtr<ViolationNlp> violation = new ViolationNlp(*nlp_, *this);
    const auto outcome = optimize(Ipopt::GetRawPtr(violation));
    if (!std::isfinite(violation->largest())) return false;
    nlp_->write(violation->point(), nearest_);
    if (violation->largest() <= clear_violation) return false;
    if (violation->slope() <= flat) return !find_other_start();
    // What was stopped has not succeeded.
    if (outcome != Ipopt::Solve_Succeeded && outcome != Ipopt::Solved_To_Acceptable_Level) {
      find_other_start();
      return false;
    }
    // What is left of the slope is the pull of the point at which it began: again, from where it has come to.
    left -= std::max(violation->iterations(), 1);
  }
  return false;
}

/// A point without slope need not be a minimum: looks for one that violates less than the least of all starts so far,
/// from the point that was found and from the guess. `nearest_` is that one, and all is open again.
bool IpoptSolver::find_other_start() {
  if (!search_.find_other(*ocp_, guess_, nearest_, deadline_, scratch_, nearest_)) return false;
  is_judged_ = false;
  return has_other_start_ = true;
}

/// True if `iterate` was replaced by the best iterate; then `report` has its objective and KKT residual.
bool IpoptSolver::improve(const Ocp& ocp, Iterate& iterate, Report& report) {
  nlp_->take(ocp);
  // The guess is the first candidate, with the given initial state.
  guess_ = iterate;
  if (ocp.initial_state()) std::copy_n(ocp.initial_state(), ocp.state_count(0), guess_.state(0));
  Report of_guess;
  assess(ocp, guess_, assessed_, scratch_, of_guess);
  if (!std::isfinite(of_guess.objective)) return false;
  best_ = guess_;
  best_kkt_ = of_guess.kkt;
  best_objective_ = of_guess.objective;
  if (nlp_->has_empty_bounds()) {
    report.status = Status::infeasible;
    return false;
  }
  const bool warm =
      options_.warm_start && (largest_costate(ocp, guess_) > 0.0 || largest_bound_multiplier(ocp, guess_) > 0.0);
  Ending ending = best_kkt_.largest() <= options_.tolerance ? Ending::converged : Ending::lost;
  if (nlp_->variables() == 0 || ending == Ending::converged) {
    // Nothing to vary, or nothing to improve.
    ending = best_kkt_.largest() <= options_.tolerance ? Ending::converged : Ending::lost;
  } else {
    int polishes = 0;
    bool was_near = false;
    Start begun = warm ? Start::warm : Start::cold;
    for (Start start = begun;;) {
      ending = run(start);
      if (ending == Ending::near && polishes++ < most_polishes) {
        start = Start::polish;
        continue;
      }
      if (ending == Ending::converged || ending == Ending::out_of_time) break;
      // That Ipopt's restoration ends somewhere, or does not end, is no proof, and neither are iterations that were too
      // few.
      const bool is_last = ending == Ending::out_of_iterations || begun == Start::adaptive;
      const bool is_claim = ending == Ending::infeasible && start != Start::warm;
      const bool is_in_doubt = is_last || is_claim || (ending == Ending::lost && start == Start::cold);
      if (is_in_doubt && violation_of(best_kkt_) > clear_violation) {
        if (!is_judged_) {
          report.fallback_used = true;
          if (is_infeasible()) {
            ending = Ending::infeasible;
            break;
          }
          if (stopped_late_) {
            ending = Ending::out_of_time;
            break;
          }
        }
        if (ending == Ending::out_of_iterations) break;
        if (std::exchange(has_other_start_, false)) {
          start = Start::nearest;
          continue;
        }
        if ((is_last || is_claim) && !was_near) {
          was_near = true;
          start = Start::nearest;
          continue;
        }
      }
      report.fallback_used |= ending != Ending::out_of_iterations;
      if (is_last) {
        if (ending == Ending::infeasible) ending = Ending::lost;
        break;
      }
      start = begun = start_after(begun, ending);
    }
  }
  switch (ending) {
    case Ending::converged:
      report.status = Status::solved;
      break;
    case Ending::out_of_time:
      report.status = Status::deadline;
      break;
    case Ending::out_of_iterations:
      report.status = Status::iteration_limit;
      break;
    case Ending::infeasible:
      report.status = Status::infeasible;
      break;
    case Ending::near:
    case Ending::lost:
      report.status = Status::stalled;
      break;
  }
  if (report.status == Status::infeasible || !is_finite(ocp, best_)) return false;
  std::swap(iterate, best_);
  report.objective = best_objective_;
  report.kkt = best_kkt_;
  return true;
}

Report IpoptSolver::solve(Iterate& iterate, Clock::time_point deadline) noexcept {
  Report report;
  if (!ocp_ || !has_sound_numbers(*ocp_, iterate)) return report;
  deadline_ = deadline;
  iterations_ = 0;
  backend_us_ = 0.0;
  stopped_late_ = is_judged_ = has_other_start_ = false;
  search_.begin();
  bool is_assessed = false;
  try {
    std::unique_lock hold(backend_lock(), std::defer_lock);
    if (deadline == Clock::time_point::max()) {
      hold.lock();
    } else if (is_late() || !hold.try_lock_until(deadline)) {
      report.status = Status::deadline;
    }
    if (hold.owns_lock()) {
      nlp_->set_spectator(this);
      is_assessed = improve(*ocp_, iterate, report);
      nlp_->release();
      if (report.status == Status::bad_input) return report;
    }
  } catch (const std::exception&) {
    // Out of memory: the iterate is still the guess.
    report.status = Status::stalled;
  } catch (...) {
    // Ipopt's exceptions are not derived from std::exception.
    report.status = Status::stalled;
  }
  report.iterations = iterations_;
  if (!is_assessed) assess(*ocp_, iterate, assessed_, scratch_, report);
  return std::isfinite(report.objective) ? report : Report{};
}

}  // namespace rhec::ipopt

RHEC_PLUGIN(rhec::PluginKind::solver, rhec::ipopt::IpoptSolver,
            {.name = "ipopt",
             .version = "0.1.0",
             .licence = "BSD-2-Clause AND EPL-1.0 AND CECILL-C",
             .source = "Multiple shooting with the interior-point filter method of Waechter and Biegler (2006)",
             .backend = "Ipopt with MUMPS",
             .backend_version = IPOPT_VERSION,
             .capabilities = "rhe, rhc, bounds on states, inputs and parameters, exact and approximate curvature; "
                             "allocates while solving; solves of one process wait for each other"});
