#include "ocp_nlp.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <IpIpoptCalculatedQuantities.hpp>
#include <IpIpoptData.hpp>
#include <IpOrigIpoptNLP.hpp>
#include <IpTNLPAdapter.hpp>

#include "rhec/core/ocp/iterate_checks.hpp"

namespace rhec::ipopt {
namespace {

/// A value that Ipopt takes for no bound, whatever its options say.
constexpr double no_bound = 1e300;
/// Objective factors below this are not divided by.
constexpr double smallest_divisor = 1e-3;

/// Whether value(0) .. value(count - 1) are finite.
template <class Value>
bool all_finite(std::size_t count, const Value& value) {
  double rests[4] = {};  // stay 0 while all values are finite
  std::size_t k = 0;
  for (; k + 4 <= count; k += 4)
    for (int j = 0; j < 4; ++j) rests[j] += 0.0 * value(k + j);
  for (; k < count; ++k) rests[0] += 0.0 * value(k);
  return (rests[0] + rests[1]) + (rests[2] + rests[3]) == 0.0;
}

bool all_finite(std::span<const double> values) {
  return all_finite(values.size(), [&](std::size_t k) { return values[k]; });
}

/// Copies values times a factor; returns whether all of them are finite.
bool copy_finite(std::span<const double> from, double factor, double* __restrict to) {
  return all_finite(from.size(), [&](std::size_t k) { return to[k] = factor * from[k]; });
}

/// Bitwise equality.
bool are_equal(std::span<const double> one, const double* other) {
  return one.empty() || std::memcmp(one.data(), other, one.size_bytes()) == 0;
}

void write_pattern(const SparseNlp::Pattern& pattern, int* rows, int* columns) {
  std::copy(pattern.row_indices.begin(), pattern.row_indices.end(), rows);
  for (int column = 0; column < pattern.columns; ++column)
    std::fill(columns + pattern.starts[column], columns + pattern.starts[column + 1], column);
}

}  // namespace

OcpNlp::OcpNlp(const Ocp& ocp, Curvature curvature)
    : curvature_(curvature),
      limit_values_((static_cast<std::size_t>(ocp.capacity().intervals) + 1) * ocp.capacity().limit_row()),
      scratch_(ocp.scratch_size()),
      trial_(ocp.capacity()),
      defects_(static_cast<std::size_t>(ocp.capacity().intervals) * ocp.capacity().states),
      pieces_(ocp.capacity(), window),
      linear_(ocp.capacity()) {}

void OcpNlp::take(const Ocp& ocp) {
  ocp_ = &ocp;
  evaluated_.is_known = linearised_.is_known = false;
  const int variables_before = static_cast<int>(lower_.size());
  const bool is_new = nlp_.take_structure(ocp);
  limits_.take(ocp, nlp_);
  if (is_new || variables() != variables_before) {
    for (auto* vector : {&lower_, &upper_, &start_.z, &start_lower_, &start_upper_, &seen_.z, &evaluated_.z,
                         &linearised_.z, &gradient_, &clipped_})
      vector->resize(variables());
    for (auto* vector :
         {&start_.multipliers.of_constraints, &seen_.multipliers.of_constraints, &constraints_, &weighted_})
      vector->resize(nlp_.constraints());
    jacobian_.resize(nlp_.jacobian().entries() + limits_.count());
    for (auto* vector : {&hessian_, &hessian_part_}) vector->resize(nlp_.hessian().entries() + limits_.count());
  }
  nlp_.bounds(ocp, lower_.data(), upper_.data());
  limits_.bounds(lower_.data() + nlp_.variables(), upper_.data() + nlp_.variables());
  limits_.jacobian(jacobian_.data() + nlp_.jacobian().entries());
  any_fixed_ = false;
  bounded_.clear();
  for (int j = 0; j < variables(); ++j) {
    if (!std::isfinite(lower_[j]) && !std::isfinite(upper_[j])) continue;
    bounded_.push_back(j);
    any_fixed_ |= lower_[j] == upper_[j];
  }
  for (auto* vector : {&seen_lower_, &seen_upper_, &seen_.multipliers.of_bounds, &start_.multipliers.of_bounds})
    vector->assign(variables(), 0.0);
}

bool OcpNlp::has_empty_bounds() const noexcept {
  for (std::size_t j = 0; j < lower_.size(); ++j)
    if (lower_[j] > upper_[j]) return true;
  return false;
}

void OcpNlp::set_curvature(Curvature curvature) noexcept {
  linearised_.is_known = linearised_.is_known && curvature == curvature_;
  curvature_ = curvature;
}

void OcpNlp::set_start(const Iterate& iterate, double barrier) noexcept {
  iterates_ = {};
  forget_seen();
  starts_with_multipliers_ = barrier > 0.0;
  const double least_multiplier = std::sqrt(barrier);
  std::vector<double>& z = start_.z;
  Multipliers& multipliers = start_.multipliers;
  nlp_.read(*ocp_, iterate, z.data(), multipliers.of_constraints.data(), multipliers.of_bounds.data());
  if (limits_.count() > 0) {
    evaluate_limits(iterate, constraints_.data());
    evaluated_.is_known = false;
    limits_.start(constraints_.data(), multipliers.of_constraints.data(), z.data() + nlp_.variables(),
                  multipliers.of_bounds.data() + nlp_.variables());
  }
  for (auto* vector : {&start_lower_, &start_upper_}) std::fill(vector->begin(), vector->end(), 1.0);
  if (barrier <= 0.0) return;
  for (const int j : bounded_) {
    const bool has_lower = std::isfinite(lower_[j]), has_upper = std::isfinite(upper_[j]);
    // Active bounds stay close, and the multipliers of distant bounds are small: both are on the central path.
    const double room = upper_[j] - lower_[j];
    const auto distance = [&](double multiplier, double slack) {
      const double wanted = std::max(slack, barrier / std::max(multiplier, least_multiplier));
      return has_lower && has_upper ? std::min(wanted, 0.5 * room) : wanted;
    };
    double& multiplier = multipliers.of_bounds[j];
    if (has_lower) z[j] = lower_[j] + distance(-multiplier, z[j] - lower_[j]);
    if (has_upper) z[j] = upper_[j] - distance(multiplier, upper_[j] - z[j]);
    if (has_lower) start_lower_[j] = std::max(-multiplier, barrier / (z[j] - lower_[j]));
    if (has_upper) start_upper_[j] = std::max(multiplier, barrier / (upper_[j] - z[j]));
    multiplier = (has_upper ? start_upper_[j] : 0.0) - (has_lower ? start_lower_[j] : 0.0);
  }
}

bool OcpNlp::Place::is_at(const double* at, unsigned now) noexcept {
  if (!is_known || !((now != elsewhere && visit == now) || are_equal(z, at))) return false;
  if (now != elsewhere) visit = now;
  return true;
}

void OcpNlp::Place::move_to(const double* at, unsigned now) noexcept {
  std::copy_n(at, z.size(), z.begin());
  visit = now;
  is_known = true;
}

bool OcpNlp::evaluate_at(const double* z, unsigned visit) noexcept {
  if (evaluated_.is_at(z, visit)) return evaluated_.is_sound;
  evaluated_.move_to(z, visit);
  nlp_.write(*ocp_, z, nullptr, nullptr, trial_);
  // If every node has as many states as the capacity allows, the defects are the constraints.
  const bool is_full = limits_.count() == 0 && constraints() == ocp_->intervals() * ocp_->capacity().states;
  double* const defects = is_full ? constraints_.data() : defects_.data();
  objective_ = ocp_->evaluate(trial_, defects, scratch_);
  if (!is_full) nlp_.constraints(*ocp_, defects, nullptr, constraints_.data());
  if (limits_.count() > 0) {
    const double* values = z + nlp_.variables();
    evaluate_limits(trial_, constraints_.data());
    limits_.add_to(values, constraints_.data());
    objective_ += limits_.cost(values);
  }
  evaluated_.is_sound = std::isfinite(objective_) && all_finite(constraints_);
  return evaluated_.is_sound;
}

/// Writes the values of limits to their places in c.
void OcpNlp::evaluate_limits(const Iterate& iterate, double* c) noexcept {
  ocp_->evaluate_limits(iterate, limit_values_.data(), scratch_);
  nlp_.limits(*ocp_, limit_values_.data(), c);
}

bool OcpNlp::linearise_at(const double* z, unsigned visit) {
  if (linearised_.is_at(z, visit)) return linearised_.is_sound;
  linearised_.move_to(z, visit);
  // Ipopt requests the Hessian and reports the iterate only later, but it already has the multipliers: use them now.
  if (iterates_.data) {
    read_iterate();
    linearise_all(seen_, true);
  } else {
    linearise_all(start_, starts_with_multipliers_);
  }
  return linearised_.is_sound;
}

/// Linearises at an iterate piece by piece and calls `take` after each piece; returns the objective.
template <class Take>
double OcpNlp::linearise(const double* z, const double* multipliers, const double* bound_multipliers, Hessian hessian,
                         const Take& take) noexcept {
  const int N = ocp_->intervals();
  double objective = 0.0;
  is_assessed_ = false;
  for (StageRange piece{0, 0}; piece.first <= N; piece.first = piece.last + 1) {
    // Includes the stage after the piece, in which its dynamics end.
    const int behind = std::min(piece.first + pieces_.window() - 1, N);
    piece.last = behind < N ? behind - 1 : N;
    pieces_.look_at(piece.first);
    nlp_.write(*ocp_, {piece.first, behind}, z, multipliers, bound_multipliers, linear_);
    objective += ocp_->linearise(piece, linear_, hessian, pieces_, scratch_);
    objective += slack_costs(pieces_, piece);
    if (piece.last < N) pieces_.set_sizes(behind, ocp_->state_count(behind), 0);
    take(piece);
  }
  return objective;
}

/// Computes all derivatives and the KKT residual at `linearised_`, the point of the iterate or a trial point of Ipopt.
void OcpNlp::linearise_all(const PrimalDual& iterate, bool has_multipliers) noexcept {
  const auto& [of_constraints, of_bounds] = iterate.multipliers;
  is_linear_exact_ = curvature_ == Curvature::exact && has_multipliers;
  const Hessian hessian = is_linear_exact_                        ? Hessian::exact
                          : curvature_ == Curvature::gauss_newton ? Hessian::gauss_newton
                                                                  : Hessian::none;
  KktTerms terms;
  const auto take = [&](StageRange piece) {
    if (hessian != Hessian::none) nlp_.hessian(pieces_, piece, hessian_.data());
    nlp_.gradient(pieces_, piece, gradient_.data());
    nlp_.jacobian(pieces_, piece, jacobian_.data());
    if (any_fixed_) set_fixed_multipliers(piece);
    if (piece.first == 0) SparseNlp::set_costate_0(pieces_, linear_);
    terms.add(pieces_, linear_, piece);
  };
  linear_objective_ = linearise(linearised_.z.data(), of_constraints.data(), of_bounds.data(), hessian, take);
  const double* of_limits = linearised_.z.data() + nlp_.variables();
  limits_.gradient(of_limits, gradient_.data() + nlp_.variables());
  limits_.hessian(of_limits, hessian_.data() + nlp_.hessian().entries());
  linear_iterate_ = &iterate;
  linear_tag_ = are_equal(linearised_.z, iterate.z.data()) ? iterate.tag : 0;
  linear_kkt_ = terms.residual();
  // If a number in the gradient or the Jacobian is not finite, the stationarity is not finite either.
  linearised_.is_sound = std::isfinite(linear_kkt_.stationarity);
  is_assessed_ = true;
}

/// Sets the bound multipliers of fixed variables of a piece such that stationarity holds.
void OcpNlp::set_fixed_multipliers(StageRange piece) noexcept {
  const auto set = [&](int i, const double* lower, const double* upper, int first, int count) {
    for (int k = first; k < first + count; ++k) {
      if (lower[k - first] != upper[k - first]) continue;
      double pull = pieces_.h(i)[k];
      if (i < ocp_->intervals())
        for (int r = 0; r < ocp_->state_count(i + 1); ++r)
          pull += pieces_.AB(i)[r * pieces_.stride() + k] * linear_.costate(i + 1)[r];
      if (k < ocp_->state_count(i)) pull -= linear_.costate(i)[k];
      for (int r = 0; r < nlp_.limit_count(i); ++r)
        pull += pieces_.G(i)[r * pieces_.stride() + k] * linear_.limit_bound(i)[r];
      linear_.bound_row(i)[k] = -pull;
    }
  };
  for (int i = piece.first; i <= piece.last; ++i) {
    if (nlp_.state_start(i) >= 0) set(i, ocp_->state_lower(i), ocp_->state_upper(i), 0, ocp_->state_count(i));
    if (i < ocp_->intervals())
      set(i, ocp_->control_lower(i), ocp_->control_upper(i), ocp_->capacity().states, ocp_->control_count(i));
  }
}

/// The exact Hessian for costates `factor` times the multipliers, or zero if there are none.
void OcpNlp::write_hessian(const double* z, const double* multipliers, double factor, double* values) noexcept {
  for (std::size_t row = 0; row < weighted_.size(); ++row)
    weighted_[row] = multipliers ? factor * multipliers[row] : 0.0;
  linearise(z, weighted_.data(), nullptr, Hessian::exact,
            [&](StageRange piece) { nlp_.hessian(pieces_, piece, values); });
  limits_.hessian(z + nlp_.variables(), values + nlp_.hessian().entries());
}

/// Whether the linearisation is that of this iterate, and the iterate is within its bounds.
bool OcpNlp::has_judged(const PrimalDual& iterate) const noexcept {
  if (!is_assessed_ || !linearised_.is_known || linear_kkt_.bound_violation > 0.0) return false;
  if (linear_tag_ != 0 && linear_tag_ == iterate.tag) return true;
  const auto& [of_constraints, of_bounds] = iterate.multipliers;
  return are_equal(linearised_.z, iterate.z.data()) &&
         are_equal(linear_iterate_->multipliers.of_constraints, of_constraints.data()) &&
         are_equal(linear_iterate_->multipliers.of_bounds, of_bounds.data());
}

KktResidual OcpNlp::residual_at(const PrimalDual& iterate) noexcept {
  if (has_judged(iterate)) return linear_kkt_;
  for (std::size_t j = 0; j < clipped_.size(); ++j)
    clipped_[j] = std::min(std::max(iterate.z[j], lower_[j]), upper_[j]);
  linearised_.move_to(clipped_.data(), elsewhere);
  linearise_all(iterate, true);
  return linear_kkt_;
}

void OcpNlp::exchange_assessed(Iterate& iterate) noexcept {
  std::swap(linear_, iterate);
  is_assessed_ = false;
}

double OcpNlp::complementarity_gap() const noexcept {
  const std::vector<double>&z = linearised_.z, &multipliers = linear_iterate_->multipliers.of_bounds;
  double gap = 0.0;
  for (const int j : bounded_) {
    if (multipliers[j] > 0.0) gap += multipliers[j] * (upper_[j] - z[j]);
    if (multipliers[j] < 0.0) gap += multipliers[j] * (lower_[j] - z[j]);
  }
  return gap;
}

double OcpNlp::violation_gap() noexcept {
  if (!evaluate_at(linearised_.z.data(), elsewhere)) return std::numeric_limits<double>::infinity();
  const std::vector<double>& multipliers = linear_iterate_->multipliers.of_constraints;
  double gap = 0.0;
  for (std::size_t row = 0; row < constraints_.size(); ++row) gap += std::abs(multipliers[row] * constraints_[row]);
  return gap;
}

bool OcpNlp::get_nlp_info(Ipopt::Index& n, Ipopt::Index& m, Ipopt::Index& jacobian_entries,
                          Ipopt::Index& hessian_entries, IndexStyleEnum& index_style) {
  const Timer timer(microseconds_);
  n = variables();
  m = constraints();
  jacobian_entries = static_cast<int>(jacobian_.size());
  hessian_entries = static_cast<int>(hessian_.size());
  index_style = C_STYLE;
  return true;
}

bool OcpNlp::get_bounds_info(Ipopt::Index n, double* lower, double* upper, Ipopt::Index m, double* constraint_lower,
                             double* constraint_upper) {
  const Timer timer(microseconds_);
  for (Ipopt::Index j = 0; j < n; ++j) {
    lower[j] = std::max(lower_[j], -no_bound);
    upper[j] = std::min(upper_[j], no_bound);
  }
  std::fill_n(constraint_lower, m, 0.0);
  std::fill_n(constraint_upper, m, 0.0);
  return true;
}

bool OcpNlp::get_starting_point(Ipopt::Index, bool init_z, double* z, bool init_bounds, double* lower_multipliers,
                                double* upper_multipliers, Ipopt::Index, bool init_multipliers, double* multipliers) {
  const Timer timer(microseconds_);
  if (init_z) std::copy(start_.z.begin(), start_.z.end(), z);
  if (init_bounds) {
    std::copy(start_lower_.begin(), start_lower_.end(), lower_multipliers);
    std::copy(start_upper_.begin(), start_upper_.end(), upper_multipliers);
  }
  const std::vector<double>& of_constraints = start_.multipliers.of_constraints;
  if (init_multipliers) std::copy(of_constraints.begin(), of_constraints.end(), multipliers);
  return true;
}

bool OcpNlp::eval_f(Ipopt::Index, const double* z, bool new_z, double& objective) {
  const Timer timer(microseconds_);
  visit(new_z);
  if (!evaluate_at(z, visit_)) return false;
  objective = objective_;
  return true;
}

bool OcpNlp::eval_g(Ipopt::Index, const double* z, bool new_z, Ipopt::Index, double* constraints) {
  const Timer timer(microseconds_);
  visit(new_z);
  if (!evaluate_at(z, visit_)) return false;
  std::copy(constraints_.begin(), constraints_.end(), constraints);
  return true;
}

bool OcpNlp::eval_grad_f(Ipopt::Index, const double* z, bool new_z, double* gradient) {
  const Timer timer(microseconds_);
  visit(new_z);
  if (!linearise_at(z, visit_)) return false;
  std::copy(gradient_.begin(), gradient_.end(), gradient);
  return true;
}

bool OcpNlp::eval_jac_g(Ipopt::Index, const double* z, bool new_z, Ipopt::Index, Ipopt::Index, Ipopt::Index* rows,
                        Ipopt::Index* columns, double* values) {
  const Timer timer(microseconds_);
  if (!values) {
    write_pattern(nlp_.jacobian(), rows, columns);
    const int first = nlp_.jacobian().entries();
    limits_.jacobian_pattern(nlp_.variables(), rows + first, columns + first);
    return true;
  }
  visit(new_z);
  if (!linearise_at(z, visit_)) return false;
  std::copy(jacobian_.begin(), jacobian_.end(), values);
  return true;
}

bool OcpNlp::eval_h(Ipopt::Index, const double* z, bool new_z, double objective_factor, Ipopt::Index,
                    const double* multipliers, bool, Ipopt::Index entries, Ipopt::Index* rows, Ipopt::Index* columns,
                    double* values) {
  const Timer timer(microseconds_);
  if (!values) {
    write_pattern(nlp_.hessian(), rows, columns);
    const int first = nlp_.hessian().entries();
    limits_.hessian_pattern(nlp_.variables(), rows + first, columns + first);
    return true;
  }
  visit(new_z);
  const std::span<double> all(values, entries);
  if (curvature_ == Curvature::gauss_newton) {
    linearise_at(z, visit_);
    return copy_finite(hessian_, objective_factor, values);
  }
  if (objective_factor == 1.0 && is_linear_exact_ && linearised_.is_at(z, visit_) &&
      are_equal(linear_iterate_->multipliers.of_constraints, multipliers)) {
    return copy_finite(hessian_, 1.0, values);
  }
  if (objective_factor >= smallest_divisor) {
    write_hessian(z, multipliers, 1.0 / objective_factor, values);
    for (double& value : all) value *= objective_factor;
  } else {
    // The Ocp's Lagrangian always contains the objective with weight 1: subtract the excess.
    write_hessian(z, multipliers, 1.0, values);
    write_hessian(z, nullptr, 0.0, hessian_part_.data());
    for (Ipopt::Index entry = 0; entry < entries; ++entry)
      values[entry] += (objective_factor - 1.0) * hessian_part_[entry];
  }
  return all_finite(all);
}

void OcpNlp::finalize_solution(Ipopt::SolverReturn, Ipopt::Index, const double* z, const double* lower_multipliers,
                               const double* upper_multipliers, Ipopt::Index, const double*, const double* multipliers,
                               double, const Ipopt::IpoptData*, Ipopt::IpoptCalculatedQuantities*) {
  const Timer timer(microseconds_);
  iterates_ = {};
  if (!spectator_) return;
  forget_seen();
  std::copy_n(z, variables(), seen_.z.begin());
  std::copy_n(multipliers, constraints(), seen_.multipliers.of_constraints.begin());
  for (const int j : bounded_) seen_.multipliers.of_bounds[j] = upper_multipliers[j] - lower_multipliers[j];
  spectator_->see_last(seen_);
}

/// Invalidates `seen_` and what was computed with its multipliers.
void OcpNlp::forget_seen() noexcept {
  seen_.tag = 0;
  if (linear_iterate_ == &seen_) is_assessed_ = is_linear_exact_ = false;
}

/// Copies Ipopt's current iterate to `seen_`. Ipopt 3.11 gives it only in its own layout: scaled and without fixed
/// variables.
void OcpNlp::read_iterate() {
  const auto& [data, scaled, adapter] = iterates_;
  const Ipopt::SmartPtr<const Ipopt::IteratesVector> now = data->curr();
  if (seen_.tag == now->GetTag()) return;
  forget_seen();
  const Ipopt::SmartPtr<Ipopt::NLPScalingObject> scaling = scaled->NLP_scaling();
  const Ipopt::SmartPtr<const Ipopt::VectorSpace> space = now->x()->OwnerSpace();
  const auto x = scaling->unapply_vector_scaling_x(now->x());
  const auto y_c = scaling->apply_vector_scaling_c(now->y_c()), y_d = scaling->apply_vector_scaling_d(now->y_d());
  const auto z_L = scaling->apply_vector_scaling_x_LU(*scaled->Px_L(), now->z_L(), *space);
  const auto z_U = scaling->apply_vector_scaling_x_LU(*scaled->Px_U(), now->z_U(), *space);
  auto& [of_constraints, of_bounds] = seen_.multipliers;
  seen_.tag = now->GetTag();
  adapter->ResortX(*x, seen_.z.data());
  adapter->ResortG(*y_c, *y_d, of_constraints.data());
  adapter->ResortBnds(*z_L, seen_lower_.data(), *z_U, seen_upper_.data());
  const double factor = scaling->unapply_obj_scaling(1.0);
  for (const int j : bounded_) of_bounds[j] = factor * (seen_upper_[j] - seen_lower_[j]);
  if (factor == 1.0) return;
  for (double& multiplier : of_constraints) multiplier *= factor;
}

bool OcpNlp::intermediate_callback(Ipopt::AlgorithmMode mode, Ipopt::Index iteration, double, double, double, double,
                                   double, double, double, double, Ipopt::Index, const Ipopt::IpoptData* data,
                                   Ipopt::IpoptCalculatedQuantities* quantities) {
  const Timer timer(microseconds_);
  if (!spectator_) return true;
  if (mode == Ipopt::RestorationPhaseMode) return spectator_->see(iteration, nullptr);
  auto* scaled = dynamic_cast<Ipopt::OrigIpoptNLP*>(Ipopt::GetRawPtr(quantities->GetIpoptNLP()));
  auto* adapter = scaled ? dynamic_cast<Ipopt::TNLPAdapter*>(Ipopt::GetRawPtr(scaled->nlp())) : nullptr;
  if (!adapter) return spectator_->see(iteration, nullptr);
  iterates_ = {data, scaled, adapter};
  read_iterate();
  return spectator_->see(iteration, &seen_);
}

}  // namespace rhec::ipopt
