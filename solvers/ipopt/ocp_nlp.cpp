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
constexpr int stages_at_once = 64;

bool all_finite(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
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
      linear_(ocp.capacity()),
      other_(ocp.capacity()) {}

void OcpNlp::take(const Ocp& ocp) {
  ocp_ = &ocp;
  is_evaluated_ = is_linear_ = false;
  if (nlp_.take_structure(ocp)) {
    for (auto* vector : {&lower_, &upper_, &start_, &start_lower_, &start_upper_, &seen_, &seen_lower_, &seen_upper_,
                         &evaluated_z_, &linear_z_, &gradient_, &clipped_, &bound_multipliers_})
      vector->assign(nlp_.variables(), 0.0);
    for (auto* vector : {&start_multipliers_, &seen_multipliers_, &constraints_, &weighted_, &linear_multipliers_})
      vector->assign(nlp_.constraints(), 0.0);
    jacobian_.assign(nlp_.jacobian().entries(), 0.0);
    hessian_part_.assign(nlp_.hessian().entries(), 0.0);
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
  is_linear_ = is_linear_ && curvature == curvature_;
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

bool OcpNlp::evaluate_at(const double* z) noexcept {
  if (is_evaluated_ && std::equal(evaluated_z_.begin(), evaluated_z_.end(), z)) return is_evaluated_sound_;
  std::copy_n(z, evaluated_z_.size(), evaluated_z_.begin());
  nlp_.write(*ocp_, z, nullptr, nullptr, work_);
  objective_ = ocp_->evaluate(work_, defects_.data(), scratch_);
  nlp_.constraints(*ocp_, defects_.data(), constraints_.data());
  is_evaluated_ = true;
  is_evaluated_sound_ = std::isfinite(objective_) && all_finite(constraints_);
  return is_evaluated_sound_;
}

bool OcpNlp::linearise_at(const double* z, const double* multipliers) {
  if (is_linear_ && std::equal(linear_z_.begin(), linear_z_.end(), z)) return is_linear_sound_;
  std::copy_n(z, linear_z_.size(), linear_z_.begin());
  // Ipopt asks for the Hessian later, most often with the multipliers that it has already.
  is_linear_exact_ = curvature_ == Curvature::exact && (multipliers || guess_multipliers());
  if (multipliers) std::copy_n(multipliers, linear_multipliers_.size(), linear_multipliers_.begin());
  const Hessian hessian = is_linear_exact_                        ? Hessian::exact
                          : curvature_ == Curvature::gauss_newton ? Hessian::gauss_newton
                                                                  : Hessian::none;
  linearise(z, linear_multipliers_.data(), 1.0, hessian, linear_);
  nlp_.gradient(linear_, gradient_.data());
  is_linear_ = true;
  is_linear_sound_ = all_finite(gradient_);
  return is_linear_sound_;
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
void OcpNlp::linearise(const double* z, const double* multipliers, double factor, Hessian hessian,
                       StageQp& qp) noexcept {
  for (std::size_t row = 0; row < weighted_.size(); ++row)
    weighted_[row] = multipliers ? factor * multipliers[row] : 0.0;
  nlp_.write(*ocp_, z, hessian == Hessian::exact ? weighted_.data() : nullptr, nullptr, work_);
  // Piece by piece, each small enough for a processor's cache.
  for (int first = 0; first <= ocp_->intervals(); first += stages_at_once)
    ocp_->linearise({first, std::min(first + stages_at_once - 1, ocp_->intervals())}, work_, hessian, qp, scratch_);
}

KktResidual OcpNlp::write_and_judge(const PrimalDual& from, Iterate& point) noexcept {
  for (std::size_t j = 0; j < clipped_.size(); ++j) {
    clipped_[j] = std::min(std::max(from.z[j], lower_[j]), upper_[j]);
    bound_multipliers_[j] = from.upper_multipliers[j] - from.lower_multipliers[j];
  }
  linearise_at(clipped_.data(), from.multipliers);
  const SparseNlp::Pattern& pattern = nlp_.jacobian();
  if (any_fixed_) nlp_.jacobian(linear_, jacobian_.data());
  for (int j = 0; any_fixed_ && j < pattern.columns; ++j) {
    if (lower_[j] != upper_[j]) continue;
    double sum = gradient_[j];
    for (int entry = pattern.starts[j]; entry < pattern.starts[j + 1]; ++entry)
      sum += jacobian_[entry] * from.multipliers[pattern.row_indices[entry]];
    bound_multipliers_[j] = -sum;
  }
  nlp_.write(*ocp_, clipped_.data(), from.multipliers, bound_multipliers_.data(), point);
  SparseNlp::set_costate_0(linear_, point);
  return kkt_residual(linear_, point);
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

bool OcpNlp::eval_f(Ipopt::Index, const double* z, bool, double& objective) {
  const Timer timer(microseconds_);
  if (!evaluate_at(z)) return false;
  objective = objective_;
  return true;
}

bool OcpNlp::eval_g(Ipopt::Index, const double* z, bool, Ipopt::Index, double* constraints) {
  const Timer timer(microseconds_);
  if (!evaluate_at(z)) return false;
  std::copy(constraints_.begin(), constraints_.end(), constraints);
  return true;
}

bool OcpNlp::eval_grad_f(Ipopt::Index, const double* z, bool, double* gradient) {
  const Timer timer(microseconds_);
  if (!linearise_at(z)) return false;
  std::copy(gradient_.begin(), gradient_.end(), gradient);
  return true;
}

bool OcpNlp::eval_jac_g(Ipopt::Index, const double* z, bool, Ipopt::Index, Ipopt::Index entries, Ipopt::Index* rows,
                        Ipopt::Index* columns, double* values) {
  const Timer timer(microseconds_);
  if (!values) {
    write_pattern(nlp_.jacobian(), rows, columns);
    return true;
  }
  if (!linearise_at(z)) return false;
  nlp_.jacobian(linear_, values);
  return all_finite({values, static_cast<std::size_t>(entries)});
}

bool OcpNlp::eval_h(Ipopt::Index, const double* z, bool, double objective_factor, Ipopt::Index,
                    const double* multipliers, bool, Ipopt::Index entries, Ipopt::Index* rows, Ipopt::Index* columns,
                    double* values) {
  const Timer timer(microseconds_);
  if (!values) {
    write_pattern(nlp_.hessian(), rows, columns);
    return true;
  }
  const std::span<double> all(values, entries);
  if (curvature_ == Curvature::gauss_newton) {
    linearise_at(z);
    nlp_.hessian(linear_, values);
    for (double& value : all) value *= objective_factor;
  } else if (objective_factor == 1.0 && is_linear_exact_ && is_linear_ &&
             std::equal(linear_z_.begin(), linear_z_.end(), z) &&
             std::equal(linear_multipliers_.begin(), linear_multipliers_.end(), multipliers)) {
    nlp_.hessian(linear_, values);
  } else if (objective_factor >= smallest_divisor) {
    linearise(z, multipliers, 1.0 / objective_factor, Hessian::exact, other_);
    nlp_.hessian(other_, values);
    for (double& value : all) value *= objective_factor;
  } else {
    // The Ocp's Lagrangian always holds the whole objective: what is too much of it is taken away.
    linearise(z, multipliers, 1.0, Hessian::exact, other_);
    nlp_.hessian(other_, values);
    linearise(z, nullptr, 0.0, Hessian::exact, other_);
    nlp_.hessian(other_, hessian_part_.data());
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
