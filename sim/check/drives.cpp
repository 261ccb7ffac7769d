// The drives used to check a model.
#include "drives.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

namespace rhec::sim {
namespace {

constexpr double heading = 0.5;  // of the drives [rad]; not along an axis

bool is_role(const Roles& roles, int state) {
  const auto& others = roles.other_headings;
  return state == roles.position_x || state == roles.position_y || state == roles.heading ||
         std::find(others.begin(), others.end(), state) != others.end();
}

double clamped(const Variable& v, double value) { return std::clamp(value, v.lower, v.upper); }

}  // namespace

Drives::Drives(const CheckedModel& checked)
    : checked_(checked),
      about_(checked.about),
      nx_(checked.model.state_count()),
      nu_(checked.model.input_count()),
      np_(checked.model.parameter_count()),
      ny_(checked.model.output_count()),
      intervals_(std::min(checked.options.horizon, ModelCheckOptions::longest_horizon)),
      motion_(checked.model) {
  for (const Variable& p : about_.parameters) {
    const double middle = 0.5 * (p.lower + p.upper);
    parameters_.push_back(std::isfinite(middle) ? middle : std::clamp(p.nominal, p.lower, p.upper));
  }
  const auto typical = typical_speed(checked);
  makes_speed_ = typical.has_value();
  speed_ = checked.options.speed.value_or(typical.value_or(1.0));
  find_blocks();
}

std::vector<Drive> Drives::all() {
  std::vector<Drive> drives;
  for (const CourseName& course : courses) drives.push_back(drive(course));
  return drives;
}

void Drives::find_blocks() {
  const Window window{0, intervals_};
  std::vector<std::uint8_t> begins(intervals_);
  for (int j = 0; j < np_; ++j) {
    std::fill(begins.begin(), begins.end(), 0);
    const Blocking* blocking = checked_.options.blockings.empty() ? nullptr : checked_.options.blockings[j].get();
    if (blocking && blocking->why_not(intervals_).empty()) blocking->starts(window, begins.data());
    std::vector<int> unknown;
    std::vector<bool> ramp;
    for (int i = 0; i < intervals_; ++i) {
      if (i == 0 || begins[i]) blocks_.parameter_of.push_back(j);
      unknown.push_back(static_cast<int>(blocks_.parameter_of.size()) - 1);
      ramp.push_back(i > 0 && begins[i] && blocking->transition() == Transition::ramp);
    }
    blocks_.unknown.push_back(std::move(unknown));
    blocks_.ramp.push_back(std::move(ramp));
  }
}

Eigen::VectorXd Drives::base_inputs(Course course, Vector& state) const {
  Vector inputs = Vector::Zero(nu_);
  const double speed = course == Course::standing ? 0.0 : speed_;
  checked_.model.straight_motion(speed, parameters_.data(), state.data(), inputs.data());
  for (int j = 0; j < nu_; ++j)
    if (std::isfinite(inputs[j])) inputs[j] = clamped(about_.inputs[j], inputs[j]);
  return inputs;
}

Eigen::VectorXd Drives::excitation(const Vector& base) const {
  Vector change = Vector::Zero(nu_);
  int driving = 0;
  for (int j = 0; j < nu_; ++j) driving += base[j] != 0.0;
  for (int j = 0, seen = 0; j < nu_; ++j) {
    const Variable& v = about_.inputs[j];
    if (base[j] != 0.0) {
      if (driving > 1) change[j] = 0.2 * std::abs(base[j]) * (seen++ % 2 == 0 ? 1.0 : -1.0);
      continue;
    }
    const double up = v.upper - base[j], down = base[j] - v.lower;
    change[j] = 0.5 * (up > 0.0 ? std::min(v.scale, up) : -std::min(v.scale, down));
  }
  return change;
}

double Drives::excess(const Vector& x) const {
  double sum = 0.0;
  for (int j = 0; j < nx_; ++j) {
    if (is_role(about_.roles, j)) continue;
    const Variable& v = about_.states[j];
    const bool bounded = std::isfinite(v.lower) && std::isfinite(v.upper);
    const double middle = bounded ? 0.5 * (v.lower + v.upper) : 0.0;
    double half = bounded ? 0.25 * (v.upper - v.lower) : v.scale;
    // A speed that the drive begins with is none that it is driven too far to.
    const double off = std::abs(start_[j] - middle);
    if (off >= half) half = bounded ? std::min(off + half, 0.5 * (v.upper - v.lower)) : off + half;
    sum += std::max(0.0, std::abs(x[j] - middle) - half) / v.scale;
  }
  return sum;
}

Eigen::VectorXd Drives::moved(const Vector& x, const Vector& u) const {
  Vector next(nx_);
  checked_.model.integrate({.count = 1,
                            .states = x.data(),
                            .inputs = u.data(),
                            .parameters = parameters_.data(),
                            .durations = &checked_.options.interval,
                            .substeps = checked_.substeps,
                            .next_states = next.data()});
  return next;
}

Eigen::VectorXd Drives::inputs_at(Course course, int k, const Vector& x, const Vector& base,
                                  const Vector& change) const {
  if (course == Course::straight || course == Course::standing) return base;
  // The slalom goes left and right once over the horizon, with twice the amplitude of the steady turn.
  const double phase = course == Course::turn ? 1.0 : 2.0 * std::cos(2.0 * std::numbers::pi * (k + 0.5) / intervals_);
  Vector inputs = base;
  for (int j = 0; j < nu_; ++j) {
    Vector tried = inputs;
    tried[j] = clamped(about_.inputs[j], base[j] + phase * change[j]);
    if (excess(moved(x, tried)) <= excess(moved(x, inputs))) inputs = tried;
  }
  return inputs;
}

Drive Drives::drive(const CourseName& named) {
  Drive made;
  made.name = named.name;
  const bool moves = makes_speed_ && named.course != Course::standing;
  made.meaning = fmt::format("{}{}", named.meaning, moves ? fmt::format(" at {:.3g} m/s", speed_) : "");
  const std::vector<double> start = state_in_line(checked_, heading);
  Vector x = Eigen::Map<const Vector>(start.data(), nx_);
  const Vector base = base_inputs(named.course, x);
  if (!base.allFinite() || !x.allFinite()) {
    made.unusable = "straight_motion is not finite";
    return made;
  }
  start_ = x;
  const Vector change = excitation(base);
  // A turn becomes steady after a while.
  if (named.course == Course::turn)
    for (int k = 0; k < intervals_; ++k) x = moved(x, inputs_at(named.course, k, x, base, change));
  made.states.resize(nx_, intervals_ + 1);
  made.inputs.resize(nu_, intervals_);
  for (int k = 0; k < intervals_; ++k) {
    made.states.col(k) = x;
    made.inputs.col(k) = inputs_at(named.course, k, x, base, change);
    made.jacobians.push_back(jacobian(x, made.inputs.col(k), k));
    x = moved(x, made.inputs.col(k));
  }
  made.states.col(intervals_) = x;
  observe(made);
  bool finite = made.states.allFinite() && made.outputs.allFinite();
  for (const Matrix& each : made.jacobians) finite = finite && each.allFinite();
  for (const Matrix& each : made.motion_jacobians) finite = finite && each.allFinite();
  for (const Matrix& each : made.output_jacobians) finite = finite && each.allFinite();
  if (!finite) made.unusable = "states, outputs or derivatives along it are not finite";
  return made;
}

Eigen::MatrixXd Drives::jacobian(const Vector& x, const Vector& u, int interval) const {
  bool ramp = false;
  for (int j = 0; j < np_; ++j) ramp = ramp || blocks_.ramp[j][interval];
  Matrix found = Matrix::Constant(nx_, nx_ + nu_ + (ramp ? 2 : 1) * np_, std::nan(""));
  checked_.model.integrate({.count = 1,
                            .states = x.data(),
                            .inputs = u.data(),
                            .parameters = parameters_.data(),
                            .parameters_end = ramp ? parameters_.data() : nullptr,
                            .durations = &checked_.options.interval,
                            .substeps = checked_.substeps,
                            .jacobians = found.data()});
  return found;
}

void Drives::observe(Drive& made) const {
  made.outputs.setConstant(ny_, intervals_ + 1, std::nan(""));
  for (int k = 0; k <= intervals_; ++k) {
    Matrix by_state = Matrix::Constant(ny_, nx_, std::nan(""));
    checked_.model.observe({.count = 1,
                            .states = made.states.col(k).data(),
                            .outputs = made.outputs.col(k).data(),
                            .jacobians = by_state.data()});
    made.output_jacobians.push_back(std::move(by_state));
  }
  const int nm = motion_.count();
  for (int k = 0; k < intervals_; ++k) {
    Vector values(nm);
    Matrix slopes(nm, nx_ + nu_ + np_);
    motion_.evaluate({.count = 1,
                      .states = made.states.col(k + 1).data(),
                      .inputs = made.inputs.col(k).data(),
                      .parameters = parameters_.data(),
                      .outputs = values.data(),
                      .jacobians = slopes.data()});
    // The first node has no interval that ends there.
    for (int m = 0; m < nm; ++m)
      for (int node = k == 0 ? 0 : k + 1; node <= k + 1; ++node) made.outputs(motion_.which()[m], node) = values[m];
    made.motion_jacobians.push_back(std::move(slopes));
  }
}

}  // namespace rhec::sim
