#include "nlopt_solver.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>

#include "active_set.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/qp/symmetric_eigen.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec::nlopt {
namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

// A violation larger than the tolerance of a run can leave.
constexpr double infeasible_beyond = 1e-6;
// Below this KKT residual Newton steps are tried.
constexpr double near_solution = 0.1;
constexpr int most_newton_steps = 30;
// A new scaling brings better curvature than quasi-Newton updates do. With many variables it takes far less time than
// an iteration of SLSQP, so runs are short; with few it takes about as long.
constexpr int many_variables = 100;
constexpr long iterations_of_many_variables = 3;
constexpr long iterations_of_few_variables = 15;
// Factor by which the runs of a second attempt are longer. With very uneven weights, rounding decides how far a short
// run gets.
constexpr long longer_runs = 3;
// The same of a run that follows one without progress, with many variables, and how many such may follow each other.
constexpr long longer_short_runs = 5;
constexpr int most_longer_runs = 3;
// Where deviations grow by more than this over the horizon, controls follow a regulator's policy.
constexpr double most_growth = 1e3;
// Iterations after which an attempt with short runs is abandoned.
constexpr long patience = 300;
// Iterations after which a run that restores feasibility has to have removed a part of the violation, with limits.
constexpr long restoring_iterations = 100;
// A gain of the merit, relative to it, for which a start is left although a run has failed.
constexpr double clear_gain = 0.1;
// Distances within which a bound may have a multiplier: the one of the smallest residual is taken.
constexpr double distances[] = {1e-9, 1e-6, 1e-4};
// Curvature is raised to at least this share of the largest.
constexpr double least_curvature = 1e-10;

/// Makes a symmetric matrix positive definite by reflecting its negative eigenvalues.
Matrix reflected(const Matrix& symmetric) {
  const SymmetricEigen eigen = symmetric_eigen(symmetric);
  Vector values = eigen.values.cwiseAbs();
  values = values.cwiseMax(std::max(least_curvature * values.maxCoeff(), 1e-300));
  const Matrix scaled = eigen.vectors * values.asDiagonal();
  return scaled * eigen.vectors.transpose();
}

}  // namespace

NloptSolver::NloptSolver(const Options& options) : options_(options), traits_(traits_of(options.algorithm)) {
  native_parameters(options.native);
  if (options.scaling == Scaling::full && !traits_.inequalities)
    throw Error("solver 'nlopt': scaling: full turns bounds into general constraints, and " +
                name_of(options.algorithm) + " takes none; use scaling: diagonal");
  if (traits_.local_optimiser && traits_of(options.local_algorithm).local_optimiser)
    throw Error("solver 'nlopt': local_algorithm: " + name_of(options.local_algorithm) +
                " needs a local algorithm itself; use one that does not, e.g. LD_SLSQP");
}

bool NloptSolver::scales_fully() const noexcept {
  return options_.scaling == Scaling::full ||
         (options_.scaling == Scaling::automatic && options_.algorithm == NLOPT_LD_SLSQP);
}

