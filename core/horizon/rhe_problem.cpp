#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/base/angle.hpp"
#include "rhec/core/model/motion_outputs.hpp"
#include "rhec/core/model/parts_of_intervals.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "checks.hpp"
#include "cost_view.hpp"
#include "rhe_linearisation.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/base/with_size.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/transcription_kernels.hpp"

namespace rhec {

namespace {

/// Adds the second derivatives of the outputs at the nodes of a range, each times its multiplier.
void add_curvature_of_outputs(const Model& model, StageRange range, const Iterate& iterate, const double* multipliers,
                              std::ptrdiff_t step, const CostView& view, double* rest) noexcept {
  const std::ptrdiff_t of_node = static_cast<std::ptrdiff_t>(view.states + view.controls) * view.stride;
  model.observe_rows({.count = range.last - range.first + 1,
                      .states = iterate.state(range.first),
                      .state_step = view.stride,
                      .multipliers = multipliers,
                      .multiplier_step = step,
                      .hessians = view.H + range.first * of_node,
                      .hessian_step = of_node,
                      .hessian_row = view.stride,
                      .scratch = rest});
}

}  // namespace

RheProblem::RheProblem(std::shared_ptr<const Model> model, Setup setup)
    : HorizonProblem(std::move(model), {{.max_intervals = setup.max_intervals,
                                         .blocked_inputs = {},
                                         .parameters_are_decided = true,
                                         .one_block = setup.one_block},
                                        setup.substeps}),
      setup_(std::move(setup)),
      ny_(this->model().output_count()),
      output_row_(padded(ny_)),
      parts_(dynamic_cast<const PartsOfIntervals*>(&this->model())) {
  refuse_outputs_of_motion(this->model(), "estimation problem");
  const ModelDescription& about = this->model().description();
  check_weights("output weights", setup_.output_weights, about.outputs);
  check_weights("input weights", setup_.input_weights, about.inputs);
  fill_default_bounds("state bounds", setup_.state_lower, setup_.state_upper, about.states, true);
  fill_default_bounds("input bounds", setup_.input_lower, setup_.input_upper, about.inputs, false);
  fill_default_bounds("parameter bounds", setup_.parameter_lower, setup_.parameter_upper, about.parameters, true);
  is_one_block_.assign(np(), 0);
  for (const int parameter : setup_.one_block) {
    if (parameter < 0 || parameter >= np())
      throw Error(fmt::format("one block: there is no parameter {}; the model has {}", parameter, np()));
    is_one_block_[parameter] = 1;
  }
  robust_group_.assign(ny_, -1);
  for (std::size_t g = 0; g < setup_.robust.size(); ++g) {
    const RobustLoss& loss = setup_.robust[g];
    if (!(loss.delta > 0.0))
      throw Error(fmt::format("robust loss: delta is {}; expected a number above 0", loss.delta));
    for (const int output : loss.outputs) {
      if (output < 0 || output >= ny_ || robust_group_[output] >= 0)
        throw Error(fmt::format("robust loss: output {} does not exist or has a loss already", output));
      robust_group_[output] = static_cast<int>(g);
    }
  }
  // Bounds of [x; p; u] that hold at every stage.
  lower_pattern_.assign(stride(), -std::numeric_limits<double>::infinity());
  upper_pattern_.assign(stride(), std::numeric_limits<double>::infinity());
  std::copy(setup_.state_lower.begin(), setup_.state_lower.end(), lower_pattern_.begin());
  std::copy(setup_.state_upper.begin(), setup_.state_upper.end(), upper_pattern_.begin());
  std::copy(setup_.input_lower.begin(), setup_.input_lower.end(), lower_pattern_.begin() + capacity().states);
  std::copy(setup_.input_upper.begin(), setup_.input_upper.end(), upper_pattern_.begin() + capacity().states);
  for (auto* v : {&output_weights_, &output_periods_, &output_inverse_periods_}) v->assign(output_row_, 0.0);
  std::copy(setup_.output_weights.begin(), setup_.output_weights.end(), output_weights_.begin());
  for (int j = 0; j < ny_; ++j) {
    if (!about.outputs[j].is_angle) continue;
    output_periods_[j] = 2.0 * std::numbers::pi;
    output_inverse_periods_[j] = 1.0 / output_periods_[j];
  }
  const auto nodes = static_cast<std::size_t>(setup_.max_intervals) + 1;
  const double missing = std::numeric_limits<double>::quiet_NaN();
  has_block_bounds_.assign(nodes, 0);
  if (setup_.most_between < 0) throw Error("between nodes: expected room for 0 measurements or more");
  between_.assign(nodes - 1, BetweenNodes(ny_, setup_.most_between));
  between_points_ = points_of_interval();
  outputs_.assign(nodes * output_row_, missing);
  weights_.assign(outputs_.size(), 1.0);
  node_weights_.assign(outputs_.size(), 0.0);
  measured_inputs_.assign(nodes * stride(), missing);
  input_weights_.assign(stride(), 0.0);
  std::copy(setup_.input_weights.begin(), setup_.input_weights.end(), input_weights_.begin() + capacity().states);
  for (auto* v : {&link_information_, &block_weights_}) v->assign(nodes * np(), 0.0);
  arrival_mean = Eigen::VectorXd::Zero(nx() + np());
  arrival_information = Eigen::MatrixXd::Zero(nx() + np(), nx() + np());
}

double RheProblem::link_variance(int interval, int parameter) const noexcept {
  return 1.0 / link_information_[interval * np() + parameter];
}

void RheProblem::set_block_weight(int interval, int parameter, double weight) noexcept {
  has_block_weights_ |= weight != 0.0;
  block_weights_[interval * np() + parameter] = weight;
}

double RheProblem::block_weight(int interval, int parameter) const noexcept {
  return block_weights_[interval * np() + parameter];
}

Measured RheProblem::measured(int node) const noexcept {
  return {output(node), has_weights_ ? weights_.data() + at_output(node) : nullptr};
}

const double* RheProblem::weights_at(int node) const noexcept {
  return has_weights_ ? node_weights_.data() + at_output(node) : output_weights_.data();
}

void RheProblem::set_output(int node, Measured measured) noexcept {
  std::copy_n(measured.values, ny_, output(node));
  if (!measured.weights && !has_weights_) return;
  double* const weights = weights_.data() + at_output(node);
  for (int j = 0; j < ny_; ++j) weights[j] = measured.weight(j);
  if (!has_weights_) {
    has_weights_ = true;
    weigh_nodes();
  }
  for (int j = 0; j < ny_; ++j) node_weights_[at_output(node) + j] = output_weights_[j] * weights[j];
}

void RheProblem::set_output_weight(int output, double weight) noexcept {
  setup_.output_weights[output] = output_weights_[output] = weight;
  if (has_weights_) weigh_nodes();
}

void RheProblem::weigh_nodes() noexcept {
  for (std::size_t row = 0; row < weights_.size(); row += output_row_)
    for (int j = 0; j < ny_; ++j) node_weights_[row + j] = output_weights_[j] * weights_[row + j];
}

void RheProblem::set_blocks(int parameter, const std::uint8_t* begins, Transition transition) noexcept {
  const bool is_one_block = is_one_block_[parameter] != 0;
  const bool ramp = transition == Transition::ramp && !is_one_block;
  HorizonStructure& structure = changing_structure();
  structure.set_ramp(parameter, ramp);
  for (int i = 0; has_block_weights_ && i < intervals(); ++i) block_weights_[i * np() + parameter] = 0.0;
  if (is_one_block) return;  // no interval has ever been marked
  // Node 0 holds the first block's value, so the first interval has no block control unless a ramp starts there.
  for (int i = 0; i < intervals(); ++i) structure.set_block_start(i, parameter, begins[i] && (i > 0 || ramp));
  for (int i = 0; i < intervals(); ++i) link_information_[i * np() + parameter] = 0.0;
}

void RheProblem::link(int interval, int parameter, double variance) noexcept {
  link_information_[interval * np() + parameter] = 1.0 / variance;
}

void RheProblem::finish() noexcept {
  if (!changing_structure().finish()) return;
  // Most rows are unchanged: blocks have bounds only where they start.
  const bool is_new = bounded_intervals_ != intervals();
  bounded_intervals_ = intervals();
  for (int i = 0; i <= intervals(); ++i) {
    const bool has_blocks = i == 0 || i == intervals() || control_count(i) > nu();
    if (is_new || has_blocks || has_block_bounds_[i] != 0) write_bounds(i);
    has_block_bounds_[i] = has_blocks;
  }
}

void RheProblem::write_bounds(int i) noexcept {
  const int ns = capacity().states;
  double *lower = lower_row(i), *upper = upper_row(i);
  for (int k = 0; k < stride(); ++k) {
    lower[k] = lower_pattern_[k];
    upper[k] = upper_pattern_[k];
  }
  // A block has bounds once, where its value is decided: at node 0 or by the control that starts it.
  if (i == 0) {
    std::copy_n(setup_.parameter_lower.data(), np(), lower + nx());
    std::copy_n(setup_.parameter_upper.data(), np(), upper + nx());
  }
  if (i == intervals()) {
    std::fill_n(lower + ns, capacity().controls, -std::numeric_limits<double>::infinity());
    std::fill_n(upper + ns, capacity().controls, std::numeric_limits<double>::infinity());
    return;
  }
  if (control_count(i) == nu()) return;
  for (int j = 0; j < np(); ++j) {
    const int control = structure().control_of_lifted(i, j);
    if (control < 0) continue;
    lower[ns + control] = setup_.parameter_lower[j];
    upper[ns + control] = setup_.parameter_upper[j];
  }
}

void RheProblem::take_data(const RheProblem& from) noexcept {
  take_horizon(from);
  arrival_mean = from.arrival_mean;
  arrival_information = from.arrival_information;
  setup_.output_weights = from.setup_.output_weights;
  output_weights_ = from.output_weights_;
  outputs_ = from.outputs_;
  has_weights_ = from.has_weights_;
  weights_ = from.weights_;
  node_weights_ = from.node_weights_;
  for (std::size_t i = 0; i < between_.size(); ++i) between_[i].assign(from.between_[i]);
  measured_inputs_ = from.measured_inputs_;
  link_information_ = from.link_information_;
  has_block_weights_ = from.has_block_weights_;
  block_weights_ = from.block_weights_;
  bounded_intervals_ = from.bounded_intervals_;
  has_block_bounds_ = from.has_block_bounds_;
}

void RheProblem::drop_first_interval() noexcept {
  for (int i = 0; i + 1 < intervals(); ++i) set_duration(i, duration(i + 1));
  std::copy(interval_data(1), interval_data(std::max(intervals(), 1)), interval_data(0));
  if (setup_.most_between > 0 && intervals() > 0)
    std::rotate(between_.begin(), between_.begin() + 1, between_.begin() + intervals());
  for (AlignedDoubles* rows : {&outputs_, &weights_, &node_weights_})
    if (has_weights_ || rows == &outputs_) std::copy(rows->begin() + output_row_, rows->end(), rows->begin());
  std::copy(measured_inputs_.begin() + stride(), measured_inputs_.end(), measured_inputs_.begin());
}

std::size_t RheProblem::cost_scratch_size() const noexcept {
  const std::size_t nodes = static_cast<std::size_t>(capacity().intervals) + 1, outputs = output_row_, ny = ny_,
                    width = padded(nx());
  // Per node: Jacobians, outputs, their gradients and the model's scratch. Once: the kernels' scratch and three rows of
  // outputs.
  return nodes * (ny * width + 2 * outputs) + model().rows_scratch(static_cast<int>(nodes)) + 6 * outputs + 16 +
         between_scratch_size();
}

void RheProblem::residual(const double* y, const double* predicted, double* difference) const noexcept {
  for (int j = 0; j < ny_; ++j) {
    if (std::isnan(y[j])) {
      difference[j] = 0.0;
    } else {
      difference[j] = output_periods_[j] != 0.0 ? angle_difference(predicted[j], y[j]) : predicted[j] - y[j];
    }
  }
}

double RheProblem::losses(const double* difference, const double* output_weights, double* weight,
                          double* curvature) const noexcept {
  double total = 0.0;
  for (int j = 0; j < ny_; ++j) {
    weight[j] = 1.0;
    if (curvature) curvature[j] = 0.0;
    if (robust_group_[j] < 0) total += output_weights[j] * difference[j] * difference[j];
  }
  for (const RobustLoss& loss : setup_.robust) {
    double s = 0.0;
    for (const int j : loss.outputs) s += output_weights[j] * difference[j] * difference[j];
    const double root = std::sqrt(1.0 + s / (loss.delta * loss.delta));
    // 2 delta^2 (root - 1), without cancellation for small s
    total += 2.0 * s / (1.0 + root);
    for (const int j : loss.outputs) {
      weight[j] = 1.0 / root;
      if (curvature) curvature[j] = -0.5 / (loss.delta * loss.delta * root * root * root);
    }
  }
  return total;
}

double RheProblem::cost(const Iterate& iterate, double* stage_costs, std::span<double> scratch) const noexcept {
  const int count = intervals() + 1;
  Scratch memory(scratch.data());
  double *predicted = memory.take(static_cast<std::ptrdiff_t>(count) * output_row_),
         *difference = memory.take(output_row_), *weight = memory.take(output_row_);
  model().observe_rows({.count = count,
                        .states = iterate.state(0),
                        .state_step = stride(),
                        .outputs = predicted,
                        .output_step = output_row_,
                        .scratch = memory.rest()});

  double total = 0.0;
  const auto add = [&](int stage, double part) {
    total += part;
    if (stage_costs) stage_costs[stage] += part;
  };
  add(0, arrival_term(iterate, nullptr));
  for (int i = 0; i < count; ++i) {
    residual(output(i), predicted + i * output_row_, difference);
    add(i, losses(difference, weights_at(i), weight, nullptr));
  }
  for (int i = 0; i < intervals(); ++i) {
    add(i, inputs(i, iterate, nullptr, nullptr));
    if (control_count(i) > nu()) add(i, links(i, iterate, nullptr, nullptr));
  }
  if (has_between())
    total += add_between({0, intervals()}, iterate, Hessian::none, nullptr, stage_costs, memory.rest());
  return total;
}

double RheProblem::write_cost(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts, StageQp& qp,
                              OutputCache* known, BetweenCache* known_between,
                              std::span<double> scratch) const noexcept {
  const bool matrices = parts != CostParts::vectors, vectors = parts != CostParts::matrices;
  const CostView view =
      cost_view(structure(), matrices ? qp.H(0) : nullptr, vectors ? qp.h(0) : nullptr, hessian == Hessian::exact);
  double total = write_measurements(range, iterate, hessian, view, known, scratch);
  if (has_between()) {
    const bool is_exact = hessian == Hessian::exact && matrices;
    const double added = known_between && !is_exact
                             ? add_known_between(range, iterate, view, *known_between, scratch.data())
                             : add_between(range, iterate, hessian, &view, nullptr, scratch.data());
    if (vectors) total += added;
    for (int i = range.first; known && matrices && i <= std::min(range.last, intervals() - 1); ++i)
      if (between(i).count() > 0) known->is_clean()[i] = 0;
  }
  if (range.first == 0) {
    if (known && matrices) known->is_clean()[0] = 0;
    if (vectors) total += arrival_term(iterate, qp.h(0));
    if (matrices) {
      with_size(nx() + np(), [&](auto n) {
        double* H = qp.H(0);
        const double* information = arrival_information.data();
        for (int c = 0; c < n; ++c, H += stride(), information += n)
          for (int r = 0; r < n; ++r) H[r] += 2.0 * information[r];
      });
      for (int j = 0; has_block_weights_ && j < np(); ++j)
        qp.H(0)[(nx() + j) * (stride() + 1)] += 2.0 * first_block_weight(j);
    }
  }
  if (structure().any_start())
    for (int i = range.first; i <= std::min(range.last, intervals() - 1); ++i) {
      const auto has_any = [&](const std::vector<double>& values) {
        const double* of_interval = values.data() + static_cast<std::ptrdiff_t>(i) * np();
        return std::any_of(of_interval, of_interval + np(), [](double value) { return value != 0.0; });
      };
      if (control_count(i) == nu() || !(has_any(link_information_) || (has_block_weights_ && has_any(block_weights_))))
        continue;
      if (known && matrices) known->is_clean()[i] = 0;
      total += links(i, iterate, matrices ? qp.H(i) : nullptr, vectors ? qp.h(i) : nullptr);
    }
  return total;
}

/// The arrival cost, and that of the first blocks' values; adds its gradient to q, if not null.
double RheProblem::arrival_term(const Iterate& iterate, double* q) const noexcept {
  const int n = nx() + np();
  double total = 0.0;
  for (int c = 0; c < n; ++c) {
    const double* information = arrival_information.data() + static_cast<std::ptrdiff_t>(c) * n;
    double pull = 0.0;
    for (int r = 0; r < n; ++r) pull += information[r] * (iterate.state(0)[r] - arrival_mean[r]);
    total += pull * (iterate.state(0)[c] - arrival_mean[c]);
    if (q) q[c] += 2.0 * pull;
  }
  for (int j = 0; has_block_weights_ && j < np(); ++j) {
    const double value = iterate.state(0)[nx() + j], pull = first_block_weight(j) * value;
    total += pull * value;
    if (q) q[nx() + j] += 2.0 * pull;
  }
  return total;
}

/// Weight of a value that is decided at node 0; a ramp's first block is decided by its control.
double RheProblem::first_block_weight(int parameter) const noexcept {
  return structure().control_of_lifted(0, parameter) < 0 ? block_weight(0, parameter) : 0.0;
}

std::unique_ptr<Linearisation> RheProblem::make_linearisation() const {
  return std::make_unique<RheLinearisation>(*this);
}

/// Outputs and their Jacobians at the nodes of a range: from the cache, or else in the caller's rows.
RheProblem::Observed RheProblem::observe(StageRange range, const Iterate& iterate, OutputCache* known, double* outputs,
                                         double* jacobians, double* room) const noexcept {
  const std::ptrdiff_t jacobian_row = padded(nx());
  const auto ask = [&](int first, int count, double* to, double* jacobians_to) {
    model().observe_rows({.count = count,
                          .states = iterate.state(first),
                          .state_step = stride(),
                          .outputs = to,
                          .output_step = output_row_,
                          .jacobians = jacobians_to,
                          .jacobian_row = jacobian_row,
                          .scratch = room});
  };
  if (!known) {
    ask(range.first, range.last - range.first + 1, outputs, jacobians);
    return {outputs, jacobians};
  }
  for (int node = range.first, end = 0; node <= range.last; node = end) {
    const int first = known->mark_unknown(node, range.last, end);
    if (first < end) ask(first, end - first, known->outputs_of(first), known->jacobians_of(first));
  }
  return {known->outputs_of(range.first), known->jacobians_of(range.first)};
}

double RheProblem::write_measurements(StageRange range, const Iterate& iterate, Hessian hessian, const CostView& view,
                                      OutputCache* known, std::span<double> scratch) const noexcept {
  const std::ptrdiff_t count = range.last - range.first + 1;
  Scratch memory(scratch.data());
  double *jacobian_rows = memory.take(count * ny_ * padded(nx())), *output_rows = memory.take(count * output_row_),
         *room = memory.take(std::ptrdiff_t{2} * output_row_);
  const auto [predicted, jacobians] = observe(range, iterate, known, output_rows, jacobian_rows, memory.rest());
  const bool is_exact = hessian == Hessian::exact && view.H, is_robust = !setup_.robust.empty();
  if (known && (is_exact || is_robust)) std::fill_n(known->is_clean() + range.first, count, std::uint8_t{0});
  if (is_robust || (is_exact && !view.h))
    return write_general_measurements(range, iterate, hessian, view, predicted, jacobians, memory.rest());
  if (is_exact && range.last == intervals()) transcription_kernels().clear_costs(view, range.last, range.last);
  const MeasurementView measured{.vehicle_states = nx(),
                                 .output_count = ny_,
                                 .input_count = nu(),
                                 .outputs = outputs_.data(),
                                 .inputs = measured_inputs_.data(),
                                 .predicted = predicted,
                                 .jacobians = jacobians,
                                 .output_weights = weights_at(range.first),
                                 .output_weights_step = has_weights_ ? output_row_ : 0,
                                 .input_weights = input_weights_.data(),
                                 .periods = output_periods_.data(),
                                 .inverse_periods = output_inverse_periods_.data(),
                                 .values = iterate.row(0),
                                 .room = room,
                                 .pulls = is_exact ? memory.take(count * output_row_) : nullptr,
                                 .is_clean = known ? known->is_clean() : nullptr};
  const double total = transcription_kernels().write_measurements(view, measured, range.first, range.last);
  if (is_exact) {
    add_curvature_of_outputs(model(), range, iterate, measured.pulls, output_row_, view, memory.rest());
  } else if (known && view.H) {
    std::fill_n(known->is_clean() + range.first, count, std::uint8_t{1});
    // At the last node, only the rows of states were cleared.
    known->is_clean()[intervals()] = 0;
  }
  return total;
}

double* RheProblem::H_of(const CostView& view, int stage) const noexcept {
  const std::ptrdiff_t size = static_cast<std::ptrdiff_t>(capacity().states + capacity().controls) * stride();
  return view.H ? view.H + stage * size : nullptr;
}

double* RheProblem::h_of(const CostView& view, int stage) const noexcept {
  return view.h ? view.h + static_cast<std::ptrdiff_t>(stage) * stride() : nullptr;
}

/// The same with robust losses, or for the exact Hessian alone.
double RheProblem::write_general_measurements(StageRange range, const Iterate& iterate, Hessian hessian,
                                              const CostView& view, const double* predicted, const double* jacobians,
                                              double* rest) const noexcept {
  const int count = range.last - range.first + 1, n = nx(), width = padded(n);
  const bool exact = hessian == Hessian::exact && view.H;
  CostView fresh = view;
  if (view.adds_to_curvature) fresh.H = nullptr;
  transcription_kernels().clear_costs(fresh, range.first, range.last);
  fresh.H = view.H;
  if (view.adds_to_curvature && range.last == intervals())
    transcription_kernels().clear_costs(fresh, range.last, range.last);
  Scratch memory(rest);
  double *difference = memory.take(output_row_), *weight = memory.take(output_row_),
         *curvature = memory.take(output_row_), *w = memory.take(output_row_),
         *multipliers = memory.take(static_cast<std::ptrdiff_t>(count) * output_row_);
  double total = 0.0;
  for (int i = range.first; i <= std::min(range.last, intervals() - 1); ++i)
    total += inputs(i, iterate, H_of(view, i), h_of(view, i));
  for (int i = 0; i < count; ++i) {
    const int node = range.first + i;
    residual(output(node), predicted + i * output_row_, difference);
    const double *const y = output(node), *const output_weights = weights_at(node);
    total += losses(difference, output_weights, weight, curvature);
    const double* J = jacobians + static_cast<std::ptrdiff_t>(i) * ny_ * width;
    double* H = H_of(view, node);
    for (int j = 0; j < ny_; ++j) {
      w[j] = std::isnan(y[j]) ? 0.0 : 2.0 * weight[j] * output_weights[j];
      multipliers[i * output_row_ + j] = w[j] * difference[j];
    }
    transcription_kernels().add_products(J, w, multipliers + i * output_row_, ny_, n, stride(), H, h_of(view, node));
    if (!exact) continue;
    // Second derivative of the loss: 4 rho'' (J' W r)(J' W r)'.
    for (const RobustLoss& loss : setup_.robust) {
      for (int c = 0; c < n; ++c) {
        for (int r = 0; r < n; ++r) {
          double left = 0.0, right = 0.0;
          for (const int j : loss.outputs) {
            left += J[j * width + r] * output_weights[j] * difference[j];
            right += J[j * width + c] * output_weights[j] * difference[j];
          }
          H[c * stride() + r] += 4.0 * curvature[loss.outputs.front()] * left * right;
        }
      }
    }
  }
  if (exact) add_curvature_of_outputs(model(), range, iterate, multipliers, output_row_, view, memory.rest());
  return total;
}

/// The terms of measured inputs on one interval; adds to H and h if they are not null.
double RheProblem::inputs(int i, const Iterate& iterate, double* H, double* h) const noexcept {
  const int ns = capacity().states;
  const double *u = iterate.control(i), *measured = measured_input(i);
  double total = 0.0;
  for (int j = 0; j < nu(); ++j) {
    if (std::isnan(measured[j])) continue;
    const double error = u[j] - measured[j], pull = setup_.input_weights[j] * error;
    total += pull * error;
    if (h) h[ns + j] += 2.0 * pull;
    if (H) H[(ns + j) * stride() + ns + j] += 2.0 * setup_.input_weights[j];
  }
  return total;
}

/// The same for the blocks that start there: their links, and what their values cost.
double RheProblem::links(int i, const Iterate& iterate, double* H, double* h) const noexcept {
  const int ns = capacity().states;
  const double* u = iterate.control(i);
  double total = 0.0;
  for (int j = 0; j < np(); ++j) {
    const int control = structure().control_of_lifted(i, j), state = nx() + j;
    const double information = link_information_[i * np() + j], weight = block_weight(i, j);
    if (control < 0) continue;
    if (weight != 0.0) {
      total += weight * u[control] * u[control];
      if (h) h[ns + control] += 2.0 * weight * u[control];
      if (H) H[(ns + control) * (stride() + 1)] += 2.0 * weight;
    }
    if (information == 0.0) continue;
    const double jump = u[control] - iterate.state(i)[state];
    total += information * jump * jump;
    const double pull = 2.0 * information * jump;
    if (h) {
      h[ns + control] += pull;
      h[state] -= pull;
    }
    if (!H) continue;
    H[(ns + control) * stride() + ns + control] += 2.0 * information;
    H[state * stride() + state] += 2.0 * information;
    H[state * stride() + ns + control] -= 2.0 * information;
    H[(ns + control) * stride() + state] -= 2.0 * information;
  }
  return total;
}

void RheProblem::robust_weights(const Iterate& iterate, int node, double* weights,
                                std::span<double> scratch) const noexcept {
  double *predicted = scratch.data(), *difference = predicted + ny_;
  Model::Nodes request;
  request.count = 1;
  request.states = iterate.state(node);
  request.outputs = predicted;
  model().observe(request);
  residual(output(node), predicted, difference);
  losses(difference, weights_at(node), weights, nullptr);
}

}  // namespace rhec
