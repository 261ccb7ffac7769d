#include "sparse_sqp.hpp"

#include <cholmod.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <utility>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/plugins/kit/sdk.hpp"
#include "sparse_products.hpp"
#include "stage_convexity.hpp"
#include "stage_covariances.hpp"

namespace rhec::sparse_sqp {
namespace {

constexpr double sufficient_decrease = 1e-4;
constexpr double shortest_step = 1e-10, longest_step = 1e6;
// Below this KKT residual Newton's method is trusted more than the merit function.
constexpr double near_solution = 1e-3;
// Below this defect, slow progress is due to the curvature and not to the distance from the solution.
constexpr double near_enough = 1e-1;
// Relative differences of the merit below this are rounding.
constexpr double merit_rounding = 1e-13;
// If the relaxed QP leaves more than this share of |c|_1, there is no progress.
constexpr double stuck = 1.0 - 1e-6;
constexpr double largest_penalty = 1e10;
// With limits: after a step shorter than this the next QP is relaxed, until one leaves less than a small share of
// |c|_1. There is no progress if so many relaxed steps have left more than this share of it; those that promise to
// remove less than the small one count ten times.
constexpr double short_step = 1e-2, small_share = 1e-2, most_left = 0.9;
constexpr int most_futile = 50;
// Share of the iterations after which another start is looked for.
constexpr double patience = 0.5;
// Share of a solution's objective that the remaining defects may account for.
constexpr double negligible_share = 1e-9;
constexpr int corrections = 4;
constexpr int convexifications = 6;
// Step lengths by stage: how often they are halved, how many stages on each side form a stage's neighbourhood, which
// share of the total change of the merit counts as a rise in it, and by how much the lengths of adjacent stages may
// differ.
constexpr int local_halvings = 10;
constexpr int neighbourhood = 20;
constexpr double least_rise = 1e-6;
constexpr double steepest_passage = 0.05;
constexpr int most_penalty_cuts = 20;
constexpr int stages_at_once = 64;

bool is_step(SparseQp::Outcome outcome) {
  return outcome == SparseQp::Outcome::solved || outcome == SparseQp::Outcome::feasible ||
         outcome == SparseQp::Outcome::relaxed;
}

/// Linearises a horizon in chunks of stages that fit the processor's cache. Returns the objective.
double linearise_stages(const Ocp& ocp, const Iterate& iterate, Hessian hessian, StageQp& qp,
                        std::span<double> scratch) {
  double objective = 0.0;
  for (int first = 0; first <= ocp.intervals(); first += stages_at_once) {
    const int last = std::min(first + stages_at_once - 1, ocp.intervals());
    objective += ocp.linearise({first, last}, iterate, hessian, qp, scratch);
  }
  return objective;
}

}  // namespace

const OptionTable<SparseSqpOptions>& SparseSqpOptions::table() {
  static const auto options =
      OptionTable<SparseSqpOptions>()
          .choice(
              "hessian", &SparseSqpOptions::hessian,
              {{"gauss_newton", Curvature::gauss_newton}, {"exact", Curvature::exact}, {"auto", Curvature::automatic}},
              "curvature of the quadratic programs; auto: Gauss-Newton for estimation, exact for control")
          .integer("max_iterations", &SparseSqpOptions::max_iterations, "limit of the iterations", between(1, 100000))
          .number("tolerance", &SparseSqpOptions::tolerance, "KKT residual at which it is content", greater_than(0.0));
  return options;
}

std::string SparseSqp::why_not(const Ocp& ocp) const {
  if (options_.hessian == Curvature::exact && !ocp.has_second_derivatives())
    return "the model has no second derivatives; set hessian: gauss_newton";
  return {};
}

void SparseSqp::setup(const Ocp& ocp) {
  if (const std::string reason = why_not(ocp); !reason.empty()) throw Error("solver 'sparse_sqp': " + reason);
  const Capacity capacity = ocp.capacity();
  ocp_ = &ocp;
  stages_ = other_stages_ = StageQp(capacity);
  for (Iterate* iterate : {&current_, &trial_}) *iterate = Iterate(capacity);
  scratch_.assign(ocp.scratch_size(), 0.0);
  defects_.assign(static_cast<std::size_t>(capacity.intervals) * capacity.states, 0.0);
  if (capacity.limits > 0) search_.setup(ocp);
  if (ocp.can_roll_out()) {
    tracking_.setup(ocp);
    tracking_start_ = Iterate(capacity);
  }
  limit_values_.assign((static_cast<std::size_t>(capacity.intervals) + 1) * capacity.limit_row(), 0.0);
  reset();
}

void SparseSqp::reset() noexcept {
  qp_.forget();
  nlp_ = SparseNlp();
}

void SparseSqp::take_structure(const Ocp& ocp) {
  if (!nlp_.take_structure(ocp)) return;
  qp_.take_structure(nlp_);
  const auto n = static_cast<std::size_t>(nlp_.variables()), m = static_cast<std::size_t>(nlp_.constraints());
  for (auto* v : {&gradient_, &lower_, &upper_, &lower_z_, &upper_z_, &z_, &bound_multipliers_, &step_,
                  &step_bound_multipliers_, &correction_, &trial_z_, &trial_bound_multipliers_})
    v->assign(n, 0.0);
  for (auto* v : {&constraints_, &multipliers_, &step_multipliers_, &trial_multipliers_, &trial_constraints_})
    v->assign(m, 0.0);
  rows_.take_structure(ocp, nlp_);
  hessian_.assign(nlp_.hessian().entries(), 0.0);
  const int N = ocp.intervals();
  stage_of_variable_.clear();
  for (int i = 0; i <= N; ++i) {
    const int count = (nlp_.state_start(i) >= 0 ? ocp.state_count(i) : 0) + (i < N ? ocp.control_count(i) : 0);
    stage_of_variable_.insert(stage_of_variable_.end(), count, i);
  }
  for (auto* v : {&stage_merits_, &merits_before_, &lengths_}) v->assign(static_cast<std::size_t>(N) + 1, 0.0);
  merit_sums_.assign(static_cast<std::size_t>(N) + 2, 0.0);
  jacobian_.assign(nlp_.jacobian().entries(), 0.0);
}

SparseQp::Data SparseSqp::qp_data() const noexcept {
  return {hessian_.data(), jacobian_.data(), gradient_.data(),   constraints_.data(),
          lower_.data(),   upper_.data(),    hessian_is_convex_, rows_.limits()};
}

/// Writes the values of limits to their places in the constraints.
void SparseSqp::evaluate_limits(const Ocp& ocp, const Iterate& iterate, std::vector<double>& constraints) noexcept {
  if (!rows_.has_limits()) return;
  ocp.evaluate_limits(iterate, limit_values_.data(), scratch_);
  nlp_.limits(ocp, limit_values_.data(), constraints.data());
}

void SparseSqp::linearise(const Ocp& ocp, Hessian hessian) {
  objective_ = linearise_stages(ocp, current_, hessian, stages_, scratch_);
  hessian_is_convex_ = hessian == Hessian::gauss_newton;
  nlp_.hessian(stages_, hessian_.data());
  nlp_.jacobian(stages_, jacobian_.data());
  nlp_.gradient(stages_, gradient_.data());
  nlp_.constraints(stages_, constraints_.data());
  evaluate_limits(ocp, current_, constraints_);
  for (std::size_t k = 0; k < z_.size(); ++k) {
    lower_[k] = lower_z_[k] - z_[k];
    upper_[k] = upper_z_[k] - z_[k];
  }
}

double SparseSqp::merit(const Ocp& ocp, const Iterate& iterate) noexcept {
  const double objective = ocp.evaluate_stages(iterate, defects_.data(), stage_merits_.data(), scratch_);
  nlp_.constraints(ocp, defects_.data(), nullptr, trial_constraints_.data());
  evaluate_limits(ocp, iterate, trial_constraints_);
  return objective + rows_.merit(trial_constraints_, penalty_, stage_merits_);
}

/// `trial_` = `current_` + the step, scaled by the length of each stage.
void SparseSqp::move(const Ocp& ocp) {
  for (std::size_t k = 0; k < z_.size(); ++k) {
    const double length = lengths_[stage_of_variable_[k]];
    trial_z_[k] = std::clamp(z_[k] + length * step_[k], lower_z_[k], upper_z_[k]);
    trial_bound_multipliers_[k] = bound_multipliers_[k] + length * (step_bound_multipliers_[k] - bound_multipliers_[k]);
  }
  for (std::size_t r = 0; r < multipliers_.size(); ++r)
    trial_multipliers_[r] = multipliers_[r] + lengths_[rows_.stage_of(r)] * (step_multipliers_[r] - multipliers_[r]);
  nlp_.write(ocp, trial_z_.data(), trial_multipliers_.data(), trial_bound_multipliers_.data(), trial_);
}

/// Makes the QP's reduced Hessian positive definite on the active set on which it was found not to be; in the last
/// round, with no bound active.
void SparseSqp::convexify(const Ocp& ocp, int round) {
  const bool for_all = round == convexifications;
  if (round == 1) linearise_stages(ocp, current_, Hessian::gauss_newton, other_stages_, scratch_);
  convexify_by_stages(stages_, other_stages_, for_all ? std::span<const std::uint8_t>() : qp_.fixed());
  nlp_.hessian(stages_, hessian_.data());
  hessian_is_convex_ = for_all;
}

/// Solves the QP for the step, with relaxed equations if it is infeasible.
SparseQp::Outcome SparseSqp::find_step(const Ocp& ocp, Report& report, Clock::time_point deadline) {
  if (is_elastic_) {
    report.fallback_used = true;
    return find_relaxed_step(deadline);
  }
  auto outcome = qp_.solve(qp_data(), step_.data(), step_multipliers_.data(), step_bound_multipliers_.data(), deadline);
  for (int round = 1; outcome == SparseQp::Outcome::indefinite && round <= convexifications; ++round) {
    if (Clock::now() > deadline) return SparseQp::Outcome::deadline;
    convexify(ocp, round);
    outcome = qp_.solve(qp_data(), step_.data(), step_multipliers_.data(), step_bound_multipliers_.data(), deadline);
  }
  predicted_defect_ = 0.0;
  if (outcome != SparseQp::Outcome::failed) {
    report.fallback_used |= qp_.used_interior_point();
    predict();
    return outcome;
  }
  report.fallback_used = true;
  return find_relaxed_step(deadline);
}

SparseQp::Outcome SparseSqp::find_relaxed_step(Clock::time_point deadline) {
  const double defect = rows_.defect(constraints_);
  const double least = 1e2 * (1.0 + max_abs(gradient_));
  // What multipliers of steps that led nowhere have left.
  if (is_elastic_) penalty_ = std::min(penalty_, least);
  double penalty = std::max(penalty_, least);
  auto outcome = solve_relaxed(penalty, deadline);
  // The penalty is high enough if the step removes most of the defect, or if a higher penalty would hardly remove more.
  // Linearised limits can be met by steps that are much too long: there some of the defect is enough.
  const double enough = rows_.has_limits() ? 0.9 * defect : 0.1 * defect;
  while (outcome == SparseQp::Outcome::relaxed && predicted_defect_ > enough && penalty < largest_penalty) {
    penalty *= 100.0;
    const double last = predicted_defect_;
    relaxed_step_ = step_;
    relaxed_multipliers_ = step_multipliers_;
    relaxed_bound_multipliers_ = step_bound_multipliers_;
    const auto next = solve_relaxed(penalty, deadline);
    if (next == SparseQp::Outcome::deadline) return next;
    if (next == SparseQp::Outcome::relaxed && predicted_defect_ < 0.9 * last) continue;
    step_ = relaxed_step_;
    step_multipliers_ = relaxed_multipliers_;
    step_bound_multipliers_ = relaxed_bound_multipliers_;
    predicted_defect_ = last;
    break;
  }
  predict();
  return outcome;
}

/// What slacks will cost if the linearised limits are right.
void SparseSqp::predict() noexcept {
  predicted_slack_cost_ = 0.0;
  if (!rows_.has_limits()) return;
  trial_constraints_ = constraints_;
  add_product(nlp_.jacobian(), jacobian_.data(), step_.data(), trial_constraints_.data());
  predicted_slack_cost_ = rows_.slack_cost(trial_constraints_);
}

/// Solves the QP with relaxed equations; `predicted_defect_` gets their remaining residual.
SparseQp::Outcome SparseSqp::solve_relaxed(double penalty, Clock::time_point deadline) {
  const auto outcome = qp_.solve_relaxed(qp_data(), penalty, step_.data(), step_multipliers_.data(),
                                         step_bound_multipliers_.data(), deadline);
  if (outcome != SparseQp::Outcome::relaxed) return outcome;
  trial_constraints_ = constraints_;
  add_product(nlp_.jacobian(), jacobian_.data(), step_.data(), trial_constraints_.data());
  predicted_defect_ = rows_.defect(trial_constraints_);
  return outcome;
}

/// Line search along the step; the accepted iterate goes to `trial_`, its merit to `after`. False if no length is
/// acceptable.
bool SparseSqp::search(const Ocp& ocp, double residual, double& after) {
  // Nothing determines a step this long: no step length is worth trying.
  if (!(max_abs(step_) <= longest_step * (1.0 + max_abs(z_)))) return false;
  const double defect = rows_.defect(constraints_);
  // Multipliers of relaxed equations reach the QP's penalty, which is large enough already.
  const double least_penalty = (predicted_defect_ > 0.0 ? 1.0 : 1.5) * rows_.largest_price(step_multipliers_);
  if (penalty_ < least_penalty) {
    penalty_ = least_penalty;
  } else if (penalty_ > 4.0 * least_penalty && penalty_cuts_left_ > 0 && predicted_defect_ == 0.0) {
    // Multipliers can be huge far from the solution; a penalty that stayed that large would shorten every later step.
    penalty_ = 2.0 * least_penalty;
    --penalty_cuts_left_;
  }
  const double slack_cost = rows_.slack_cost(constraints_);
  const double before = objective_ + slack_cost + penalty_ * defect;
  double slope = penalty_ * (predicted_defect_ - defect) + predicted_slack_cost_ - slack_cost;
  for (std::size_t k = 0; k < z_.size(); ++k) slope += gradient_[k] * step_[k];
  const auto acceptable = [&](double length) {
    after = merit(ocp, trial_);
    return std::isfinite(after) && after <= before + sufficient_decrease * length * std::min(slope, 0.0) +
                                                merit_rounding * (1.0 + std::abs(before));
  };
  // The merit rejects the step because of the equations' curvature: second-order corrections with the same matrix.
  const auto correct = [&](double length) {
    if (!std::isfinite(after) || predicted_defect_ > 0.0) return false;
    double remaining = rows_.defect(trial_constraints_);
    for (int round = 0; round < corrections; ++round) {
      if (!qp_.correct(qp_data(), trial_constraints_.data(), correction_.data())) break;
      // A correction longer than the step itself is useless, e.g. if equations and active bounds are linearly
      // dependent.
      if (!(max_abs(correction_) <= max_abs(step_))) break;
      for (std::size_t k = 0; k < z_.size(); ++k)
        trial_z_[k] = std::clamp(trial_z_[k] + correction_[k], lower_z_[k], upper_z_[k]);
      nlp_.write(ocp, trial_z_.data(), nullptr, nullptr, trial_);
      if (acceptable(length)) return true;
      const double last = std::exchange(remaining, rows_.defect(trial_constraints_));
      if (!(remaining < 0.5 * last)) break;
    }
    return false;
  };
  std::fill(lengths_.begin(), lengths_.end(), 1.0);
  // First shorten the step only around the stages that reject the full step.
  for (int round = 0; round < local_halvings; ++round) {
    move(ocp);
    const double shortest = *std::min_element(lengths_.begin(), lengths_.end());
    if (acceptable(shortest)) return true;
    // Near the solution the merit function may reject a good Newton step.
    if (round == 0 && residual < near_solution && std::isfinite(after)) {
      linearise_stages(ocp, trial_, Hessian::gauss_newton, other_stages_, scratch_);
      if (kkt_residual(other_stages_, trial_).largest() < 0.5 * residual) return true;
    }
    if (!std::isfinite(after)) break;
    if (correct(shortest)) return true;
    if (round == 0) {
      stage_merits_.swap(merits_before_);
      merit(ocp, current_);
      stage_merits_.swap(merits_before_);
    }
    if (!shorten_locally()) break;
  }
  for (double length = 0.5; length >= shortest_step; length *= 0.5) {
    std::fill(lengths_.begin(), lengths_.end(), length);
    move(ocp);
    if (acceptable(length) || correct(length)) return true;
  }
  return false;
}

/// Halves the step lengths around stages where the merit rose, with a gradual transition to the other stages. False if
/// it rose nowhere.
bool SparseSqp::shorten_locally() {
  const int stages = static_cast<int>(lengths_.size());
  double size = 0.0;
  merit_sums_[0] = 0.0;
  for (int i = 0; i < stages; ++i) {
    const double change = stage_merits_[i] - merits_before_[i];
    merit_sums_[i + 1] = merit_sums_[i] + change;
    size += std::abs(change);
  }
  bool is_shorter = false;
  for (int i = 0; i < stages; ++i) {
    const int from = std::max(0, i - neighbourhood), to = std::min(stages, i + neighbourhood + 1);
    if (!(merit_sums_[to] - merit_sums_[from] > least_rise * size)) continue;
    lengths_[i] *= 0.5;
    is_shorter = true;
  }
  for (int i = 1; i < stages; ++i) lengths_[i] = std::min(lengths_[i], lengths_[i - 1] + steepest_passage);
  for (int i = stages - 2; i >= 0; --i) lengths_[i] = std::min(lengths_[i], lengths_[i + 1] + steepest_passage);
  return is_shorter;
}

/// The remaining defects may be within the tolerance and yet, weighted with large multipliers, change the objective by
/// more than is acceptable. Then one more step is taken, and kept if it reduces the defects.
void SparseSqp::polish(const Ocp& ocp, Report& report, Clock::time_point deadline) {
  const double price = violation_of(report.kkt) * max_abs(multipliers_);
  if (price <= negligible_share * std::abs(objective_)) return;
  if (report.iterations == options_.max_iterations || Clock::now() > deadline) return;
  const auto outcome = find_step(ocp, report, deadline);
  if (outcome != SparseQp::Outcome::solved && outcome != SparseQp::Outcome::feasible) return;
  ++report.iterations;
  std::fill(lengths_.begin(), lengths_.end(), 1.0);
  move(ocp);
  linearise_stages(ocp, trial_, Hessian::gauss_newton, other_stages_, scratch_);
  SparseNlp::set_costate_0(other_stages_, trial_);
  const KktResidual after = kkt_residual(other_stages_, trial_);
  if (after.largest() <= options_.tolerance && violation_of(after) < violation_of(report.kkt))
    std::swap(current_, trial_);
}

/// Looks back at a step that was accepted: what comes next, and whether so many relaxed ones have removed so little
/// that the limits cannot be met.
bool SparseSqp::is_futile(SparseQp::Outcome outcome, const Report& report) noexcept {
  const double defect = rows_.defect(constraints_);
  const bool was_short = *std::min_element(lengths_.begin(), lengths_.end()) < short_step;
  is_elastic_ = was_short || (is_elastic_ && predicted_defect_ > small_share * defect);
  if (outcome != SparseQp::Outcome::relaxed || defect < most_left * defect_before_) {
    defect_before_ = defect;
    futile_ = 0;
  }
  futile_ += predicted_defect_ > (1.0 - small_share) * defect ? most_futile / 10 : 1;
  return futile_ >= most_futile && violation_of(report.kkt) > options_.tolerance;
}

/// Looks for a regulator's trajectory, once in a solve: where the simulation of a guess leads far away, so do steps.
bool SparseSqp::find_tracking_start(const Ocp& ocp, const Iterate& guess, Clock::time_point deadline) noexcept {
  if (std::exchange(has_looked_for_tracking_, true)) return false;
  has_tracking_start_ = tracking_.find(ocp, guess, deadline, scratch_, tracking_start_);
  return has_tracking_start_;
}

void SparseSqp::begin_within_bounds(const Ocp& ocp) noexcept {
  nlp_.read(ocp, current_, z_.data(), multipliers_.data(), bound_multipliers_.data());
  for (std::size_t k = 0; k < z_.size(); ++k) z_[k] = std::clamp(z_[k], lower_z_[k], upper_z_[k]);
  nlp_.write(ocp, z_.data(), nullptr, nullptr, current_);
}

/// The next attempt is from `current_`.
void SparseSqp::begin_again(const Ocp& ocp, Report& report) noexcept {
  nlp_.read(ocp, current_, z_.data(), multipliers_.data(), bound_multipliers_.data());
  qp_.factor().forget_scales();
  penalty_ = 0.0;
  penalty_cuts_left_ = most_penalty_cuts;
  report.fallback_used = true;
  ++report.iterations;
}

Status SparseSqp::converge(const Ocp& ocp, const Iterate& guess, Report& report, Clock::time_point deadline) {
  bool use_exact = options_.hessian == Curvature::exact ||
                   (options_.hessian == Curvature::automatic && ocp.preferred_hessian() == Hessian::exact);
  double last_residual = infinity;
  int slow = 0;
  bool has_costates = max_abs(multipliers_) > 0.0;
  // The active set of the first QP is guessed from the iterate's multipliers, that of each later QP from the previous
  // QP.
  step_bound_multipliers_ = bound_multipliers_;
  step_multipliers_ = multipliers_;
  is_elastic_ = false;
  defect_before_ = infinity;
  for (;; ++report.iterations) {
    if (use_exact && !has_costates) {
      // The exact Hessian needs costates: those that fit the start.
      linearise_stages(ocp, current_, Hessian::gauss_newton, stages_, scratch_);
      set_costates(stages_, current_);
      nlp_.read(ocp, current_, nullptr, multipliers_.data(), nullptr);
      has_costates = true;
    }
    linearise(ocp, use_exact ? Hessian::exact : Hessian::gauss_newton);
    SparseNlp::set_costate_0(stages_, current_);
    report.kkt = kkt_residual(stages_, current_);
    const double residual = report.kkt.largest();
    if (residual <= options_.tolerance) {
      polish(ocp, report, deadline);
      return Status::solved;
    }
    if (report.iterations == options_.max_iterations) return Status::iteration_limit;
    if (report.iterations >= std::max(1, static_cast<int>(patience * options_.max_iterations)) &&
        find_tracking_start(ocp, guess, deadline))
      return Status::iteration_limit;
    if (Clock::now() > deadline) return Status::deadline;
    // If Gauss-Newton makes little progress the residuals are large: there the exact Hessian does better.
    if (options_.hessian == Curvature::automatic && !use_exact && ocp.has_second_derivatives()) {
      slow = violation_of(report.kkt) < near_enough && residual > 0.3 * last_residual ? slow + 1 : 0;
      if (slow >= 4) {
        use_exact = true;
        linearise(ocp, Hessian::exact);
      }
    }
    last_residual = residual;
    auto outcome = find_step(ocp, report, deadline);
    if (use_exact && outcome == SparseQp::Outcome::relaxed) {
      // With the large multipliers of relaxed equations, their curvature would dominate the exact Hessian.
      linearise(ocp, Hessian::gauss_newton);
      outcome = find_step(ocp, report, deadline);
    }
    if (outcome == SparseQp::Outcome::deadline) return Status::deadline;
    double after = 0.0;
    bool accepted = is_step(outcome) && search(ocp, residual, after);
    if (use_exact && !accepted) {
      linearise(ocp, Hessian::gauss_newton);
      outcome = find_step(ocp, report, deadline);
      if (outcome == SparseQp::Outcome::deadline) return Status::deadline;
      accepted = is_step(outcome) && search(ocp, residual, after);
    }
    if (outcome == SparseQp::Outcome::relaxed && violation_of(report.kkt) > options_.tolerance &&
        predicted_defect_ >= stuck * rows_.defect(constraints_))
      return Status::infeasible;
    if (!accepted) return Status::stalled;
    if (rows_.has_limits() && is_futile(outcome, report)) return Status::infeasible;
    std::swap(current_, trial_);
    nlp_.read(ocp, current_, z_.data(), multipliers_.data(), bound_multipliers_.data());
  }
}

Report SparseSqp::solve(Iterate& iterate, Clock::time_point deadline) noexcept {
  Report report;
  if (!ocp_ || !is_sound_start(*ocp_, iterate, scratch_)) return report;
  const Ocp& ocp = *ocp_;
  current_ = iterate;
  const int factorisations_before = qp_.factorisations();
  try {
    take_structure(ocp);
    qp_.factor().forget_scales();
    penalty_ = 0.0;
    penalty_cuts_left_ = most_penalty_cuts;
    nlp_.bounds(ocp, lower_z_.data(), upper_z_.data());
    bool bounds_cross = !rows_.take_limits(ocp, nlp_);
    for (std::size_t k = 0; k < z_.size(); ++k) bounds_cross = bounds_cross || lower_z_[k] > upper_z_[k];
    if (bounds_cross) {
      report.status = Status::infeasible;
      assess(ocp, iterate, stages_, scratch_, report);
      return report;
    }
    begin_within_bounds(ocp);
    search_.begin();
    has_looked_for_tracking_ = has_tracking_start_ = false;
    while (true) {
      report.status = converge(ocp, iterate, report, deadline);
      if (report.status == Status::solved || report.status == Status::deadline ||
          report.iterations >= options_.max_iterations)
        break;
      if (has_tracking_start_ || find_tracking_start(ocp, iterate, deadline)) {
        has_tracking_start_ = false;
        current_ = tracking_start_;
        begin_within_bounds(ocp);
      } else {
        const bool may_be_misled = report.status == Status::infeasible ||
                                   (report.status == Status::stalled && violation_of(report.kkt) > options_.tolerance);
        if (!may_be_misled || !search_.find_other(ocp, iterate, current_, deadline, scratch_, current_)) break;
      }
      begin_again(ocp, report);
    }
  } catch (const std::bad_alloc&) {
    reset();  // the data of the structure may be incomplete
    report.status = Status::stalled;
  }
  report.factorisations = qp_.factorisations() - factorisations_before;
  if (report.status != Status::infeasible && is_sound_start(ocp, current_, scratch_)) std::swap(iterate, current_);
  assess(ocp, iterate, stages_, scratch_, report);
  return report;
}

bool SparseSqp::covariances(const Iterate& iterate, StageRange nodes, std::span<double> blocks) noexcept {
  if (!ocp_ || !is_sound_start(*ocp_, iterate, scratch_)) return false;
  const Ocp& ocp = *ocp_;
  // Computes the covariances of all nodes or none.
  const auto stride = static_cast<std::size_t>(ocp.capacity().states);
  if (nodes.first != 0 || nodes.last != ocp.intervals() ||
      blocks.size() < (static_cast<std::size_t>(ocp.intervals()) + 1) * stride * stride)
    return false;
  try {
    linearise_stages(ocp, iterate, Hessian::gauss_newton, stages_, scratch_);
    return stage_covariances(stages_, blocks);
  } catch (const std::bad_alloc&) {
    return false;
  }
}

}  // namespace rhec::sparse_sqp

RHEC_PLUGIN(rhec::PluginKind::solver, rhec::sparse_sqp::SparseSqp,
            {.name = "sparse_sqp",
             .version = "0.1.0",
             .licence = "BSD-2-Clause AND LGPL-2.1-or-later",
             .source = "Sequential quadratic programming with sparse quasi-definite factors, for long horizons",
             .backend = "CHOLMOD",
             .backend_version = RHEC_TEXT_OF(CHOLMOD_MAIN_VERSION) "." RHEC_TEXT_OF(
                 CHOLMOD_SUB_VERSION) "." RHEC_TEXT_OF(CHOLMOD_SUBSUB_VERSION),
             .capabilities = "rhe, rhc, bounds on states, inputs and parameters, long horizons, covariances; allocates "
                             "for structures not seen before"});