std::string NloptSolver::why_not(const Ocp& ocp) const {
  const std::string name = "NLopt's " + name_of(options_.algorithm);
  int variables = 0;
  bool bounded = false, unbounded = false, inequalities = false, equalities = false, limits = false;
  const auto count = [&](const double* lower, const double* upper, int n) {
    for (int j = 0; j < n; ++j) {
      if (lower[j] == upper[j]) continue;
      ++variables;
      const bool below = std::isfinite(lower[j]), above = std::isfinite(upper[j]);
      bounded = bounded || below || above;
      unbounded = unbounded || !below || !above;
    }
  };
  if (!ocp.initial_state()) count(ocp.state_lower(0), ocp.state_upper(0), ocp.state_count(0));
  for (int i = 0; i < ocp.intervals(); ++i) {
    count(ocp.control_lower(i), ocp.control_upper(i), ocp.control_count(i));
    for (int j = 0; j < ocp.state_count(i + 1); ++j) {
      const double lower = ocp.state_lower(i + 1)[j], upper = ocp.state_upper(i + 1)[j];
      if (lower == upper) {
        equalities = true;
      } else {
        inequalities = inequalities || std::isfinite(lower) || std::isfinite(upper);
      }
    }
  }
  // A limit without a linear weight is a part of the objective; other soft ones have slacks.
  for (int i = 0; i <= ocp.intervals() && ocp.capacity().limits > 0; ++i) {
    for (int r = 0; r < ocp.limit_count(i); ++r) {
      const double lower = ocp.limit_lower(i)[r], upper = ocp.limit_upper(i)[r], linear = ocp.limit_linear(i)[r];
      const int sides = (std::isfinite(lower) ? 1 : 0) + (std::isfinite(upper) ? 1 : 0);
      if (linear == 0.0 || sides == 0) continue;
      limits = true;
      (lower == upper ? equalities : inequalities) = true;
      if (!std::isfinite(linear)) continue;
      variables += sides;
      bounded = unbounded = true;
    }
  }
  if (variables > options_.max_variables)
    return "single shooting makes a dense problem of " + std::to_string(variables) +
           " decision variables, more than max_variables: " + std::to_string(options_.max_variables) +
           "; the time of an iteration grows with their cube, so use a sparse solver, or raise max_variables";
  if (variables > 0 && variables < traits_.fewest_variables)
    return name + " needs at least " + std::to_string(traits_.fewest_variables) + " variables";
  if (equalities && !traits_.equalities)
    return name + " takes no equality constraints, and this problem " +
           (limits ? "has limits, or fixes states beyond node 0" : "fixes states beyond node 0") +
           " (their bounds are equal); choose one of " + names_of_those_with(inequalities, true);
  if (inequalities && !traits_.inequalities)
    return name + " takes no inequality constraints, and this problem " +
           (limits ? "has limits, or bounds states" : "bounds states") + " beyond node 0; choose one of " +
           names_of_those_with(true, equalities);
  if (inequalities && traits_.local_optimiser && name_of(options_.algorithm).find("_EQ") != std::string::npos &&
      !traits_of(options_.local_algorithm).inequalities)
    return name + " leaves inequality constraints to its local_algorithm, and " + name_of(options_.local_algorithm) +
           " takes none; choose e.g. LD_SLSQP or LD_MMA there";
  if (bounded && !traits_.bounds) return name + " takes no bounds, and this problem has some on its decisions";
  if (traits_.local_optimiser && bounded && !traits_of(options_.local_algorithm).bounds)
    return name + " leaves bounds to its local_algorithm, and " + name_of(options_.local_algorithm) + " takes none";
  if (unbounded && traits_.finite_bounds)
    return name + " searches the whole box of its variables, and this problem leaves some decisions unbounded; " +
           "give every input, parameter and (in estimation) initial state finite bounds, or choose a local algorithm";
  return {};
}

void NloptSolver::setup(const Ocp& ocp) {
  if (const std::string reason = why_not(ocp); !reason.empty()) throw Error("solver 'nlopt': " + reason);
  ocp_ = &ocp;
  problem_ = CondensedProblem(ocp);
  if (ocp.capacity().limits > 0) search_.setup(ocp);
  tracking_.setup(ocp);
  regulator_.setup(ocp);
  qp_ = StageQp(ocp.capacity());
  scratch_.assign(ocp.scratch_size(), 0.0);
}

void NloptSolver::prepare(const Iterate&) noexcept {}

// Nothing carries over from one solve to the next.
void NloptSolver::reset() noexcept {}

Report NloptSolver::solve(Iterate& iterate, Clock::time_point deadline) noexcept {
  Report report;
  if (ocp_ && is_sound_start(*ocp_, iterate, scratch_)) {
    factorisations_ = 0;
    iterations_ = 0;
    limit_ = options_.max_iterations;
    fallback_used_ = false;
    try {
      report = optimise(*ocp_, iterate, deadline);
    } catch (const std::exception&) {  // out of memory; `iterate` is unchanged, since it is written last
      report.status = Status::stalled;
      rhec::assess(*ocp_, iterate, qp_, scratch_, report);
    }
    report.factorisations = factorisations_;
    report.fallback_used = fallback_used_;
  }
  return report;
}

Report NloptSolver::optimise(const Ocp& ocp, Iterate& iterate, Clock::time_point deadline) {
  Report report;
  const auto leave_as_it_was = [&](Status status) {
    report.status = status;
    rhec::assess(ocp, iterate, qp_, scratch_, report);
    return report;
  };
  if (!problem_.take(ocp)) return leave_as_it_was(Status::infeasible);
  if (Clock::now() > deadline) return leave_as_it_was(Status::deadline);
  // The structure may have changed since setup.
  if (!why_not(ocp).empty() || !find_start(ocp, iterate)) return leave_as_it_was(Status::stalled);

  Answer answer;
  Status status = improve_from_starts(ocp, answer, deadline);
  search_.begin();
  const auto may_be_misled = [&] {
    return status == Status::infeasible || (status == Status::stalled && answer.violation > infeasible_beyond);
  };
  while (may_be_misled() && iterations_left() > 0 && find_other_start(ocp, iterate, answer, deadline)) {
    fallback_used_ = true;
    status = improve(ocp, answer, deadline);
  }
  report.iterations = static_cast<int>(iterations_);
  if (status == Status::infeasible) return leave_as_it_was(status);
  go_back_to(answer);
  report.status = status;
  report.objective = problem_.objective_of_iterate();
  report.kkt = problem_.residual();
  iterate = problem_.iterate();
  return report;
}

