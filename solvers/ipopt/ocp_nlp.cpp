#include "ocp_nlp.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <IpIpoptCalculatedQuantities.hpp>
#include <IpIpoptData.hpp>
#include <IpOrigIpoptNLP.hpp>
#include <IpTNLPAdapter.hpp>

#include "rhec/core/point.hpp"

namespace rhec::ipopt {
namespace {

/// What Ipopt takes for no bound, whatever its option for that says.
constexpr double no_bound = 1e300;
/// Weights of the objective below this are not divided by.
constexpr double smallest_divisor = 1e-3;

/// Whether all of so many values are finite.
template <class Value>
bool all_finite(std::size_t count, const Value& value) {
  double rests[4] = {};  // stay 0 as long as all is finite
  std::size_t k = 0;
  for (; k + 4 <= count; k += 4)
    for (int j = 0; j < 4; ++j) rests[j] += 0.0 * value(k + j);
  for (; k < count; ++k) rests[0] += 0.0 * value(k);
  return (rests[0] + rests[1]) + (rests[2] + rests[3]) == 0.0;
}

bool all_finite(std::span<const double> values) {
  return all_finite(values.size(), [&](std::size_t k) { return values[k]; });
}

/// Copies values times a factor; whether all of them are finite.
bool copy_finite(std::span<const double> from, double factor, double* __restrict to) {
  return all_finite(from.size(), [&](std::size_t k) { return to[k] = factor * from[k]; });
}

void write_pattern(const SparseNlp::Pattern& pattern, int* rows, int* columns) {
  std::copy(pattern.row_indices.begin(), pattern.row_indices.end(), rows);
  for (int column = 0; column < pattern.columns; ++column)
    std::fill(columns + pattern.starts[column], columns + pattern.starts[column + 1], column);
}

}  // namespace

OcpNlp::OcpNlp(const Ocp& ocp, Curvature curvature)
    : curvature_(curvature),
      scratch_(ocp.scratch_size()),
      defects_(static_cast<std::size_t>(ocp.capacity().intervals) * ocp.capacity().states),
      work_(ocp.capacity()),
      pieces_(ocp.capacity(), stages_at_once) {}

void OcpNlp::take(const Ocp& ocp) {
  ocp_ = &ocp;
  evaluated_.is_known = linearised_.is_known = false;
  if (nlp_.take_structure(ocp)) {
    for (auto* vector :
         {&lower_, &upper_, &start_, &start_lower_, &start_upper_, &seen_, &seen_lower_, &seen_upper_, &evaluated_.z,
          &linearised_.z, &gradient_, &clipped_, &bound_multipliers_, &lagrangian_gradient_})
      vector->assign(nlp_.variables(), 0.0);
    for (auto* vector : {&start_multipliers_, &seen_multipliers_, &constraints_, &weighted_, &linear_multipliers_,
                         &linear_constraints_})
      vector->assign(nlp_.constraints(), 0.0);
    jacobian_.assign(nlp_.jacobian().entries(), 0.0);
    for (auto* vector : {&hessian_, &hessian_part_}) vector->assign(nlp_.hessian().entries(), 0.0);
  }
  nlp_.bounds(ocp, lower_.data(), upper_.data());
  any_fixed_ = false;
  for (std::size_t j = 0; j < lower_.size(); ++j) any_fixed_ = any_fixed_ || lower_[j] == upper_[j];
  work_.clear_multipliers();
}

bool OcpNlp::has_sound_bounds() const noexcept {
  for (std::size_t j = 0; j < lower_.size(); ++j)
    if (std::isnan(lower_[j]) || std::isnan(upper_[j])) return false;
  return true;
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

void OcpNlp::set_start(const Iterate& point, double barrier) noexcept {
  iterates_ = {};
  starts_with_multipliers_ = barrier > 0.0;
  nlp_.read(*ocp_, point, start_.data(), start_multipliers_.data(), bound_multipliers_.data());
  for (std::size_t j = 0; j < start_.size(); ++j) {
    start_lower_[j] = start_upper_[j] = 1.0;
    if (barrier <= 0.0) continue;
    // A bound claimed as active stays close, the multiplier of one that is far is small: both on the central path.
    const bool has_lower = std::isfinite(lower_[j]), has_upper = std::isfinite(upper_[j]);
    const double room = upper_[j] - lower_[j];
    const auto distance = [&](double multiplier, double slack) {
      const double wanted = std::max(slack, barrier / std::max(multiplier, std::sqrt(barrier)));
      return has_lower && has_upper ? std::min(wanted, 0.5 * room) : wanted;
    };
    const double multiplier = bound_multipliers_[j];
    if (has_lower) start_[j] = lower_[j] + distance(-multiplier, start_[j] - lower_[j]);
    if (has_upper) start_[j] = upper_[j] - distance(multiplier, upper_[j] - start_[j]);
    if (has_lower) start_lower_[j] = std::max(-multiplier, barrier / (start_[j] - lower_[j]));
    if (has_upper) start_upper_[j] = std::max(multiplier, barrier / (upper_[j] - start_[j]));
  }
}

bool OcpNlp::Place::is_at(const double* at, unsigned now) noexcept {
  if (!is_known || !((now != elsewhere && visit == now) || std::equal(z.begin(), z.end(), at))) return false;
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
  nlp_.write(*ocp_, z, nullptr, nullptr, work_);
  objective_ = ocp_->evaluate(work_, defects_.data(), scratch_);
  nlp_.constraints(*ocp_, defects_.data(), constraints_.data());
  evaluated_.is_sound = std::isfinite(objective_) && all_finite(constraints_);
  return evaluated_.is_sound;
}

bool OcpNlp::linearise_at(const double* z, const double* multipliers, unsigned visit) {
  if (linearised_.is_at(z, visit)) return linearised_.is_sound;
  linearised_.move_to(z, visit);
  // Ipopt asks for the Hessian later, most often with the multipliers that it has already.
  is_linear_exact_ = curvature_ == Curvature::exact && (multipliers || guess_multipliers());
  if (multipliers) std::copy_n(multipliers, linear_multipliers_.size(), linear_multipliers_.begin());
  const Hessian hessian = is_linear_exact_                        ? Hessian::exact
                          : curvature_ == Curvature::gauss_newton ? Hessian::gauss_newton
                                                                  : Hessian::none;
  linearise(z, linear_multipliers_.data(), 1.0, hessian, Kept::all, hessian_.data());
  linearised_.is_sound = all_finite(gradient_);
  return linearised_.is_sound;
}

/// The multipliers of Ipopt's iterate to `linear_multipliers_`. False where there are none yet.
bool OcpNlp::guess_multipliers() {
  if (iterates_.data) {
    read_multipliers(linear_multipliers_.data());
  } else {
    std::copy(start_multipliers_.begin(), start_multipliers_.end(), linear_multipliers_.begin());
  }
  return iterates_.data || starts_with_multipliers_;
}

/// At costates that are `factor` times the multipliers, or zero where there are none.
void OcpNlp::linearise(const double* z, const double* multipliers, double factor, Hessian hessian, Kept kept,
                       double* hessian_values) noexcept {
  for (std::size_t row = 0; row < weighted_.size(); ++row)
    weighted_[row] = multipliers ? factor * multipliers[row] : 0.0;
  nlp_.write(*ocp_, z, hessian == Hessian::exact ? weighted_.data() : nullptr, nullptr, work_);
  for (int first = 0; first <= ocp_->intervals(); first += stages_at_once) {
    const StageRange piece{first, std::min(first + stages_at_once - 1, ocp_->intervals())};
    pieces_.look_at(first);
    ocp_->linearise(piece, work_, hessian, pieces_, scratch_);
    if (hessian != Hessian::none) nlp_.hessian(pieces_, piece, hessian_values);
    if (kept == Kept::hessian) continue;
    nlp_.constraints(pieces_, piece, linear_constraints_.data());
    nlp_.gradient(pieces_, piece, gradient_.data());
    nlp_.jacobian(pieces_, piece, jacobian_.data());
  }
}

KktResidual OcpNlp::write_and_judge(const PrimalDual& from, Iterate& point) noexcept {
  for (std::size_t j = 0; j < clipped_.size(); ++j) {
    clipped_[j] = std::min(std::max(from.z[j], lower_[j]), upper_[j]);
    bound_multipliers_[j] = from.upper_multipliers[j] - from.lower_multipliers[j];
  }
  linearise_at(clipped_.data(), from.multipliers);
  nlp_.lagrangian_gradient(gradient_.data(), jacobian_.data(), from.multipliers, lagrangian_gradient_.data());
  for (std::size_t j = 0; any_fixed_ && j < lower_.size(); ++j)
    if (lower_[j] == upper_[j]) bound_multipliers_[j] = -lagrangian_gradient_[j];
  nlp_.write(*ocp_, clipped_.data(), from.multipliers, bound_multipliers_.data(), point);
  KktTerms terms;
  nlp_.add_kkt({clipped_.data(), lower_.data(), upper_.data(), linear_constraints_.data(), gradient_.data(),
                lagrangian_gradient_.data(), from.multipliers, bound_multipliers_.data()},
               terms);
  pieces_.look_at(0);
  ocp_->linearise({0, 0}, point, Hessian::none, pieces_, scratch_);
  if (ocp_->intervals() > 0) pieces_.set_sizes(1, ocp_->state_count(1), 0);
  SparseNlp::set_costate_0(pieces_, point);
  terms.add(pieces_, point, {0, 0});
  return terms.residual();
}

double OcpNlp::objective(const Iterate& point) noexcept {
  nlp_.read(*ocp_, point, clipped_.data(), nullptr, nullptr);
  evaluate_at(clipped_.data());
  return objective_;
}

double OcpNlp::complementarity_gap(const Iterate& point) noexcept {
  nlp_.read(*ocp_, point, clipped_.data(), nullptr, bound_multipliers_.data());
  double gap = 0.0;
  for (std::size_t j = 0; j < clipped_.size(); ++j) {
    if (bound_multipliers_[j] > 0.0) gap += bound_multipliers_[j] * (upper_[j] - clipped_[j]);
    if (bound_multipliers_[j] < 0.0) gap += bound_multipliers_[j] * (lower_[j] - clipped_[j]);
  }
  return gap;
}

bool OcpNlp::get_nlp_info(Ipopt::Index& n, Ipopt::Index& m, Ipopt::Index& jacobian_entries,
                          Ipopt::Index& hessian_entries, IndexStyleEnum& index_style) {
  const Timer timer(microseconds_);
  n = nlp_.variables();
  m = nlp_.constraints();
  jacobian_entries = nlp_.jacobian().entries();
  hessian_entries = nlp_.hessian().entries();
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
  if (init_z) std::copy(start_.begin(), start_.end(), z);
  if (init_bounds) {
    std::copy(start_lower_.begin(), start_lower_.end(), lower_multipliers);
    std::copy(start_upper_.begin(), start_upper_.end(), upper_multipliers);
  }
  if (init_multipliers) std::copy(start_multipliers_.begin(), start_multipliers_.end(), multipliers);
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
  if (!linearise_at(z, nullptr, visit_)) return false;
  std::copy(gradient_.begin(), gradient_.end(), gradient);
  return true;
}

bool OcpNlp::eval_jac_g(Ipopt::Index, const double* z, bool new_z, Ipopt::Index, Ipopt::Index, Ipopt::Index* rows,
                        Ipopt::Index* columns, double* values) {
  const Timer timer(microseconds_);
  if (!values) {
    write_pattern(nlp_.jacobian(), rows, columns);
    return true;
  }
  visit(new_z);
  if (!linearise_at(z, nullptr, visit_)) return false;
  return copy_finite(jacobian_, 1.0, values);
}

bool OcpNlp::eval_h(Ipopt::Index, const double* z, bool new_z, double objective_factor, Ipopt::Index,
                    const double* multipliers, bool, Ipopt::Index entries, Ipopt::Index* rows, Ipopt::Index* columns,
                    double* values) {
  const Timer timer(microseconds_);
  if (!values) {
    write_pattern(nlp_.hessian(), rows, columns);
    return true;
  }
  visit(new_z);
  const std::span<double> all(values, entries);
  if (curvature_ == Curvature::gauss_newton) {
    linearise_at(z, nullptr, visit_);
    return copy_finite(hessian_, objective_factor, values);
  }
  if (objective_factor == 1.0 && is_linear_exact_ && linearised_.is_at(z, visit_) &&
      std::equal(linear_multipliers_.begin(), linear_multipliers_.end(), multipliers)) {
    return copy_finite(hessian_, 1.0, values);
  }
  if (objective_factor >= smallest_divisor) {
    linearise(z, multipliers, 1.0 / objective_factor, Hessian::exact, Kept::hessian, values);
    for (double& value : all) value *= objective_factor;
  } else {
    // The Ocp's Lagrangian always holds the whole objective: what is too much of it is taken away.
    linearise(z, multipliers, 1.0, Hessian::exact, Kept::hessian, values);
    linearise(z, nullptr, 0.0, Hessian::exact, Kept::hessian, hessian_part_.data());
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
  if (spectator_) spectator_->see_last({z, multipliers, lower_multipliers, upper_multipliers});
}

void OcpNlp::read_multipliers(double* multipliers) {
  const auto& [data, scaled, adapter] = iterates_;
  const Ipopt::SmartPtr<const Ipopt::IteratesVector> now = data->curr();
  const Ipopt::SmartPtr<Ipopt::NLPScalingObject> scaling = scaled->NLP_scaling();
  const double factor = scaling->unapply_obj_scaling(1.0);
  const auto y_c = scaling->apply_vector_scaling_c_NonConst(now->y_c());
  const auto y_d = scaling->apply_vector_scaling_d_NonConst(now->y_d());
  y_c->Scal(factor);
  y_d->Scal(factor);
  std::fill_n(multipliers, nlp_.constraints(), 0.0);
  adapter->ResortG(*y_c, *y_d, multipliers);
}

bool OcpNlp::intermediate_callback(Ipopt::AlgorithmMode mode, Ipopt::Index iteration, double, double, double, double,
                                   double, double, double, double, Ipopt::Index, const Ipopt::IpoptData* data,
                                   Ipopt::IpoptCalculatedQuantities* quantities) {
  const Timer timer(microseconds_);
  if (!spectator_) return true;
  if (mode == Ipopt::RestorationPhaseMode) return spectator_->see(iteration, nullptr);
  // Ipopt 3.11 shows its iterate only in its own layout: scaled, and without variables that have one value only.
  auto* scaled = dynamic_cast<Ipopt::OrigIpoptNLP*>(Ipopt::GetRawPtr(quantities->GetIpoptNLP()));
  auto* adapter = scaled ? dynamic_cast<Ipopt::TNLPAdapter*>(Ipopt::GetRawPtr(scaled->nlp())) : nullptr;
  if (!adapter) return spectator_->see(iteration, nullptr);
  iterates_ = {data, scaled, adapter};
  read_multipliers(seen_multipliers_.data());
  const Ipopt::SmartPtr<const Ipopt::IteratesVector> now = data->curr();
  const Ipopt::SmartPtr<Ipopt::NLPScalingObject> scaling = scaled->NLP_scaling();
  const double factor = scaling->unapply_obj_scaling(1.0);
  const Ipopt::SmartPtr<const Ipopt::VectorSpace> space = now->x()->OwnerSpace();
  const auto z_L = scaling->apply_vector_scaling_x_LU_NonConst(*scaled->Px_L(), now->z_L(), *space);
  const auto z_U = scaling->apply_vector_scaling_x_LU_NonConst(*scaled->Px_U(), now->z_U(), *space);
  z_L->Scal(factor);
  z_U->Scal(factor);
  std::fill(seen_lower_.begin(), seen_lower_.end(), 0.0);
  std::fill(seen_upper_.begin(), seen_upper_.end(), 0.0);
  adapter->ResortX(*scaling->unapply_vector_scaling_x(now->x()), seen_.data());
  adapter->ResortBnds(*z_L, seen_lower_.data(), *z_U, seen_upper_.data());
  const PrimalDual iterate{seen_.data(), seen_multipliers_.data(), seen_lower_.data(), seen_upper_.data()};
  return spectator_->see(iteration, &iterate);
}

}  // namespace rhec::ipopt
