#include "rhec/core/horizon_problem.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>

#include "kernels/kernels.hpp"
#include "kernels/program_kernels.hpp"
#include "recollection.hpp"
#include "rhec/core/error.hpp"
#include "scratch.hpp"

namespace rhec {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
/// Intervals that are integrated at once, and whose rows stay in the processor's cache until their defects are known.
constexpr int evaluated_at_once = 64;

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
  capacity_ = {shape.max_intervals, nx_ + channels_, nu_};
  for (int j = 0; shape.decides_parameters && j < np_; ++j)
    capacity_.controls += std::ranges::count(shape.one_block, j) == 0;
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
  stride_ = capacity_.row();
  row_ = Capacity{0, nx_ + np_, nu_ + np_}.row();
  lower_.assign(nodes * stride_, -infinity);
  upper_.assign(nodes * stride_, infinity);
  for (auto* v : {&foreseen_.z, &foreseen_.next}) v->assign(row_, 0.0);
  foreseen_.jacobian.assign(static_cast<std::size_t>(nx_) * row_, 0.0);
  foreseen_.scratch.assign(model_->rows_scratch(1), 0.0);
}

void HorizonProblem::clear_bounds() noexcept {
  std::fill(lower_.begin(), lower_.end(), -infinity);
  std::fill(upper_.begin(), upper_.end(), infinity);
}

int HorizonProblem::column_of_input(int interval, int input) const noexcept {
  const int control = control_of_input(interval, input);
  return control >= 0 ? capacity_.states + control : nx_ + input_channel_[input];
}

void HorizonProblem::set_ramp(int channel, bool ramp) noexcept {
  ramp_[channel] = ramp;
  any_ramp_ = std::any_of(ramp_.begin(), ramp_.end(), [](std::uint8_t flag) { return flag != 0; });
}

bool HorizonProblem::finish_structure() noexcept {
  if (is_finished_) return false;
  is_finished_ = true;
  const int free_count = static_cast<int>(free_inputs_.size());
  any_start_ = false;
  for (int i = 0; i < intervals_; ++i) {
    int next = free_count;
    for (int c = 0; c < channels_; ++c) control_index_[i * channels_ + c] = begins(i, c) ? next++ : -1;
    control_counts_[i] = next;
    any_start_ |= next > free_count;
  }
  return true;
}

int HorizonProblem::control_of_input(int interval, int input) const noexcept {
  if (input_channel_[input] >= 0) return control_of_channel(interval, input_channel_[input]);
  return static_cast<int>(std::lower_bound(free_inputs_.begin(), free_inputs_.end(), input) - free_inputs_.begin());
}

std::size_t HorizonProblem::scratch_size() const noexcept {
  const auto nodes = static_cast<std::size_t>(capacity_.intervals) + 1;
  const std::size_t gathered = 2 * static_cast<std::size_t>(nx_) + nu_ + 2 * np_;
  const std::size_t rows = row_ * (1 + static_cast<std::size_t>(nx_) + row_);
  return nodes * (gathered + rows) + model_->rows_scratch(static_cast<int>(nodes)) + cost_scratch_size() + 8;
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
    const double *s = point.state(i), *w = point.control(i);
    for (int j = 0; j < nx_; ++j) x[j] = s[j];
    if (is_direct())
      for (int j = 0; j < nu_; ++j) u[j] = w[j];
    else
      inputs_on(point, i, u);
    for (int j = 0; j < np_; ++j) {
      const int control = control_of_channel(i, j);
      p_end[j] = control >= 0 ? w[control] : s[nx_ + j];
      p[j] = ramp_[j] ? s[nx_ + j] : p_end[j];
    }
    x += nx_;
    u += nu_;
    p += np_;
    p_end += np_;
  }
}

namespace {

/// Dense rows for a range of intervals.
struct Rows {
  double *x, *u, *p, *p_end, *next;
  Rows(Scratch scratch, std::ptrdiff_t count, int nx, int nu, int np)
      : x(scratch.take(count * nx)),
        u(scratch.take(count * nu)),
        p(scratch.take(count * np)),
        p_end(scratch.take(count * np)),
        next(scratch.take(count * nx)) {}
};

}  // namespace