/// From the guess, where the problem is, and if that does not solve it from the trajectory of a regulator, if that is
/// better than the guess; with the regulator's feedback where deviations grow much along it.
Status NloptSolver::improve_from_starts(const Ocp& ocp, Answer& answer, Clock::time_point deadline) {
  const Iterate guess = problem_.iterate();
  if (!begin_at(ocp, guess, nullptr, answer)) return Status::stalled;
  const Status status = improve(ocp, answer, deadline);
  if (status == Status::solved || status == Status::deadline || iterations_left() <= 0) return status;
  Iterate start = guess;
  const bool has_start = tracking_.find(ocp, guess, deadline, scratch_, start);
  std::shared_ptr<const Feedback> feedback = feedback_about(ocp, start);
  if (!has_start && !feedback) return status;
  Answer other;
  if (!begin_at(ocp, start, std::move(feedback), other)) return status;
  fallback_used_ = true;
  const Status second = improve(ocp, other, deadline);
  if (second != Status::solved && !is_better(other, answer)) return status;
  answer = std::move(other);
  return second;
}

/// Null where deviations do not grow much along a trajectory, and where bounds of controls cannot be constraints.
std::shared_ptr<const Feedback> NloptSolver::feedback_about(const Ocp& ocp, const Iterate& start) {
  if (!ocp.can_roll_out() || !scales_fully() || !traits_.from_start ||
      !(regulator_.growth(ocp, start, scratch_) > most_growth))
    return nullptr;
  return regulator_.about(ocp, start, scratch_);
}

/// The answer becomes the one at a trajectory. False if its simulation is not finite.
bool NloptSolver::begin_at(const Ocp& ocp, const Iterate& start, std::shared_ptr<const Feedback> feedback,
                           Answer& answer) {
  problem_.take(ocp, std::move(feedback));
  if (!problem_.move_to(problem_.read(start))) return false;
  if (problem_.has_slacks()) problem_.move_to(problem_.with_fitting_slacks());
  answer = assess(problem_.x());
  return true;
}

void NloptSolver::go_back_to(const Answer& answer) {
  if (answer.feedback != problem_.feedback()) problem_.take(*ocp_, answer.feedback);
  problem_.move_to(answer.x);
  problem_.set_multipliers(answer.multipliers);
}

/// The answer becomes one at another start, if there is one.
bool NloptSolver::find_other_start(const Ocp& ocp, const Iterate& guess, Answer& answer, Clock::time_point deadline) {
  if (!problem_.has_limits()) return false;
  go_back_to(answer);
  Iterate other = problem_.iterate();
  if (!search_.find_other(ocp, guess, other, deadline, scratch_, other)) return false;
  return begin_at(ocp, other, feedback_about(ocp, other), answer);
}

/// Simulates the guess. If the result is not finite, controls closer to zero are tried.
bool NloptSolver::find_start(const Ocp& ocp, const Iterate& iterate) {
  if (problem_.move_to(problem_.read(iterate))) return true;
  Iterate smaller = iterate;
  for (int attempt = 0; attempt < 8; ++attempt) {
    for (int i = 0; i < ocp.intervals(); ++i)
      for (int j = 0; j < ocp.control_count(i); ++j) smaller.control(i)[j] *= attempt < 7 ? 0.5 : 0.0;
    if (problem_.move_to(problem_.read(smaller))) return true;
  }
  return false;
}

namespace {

CondensedQp qp_at(CondensedProblem& problem) {
  const Eigen::Index n = problem.variables(), m = problem.rows();
  CondensedQp qp{problem.gradient(), problem.jacobian(), Vector(n + m), Vector(n + m)};
  qp.lower.head(n) = problem.lower() - problem.x();
  qp.upper.head(n) = problem.upper() - problem.x();
  for (Eigen::Index k = 0; k < m; ++k) {
    const double value = problem.row_value(static_cast<int>(k));
    qp.lower[n + k] = problem.row_lower()[k] - value;
    qp.upper[n + k] = problem.row_upper()[k] - value;
  }
  return qp;
}

}  // namespace

