#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "car.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/ocp/ocp.hpp"

/// A third kind of problem beside estimation and control: from one pose to another in the shortest time, forwards and
/// in reverse, past an obstacle. It derives from rhec::Ocp itself.
///
///     minimise    T + effort sum_{i=0}^{N-1} |w_i|^2
///     subject to  s_{i+1} = [F(x_i, w_i, T); T]   over tau = 1 / N     (s = [x; T]: the time is a decision of node 0,
///                 x_0 = start,  x_N = goal                               and carried along)
///                 bounds on speed, steering angle and inputs
///                 h_j(x_i) >= clearance^2                                (limits: both axles keep off the obstacle)
class MinimumTimeProblem final : public rhec::Ocp {
 public:
  static constexpr int nx = 5, nu = 2, nz = nx + nu + 1, ns = nx + 1, limits = 2;
  struct Setup {
    int intervals = 60;                      ///< N
    Car<double> car;                         ///< and the obstacle
    double clearance = 2.0;                  ///< of the axles' centres from that of the obstacle [m]
    std::vector<double> start, goal;         ///< [x, y, psi, delta, v]
    double steering = 0.6, rate = 0.8;       ///< most [rad], [rad/s]
    double forwards = 3.0, reverse = 2.0;    ///< fastest [m/s]
    double acceleration = 1.5;               ///< most [m/s^2]
    double shortest = 0.5, longest = 120.0;  ///< T [s]
    double effort = 1e-3;
  };

  explicit MinimumTimeProblem(Setup setup) : setup_(std::move(setup)), car_(make_car(setup_.car)) {
    const std::vector<double> free = {-rhec::infinity, -rhec::infinity, -rhec::infinity};
    lower_ = upper_ = std::vector<double>(static_cast<std::size_t>(setup_.intervals + 1) * ns);
    for (int i = 0; i <= setup_.intervals; ++i) {
      double *lower = lower_.data() + i * ns, *upper = upper_.data() + i * ns;
      std::copy_n(free.data(), 3, lower);
      std::fill_n(upper, 3, rhec::infinity);
      lower[3] = -setup_.steering;
      upper[3] = setup_.steering;
      lower[4] = -setup_.reverse;
      upper[4] = setup_.forwards;
      // A bound of T is one of node 0 alone: further ones would say the same again.
      lower[5] = i == 0 ? setup_.shortest : -rhec::infinity;
      upper[5] = i == 0 ? setup_.longest : rhec::infinity;
    }
    for (double* row : {lower_.data(), upper_.data()}) {
      std::copy_n(setup_.start.data(), nx, row);
      std::copy_n(setup_.goal.data(), nx, row + setup_.intervals * ns);
    }
    const double square = setup_.clearance * setup_.clearance;
    for (int j = 0; j < limits; ++j) {
      limit_lower_[j] = square;
      limit_upper_[j] = limit_linear_[j] = rhec::infinity;  // from below alone, and hard
    }
  }

  rhec::Capacity capacity() const noexcept override { return {setup_.intervals, ns, nu, limits}; }
  int intervals() const noexcept override { return setup_.intervals; }
  int state_count(int) const noexcept override { return ns; }
  int control_count(int) const noexcept override { return nu; }
  /// T is free, so that the start is given by bounds.
  const double* initial_state() const noexcept override { return nullptr; }
  const double* state_lower(int node) const noexcept override { return lower_.data() + node * ns; }
  const double* state_upper(int node) const noexcept override { return upper_.data() + node * ns; }
  const double* control_lower(int) const noexcept override { return control_lower_; }
  const double* control_upper(int) const noexcept override { return control_upper_; }
  int limit_count(int node) const noexcept override { return node == 0 || node == intervals() ? 0 : limits; }
  const double* limit_lower(int) const noexcept override { return limit_lower_; }
  const double* limit_upper(int) const noexcept override { return limit_upper_; }
  const double* limit_linear(int) const noexcept override { return limit_linear_; }
  const double* limit_quadratic(int) const noexcept override { return limit_quadratic_; }
  bool has_second_derivatives() const noexcept override { return true; }
  /// Results of one interval: next state, Jacobian and Hessian.
  std::size_t scratch_size() const noexcept override { return nx + nx * nz + nz * nz; }