double HorizonProblem::evaluate_stages(const Iterate& point, double* defects, double* stage_costs,
                                       std::span<double> scratch) const noexcept {
  for (int first = 0; defects && first < intervals_; first += evaluated_at_once) {
    const StageRange piece{first, std::min(first + evaluated_at_once, intervals_) - 1};
    const int count = piece.last - first + 1;
    const Rows rows(Scratch(scratch.data()), count, nx_, nu_, np_);
    gather(point, piece, rows.x, rows.u, rows.p, rows.p_end);
    Model::Intervals request;
    request.count = count;
    request.states = rows.x;
    request.inputs = rows.u;
    request.parameters = rows.p;
    request.parameters_end = any_ramp_ ? rows.p_end : nullptr;
    request.durations = durations_.data() + first;
    request.substeps = substeps_;
    request.next_states = rows.next;
    model_->integrate(request);
    const double* next = rows.next;
    for (int i = first; i <= piece.last; ++i, next += nx_) {
      double* defect = defects + static_cast<std::ptrdiff_t>(i) * capacity_.states;
      const double *s = point.state(i), *w = point.control(i), *s_next = point.state(i + 1);
      const int* control_of = control_index_.data() + static_cast<std::ptrdiff_t>(i) * channels_;
      for (int j = 0; j < nx_; ++j) defect[j] = next[j] - s_next[j];
      for (int c = 0; c < channels_; ++c)
        defect[nx_ + c] = (control_of[c] >= 0 ? w[control_of[c]] : s[nx_ + c]) - s_next[nx_ + c];
    }
  }
  if (stage_costs) std::fill_n(stage_costs, intervals_ + 1, 0.0);
  return cost(point, stage_costs, scratch);
}

void HorizonProblem::simulate_interval(int i, Iterate& point, std::span<double> scratch) const noexcept {
  const Rows rows(Scratch(scratch.data()), 1, nx_, nu_, np_);
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
  carry_channels(i, point);
}

void HorizonProblem::carry_channels(int i, Iterate& point) const noexcept {
  for (int c = 0; c < channels_; ++c) {
    const int control = control_of_channel(i, c);
    point.state(i + 1)[nx_ + c] = control >= 0 ? point.control(i)[control] : point.state(i)[nx_ + c];
  }
}

double HorizonProblem::linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                                 std::span<double> scratch) const noexcept {
  const Parts parts = hessian == Hessian::none ? Parts::vectors : Parts::all;
  fill_stages(range, point, hessian, qp, scratch);
  return add_cost(range, point, hessian, parts, qp, scratch);
}

void HorizonProblem::prepare(const Iterate& point, Hessian hessian, StageQp& qp,
                             std::span<double> scratch) const noexcept {
  const StageRange all{0, intervals_};
  Recollection* known = recollection_in(qp);
  const bool has_moved = known && move_along(point, hessian, qp, *known, scratch);
  if (has_moved && hessian == Hessian::exact) return;
  if (!has_moved) fill_stages(all, point, hessian, qp, scratch);
  add_cost(all, point, hessian, Parts::matrices, qp, scratch);
}

void HorizonProblem::refresh(const Iterate& point, StageQp& qp, std::span<double> scratch) const noexcept {
  const StageRange all{0, intervals_};
  if (has_late_bounds()) fill_bounds(point, all, qp);
  add_cost(all, point, Hessian::none, Parts::vectors, qp, scratch);
}

/// Sizes, dynamics with their curvature, and bounds.
void HorizonProblem::fill_stages(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                                 std::span<double> scratch) const noexcept {
  const StageRange steps{range.first, std::min(range.last, intervals_ - 1)};
  Recollection* known = recollection_in(qp);
  const bool has_channel_rows = known && has_structure(qp, *known);
  // Memory that is not for this model's programs must not take this one for its own.
  if (!known) qp.change();
  if (!has_channel_rows) fill_sizes(range, qp);
  Dynamics how{hessian, has_channel_rows, nullptr};
  if (known) {
    if (known->changes != qp.changes()) std::fill(known->is_clean.begin(), known->is_clean.end(), std::uint8_t{0});
    known->forget();
    if (range.first == 0 && range.last == intervals_) {
      remember(point, 0, qp, *known);
      known->has_curvature = hessian == Hessian::exact && keeps_curvature() && intervals_ > 0;
      if (known->has_curvature) {
        look_ahead(*known);
        how.ahead = known;
      }
    }
  }
  if (steps.last >= steps.first) linearise_dynamics(steps, point, how, qp, scratch);
  fill_bounds(point, range, qp);
}