NloptSolver::Answer NloptSolver::answer_with(const Vector& multipliers) {
  problem_.set_multipliers(multipliers);
  Answer answer{problem_.feedback(),  problem_.x(),         multipliers,
                problem_.objective(), problem_.violation(), problem_.residual()};
  answer.merit = answer.objective;
  const auto add = [&](double multiplier, double value, double lower, double upper) {
    answer.merit += std::abs(multiplier) * std::max({0.0, lower - value, value - upper});
  };
  const int n = problem_.variables();
  for (int k = 0; k < n; ++k) add(multipliers[k], problem_.x()[k], problem_.lower()[k], problem_.upper()[k]);
  for (int k = 0; k < problem_.rows(); ++k)
    add(multipliers[n + k], problem_.row_value(k), problem_.row_lower()[k], problem_.row_upper()[k]);
  return answer;
}

Vector NloptSolver::within_bounds(const Vector& x) const {
  return x.cwiseMax(problem_.lower()).cwiseMin(problem_.upper());
}

NloptSolver::Answer NloptSolver::assess(const Vector& x) {
  problem_.move_to(x);
  const CondensedQp qp = qp_at(problem_);
  Vector diagonal = problem_.hessian(Hessian::gauss_newton).diagonal();
  if (problem_.has_slacks()) diagonal += problem_.slack_curvature();
  const Vector scale = diagonal.cwiseAbs().cwiseMax(1e-300).cwiseSqrt();
  std::optional<Answer> best;
  for (const double distance : distances) {
    const Vector multipliers = recover_multipliers(qp, scale, distance);
    if (best && multipliers == best->multipliers) continue;
    Answer answer = answer_with(multipliers);
    if (!best || answer.kkt.largest() < best->kkt.largest()) best = std::move(answer);
  }
  problem_.set_multipliers(best->multipliers);
  return *std::move(best);
}

bool NloptSolver::is_better(const Answer& one, const Answer& other) const noexcept {
  const double allowed = options_.tolerance;
  if (one.violation > allowed || other.violation > allowed) {
    if (one.violation != other.violation) return one.violation < other.violation;
  }
  const double rounding = 1e-9 * (1.0 + std::abs(other.merit));
  if (std::abs(one.merit - other.merit) > rounding) return one.merit < other.merit;
  return one.kkt.largest() < other.kkt.largest();
}

long NloptSolver::iterations_per_run() const noexcept {
  if (options_.iterations_per_run) return *options_.iterations_per_run;
  return problem_.variables() > many_variables ? iterations_of_many_variables : iterations_of_few_variables;
}

Transformation NloptSolver::transformation_at(const Ocp& ocp, const Answer& answer) {
  const Eigen::Index n = problem_.variables();
  Transformation t;
  t.centre = answer.x;
  t.diagonal = Vector::Ones(n);
  if (options_.scaling == Scaling::none) return t;
  problem_.move_to(answer.x);
  problem_.set_multipliers(answer.multipliers);
  Eigen::LLT<Matrix> factor;
  // Far from a solution the exact Hessian may be indefinite; then Gauss-Newton does better than a convexified Hessian.
  const auto usable = [&](const Matrix& hessian) {
    ++factorisations_;
    factor.compute(hessian);
    return factor.info() == Eigen::Success && factor.rcond() > least_curvature;
  };
  const auto curvature = [&](Hessian kind) {
    Matrix hessian = problem_.hessian(kind);
    if (problem_.has_slacks()) hessian.diagonal() += problem_.slack_curvature();
    return hessian;
  };
  const bool exact = ocp.has_second_derivatives() && usable(curvature(Hessian::exact));
  const bool positive = exact || usable(curvature(Hessian::gauss_newton));
  const Matrix hessian = curvature(exact ? Hessian::exact : Hessian::gauss_newton);
  if (!scales_fully()) {
    const double largest = hessian.diagonal().cwiseAbs().maxCoeff();
    t.diagonal = hessian.diagonal().cwiseAbs().cwiseMax(std::max(least_curvature * largest, 1e-300)).cwiseSqrt();
    t.diagonal = t.diagonal.cwiseInverse();
    return t;
  }
  if (!positive) factor.compute(reflected(hessian));
  if (factor.info() != Eigen::Success) return t;
  t.full = Matrix(factor.matrixU()).triangularView<Eigen::Upper>().solve(Matrix::Identity(n, n));
  if (!t.full.allFinite()) t.full.resize(0, 0);
  return t;
}

