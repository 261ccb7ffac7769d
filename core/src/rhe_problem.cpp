#include "rhec/core/rhe_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "checks.hpp"
#include "rhec/core/error.hpp"

namespace rhec {

double angle_difference(double a, double b) noexcept { return std::remainder(a - b, 2.0 * std::numbers::pi); }

RheProblem::RheProblem(std::shared_ptr<const Model> model, Setup setup)
    : HorizonProblem(std::move(model), {setup.max_intervals, setup.substeps, {}}),
      setup_(std::move(setup)),
      ny_(this->model().output_count()) {
  const ModelDescription& about = this->model().description();
  check_weights("output weights", setup_.output_weights, about.outputs);
  check_weights("input weights", setup_.input_weights, about.inputs);
  fill_default_bounds("state bounds", setup_.state_lower, setup_.state_upper, about.states, true);
  fill_default_bounds("input bounds", setup_.input_lower, setup_.input_upper, about.inputs, false);
  fill_default_bounds("parameter bounds", setup_.parameter_lower, setup_.parameter_upper, about.parameters, true);
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
  const auto nodes = static_cast<std::size_t>(setup_.max_intervals) + 1;
  const double missing = std::numeric_limits<double>::quiet_NaN();
  outputs_.assign(nodes * ny_, missing);
  measured_inputs_.assign(nodes * nu(), missing);
  link_information_.assign(nodes * np(), 0.0);
  arrival_mean = Eigen::VectorXd::Zero(nx() + np());
  arrival_information = Eigen::MatrixXd::Zero(nx() + np(), nx() + np());
}

void RheProblem::set_blocks(int parameter, const std::uint8_t* begins, Transition transition) noexcept {
  const bool ramp = transition == Transition::ramp;
  set_ramp(parameter, ramp);
  // Node 0 carries the first block's value, so the first interval has nothing to decide, unless a ramp starts there.
  for (int i = 0; i < intervals(); ++i) set_begins(i, parameter, begins[i] && (i > 0 || ramp));
  for (int i = 0; i < intervals(); ++i) link(i, parameter, std::numeric_limits<double>::infinity());
}

void RheProblem::link(int interval, int parameter, double variance) noexcept {
  link_information_[interval * np() + parameter] = 1.0 / variance;
}

void RheProblem::finish() noexcept {
  finish_structure();
  const int ns = capacity().states, nw = capacity().controls;
  for (int i = 0; i <= intervals(); ++i) {
    for (int j = 0; j < nx(); ++j) {
      state_lower_[i * ns + j] = setup_.state_lower[j];
      state_upper_[i * ns + j] = setup_.state_upper[j];
    }
    // A block is bounded once, where its value is decided: at node 0 or by the control that starts it.
    for (int j = 0; j < np(); ++j) {
      state_lower_[i * ns + nx() + j] = i == 0 ? setup_.parameter_lower[j] : -std::numeric_limits<double>::infinity();
      state_upper_[i * ns + nx() + j] = i == 0 ? setup_.parameter_upper[j] : std::numeric_limits<double>::infinity();
    }
    if (i == intervals()) break;
    for (int j = 0; j < nu(); ++j) {
      control_lower_[i * nw + j] = setup_.input_lower[j];
      control_upper_[i * nw + j] = setup_.input_upper[j];
    }
    for (int j = 0; j < np(); ++j) {
      const int control = control_of_channel(i, j);
      if (control < 0) continue;
      control_lower_[i * nw + control] = setup_.parameter_lower[j];
      control_upper_[i * nw + control] = setup_.parameter_upper[j];
    }
  }
}

void RheProblem::drop_first_interval() noexcept {
  for (int i = 0; i + 1 < intervals(); ++i) set_duration(i, duration(i + 1));
  std::copy(outputs_.begin() + ny_, outputs_.end(), outputs_.begin());
  std::copy(measured_inputs_.begin() + nu(), measured_inputs_.end(), measured_inputs_.begin());
}

std::size_t RheProblem::cost_scratch_size() const noexcept {
  const std::size_t nodes = static_cast<std::size_t>(capacity().intervals) + 1;
  // states, outputs, multipliers, jacobians, hessians of all nodes, and four rows of outputs
  return nodes * (nx() + 2 * ny_ + ny_ * nx() + nx() * nx()) + 4 * static_cast<std::size_t>(ny_);
}

void RheProblem::residual(int node, const double* predicted, double* difference) const noexcept {
  const double* y = output(node);
  const auto& about = model().description().outputs;
  for (int j = 0; j < ny_; ++j) {
    if (std::isnan(y[j])) {
      difference[j] = 0.0;
    } else {
      difference[j] = about[j].is_angle ? angle_difference(predicted[j], y[j]) : predicted[j] - y[j];
    }
  }
}

double RheProblem::losses(const double* difference, double* weight, double* curvature) const noexcept {
  double total = 0.0;
  for (int j = 0; j < ny_; ++j) {
    weight[j] = 1.0;
    if (curvature) curvature[j] = 0.0;
    if (robust_group_[j] < 0) total += setup_.output_weights[j] * difference[j] * difference[j];
  }
  for (const RobustLoss& loss : setup_.robust) {
    double s = 0.0;
    for (const int j : loss.outputs) s += setup_.output_weights[j] * difference[j] * difference[j];
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

double RheProblem::cost(const Iterate& point, double* stage_costs, std::span<double> scratch) const noexcept {
  const int count = intervals() + 1;
  double* states = scratch.data();
  double* predicted = states + count * nx();
  double* difference = predicted + count * ny_;
  double* weight = difference + ny_;
  for (int i = 0; i < count; ++i) std::copy_n(point.state(i), nx(), states + i * nx());
  Model::Nodes request;
  request.count = count;
  request.states = states;
  request.outputs = predicted;
  model().observe(request);

  double total = 0.0;
  const auto add = [&](int stage, double part) {
    total += part;
    if (stage_costs) stage_costs[stage] += part;
  };
  const int n = nx() + np();
  for (int r = 0; r < n; ++r)
    for (int c = 0; c < n; ++c)
      add(0, (point.state(0)[r] - arrival_mean[r]) * arrival_information(r, c) * (point.state(0)[c] - arrival_mean[c]));
  for (int i = 0; i < count; ++i) {
    residual(i, predicted + i * ny_, difference);
    add(i, losses(difference, weight, nullptr));
  }
  for (int i = 0; i < intervals(); ++i) {
    for (int j = 0; j < nu(); ++j) {
      const double measured = measured_input(i)[j];
      if (std::isnan(measured)) continue;
      const double error = point.control(i)[j] - measured;
      add(i, setup_.input_weights[j] * error * error);
    }
    for (int j = 0; j < np(); ++j) {
      const int control = control_of_channel(i, j);
      if (control < 0) continue;
      const double jump = point.control(i)[control] - point.state(i)[nx() + j];
      add(i, link_information_[i * np() + j] * jump * jump);
    }
  }
  return total;
}

void RheProblem::add_cost(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                          std::span<double> scratch) const noexcept {
  if (range.first == 0) add_arrival(point, true, qp);
  add_outputs(range, point, hessian, true, qp, scratch);
  add_inputs_and_links(range, point, true, qp);
}

void RheProblem::add_gradient(const Iterate& point, StageQp& qp, std::span<double> scratch) const noexcept {
  add_arrival(point, false, qp);
  add_outputs({0, intervals()}, point, Hessian::gauss_newton, false, qp, scratch);
  add_inputs_and_links({0, intervals()}, point, false, qp);
}

void RheProblem::add_arrival(const Iterate& point, bool matrices, StageQp& qp) const noexcept {
  const int n = nx() + np();
  for (int c = 0; c < n; ++c) {
    const double error = point.state(0)[c] - arrival_mean[c];
    for (int r = 0; r < n; ++r) {
      const double information = arrival_information(r, c);
      qp.q(0)[r] += 2.0 * information * error;
      if (matrices) qp.H(0)[c * qp.stride() + r] += 2.0 * information;
    }
  }
}

void RheProblem::add_outputs(StageRange range, const Iterate& point, Hessian hessian, bool matrices, StageQp& qp,
                             std::span<double> scratch) const noexcept {
  const int count = range.last - range.first + 1, n = nx(), stride = qp.stride();
  double* states = scratch.data();
  double* predicted = states + count * n;
  double* jacobians = predicted + count * ny_;
  double* multipliers = jacobians + count * ny_ * n;
  double* hessians = multipliers + count * ny_;
  double* difference = hessians + count * n * n;
  double *weight = difference + ny_, *curvature = weight + ny_;
  for (int i = 0; i < count; ++i) std::copy_n(point.state(range.first + i), n, states + i * n);
  Model::Nodes request;
  request.count = count;
  request.states = states;
  request.outputs = predicted;
  request.jacobians = jacobians;
  model().observe(request);

  const bool exact = matrices && hessian == Hessian::exact;
  for (int i = 0; i < count; ++i) {
    const int node = range.first + i;
    residual(node, predicted + i * ny_, difference);
    losses(difference, weight, curvature);
    const double* y = output(node);
    const double* J = jacobians + i * ny_ * n;
    double *H = qp.H(node), *q = qp.q(node);
    for (int j = 0; j < ny_; ++j) {
      const double w = std::isnan(y[j]) ? 0.0 : 2.0 * weight[j] * setup_.output_weights[j];
      multipliers[i * ny_ + j] = w * difference[j];
      if (w == 0.0) continue;
      for (int c = 0; c < n; ++c) {
        const double wJ = w * J[c * ny_ + j];
        q[c] += wJ * difference[j];
        if (matrices && wJ != 0.0)
          for (int r = 0; r < n; ++r) H[c * stride + r] += J[r * ny_ + j] * wJ;
      }
    }
    if (!exact) continue;
    // The loss itself bends: 4 rho'' (J' W r)(J' W r)'.
    for (const RobustLoss& loss : setup_.robust) {
      for (int c = 0; c < n; ++c) {
        for (int r = 0; r < n; ++r) {
          double left = 0.0, right = 0.0;
          for (const int j : loss.outputs) {
            left += J[r * ny_ + j] * setup_.output_weights[j] * difference[j];
            right += J[c * ny_ + j] * setup_.output_weights[j] * difference[j];
          }
          H[c * stride + r] += 4.0 * curvature[loss.outputs.front()] * left * right;
        }
      }
    }
  }
  if (!exact) return;
  request.outputs = nullptr;
  request.jacobians = nullptr;
  request.multipliers = multipliers;
  request.hessians = hessians;
  model().observe(request);
  for (int i = 0; i < count; ++i)
    for (int c = 0; c < n; ++c)
      for (int r = 0; r < n; ++r) qp.H(range.first + i)[c * stride + r] += hessians[(i * n + c) * n + r];
}

void RheProblem::add_inputs_and_links(StageRange range, const Iterate& point, bool matrices,
                                      StageQp& qp) const noexcept {
  const int ns = capacity().states, stride = qp.stride();
  for (int i = range.first; i <= std::min(range.last, intervals() - 1); ++i) {
    for (int j = 0; j < nu(); ++j) {
      const double measured = measured_input(i)[j];
      if (std::isnan(measured)) continue;
      const double w = 2.0 * setup_.input_weights[j];
      qp.r(i)[j] += w * (point.control(i)[j] - measured);
      if (matrices) qp.H(i)[(ns + j) * stride + ns + j] += w;
    }
    for (int j = 0; j < np(); ++j) {
      const int control = control_of_channel(i, j), state = nx() + j;
      if (control < 0) continue;
      const double w = 2.0 * link_information_[i * np() + j];
      const double pull = w * (point.control(i)[control] - point.state(i)[state]);
      qp.r(i)[control] += pull;
      qp.q(i)[state] -= pull;
      if (matrices) {
        double* H = qp.H(i);
        H[(ns + control) * stride + ns + control] += w;
        H[state * stride + state] += w;
        H[state * stride + ns + control] -= w;
        H[(ns + control) * stride + state] -= w;
      }
    }
  }
}

void RheProblem::robust_weights(const Iterate& point, int node, double* weights,
                                std::span<double> scratch) const noexcept {
  double *predicted = scratch.data(), *difference = predicted + ny_;
  Model::Nodes request;
  request.count = 1;
  request.states = point.state(node);
  request.outputs = predicted;
  model().observe(request);
  residual(node, predicted, difference);
  losses(difference, weights, nullptr);
}

}  // namespace rhec