void HorizonProblem::fill_sizes(StageRange range, StageQp& qp) const noexcept {
  qp.set_intervals(intervals_);
  qp.initial_state_is_given = initial_state() != nullptr;
  const int free_count = static_cast<int>(free_inputs_.size());
  for (int i = range.first; i <= range.last; ++i) {
    if (i == intervals_) {
      qp.set_sizes(i, capacity_.states, 0);
    } else {
      const bool any_starts = control_counts_[i] > free_count;
      qp.set_sizes(i, capacity_.states, control_counts_[i], any_starts ? 0 : channels_);
    }
  }
}

/// z = [x; p; u (; p_end)] of each interval, as `Model::integrate_rows` takes it.
void HorizonProblem::gather_rows(const Iterate& point, StageRange range, double* rows) const noexcept {
  double* z = rows;
  for (int i = range.first; i <= range.last; ++i, z += row_) {
    const double *s = point.state(i), *w = point.control(i);
    for (int j = 0; j < nx_ + np_; ++j) z[j] = s[j];
    if (is_direct()) {
      for (int j = 0; j < nu_; ++j) z[nx_ + np_ + j] = w[j];
      if (control_counts_[i] == nu_ && !any_ramp_) continue;
    } else {
      inputs_on(point, i, z + nx_ + np_);
    }
    for (int j = 0; j < np_; ++j) {
      const int control = control_of_channel(i, j);
      if (any_ramp_) z[nx_ + np_ + nu_ + j] = control >= 0 ? w[control] : z[nx_ + j];
      if (control >= 0 && ramp_[j] == 0) z[nx_ + j] = w[control];
    }
  }
}

void HorizonProblem::linearise_dynamics(StageRange steps, const Iterate& point, const Dynamics& how, StageQp& qp,
                                        std::span<double> scratch) const noexcept {
  const int ns = capacity_.states;
  const std::ptrdiff_t count = steps.last - steps.first + 1;
  Scratch memory(scratch.data());
  double *z = memory.take(count * row_), *jacobians = memory.take(count * nx_ * row_),
         *hessians = memory.take(count * row_ * row_);
  // Without carried inputs and ramps the model's rows are those of the program, but for channels that start.
  const bool in_place = is_direct() && !any_ramp_;
  const bool is_exact = how.hessian == Hessian::exact;
  const double *inputs = z, *durations = durations_.data() + steps.first, *costates = point.costate(steps.first + 1);
  if (how.ahead) {
    inputs = row(how.ahead->rows, steps.first, stride_);
    durations = how.ahead->durations.data();
    costates = row(how.ahead->costates, 1, stride_);
  } else if (in_place && !any_start_) {
    inputs = point.row(steps.first);
  } else {
    gather_rows(point, steps, z);
  }
  double* const curvature = in_place ? qp.H(steps.first) : hessians;
  model_->integrate_rows({.count = static_cast<int>(how.ahead ? count + 1 : count),
                          .z = inputs,
                          .z_step = inputs == z ? row_ : stride_,
                          .ramp = any_ramp_,
                          .durations = durations,
                          .substeps = substeps_,
                          .next_states = qp.b(steps.first),
                          .next_step = stride_,
                          .jacobians = in_place ? qp.F(steps.first) : jacobians,
                          .jacobian_step = in_place ? ns * stride_ : nx_ * row_,
                          .jacobian_row = in_place ? stride_ : row_,
                          .multipliers = is_exact ? costates : nullptr,
                          .multiplier_step = stride_,
                          .hessians = is_exact ? curvature : nullptr,
                          .hessian_step = in_place ? (ns + capacity_.controls) * stride_ : row_ * row_,
                          .hessian_row = in_place ? stride_ : row_,
                          .scratch = memory.rest()});

  if (!in_place) {
    std::fill_n(qp.F(steps.first), count * ns * stride_, 0.0);
    if (is_exact) std::fill_n(qp.H(steps.first), count * (ns + capacity_.controls) * stride_, 0.0);
  }
  if (how.ahead) {
    std::copy_n(qp.H(intervals_), how.ahead->ahead.size(), how.ahead->ahead.data());
    std::fill_n(qp.H(intervals_), how.ahead->ahead.size(), 0.0);
  }
  complete_dynamics(steps, point, how.has_channel_rows, qp);
  if (in_place && !any_start_) return;
  for (int i = steps.first; i <= steps.last; ++i) {
    if (!in_place) {
      scatter(i, jacobians + (i - steps.first) * nx_ * row_,
              is_exact ? hessians + (i - steps.first) * row_ * row_ : nullptr, qp);
    } else if (control_counts_[i] > nu_) {
      place_started_channels(i, how.hessian, qp);
    }
  }
}