  double evaluate_stages(const rhec::Iterate& iterate, double* defects, double* stage_costs,
                         std::span<double> scratch) const noexcept override {
    double total = 0.0;
    for (int i = 0; i <= intervals(); ++i) {
      const double cost = stage_cost(i, iterate);
      if (stage_costs) stage_costs[i] = cost;
      total += cost;
      if (!defects || i == intervals()) continue;
      integrate(i, iterate, {.next_states = scratch.data()});
      for (int j = 0; j < nx; ++j) defects[i * ns + j] = scratch[j] - iterate.state(i + 1)[j];
      defects[i * ns + nx] = iterate.state(i)[nx] - iterate.state(i + 1)[nx];
    }
    return total;
  }

  void evaluate_limits(const rhec::Iterate& iterate, double* values, std::span<double>) const noexcept override {
    for (int i = 0; i <= intervals(); ++i)
      car_.observe({.count = 1, .states = iterate.state(i), .outputs = values + i * capacity().limit_row()});
  }

  void simulate_interval(int i, rhec::Iterate& iterate, std::span<double> scratch) const noexcept override {
    integrate(i, iterate, {.next_states = scratch.data()});
    std::copy_n(scratch.data(), nx, iterate.state(i + 1));
    iterate.state(i + 1)[nx] = iterate.state(i)[nx];
  }

  double linearise(rhec::StageRange range, const rhec::Iterate& iterate, rhec::Hessian hessian, rhec::StageQp& qp,
                   std::span<double> scratch) const noexcept override {
    qp.set_intervals(intervals());
    qp.initial_state_is_given = false;
    double total = 0.0;
    for (int i = range.first; i <= range.last; ++i) {
      const bool is_last = i == intervals();
      qp.set_sizes(i, ns, is_last ? 0 : nu, is_last ? 0 : 1);
      qp.set_limits(i, limit_count(i));
      total += stage_cost(i, iterate);
      write_cost(i, iterate, hessian, qp);
      if (!is_last) write_dynamics(i, iterate, hessian, qp, scratch);
      if (limit_count(i) > 0) write_limits(i, iterate, hessian, qp, scratch);
      for (int c = 0; c < ns; ++c) {
        qp.state_lower(i)[c] = state_lower(i)[c] - iterate.state(i)[c];
        qp.state_upper(i)[c] = state_upper(i)[c] - iterate.state(i)[c];
      }
      for (int c = 0; !is_last && c < nu; ++c) {
        qp.control_lower(i)[c] = control_lower_[c] - iterate.control(i)[c];
        qp.control_upper(i)[c] = control_upper_[c] - iterate.control(i)[c];
      }
    }
    // The sizes of the stage behind a range are known, too.
    if (range.last < intervals()) qp.set_sizes(range.last + 1, ns, range.last + 1 < intervals() ? nu : 0);
    return total;
  }

 private:
  /// The columns of [s; w] where the car's [x; u; T] are.
  static int column(int k) noexcept { return k < nx ? k : k < nx + nu ? k + 1 : nx; }

  double stage_cost(int i, const rhec::Iterate& iterate) const noexcept {
    if (i == intervals()) return iterate.state(i)[nx];
    const double* w = iterate.control(i);
    return setup_.effort * (w[0] * w[0] + w[1] * w[1]);
  }

  void integrate(int i, const rhec::Iterate& iterate, rhec::Model::Intervals request) const noexcept {
    const double duration = 1.0 / intervals();
    request.count = 1;
    request.states = iterate.state(i);
    request.inputs = iterate.control(i);
    request.parameters = iterate.state(i) + nx;
    request.durations = &duration;
    car_.integrate(request);
  }

