#include "rhec/core/horizon/rhc_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "checks.hpp"
#include "cost_view.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

namespace rhec {
namespace {

std::shared_ptr<const TermFunctions> functions_of(const Model& model, const std::vector<NamedTerm>& terms) {
  return terms.empty() ? nullptr : std::make_shared<const TermFunctions>(model, terms);
}

}  // namespace

RhcProblem::RhcProblem(std::shared_ptr<const Model> model, Setup setup)
    : RhcProblem(model, setup, functions_of(*model, setup.terms)) {}

RhcProblem::RhcProblem(std::shared_ptr<const Model> model, Setup setup, std::shared_ptr<const TermFunctions> terms)
    : HorizonProblem(std::move(model), {{.max_intervals = setup.max_intervals,
                                         .blocked_inputs = setup.blocked_inputs,
                                         .parameters_are_decided = false,
                                         .one_block = {},
                                         .limits = terms ? terms->limit_count() : 0},
                                        setup.substeps,
                                        terms}),
      setup_(std::move(setup)) {
  const ModelDescription& about = this->model().description();
  check_weights("state weights", setup_.state_weights, about.states);
  check_weights("terminal weights", setup_.terminal_weights, about.states);
  check_weights("input weights", setup_.input_weights, about.inputs);
  fill_default_bounds("state bounds", setup_.state_lower, setup_.state_upper, about.states, true);
  fill_default_bounds("input bounds", setup_.input_lower, setup_.input_upper, about.inputs, true);
  const auto nodes = static_cast<std::size_t>(setup_.max_intervals) + 1;
  check_rates();
  initial_.assign(capacity().states, 0.0);
  reference_.assign(nodes * stride(), 0.0);
  for (auto* v : {&stage_weights_, &terminal_weights_, &periods_, &inverse_periods_}) v->assign(stride(), 0.0);
  std::copy(setup_.state_weights.begin(), setup_.state_weights.end(), stage_weights_.begin());
  std::copy(setup_.terminal_weights.begin(), setup_.terminal_weights.end(), terminal_weights_.begin());
  if (structure().is_direct())
    std::copy(setup_.input_weights.begin(), setup_.input_weights.end(), stage_weights_.begin() + capacity().states);
  for (int j = 0; j < nx(); ++j) {
    if (!about.states[j].is_angle) continue;
    periods_[j] = 2.0 * std::numbers::pi;
    inverse_periods_[j] = 1.0 / periods_[j];
  }
  for (std::size_t i = 0; i < nodes; ++i) {
    input_lower_.insert(input_lower_.end(), setup_.input_lower.begin(), setup_.input_lower.end());
    input_upper_.insert(input_upper_.end(), setup_.input_upper.begin(), setup_.input_upper.end());
  }
}

void RhcProblem::check_rates() {
  if (setup_.rates.empty()) return;
  behind_.assign(nu(), std::numeric_limits<double>::quiet_NaN());
  for (const Rate& rate : setup_.rates) {
    if (rate.input < 0 || rate.input >= nu() || rate.state < 0 || rate.state >= nx())
      throw Error(
          fmt::format("rates: input {} as the rate of state {}; expected an input of 0 .. {} and a state of 0 .. {}",
                      rate.input, rate.state, nu() - 1, nx() - 1));
    if (structure().lifted_of_input(rate.input) >= 0)
      throw Error(fmt::format("rates: input {} is a rate and blocked; bound it to 0 where it must not change instead",
                              rate.input));
    behind_[rate.input] = 0.0;
  }
}

void RhcProblem::set_state_bounds(int state, double lower, double upper) noexcept {
  has_new_state_bounds_ |= setup_.state_lower[state] != lower || setup_.state_upper[state] != upper;
  setup_.state_lower[state] = lower;
  setup_.state_upper[state] = upper;
}

void RhcProblem::set_blocks(int input, const std::uint8_t* begins) noexcept {
  const int lifted = structure().lifted_of_input(input);
  if (lifted < 0) return;
  for (int i = 0; i < intervals(); ++i) changing_structure().set_block_start(i, lifted, i == 0 || begins[i]);
}

void RhcProblem::take_data(const RhcProblem& from) noexcept {
  take_horizon(from);
  initial_ = from.initial_;
  input_lower_ = from.input_lower_;
  input_upper_ = from.input_upper_;
  reference_ = from.reference_;
  moved_bounds_ = from.moved_bounds_;
  setup_.state_lower = from.setup_.state_lower;
  setup_.state_upper = from.setup_.state_upper;
  has_new_state_bounds_ = from.has_new_state_bounds_;
}

int RhcProblem::finish(std::span<double> scratch) noexcept {
  // State bounds stay as written, unless one was relaxed.
  if (changing_structure().finish() || moved_bounds_ > 0 || has_new_state_bounds_) write_state_bounds();
  has_new_state_bounds_ = false;
  write_input_bounds();
  moved_bounds_ = relax_unreachable_bounds(scratch);
  return moved_bounds_;
}

void RhcProblem::write_state_bounds() noexcept {
  // Node 0 and the lifted variables keep no bounds.
  clear_bounds();
  for (int i = 1; i <= intervals(); ++i) {
    std::copy_n(setup_.state_lower.begin(), nx(), lower_row(i));
    std::copy_n(setup_.state_upper.begin(), nx(), upper_row(i));
  }
}

void RhcProblem::write_input_bounds() noexcept {
  const int ns = capacity().states, inputs = nu();
  if (structure().is_direct()) {
    const double *from_lower = input_lower_.data(), *from_upper = input_upper_.data();
    double *lower = lower_row(0) + ns, *upper = upper_row(0) + ns;
    for (int i = 0; i < intervals(); ++i, lower += stride(), upper += stride()) {
      for (int j = 0; j < inputs; ++j) {
        lower[j] = *from_lower++;
        upper[j] = *from_upper++;
      }
    }
    return;
  }
  for (int i = 0; i < intervals(); ++i) {
    for (int j = 0; j < inputs; ++j) {
      const int control = structure().control_of_input(i, j);
      if (control < 0) continue;
      // A block satisfies the bounds of every interval that it covers.
      double lower = input_lower(i, j), upper = input_upper(i, j);
      for (int later = i + 1; later < intervals() && structure().control_of_input(later, j) < 0; ++later) {
        lower = std::max(lower, input_lower(later, j));
        upper = std::min(upper, input_upper(later, j));
      }
      lower_row(i)[ns + control] = lower;
      upper_row(i)[ns + control] = upper;
    }
  }
}

/// Relaxes bounds for each state that starts outside of them: drives it back as fast as the corners of the input box
/// (and standing still) allow, block by block, and relaxes the bound along this trajectory until it is satisfied.
int RhcProblem::relax_unreachable_bounds(std::span<double> scratch) noexcept {
  const int n = nx(), inputs = nu();
  double* x = scratch.data();
  double *trial = x + n, *u = trial + n, *next = u + inputs;
  int candidates = 1;
  for (int k = 0; k < inputs; ++k) candidates *= 3;

  const auto choose = [&](int candidate, int interval) {
    for (int k = 0; k < inputs; ++k, candidate /= 3) {
      const double lower = input_lower(interval, k), upper = input_upper(interval, k);
      const double middle = std::min(std::max(0.0, lower), upper);
      const double wanted = candidate % 3 == 0 ? lower : candidate % 3 == 1 ? upper : middle;
      u[k] = std::isfinite(wanted) ? wanted : std::min(std::max(input_reference(interval)[k], lower), upper);
    }
  };
  // A section ends where every input may change.
  const auto stretch_end = [&](int interval) {
    int end = interval + 1;
    const auto all_change = [&](int at) {
      for (int k = 0; k < inputs; ++k)
        if (structure().control_of_input(at, k) < 0) return false;
      return true;
    };
    while (end < intervals() && !all_change(end)) ++end;
    return end;
  };
  // Rates lead to the same values as soon as they may, rather than being that large themselves.
  const auto choose_rates = [&](int candidate, const double* state, int interval) {
    for (const Rate& rate : setup_.rates) {
      int corner = candidate;
      for (int k = 0; k < rate.input; ++k) corner /= 3;
      const double lower = setup_.state_lower[rate.state], upper = setup_.state_upper[rate.state];
      const double middle = std::min(std::max(0.0, lower), upper);
      const double wanted = corner % 3 == 0 ? lower : corner % 3 == 1 ? upper : middle;
      const double change = std::isfinite(wanted) ? wanted - state[rate.state] : 0.0;
      u[rate.input] = std::min(std::max(change / duration(interval), input_lower(interval, rate.input)),
                               input_upper(interval, rate.input));
    }
  };
  const auto step = [&](int candidate, double* state, int interval) {
    const double seconds = duration(interval);
    choose_rates(candidate, state, interval);
    model().integrate({.count = 1,
                       .states = state,
                       .inputs = u,
                       .parameters = given_parameters(),
                       .durations = &seconds,
                       .data = interval_data(interval),
                       .substeps = substeps(),
                       .next_states = next});
    std::copy_n(next, n, state);
  };

  int moved = 0;
  for (int j = 0; j < n; ++j) {
    const auto violation = [&](const double* state) {
      return std::max({0.0, setup_.state_lower[j] - state[j], state[j] - setup_.state_upper[j]});
    };
    std::copy_n(initial_.data(), n, x);
    for (int first = 0; first < intervals() && violation(x) > 0.0;) {
      const int end = stretch_end(first);
      double least = infinity;
      int best = 0;
      for (int candidate = 0; candidate < candidates; ++candidate) {
        std::copy_n(x, n, trial);
        choose(candidate, first);
        double sum = 0.0;
        for (int i = first; i < end; ++i) {
          step(candidate, trial, i);
          sum += violation(trial);
        }
        if (sum < least) least = sum, best = candidate;
      }
      choose(best, first);
      for (int i = first; i < end; ++i) {
        step(best, x, i);
        if (violation(x) <= 0.0) continue;
        // A small slack keeps the feasible set from being a single point.
        const double slack = 1e-6 * (1.0 + std::abs(x[j]));
        double &lower = lower_row(i + 1)[j], &upper = upper_row(i + 1)[j];
        lower = std::min(lower, x[j] - slack);
        upper = std::max(upper, x[j] + slack);
        ++moved;
      }
      first = end;
    }
  }
  return moved;
}

std::size_t RhcProblem::cost_scratch_size() const noexcept {
  return (static_cast<std::size_t>(capacity().intervals) + 1) * stride() + 8;
}

double RhcProblem::cost(const Iterate& iterate, double* stage_costs, std::span<double> scratch) const noexcept {
  double* const gradients = Scratch(scratch.data()).rest();  // written, but not used
  const CostView view = cost_view(structure(), nullptr, gradients, false);
  if (structure().is_direct() && !stage_costs) return write_tracking({0, intervals()}, iterate, view);
  double total = 0.0;
  for (int i = 0; i <= intervals(); ++i) {
    const double part = write_tracking({i, i}, iterate, view);
    total += part;
    if (stage_costs) stage_costs[i] += part;
  }
  return total;
}

double RhcProblem::write_cost(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts, StageQp& qp,
                              std::span<double> /*scratch*/) const noexcept {
  return write_tracking(range, iterate,
                        cost_view(structure(), parts != CostParts::vectors ? qp.H(0) : nullptr,
                                  parts != CostParts::matrices ? qp.h(0) : nullptr, hessian == Hessian::exact));
}

double RhcProblem::write_tracking(StageRange range, const Iterate& iterate, const CostView& view) const noexcept {
  const TrackingView tracked{.values = iterate.row(0),
                             .references = reference_.data(),
                             .stage_weights = stage_weights_.data(),
                             .terminal_weights = terminal_weights_.data(),
                             .periods = periods_.data(),
                             .inverse_periods = inverse_periods_.data()};
  double total = transcription_kernels().write_tracking(view, tracked, range.first, range.last);
  if (structure().is_direct()) return total;
  const std::ptrdiff_t wide = capacity().states + capacity().controls;
  for (int i = range.first; i <= std::min(range.last, intervals() - 1); ++i) {
    for (int j = 0; j < nu(); ++j) {
      const int column = structure().column_of_input(i, j);
      const double error = iterate.row(i)[column] - input_reference(i)[j], weight = setup_.input_weights[j];
      if (view.H) view.H[(i * wide + column) * stride() + column] += 2.0 * weight;
      if (!view.h) continue;
      total += weight * error * error;
      view.h[static_cast<std::ptrdiff_t>(i) * stride() + column] += 2.0 * weight * error;
    }
  }
  return total;
}

}  // namespace rhec