/// What the model does not know of a program: rows of channels, and the next state in b.
void HorizonProblem::complete_dynamics(StageRange steps, const Iterate& point, bool has_channel_rows,
                                       StageQp& qp) const noexcept {
  program_kernels().complete_dynamics({.first = steps.first,
                                       .last = steps.last,
                                       .states = capacity_.states,
                                       .stride = stride_,
                                       .vehicle_states = nx_,
                                       .channels = channels_,
                                       .control_of = control_index_.data(),
                                       .values = point.row(0),
                                       .F = qp.F(0),
                                       .b = qp.b(0),
                                       .has_channel_rows = has_channel_rows,
                                       .any_start = any_start_});
}

CostView HorizonProblem::cost_view(Parts parts, Hessian hessian, StageQp& qp) const noexcept {
  return cost_view(parts != Parts::vectors ? qp.H(0) : nullptr, parts != Parts::matrices ? qp.h(0) : nullptr,
                   hessian == Hessian::exact);
}

CostView HorizonProblem::cost_view(double* H, double* h, bool bends) const noexcept {
  return {.intervals = intervals_,
          .states = capacity_.states,
          .controls = capacity_.controls,
          .stride = stride_,
          .control_counts = control_counts_.data(),
          .H = H,
          .h = h,
          .bends = bends};
}

/// What the model says of a parameter is that of its control where a block of it starts.
void HorizonProblem::place_started_channels(int i, Hessian hessian, StageQp& qp) const noexcept {
  const int ns = capacity_.states, width = ns + control_counts_[i];
  const auto move = [](double& from, double& to) {
    to = from;
    from = 0.0;
  };
  for (int c = 0; c < channels_; ++c) {
    const int control = control_of_channel(i, c);
    if (control < 0) continue;
    double *F = qp.F(i), *H = qp.H(i);
    for (int r = 0; r < nx_; ++r) move(F[r * stride_ + nx_ + c], F[r * stride_ + ns + control]);
    if (hessian != Hessian::exact) continue;
    for (int r = 0; r < width; ++r) move(H[r * stride_ + nx_ + c], H[r * stride_ + ns + control]);
    for (int k = 0; k < width; ++k) move(H[(nx_ + c) * stride_ + k], H[(ns + control) * stride_ + k]);
  }
}

/// From the model's rows to the program's, whatever is carried.
void HorizonProblem::scatter(int i, const double* jacobian, const double* hessian, StageQp& qp) const noexcept {
  const int ns = capacity_.states, nz = nx_ + np_ + nu_ + (any_ramp_ ? np_ : 0);
  const auto column_of = [&](int z) {
    if (z < nx_) return z;
    if (z >= nx_ + np_ && z < nx_ + np_ + nu_) return column_of_input(i, z - nx_ - np_);
    const bool end = z >= nx_ + np_ + nu_;
    const int parameter = z - nx_ - (end ? np_ + nu_ : 0), control = control_of_channel(i, parameter);
    // A jump is seen by the whole interval; of a ramp, only the end is new.
    return control >= 0 && (end || ramp_[parameter] == 0) ? ns + control : nx_ + parameter;
  };
  for (int r = 0; r < nx_; ++r)
    for (int z = 0; z < nz; ++z) qp.F(i)[r * stride_ + column_of(z)] += jacobian[r * row_ + z];
  if (!hessian) return;
  for (int r = 0; r < nz; ++r)
    for (int z = 0; z < nz; ++z) qp.H(i)[column_of(r) * stride_ + column_of(z)] += hessian[r * row_ + z];
}

void HorizonProblem::fill_bounds(const Iterate& point, StageRange range, StageQp& qp) const noexcept {
  const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(range.first) * stride_,
                       count = static_cast<std::ptrdiff_t>(range.last - range.first + 1) * stride_;
  program_kernels().write_bounds(lower_.data() + first, upper_.data() + first, point.row(range.first),
                                 qp.lower(range.first), qp.upper(range.first), count);
  if (range.first == 0 && initial_state())
    for (int j = 0; j < capacity_.states; ++j) qp.initial_step()[j] = initial_state()[j] - point.state(0)[j];
}

}  // namespace rhec