  void write_cost(int i, const rhec::Iterate& iterate, rhec::Hessian hessian, rhec::StageQp& qp) const noexcept {
    std::fill_n(qp.h(i), qp.stride(), 0.0);
    if (hessian != rhec::Hessian::none) std::fill_n(qp.H(i), (ns + nu) * qp.stride(), 0.0);
    if (i == intervals()) {
      qp.h(i)[nx] = 1.0;
      return;
    }
    for (int c = 0; c < nu; ++c) {
      qp.h(i)[ns + c] = 2.0 * setup_.effort * iterate.control(i)[c];
      if (hessian != rhec::Hessian::none) qp.H(i)[(ns + c) * qp.stride() + ns + c] = 2.0 * setup_.effort;
    }
  }

  void write_dynamics(int i, const rhec::Iterate& iterate, rhec::Hessian hessian, rhec::StageQp& qp,
                      std::span<double> scratch) const noexcept {
    double *next = scratch.data(), *jacobian = next + nx, *second = jacobian + nx * nz;
    const bool is_exact = hessian == rhec::Hessian::exact;
    integrate(i, iterate,
              {.next_states = next,
               .jacobians = jacobian,
               .multipliers = is_exact ? iterate.costate(i + 1) : nullptr,
               .hessians = is_exact ? second : nullptr});
    double* AB = qp.AB(i);
    std::fill_n(AB, ns * qp.stride(), 0.0);
    for (int k = 0; k < nz; ++k)
      for (int r = 0; r < nx; ++r) AB[r * qp.stride() + column(k)] = jacobian[k * nx + r];
    AB[nx * qp.stride() + nx] = 1.0;
    for (int r = 0; r < nx; ++r) qp.b(i)[r] = next[r] - iterate.state(i + 1)[r];
    qp.b(i)[nx] = iterate.state(i)[nx] - iterate.state(i + 1)[nx];
    for (int k = 0; is_exact && k < nz; ++k)
      for (int l = 0; l < nz; ++l) qp.H(i)[column(k) * qp.stride() + column(l)] += second[k * nz + l];
  }

  void write_limits(int i, const rhec::Iterate& iterate, rhec::Hessian hessian, rhec::StageQp& qp,
                    std::span<double> scratch) const noexcept {
    double *value = scratch.data(), *jacobian = value + limits, *second = jacobian + limits * nx;
    const bool is_exact = hessian == rhec::Hessian::exact;
    car_.observe({.count = 1,
                  .states = iterate.state(i),
                  .outputs = value,
                  .jacobians = jacobian,
                  .multipliers = is_exact ? iterate.limit_bound(i) : nullptr,
                  .hessians = is_exact ? second : nullptr});
    std::fill_n(qp.G(i), limits * qp.stride(), 0.0);
    for (int j = 0; j < limits; ++j) {
      for (int c = 0; c < nx; ++c) qp.G(i)[j * qp.stride() + c] = jacobian[c * limits + j];
      qp.limit_lower(i)[j] = limit_lower_[j] - value[j];
      qp.limit_upper(i)[j] = limit_upper_[j];
      qp.limit_linear(i)[j] = limit_linear_[j];
      qp.limit_quadratic(i)[j] = 0.0;
    }
    for (int c = 0; is_exact && c < nx; ++c)
      for (int d = 0; d < nx; ++d) qp.H(i)[c * qp.stride() + d] += second[c * nx + d];
  }

  Setup setup_;
  rhec::GraphModel car_;
  std::vector<double> lower_, upper_;  // N + 1 rows
  double control_lower_[nu] = {-setup_.acceleration, -setup_.rate},
         control_upper_[nu] = {setup_.acceleration, setup_.rate};
  double limit_lower_[limits]{}, limit_upper_[limits]{}, limit_linear_[limits]{}, limit_quadratic_[limits]{};
};
