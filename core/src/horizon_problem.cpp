#include "rhec/core/horizon_problem.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "rhec/core/error.hpp"

namespace rhec {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace

HorizonProblem::HorizonProblem(std::shared_ptr<const Model> model, const Shape& shape)
    : model_(std::move(model)),
      nx_(model_->state_count()),
      nu_(model_->input_count()),
      np_(model_->parameter_count()),
      channels_(np_ + static_cast<int>(shape.blocked_inputs.size())),
      substeps_(shape.substeps) {
  if (shape.max_intervals < 1) throw Error("horizon: expected at least 1 interval; set it to 1 or more");
  if (shape.substeps < 1) throw Error("substeps: expected at least 1 integration step per interval");
  capacity_ = {shape.max_intervals, nx_ + channels_, nu_ + np_};
  const auto nodes = static_cast<std::size_t>(shape.max_intervals) + 1;
  input_channel_.assign(nu_, -1);
  for (std::size_t j = 0; j < shape.blocked_inputs.size(); ++j)
    input_channel_[shape.blocked_inputs[j]] = np_ + static_cast<int>(j);
  for (int j = 0; j < nu_; ++j)
    if (input_channel_[j] < 0) free_inputs_.push_back(j);
  durations_.assign(nodes, 0.0);
  begins_.assign(nodes * channels_, 0);
  ramp_.assign(channels_, 0);
  control_index_.assign(nodes * channels_, -1);
  control_counts_.assign(nodes, 0);
  state_lower_.assign(nodes * capacity_.states, -infinity);
  state_upper_.assign(nodes * capacity_.states, infinity);
  control_lower_.assign(nodes * capacity_.controls, -infinity);
  control_upper_.assign(nodes * capacity_.controls, infinity);
}

void HorizonProblem::set_ramp(int channel, bool ramp) noexcept {
  ramp_[channel] = ramp;
  any_ramp_ = std::any_of(ramp_.begin(), ramp_.end(), [](std::uint8_t flag) { return flag != 0; });
}

void HorizonProblem::finish_structure() noexcept {
  for (int i = 0; i < intervals_; ++i) {
    int next = static_cast<int>(free_inputs_.size());
    for (int c = 0; c < channels_; ++c) control_index_[i * channels_ + c] = begins(i, c) ? next++ : -1;
    control_counts_[i] = next;
  }
}

int HorizonProblem::control_of_input(int interval, int input) const noexcept {
  if (input_channel_[input] >= 0) return control_of_channel(interval, input_channel_[input]);
  return static_cast<int>(std::lower_bound(free_inputs_.begin(), free_inputs_.end(), input) - free_inputs_.begin());
}

std::size_t HorizonProblem::scratch_size() const noexcept {
  const std::size_t nz = static_cast<std::size_t>(nx_) + nu_ + 2 * np_;
  const std::size_t per_interval = 3 * static_cast<std::size_t>(nx_) + nu_ + 2 * np_ + nx_ * nz + nz * nz;
  return (capacity_.intervals + 1) * per_interval + cost_scratch_size();
}

void HorizonProblem::mark_dynamics(int i, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept {
  const int ns = capacity_.states, inputs = static_cast<int>(free_inputs_.size());
  // The vehicle's next state depends on all of the vehicle's own, and on a channel's value where that is in use.
  for (int c = 0; c < ns; ++c) {
    const int channel = c - nx_;
    const bool carried = channel < 0 || control_of_channel(i, channel) < 0;
    const bool starts_ramp = channel >= 0 && !carried && is_ramp(channel);
    for (int r = 0; r < nx_; ++r) state_flags[c * ns + r] = carried || starts_ramp;
    for (int r = nx_; r < ns; ++r) state_flags[c * ns + r] = channel >= 0 && carried && r == c;
  }
  for (int c = 0; c < control_counts_[i]; ++c)
    for (int r = 0; r < ns; ++r)
      control_flags[c * ns + r] = r < nx_ || (c >= inputs && control_of_channel(i, r - nx_) == c);
}

void HorizonProblem::inputs_on(const Iterate& point, int interval, double* u) const noexcept {
  const double* w = point.control(interval);
  for (int j = 0; j < nu_; ++j) {
    const int control = control_of_input(interval, j);
    u[j] = control >= 0 ? w[control] : point.state(interval)[nx_ + input_channel_[j]];
  }
}

void HorizonProblem::parameters_on(const Iterate& point, int interval, double* p) const noexcept {
  for (int j = 0; j < np_; ++j) {
    const int control = control_of_channel(interval, j);
    p[j] = control >= 0 ? point.control(interval)[control] : point.state(interval)[nx_ + j];
  }
}

void HorizonProblem::set_decisions(Iterate& point, const double* inputs, const double* parameters) const noexcept {
  for (int i = 0; i < intervals_; ++i) {
    const auto value_of = [&](int channel, int at) {
      if (channel < np_) return parameters[at * np_ + channel];
      const auto input = std::find(input_channel_.begin(), input_channel_.end(), channel) - input_channel_.begin();
      return inputs[at * nu_ + input];
    };
    if (i == 0)
      for (int c = 0; c < channels_; ++c) point.state(0)[nx_ + c] = value_of(c, 0);
    for (std::size_t f = 0; f < free_inputs_.size(); ++f) point.control(i)[f] = inputs[i * nu_ + free_inputs_[f]];
    for (int c = 0; c < channels_; ++c) {
      const int control = control_of_channel(i, c);
      if (control >= 0) point.control(i)[control] = value_of(c, i);
      point.state(i + 1)[nx_ + c] = control >= 0 ? point.control(i)[control] : point.state(i)[nx_ + c];
    }
  }
}

void HorizonProblem::gather(const Iterate& point, StageRange range, double* x, double* u, double* p,
                            double* p_end) const noexcept {
  for (int i = range.first; i <= range.last; ++i) {
    const double* s = point.state(i);
    std::copy(s, s + nx_, x);
    inputs_on(point, i, u);
    parameters_on(point, i, p_end);
    for (int j = 0; j < np_; ++j) p[j] = ramp_[j] ? s[nx_ + j] : p_end[j];
    x += nx_;
    u += nu_;
    p += np_;
    p_end += np_;
  }
}

namespace {

/// Dense rows for a range of intervals, cut out of the caller's scratch.
struct Rows {
  double *x, *u, *p, *p_end, *next, *multipliers, *jacobians, *hessians;
  std::span<double> rest;
  Rows(std::span<double> scratch, int count, int nx, int nu, int np) {
    const int nz = nx + nu + 2 * np;
    double* position = scratch.data();
    const auto take = [&](int width) {
      return std::exchange(position, position + static_cast<std::ptrdiff_t>(count) * width);
    };
    x = take(nx);
    u = take(nu);
    p = take(np);
    p_end = take(np);
    next = take(nx);
    multipliers = take(nx);
    jacobians = take(nx * nz);
    hessians = take(nz * nz);
    rest = {position, static_cast<std::size_t>(scratch.data() + scratch.size() - position)};
  }
};

}  // namespace

double HorizonProblem::evaluate_stages(const Iterate& point, double* defects, double* stage_costs,
                                       std::span<double> scratch) const noexcept {
  if (defects) {
    const Rows rows(scratch, intervals_, nx_, nu_, np_);
    gather(point, {0, intervals_ - 1}, rows.x, rows.u, rows.p, rows.p_end);
    Model::Intervals request;
    request.count = intervals_;
    request.states = rows.x;
    request.inputs = rows.u;
    request.parameters = rows.p;
    request.parameters_end = any_ramp_ ? rows.p_end : nullptr;
    request.durations = durations_.data();
    request.substeps = substeps_;
    request.next_states = rows.next;
    model_->integrate(request);
    for (int i = 0; i < intervals_; ++i) {
      double* defect = defects + i * capacity_.states;
      const double* s_next = point.state(i + 1);
      for (int j = 0; j < nx_; ++j) defect[j] = rows.next[i * nx_ + j] - s_next[j];
      for (int c = 0; c < channels_; ++c) {
        const int control = control_of_channel(i, c);
        defect[nx_ + c] = (control >= 0 ? point.control(i)[control] : point.state(i)[nx_ + c]) - s_next[nx_ + c];
      }
    }
  }
  if (stage_costs) std::fill_n(stage_costs, intervals_ + 1, 0.0);
  return cost(point, stage_costs, scratch);
}

void HorizonProblem::simulate_interval(int i, Iterate& point, std::span<double> scratch) const noexcept {
  const Rows rows(scratch, 1, nx_, nu_, np_);
  gather(point, {i, i}, rows.x, rows.u, rows.p, rows.p_end);
  Model::Intervals request;
  request.count = 1;
  request.states = rows.x;
  request.inputs = rows.u;
  request.parameters = rows.p;
  request.parameters_end = any_ramp_ ? rows.p_end : nullptr;
  request.durations = durations_.data() + i;
  request.substeps = substeps_;
  request.next_states = point.state(i + 1);
  model_->integrate(request);
  for (int c = 0; c < channels_; ++c) {
    const int control = control_of_channel(i, c);
    point.state(i + 1)[nx_ + c] = control >= 0 ? point.control(i)[control] : point.state(i)[nx_ + c];
  }
}

void HorizonProblem::linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                               std::span<double> scratch) const noexcept {
  const int ns = capacity_.states, nw = capacity_.controls, stride = qp.stride();
  const StageRange steps{range.first, std::min(range.last, intervals_ - 1)};
  const int count = steps.last - steps.first + 1;
  const Rows rows(scratch, std::max(count, 0), nx_, nu_, np_);
  const int nz = nx_ + nu_ + (any_ramp_ ? 2 * np_ : np_);
  const bool exact = hessian == Hessian::exact;
  if (range.first == 0) {
    qp.set_intervals(intervals_);
    qp.initial_state_is_given = initial_state() != nullptr;
  }
  for (int i = range.first; i <= range.last; ++i) {
    const int controls = i < intervals_ ? control_counts_[i] : 0;
    qp.set_sizes(i, ns, controls);
    std::fill_n(qp.H(i), (ns + nw) * stride, 0.0);
    std::fill_n(qp.h(i), stride, 0.0);
  }

  if (count > 0) {
    gather(point, steps, rows.x, rows.u, rows.p, rows.p_end);
    Model::Intervals request;
    request.count = count;
    request.states = rows.x;
    request.inputs = rows.u;
    request.parameters = rows.p;
    request.parameters_end = any_ramp_ ? rows.p_end : nullptr;
    request.durations = durations_.data() + steps.first;
    request.substeps = substeps_;
    request.next_states = rows.next;
    request.jacobians = rows.jacobians;
    if (exact) {
      for (int i = steps.first; i <= steps.last; ++i)
        std::copy_n(point.costate(i + 1), nx_, rows.multipliers + (i - steps.first) * nx_);
      request.multipliers = rows.multipliers;
      request.hessians = rows.hessians;
    }
    model_->integrate(request);
  }

  for (int i = steps.first; i <= steps.last; ++i) {
    const double* jacobian = rows.jacobians + (i - steps.first) * nx_ * nz;
    double *F = qp.F(i), *b = qp.b(i);
    std::fill_n(F, ns * stride, 0.0);
    // Column of the model's z = [x; u; p (; p_end)] -> where it goes in [s; w].
    const auto column_of = [&](int z) {
      if (z < nx_) return z;
      if (z < nx_ + nu_) {
        const int control = control_of_input(i, z - nx_);
        return control >= 0 ? ns + control : nx_ + input_channel_[z - nx_];
      }
      const bool end = z >= nx_ + nu_ + np_;
      const int parameter = z - nx_ - nu_ - (end ? np_ : 0);
      const int control = control_of_channel(i, parameter);
      // A jump is seen by the whole interval; of a ramp, only the end is new.
      return control >= 0 && (end || !ramp_[parameter]) ? ns + control : nx_ + parameter;
    };
    for (int z = 0; z < nz; ++z)
      for (int r = 0; r < nx_; ++r) F[r * stride + column_of(z)] += jacobian[z * nx_ + r];
    for (int c = 0; c < channels_; ++c) {
      const int control = control_of_channel(i, c);
      F[(nx_ + c) * stride + (control >= 0 ? ns + control : nx_ + c)] = 1.0;
    }
    const double* s_next = point.state(i + 1);
    for (int r = 0; r < nx_; ++r) b[r] = rows.next[(i - steps.first) * nx_ + r] - s_next[r];
    for (int c = 0; c < channels_; ++c) {
      const int control = control_of_channel(i, c);
      b[nx_ + c] = (control >= 0 ? point.control(i)[control] : point.state(i)[nx_ + c]) - s_next[nx_ + c];
    }
    if (exact) {
      const double* h = rows.hessians + (i - steps.first) * nz * nz;
      for (int z1 = 0; z1 < nz; ++z1)
        for (int z2 = 0; z2 < nz; ++z2) qp.H(i)[column_of(z2) * stride + column_of(z1)] += h[z2 * nz + z1];
    }
  }
  fill_bounds(point, range, qp);
  add_cost(range, point, hessian, qp, scratch);
}

void HorizonProblem::refresh(const Iterate& point, StageQp& qp, std::span<double> scratch) const noexcept {
  for (int i = 0; i <= intervals_; ++i) {
    std::fill_n(qp.q(i), capacity_.states, 0.0);
    if (i < intervals_) std::fill_n(qp.r(i), capacity_.controls, 0.0);
  }
  fill_bounds(point, {0, intervals_}, qp);
  add_gradient(point, qp, scratch);
}

void HorizonProblem::fill_bounds(const Iterate& point, StageRange range, StageQp& qp) const noexcept {
  const int ns = capacity_.states;
  for (int i = range.first; i <= range.last; ++i) {
    for (int j = 0; j < ns; ++j) {
      qp.state_lower(i)[j] = state_lower(i)[j] - point.state(i)[j];
      qp.state_upper(i)[j] = state_upper(i)[j] - point.state(i)[j];
    }
    if (i == intervals_) continue;
    for (int j = 0; j < control_counts_[i]; ++j) {
      qp.control_lower(i)[j] = control_lower(i)[j] - point.control(i)[j];
      qp.control_upper(i)[j] = control_upper(i)[j] - point.control(i)[j];
    }
  }
  if (range.first == 0 && initial_state())
    for (int j = 0; j < ns; ++j) qp.initial_step()[j] = initial_state()[j] - point.state(0)[j];
}

}  // namespace rhec