bool NloptSolver::polish(const Ocp& ocp, Answer& answer, Clock::time_point deadline) {
  bool any = false;
  for (int round = 0; round < most_newton_steps && answer.kkt.largest() > options_.tolerance; ++round) {
    if (Clock::now() > deadline || iterations_left() <= 0) break;
    ++iterations_;
    problem_.move_to(answer.x);
    problem_.set_multipliers(answer.multipliers);
    const CondensedQp qp = qp_at(problem_);
    Vector step, multipliers;
    bool accepted = false;
    for (const Hessian kind : {Hessian::exact, Hessian::gauss_newton}) {
      if (kind == Hessian::exact && !ocp.has_second_derivatives()) continue;
      problem_.move_to(answer.x);
      problem_.set_multipliers(answer.multipliers);
      multipliers = answer.multipliers;
      const Matrix hessian = problem_.hessian(kind);
      ++factorisations_;
      if (!solve_active_set(qp, hessian, step, multipliers)) continue;
      const Vector x = within_bounds(answer.x + step);
      if (!problem_.move_to(x)) continue;
      Answer next = answer_with(multipliers);
      // Newton's method also converges to maxima: a step may raise the merit only to repair a violation.
      const double rise = next.merit - answer.merit;
      const double allowed = 1e-7 * (1.0 + std::abs(answer.merit));
      if (!(next.kkt.largest() < 0.9 * answer.kkt.largest()) ||
          (rise > allowed && answer.violation <= options_.tolerance))
        continue;
      answer = std::move(next);
      accepted = any = true;
      break;
    }
    if (!accepted) break;
  }
  return any;
}

Status NloptSolver::restore_feasibility(const Ocp& ocp, Answer& answer, Clock::time_point deadline) {
  double last = HUGE_VAL;
  bool is_thorough = false;
  while (answer.violation > infeasible_beyond) {
    if (answer.violation > 0.9 * last) {
      // Short runs lose the curvature that they have learnt.
      if (is_thorough || !problem_.has_limits()) return Status::infeasible;
      is_thorough = true;
    }
    last = answer.violation;
    const Transformation transformation = transformation_at(ocp, answer);
    const long quota = !problem_.has_limits() ? 0
                       : is_thorough          ? longer_runs * restoring_iterations
                                              : restoring_iterations;
    Run run(problem_, options_, NLOPT_LD_SLSQP, Run::Goal::violation, transformation,
            {deadline, iterations_left(), quota, is_thorough ? 1e-8 : 1e-4});
    const Run::Outcome outcome = run.optimise();
    iterations_ += run.iterations();
    answer = assess(run.x());
    if (outcome == Run::Outcome::deadline) return Status::deadline;
    if (outcome == Run::Outcome::iteration_limit)
      return is_thorough && answer.violation > 0.9 * last ? Status::infeasible : Status::iteration_limit;
    if (outcome == Run::Outcome::failed) return Status::stalled;
  }
  return Status::solved;
}

/// An attempt from the given start with short runs and, if that stalls, another one with longer runs. Not with many
/// variables: there long runs take too long and get no further.
Status NloptSolver::improve(const Ocp& ocp, Answer& answer, Clock::time_point deadline) {
  // Since scaling uses the Hessian at the start, an early restart does better than more quasi-Newton updates.
  const long quota = scales_fully() && traits_.gradients ? iterations_per_run() : 0;
  const bool may_retry = quota > 0 && problem_.variables() > 0 && problem_.variables() <= many_variables;
  if (!may_retry) return attempt(ocp, answer, quota, deadline);
  Answer other = answer;
  limit_ = std::min<long>(options_.max_iterations, iterations_ + patience);
  const Status status = attempt(ocp, answer, quota, deadline);
  limit_ = options_.max_iterations;
  const bool is_stuck = status == Status::stalled || status == Status::iteration_limit;
  if (!is_stuck || iterations_left() <= 0) return status;
  fallback_used_ = true;
  const Status second = attempt(ocp, other, longer_runs * quota, deadline);
  if (second == Status::solved || is_better(other, answer)) answer = std::move(other);
  return second;
}

