#include "nlopt_run.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

namespace rhec::nlopt {
namespace {

using Vector = Eigen::VectorXd;

struct Destroy {
  void operator()(nlopt_opt optimiser) const noexcept { nlopt_destroy(optimiser); }
};
using Optimiser = std::unique_ptr<nlopt_opt_s, Destroy>;

// Value of the constraints where the simulation is not finite: far outside but finite, since NLopt computes with it.
constexpr double far_outside = 1e10;
// A smaller tolerance on violations would only demand rounding errors of NLopt.
constexpr double least_allowed_violation = 1e-10;
// How often a run may return to the same iterate. Evaluating the objective and the constraints there takes a few
// returns.
constexpr int most_returns = 100;

}  // namespace

Vector Transformation::x_of(const Vector& y) const {
  if (is_full()) return centre + full.triangularView<Eigen::Upper>() * y;
  return centre + diagonal.cwiseProduct(y);
}

Vector Transformation::pulled_back(const Vector& g) const {
  if (is_full()) return full.triangularView<Eigen::Upper>().transpose() * g;
  return diagonal.cwiseProduct(g);
}

Run::Run(CondensedProblem& problem, const NloptOptions& options, nlopt_algorithm algorithm, Goal goal,
         const Transformation& transformation, const Limits& limits)
    : problem_(problem),
      options_(options),
      algorithm_(algorithm),
      traits_(traits_of(algorithm)),
      goal_(goal),
      transformation_(transformation),
      limits_(limits),
      uses_gradients_(uses_gradients(algorithm, options)),
      last_counted_(transformation.centre),
      best_x_(transformation.centre) {}

void Run::list_constraints() {
  const auto add = [&](bool is_row, int index, double lower, double upper) {
    if (lower == upper) {
      equalities_.push_back({is_row, index, 1.0, lower});
      return;
    }
    if (std::isfinite(lower)) inequalities_.push_back({is_row, index, -1.0, lower});
    if (std::isfinite(upper)) inequalities_.push_back({is_row, index, 1.0, upper});
  };
  if (transformation_.is_full())
    for (int k = 0; k < problem_.variables(); ++k) add(false, k, problem_.lower()[k], problem_.upper()[k]);
  if (goal_ == Goal::objective)
    for (int k = 0; k < problem_.rows(); ++k) add(true, k, problem_.row_lower()[k], problem_.row_upper()[k]);
}

void Run::stop(Outcome why) noexcept {
  if (!was_stopped_) outcome_ = why;
  was_stopped_ = true;
  nlopt_force_stop(optimiser_);
}

bool Run::go_to(const double* y, bool with_gradient) {
  if (Clock::now() > limits_.deadline) {
    stop(Outcome::deadline);
    return false;
  }
  Vector x = transformation_.x_of(Eigen::Map<const Vector>(y, problem_.variables()));
  // NLopt keeps bounds in y: a violation in x is rounding.
  if (!transformation_.is_full()) x = x.cwiseMax(problem_.lower()).cwiseMin(problem_.upper());
  if (!x.allFinite()) {
    // The line search of LD_SLSQP asks for such points for ever.
    stop(Outcome::ended);
    return false;
  }
  return may_count(x, with_gradient) && problem_.move_to(x);
}

/// Counts a new iteration, or stops the run if the limit is reached.
bool Run::may_count(const Vector& x, bool with_gradient) {
  if (with_gradient != uses_gradients_) return true;
  if (iterations_ > 0 && x == last_counted_) {
    // LD_CCSAQ and LD_MMA retry the same point again and again if rounding keeps it from being accepted.
    if (++returns_ <= most_returns) return true;
    stop(Outcome::ended);
    return false;
  }
  if (iterations_ >= limits_.iterations) {
    stop(Outcome::iteration_limit);
    return false;
  }
  if (limits_.quota > 0 && iterations_ >= limits_.quota) {
    stop(Outcome::ended);
    return false;
  }
  last_counted_ = x;
  returns_ = 0;
  ++iterations_;
  return true;
}

double Run::value_of(const Constraint& c) const noexcept {
  return c.sign * ((c.is_row ? problem_.row_value(c.index) : problem_.x()[c.index]) - c.bound);
}

double Run::goal_value() const noexcept {
  if (goal_ == Goal::objective) return problem_.objective();
  double sum = 0.0;
  for (int k = 0; k < problem_.rows(); ++k) {
    const double value = problem_.row_value(k);
    const double excess = std::max({0.0, problem_.row_lower()[k] - value, value - problem_.row_upper()[k]});
    sum += excess * excess;
  }
  return violation_weight_ * sum;
}

void Run::remember() {
  const double value = goal_value();
  double violation = problem_.violation();
  if (goal_ == Goal::violation) {
    violation = 0.0;
    for (int k = 0; k < problem_.variables(); ++k)
      violation = std::max({violation, problem_.lower()[k] - problem_.x()[k], problem_.x()[k] - problem_.upper()[k]});
  }
  // Feasible points are compared by objective, others by violation.
  violation = violation <= 2.0 * allowed_violation() ? 0.0 : violation;
  if (violation < best_violation_ || (violation == best_violation_ && value < best_value_)) {
    best_violation_ = violation;
    best_value_ = value;
    best_x_ = problem_.x();
  }
}

double Run::evaluate(const double* y, double* gradient) {
  const bool finite = go_to(y, gradient != nullptr);
  if (!finite) {
    if (gradient) std::fill_n(gradient, problem_.variables(), 0.0);
    return HUGE_VAL;
  }
  remember();
  if (gradient) {
    Vector g;
    if (goal_ == Goal::objective) {
      g = problem_.gradient();
    } else {
      g = Vector::Zero(problem_.variables());
      for (int k = 0; k < problem_.rows(); ++k) {
        const double value = problem_.row_value(k);
        const double excess =
            std::max(0.0, value - problem_.row_upper()[k]) - std::max(0.0, problem_.row_lower()[k] - value);
        if (excess != 0.0) g += 2.0 * violation_weight_ * excess * problem_.jacobian().row(k).transpose();
      }
    }
    Eigen::Map<Vector>(gradient, problem_.variables()) = transformation_.pulled_back(g);
  }
  return goal_value();
}

void Run::evaluate(const std::vector<Constraint>& constraints, const double* y, double* values, double* gradient) {
  const int n = problem_.variables();
  if (!go_to(y, gradient != nullptr)) {
    std::fill_n(values, constraints.size(), far_outside);
    if (gradient) std::fill_n(gradient, constraints.size() * static_cast<std::size_t>(n), 0.0);
    return;
  }
  Vector normal(n);
  for (std::size_t k = 0; k < constraints.size(); ++k) {
    const Constraint& c = constraints[k];
    values[k] = value_of(c);
    if (!gradient) continue;
    if (c.is_row) {
      normal = c.sign * problem_.jacobian().row(c.index).transpose();
    } else {
      normal.setZero();
      normal[c.index] = c.sign;
    }
    Eigen::Map<Vector>(gradient + k * static_cast<std::size_t>(n), n) = transformation_.pulled_back(normal);
  }
}

// NLopt is C code: no exception may pass through it. Eigen may throw if an allocation fails.
double Run::objective_of(unsigned, const double* y, double* gradient, void* data) noexcept {
  Run& run = *static_cast<Run*>(data);
  try {
    return run.evaluate(y, gradient);
  } catch (const std::exception&) {
    run.stop(Outcome::failed);
    return HUGE_VAL;
  }
}

void Run::inequalities_of(unsigned, double* values, unsigned, const double* y, double* gradient, void* data) noexcept {
  Run& run = *static_cast<Run*>(data);
  try {
    run.evaluate(run.inequalities_, y, values, gradient);
  } catch (const std::exception&) {
    run.stop(Outcome::failed);
  }
}

void Run::equalities_of(unsigned, double* values, unsigned, const double* y, double* gradient, void* data) noexcept {
  Run& run = *static_cast<Run*>(data);
  try {
    run.evaluate(run.equalities_, y, values, gradient);
  } catch (const std::exception&) {
    run.stop(Outcome::failed);
  }
}

// With a large multiplier, a violation within the tolerance can cause a residual above it; so the allowed violation
// shrinks with `strictness` too.
double Run::allowed_violation() const noexcept {
  const double allowed = 0.5 * options_.tolerance;
  return std::max(limits_.strictness * allowed, std::min(allowed, least_allowed_violation));
}

void Run::configure(nlopt_opt optimiser, bool is_local) const {
  nlopt_set_ftol_rel(optimiser, options_.ftol_rel * limits_.strictness);
  nlopt_set_ftol_abs(optimiser, options_.ftol_abs * limits_.strictness);
  nlopt_set_xtol_rel(optimiser, options_.xtol_rel * limits_.strictness);
  nlopt_set_xtol_abs1(optimiser, options_.xtol_abs * limits_.strictness);
  if (!is_local) nlopt_set_maxeval(optimiser, options_.maxeval);
  if (options_.initial_step) nlopt_set_initial_step1(optimiser, *options_.initial_step);
  nlopt_set_population(optimiser, static_cast<unsigned>(options_.population));
  nlopt_set_vector_storage(optimiser, static_cast<unsigned>(options_.vector_storage));
  for (const auto& [name, value] : native_parameters(options_.native)) nlopt_set_param(optimiser, name.c_str(), value);
}

Run::Outcome Run::optimise() {
  const int n = problem_.variables();
  const auto dimension = static_cast<unsigned>(n);
  list_constraints();
  if (!problem_.move_to(transformation_.centre)) return Outcome::failed;
  if (goal_ == Goal::violation) {
    double largest = 0.0;
    for (int k = 0; k < problem_.rows(); ++k)
      largest = std::max(largest, transformation_.pulled_back(problem_.jacobian().row(k).transpose()).squaredNorm());
    if (largest > 0.0) violation_weight_ = 1.0 / largest;
  }
  best_value_ = best_violation_ = HUGE_VAL;
  remember();

  const Optimiser optimiser(nlopt_create(algorithm_, dimension));
  if (!optimiser) return Outcome::failed;
  optimiser_ = optimiser.get();
  bool accepted = nlopt_set_min_objective(optimiser_, &objective_of, this) == NLOPT_SUCCESS;
  if (!transformation_.is_full()) {
    Vector lower = (problem_.lower() - transformation_.centre).cwiseQuotient(transformation_.diagonal);
    Vector upper = (problem_.upper() - transformation_.centre).cwiseQuotient(transformation_.diagonal);
    lower = lower.cwiseMin(0.0);
    upper = upper.cwiseMax(0.0);
    accepted = accepted && nlopt_set_lower_bounds(optimiser_, lower.data()) == NLOPT_SUCCESS &&
               nlopt_set_upper_bounds(optimiser_, upper.data()) == NLOPT_SUCCESS;
  }
  const double allowed = allowed_violation();
  const auto tolerances = [&](const std::vector<Constraint>& constraints) {
    return std::vector<double>(constraints.size(), allowed);
  };
  if (!inequalities_.empty())
    accepted = accepted && nlopt_add_inequality_mconstraint(optimiser_, static_cast<unsigned>(inequalities_.size()),
                                                            &inequalities_of, this,
                                                            tolerances(inequalities_).data()) == NLOPT_SUCCESS;
  if (!equalities_.empty())
    accepted = accepted &&
               nlopt_add_equality_mconstraint(optimiser_, static_cast<unsigned>(equalities_.size()), &equalities_of,
                                              this, tolerances(equalities_).data()) == NLOPT_SUCCESS;
  configure(optimiser_, false);
  if (traits_.local_optimiser) {
    const Optimiser local(nlopt_create(options_.local_algorithm, dimension));
    if (!local) return Outcome::failed;
    configure(local.get(), true);
    accepted = accepted && nlopt_set_local_optimizer(optimiser_, local.get()) == NLOPT_SUCCESS;
  }
  if (!accepted) return Outcome::failed;
  if (limits_.deadline != Clock::time_point::max()) {
    const Clock::time_point now = Clock::now();  // from a deadline that is long past, the difference may overflow
    const auto left = limits_.deadline > now ? limits_.deadline - now : Clock::duration::zero();
    nlopt_set_maxtime(optimiser_, std::max(1e-9, std::chrono::duration<double>(left).count()));
  }
  nlopt_srand(static_cast<unsigned long>(options_.seed));

  Vector y = Vector::Zero(n);
  double value = 0.0;
  const nlopt_result result = nlopt_optimize(optimiser_, y.data(), &value);
  optimiser_ = nullptr;
  gave_up_ = result == NLOPT_ROUNDOFF_LIMITED;
  const auto within = [&](const Vector& x) -> Vector {
    return x.cwiseMax(problem_.lower()).cwiseMin(problem_.upper());
  };
  best_x_ = within(best_x_);
  if (was_stopped_) return outcome_;
  if (result == NLOPT_MAXTIME_REACHED) return Outcome::deadline;
  // NLopt's other failures (rounding, incompatible linearised constraints) count as normal ends; the residual decides.
  if (result == NLOPT_INVALID_ARGS || result == NLOPT_OUT_OF_MEMORY) return Outcome::failed;
  // NLopt's own result is preferred if it is as good: NLopt weighs violations by its merit function.
  const Vector x = within(transformation_.x_of(y));
  if (!traits_.from_start || !x.allFinite() || !problem_.move_to(x)) return Outcome::ended;
  if (problem_.violation() <= 2.0 * allowed &&
      (best_violation_ > 0.0 || goal_value() <= best_value_ + 1e-10 * (1.0 + std::abs(best_value_))))
    best_x_ = x;
  return Outcome::ended;
}

}  // namespace rhec::nlopt
