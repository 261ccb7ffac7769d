#include "rhec/core/horizon/horizon_problem.hpp"

#include <algorithm>
#include <utility>

#include "horizon_linearisation.hpp"
#include "interval_dynamics.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

namespace rhec {
namespace {

/// Whether an interval uses the value in its stage state: if no block starts, or a ramp starts there.
bool uses_carried_value(const HorizonStructure& structure, int interval, int lifted) noexcept {
  return structure.control_of_lifted(interval, lifted) < 0 || structure.is_ramp(lifted);
}

/// Preconditions of every evaluation: a finished structure, an iterate and scratch of matching sizes.
void assert_ready([[maybe_unused]] const HorizonProblem& problem, [[maybe_unused]] const Iterate& iterate,
                  [[maybe_unused]] std::span<double> scratch) {
  RHEC_ASSERT(problem.structure().is_finished(), "`finish` comes after every change of the structure");
  RHEC_ASSERT(iterate.capacity() == problem.capacity(), "an iterate of the problem's capacity");
  RHEC_ASSERT(scratch.size() >= problem.scratch_size(), "scratch of `scratch_size()`");
}

}  // namespace

HorizonProblem::HorizonProblem(std::shared_ptr<const Model> model, const Setup& setup)
    : model_(std::move(model)),
      structure_(*model_, setup.structure),
      substeps_(setup.substeps),
      terms_(setup.terms, *model_, setup.structure.max_intervals) {
  if (substeps_ < 1) throw Error("substeps: expected at least 1 integration step per interval");
  const auto nodes = static_cast<std::size_t>(structure_.capacity().intervals) + 1;
  durations_.assign(nodes, 0.0);
  data_count_ = model_->data_count();
  data_.assign(nodes * data_count_, 0.0);
  lower_.assign(nodes * stride(), -infinity);
  upper_.assign(nodes * stride(), infinity);
  const int row = IntervalDynamics::row_length(structure_);
  for (auto* v : {&simulated_.z, &simulated_.next}) v->assign(row, 0.0);
  simulated_.jacobian.assign(static_cast<std::size_t>(nx()) * row, 0.0);
  simulated_.scratch.assign(model_->rows_scratch(1), 0.0);
}

void HorizonProblem::clear_bounds() noexcept {
  std::fill(lower_.begin(), lower_.end(), -infinity);
  std::fill(upper_.begin(), upper_.end(), infinity);
}

void HorizonProblem::take_horizon(const HorizonProblem& from) noexcept {
  structure_ = from.structure_;
  durations_ = from.durations_;
  data_ = from.data_;
  lower_ = from.lower_;
  upper_ = from.upper_;
  terms_.take_data(from.terms_);
}

Ocp::StepOperations HorizonProblem::step_operations() const noexcept {
  const Model::Operations model = model_->operations();
  if (!(model.hessians > 0.0)) return {};
  // A stage of the recursion: [A B]' (P [A B]), of which half is needed, and the elimination of the controls (Frison
  // and Jorgensen, Efficient implementation of the Riccati recursion for solving linear-quadratic control problems,
  // 2013).
  const double n = capacity().states, m = capacity().controls;
  const double products = n * n * (n + m) + n * (n + m) * (n + m) / 2 + m * m * m / 6 + m * m * n / 2 + m * n * n / 2;
  const double recursion = products / 8, steps = substeps_, stages = capacity().intervals;
  return {.gauss_newton = stages * (recursion + steps * model.jacobians),
          .exact = stages * (recursion + steps * model.hessians)};
}

std::size_t HorizonProblem::scratch_size() const noexcept {
  const auto nodes = static_cast<std::size_t>(structure_.capacity().intervals) + 1;
  const std::size_t of_terms = terms_.scratch_size(structure_);
  return IntervalDynamics::scratch_size(*model_, structure_, nodes) + std::max(cost_scratch_size(), of_terms);
}

void HorizonProblem::mark_dynamics(int i, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept {
  const int ns = structure_.capacity().states, free_count = structure_.free_input_count();
  // The model's next state depends on all of its own states, and on a lifted variable if the interval uses it.
  for (int c = 0; c < ns; ++c) {
    const int lifted = c - nx();
    const bool is_carried = lifted >= 0 && structure_.control_of_lifted(i, lifted) < 0;
    const bool is_used = lifted < 0 || uses_carried_value(structure_, i, lifted);
    for (int r = 0; r < nx(); ++r) state_flags[c * ns + r] = is_used;
    for (int r = nx(); r < ns; ++r) state_flags[c * ns + r] = is_carried && r == c;
  }
  for (int c = 0; c < structure_.control_count(i); ++c)
    for (int r = 0; r < ns; ++r)
      control_flags[c * ns + r] = r < nx() || (c >= free_count && structure_.control_of_lifted(i, r - nx()) == c);
}

double HorizonProblem::evaluate_stages(const Iterate& iterate, double* defects, double* stage_costs,
                                       std::span<double> scratch) const noexcept {
  assert_ready(*this, iterate, scratch);
  if (defects)
    IntervalDynamics{*model_, structure_, durations_.data(), data_.data(), substeps_}.write_defects(iterate, defects,
                                                                                                    scratch.data());
  if (stage_costs) std::fill_n(stage_costs, intervals() + 1, 0.0);
  const double total = cost(iterate, stage_costs, scratch);
  if (!terms_.has_residuals()) return total;
  return total + terms_.cost(horizon_of_terms(), iterate, stage_costs, scratch.data());
}

HorizonTerms::Horizon HorizonProblem::horizon_of_terms() const noexcept {
  return {structure_, durations_.data(), data_.data(), model_->data_count(), initial_state() != nullptr};
}

int HorizonProblem::limit_count(int stage) const noexcept {
  if (!terms_.has_limits()) return 0;
  const TermFunctions::Rows* const rows = terms_.rows(stage, intervals(), initial_state() != nullptr);
  return rows ? rows->limits : 0;
}

int HorizonProblem::first_limit(int stage) const noexcept {
  const TermFunctions::Rows* const rows = terms_.rows(stage, intervals(), initial_state() != nullptr);
  return rows ? rows->first_limit : 0;
}

const double* HorizonProblem::limit_linear(int stage) const noexcept {
  return terms_.functions() ? terms_.linear() + first_limit(stage) : nullptr;
}

const double* HorizonProblem::limit_quadratic(int stage) const noexcept {
  return terms_.functions() ? terms_.functions()->quadratic() + first_limit(stage) : nullptr;
}

void HorizonProblem::evaluate_limits(const Iterate& iterate, double* values, std::span<double> scratch) const noexcept {
  assert_ready(*this, iterate, scratch);
  if (terms_.has_limits()) terms_.evaluate_limits(horizon_of_terms(), iterate, values, scratch.data());
}

void HorizonProblem::mark_limits(int stage, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept {
  terms_.mark_limits(horizon_of_terms(), stage, state_flags, control_flags);
}

double HorizonProblem::write_costs(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts,
                                   StageQp& qp, std::span<double> scratch) const noexcept {
  const double total = write_cost(range, iterate, hessian, parts, qp, scratch);
  return terms_.functions() ? total + add_terms(range, iterate, hessian, parts, qp, scratch) : total;
}

double HorizonProblem::add_terms(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts,
                                 StageQp& qp, std::span<double> scratch) const noexcept {
  return terms_.add_cost(horizon_of_terms(), range, iterate,
                         {.vectors = parts != CostParts::matrices,
                          .matrices = parts != CostParts::vectors,
                          .exact = hessian == Hessian::exact},
                         qp, scratch.data());
}

void HorizonProblem::simulate_interval(int interval, Iterate& iterate, std::span<double> scratch) const noexcept {
  assert_ready(*this, iterate, scratch);
  RHEC_ASSERT(interval >= 0 && interval < intervals(), "an interval of the horizon");
  IntervalDynamics{*model_, structure_, durations_.data(), data_.data(), substeps_}.simulate(interval, iterate,
                                                                                             scratch.data());
}

double HorizonProblem::linearise(StageRange range, const Iterate& iterate, Hessian hessian, StageQp& qp,
                                 std::span<double> scratch) const noexcept {
  assert_ready(*this, iterate, scratch);
  RHEC_ASSERT(range.first >= 0 && range.first <= range.last && range.last <= intervals(), "stages of the horizon");
  RHEC_ASSERT(qp.capacity() == capacity(), "a QP of the problem's capacity");
  const IntervalDynamics dynamics{*model_, structure_, durations_.data(), data_.data(), substeps_};
  dynamics.write_sizes(range, initial_state() != nullptr, qp);
  const StageRange steps{range.first, std::min(range.last, intervals() - 1)};
  if (steps.last >= steps.first) dynamics.linearise(steps, iterate, {.hessian = hessian}, qp, scratch.data());
  write_bounds(iterate, range, qp, scratch);
  return write_costs(range, iterate, hessian, hessian == Hessian::none ? CostParts::vectors : CostParts::all, qp,
                     scratch);
}

void HorizonProblem::refresh(const Iterate& iterate, StageQp& qp, std::span<double> scratch) const noexcept {
  assert_ready(*this, iterate, scratch);
  RHEC_ASSERT(qp.capacity() == capacity() && qp.intervals() == intervals(), "the QP that `linearise` has filled");
  if (has_late_bounds()) write_bounds(iterate, all_stages(*this), qp, scratch);
  write_costs(all_stages(*this), iterate, Hessian::none, CostParts::vectors, qp, scratch);
}

void HorizonProblem::write_bounds(const Iterate& iterate, StageRange range, StageQp& qp,
                                  std::span<double> scratch) const noexcept {
  write_own_bounds(iterate, range, qp);
  write_limits(iterate, range, HorizonTerms::LimitParts::all, qp, scratch);
}

void HorizonProblem::write_own_bounds(const Iterate& iterate, StageRange range, StageQp& qp) const noexcept {
  const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(range.first) * stride(),
                       count = static_cast<std::ptrdiff_t>(range.last - range.first + 1) * stride();
  transcription_kernels().write_bounds(lower_.data() + first, upper_.data() + first, iterate.row(range.first),
                                       qp.lower(range.first), qp.upper(range.first), count);
  if (range.first == 0 && initial_state())
    for (int j = 0; j < structure_.capacity().states; ++j)
      qp.initial_step()[j] = initial_state()[j] - iterate.state(0)[j];
}

void HorizonProblem::write_limits(const Iterate& iterate, StageRange range, HorizonTerms::LimitParts parts, StageQp& qp,
                                  std::span<double> scratch) const noexcept {
  if (terms_.has_limits()) terms_.write_limits(horizon_of_terms(), range, iterate, parts, qp, scratch.data());
}

void HorizonProblem::clear_cost(StageRange range, Hessian hessian, CostParts parts, StageQp& qp) const noexcept {
  const int ns = structure_.capacity().states;
  const bool keeps_H = hessian == Hessian::exact;
  for (int i = range.first; i <= range.last; ++i) {
    const int used = ns + (i < intervals() ? structure_.control_count(i) : 0);
    if (parts != CostParts::matrices) std::fill_n(qp.h(i), stride(), 0.0);
    // The dynamics write no H for the last node.
    if (parts != CostParts::vectors && !(keeps_H && i < intervals())) std::fill_n(qp.H(i), used * stride(), 0.0);
  }
}

std::unique_ptr<Linearisation> HorizonProblem::make_linearisation() const {
  return std::make_unique<HorizonLinearisation>(*this);
}

bool HorizonProblem::keeps_curvature() const noexcept {
  return has_constant_cost_hessian() && structure_.is_direct() && !structure_.any_start();
}

void HorizonProblem::simulate_new_interval(int interval, Iterate& iterate, std::span<double> scratch) noexcept {
  const int row = IntervalDynamics::row_length(structure_);
  const IntervalDynamics dynamics{*model_, structure_, durations_.data(), data_.data(), substeps_};
  if (keeps_curvature()) {
    // A linearisation that keeps curvature has already evaluated the interval behind its horizon.
    dynamics.simulate(interval, iterate, scratch.data());
    return;
  }
  dynamics.gather_rows(iterate, {interval, interval}, simulated_.z.data());
  // With a ramp, derivatives are with respect to both its ends, which a linearisation cannot reuse; data may change.
  const bool is_reusable = !structure_.any_ramp() && data_count_ == 0;
  simulated_.duration = is_reusable ? durations_[interval] : 0.0;
  model_->integrate_rows({.count = 1,
                          .z = simulated_.z.data(),
                          .z_step = row,
                          .ramp = structure_.any_ramp(),
                          .durations = &durations_[interval],
                          .data = interval_data(interval),
                          .substeps = substeps_,
                          .next_states = simulated_.next.data(),
                          .next_step = row,
                          .jacobians = simulated_.jacobian.data(),
                          .jacobian_step = nx() * row,
                          .jacobian_row = row,
                          .scratch = simulated_.scratch.data()});
  std::copy_n(simulated_.next.data(), nx(), iterate.state(interval + 1));
  structure_.carry_lifted(interval, iterate);
}

}  // namespace rhec