Status NloptSolver::attempt(const Ocp& ocp, Answer& answer, long quota, Clock::time_point deadline) {
  if (problem_.variables() == 0) {
    if (answer.kkt.largest() <= options_.tolerance) return Status::solved;
    return answer.violation > options_.tolerance ? Status::infeasible : Status::stalled;
  }
  const long first_quota = quota;
  bool restored = false;
  double least_residual = answer.kkt.largest();
  int idle = 0;
  double strictness = 1.0;
  for (int round = 0;; ++round) {
    if (answer.kkt.largest() <= options_.tolerance) return Status::solved;
    if (round > (traits_.from_start ? options_.restarts : 0)) return Status::stalled;
    const Transformation transformation = transformation_at(ocp, answer);
    Run run(problem_, options_, options_.algorithm, Run::Goal::objective, transformation,
            {deadline, iterations_left(), quota, strictness});
    const Run::Outcome outcome = run.optimise();
    iterations_ += run.iterations();
    Answer next = assess(run.x());
    // From a distant start, rounding errors of a large step can leave it close to a solution but slightly infeasible.
    // NLopt then stops because of rounding and returns the start, which was feasible; so the last iterate is assessed
    // too.
    const double wanted = 0.1 * std::min(next.kkt.largest(), least_residual);
    if (run.last_x() != run.x() && problem_.move_to(within_bounds(run.last_x())) && problem_.violation() < wanted) {
      Answer last = assess(problem_.x());
      if (last.kkt.largest() < wanted) next = std::move(last);
    }
    // Where it stops so far from a solution, its iterate may be far better than the start and violate a little more.
    if (outcome == Run::Outcome::ended && run.gave_up() && next.kkt.largest() > near_solution &&
        problem_.move_to(within_bounds(run.last_x()))) {
      Answer last = assess(problem_.x());
      if (last.merit < next.merit - clear_gain * (1.0 + std::abs(next.merit))) {
        answer = std::move(last);
        continue;
      }
    }
    const bool stopped = outcome == Run::Outcome::deadline || outcome == Run::Outcome::iteration_limit;
    if (!stopped && options_.polish && next.kkt.largest() < near_solution) polish(ocp, next, deadline);
    // The least residual falls each time, so this cannot cycle with the other criteria.
    const bool is_nearer = next.kkt.largest() < 0.1 * least_residual;
    least_residual = std::min(least_residual, next.kkt.largest());
    const bool progress =
        is_nearer || (is_better(next, answer) && (next.violation < 0.5 * answer.violation ||
                                                  next.merit < answer.merit - 1e-10 * (1.0 + std::abs(answer.merit)) ||
                                                  next.kkt.largest() < 0.5 * answer.kkt.largest()));
    if (next.kkt.largest() <= options_.tolerance || is_nearer || is_better(next, answer)) answer = std::move(next);
    if (answer.kkt.largest() <= options_.tolerance) return Status::solved;
    if (outcome == Run::Outcome::deadline) return Status::deadline;
    if (outcome == Run::Outcome::iteration_limit) return Status::iteration_limit;
    if (answer.violation > infeasible_beyond && !restored) {
      const Status status = restore_feasibility(ocp, answer, deadline);
      if (status != Status::solved) return status;
      restored = true;
      continue;
    }
    // A run that ended early by its own criteria gets another chance, with tolerances down to rounding. With many
    // variables, where no attempt with longer runs follows, it gets others with a larger quota each.
    idle = progress ? 0 : idle + 1;
    const bool may_lengthen = first_quota > 0 && problem_.variables() > many_variables;
    if (idle > (may_lengthen ? most_longer_runs : 1)) return Status::stalled;
    if (may_lengthen) quota = progress ? first_quota : longer_short_runs * quota;
    strictness = idle >= 1 ? 0.0 : 0.01 * strictness;
  }
}

}  // namespace rhec::nlopt

RHEC_PLUGIN(rhec::PluginKind::solver, rhec::nlopt::NloptSolver,
            {.name = "nlopt",
             .version = "0.1.0",
             .licence = "BSD-2-Clause AND MIT AND BSD-3-Clause AND LGPL-2.1-or-later",
             .source = "Single shooting on S. G. Johnson's NLopt (https://nlopt.readthedocs.io). Licences: ours "
                       "BSD-2-Clause; NLopt MIT, its SLSQP BSD-3-Clause, its LBFGS, VAR and TNEWTON LGPL-2.1-or-later",
             .backend = "NLopt",
             .backend_version = RHEC_NLOPT_VERSION,
             .capabilities = "rhe, rhc, bounds on states, inputs and parameters, choice of algorithm; dense, allocates "
                             "while solving"});
