#include "rhec/core/control/controller.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/control/slip_ahead_model.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"

namespace rhec {
namespace {

RhcProblem make_problem(std::shared_ptr<const Model> model, const Controller::Setup& setup) {
  const Roles& roles = model->description().roles;
  if (roles.position_x < 0 || roles.position_y < 0)
    throw Error(
        fmt::format("controller: the model '{}' does not say which states are its position; it cannot follow a "
                    "path",
                    model->description().name));
  if (setup.blockings.size() != setup.problem.blocked_inputs.size())
    throw Error("controller: expected one blocking for each blocked input");
  for (const auto& blocking : setup.blockings)
    if (const std::string reason = blocking->why_not(setup.problem.max_intervals); !reason.empty())
      throw Error("controller: blocking: " + reason);
  if (!(setup.interval > 0.0))
    throw Error(fmt::format("controller: interval {} s; expected a positive number", setup.interval));
  if (setup.ahead) model = std::make_shared<SlipAheadModel>(std::move(model));
  return {std::move(model), setup.problem};
}

}  // namespace

Controller::Controller(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Path path, Setup setup)
    : setup_(std::move(setup)),
      path_(std::move(path)),
      follower_(path_, setup_.search),
      problem_(make_problem(std::move(model), setup_)),
      solver_(std::move(solver)),
      shifter_(problem_),
      point_(problem_.capacity()) {
  const int N = setup_.problem.max_intervals;
  problem_.set_intervals(N);
  begins_.assign(N, 0);
  for (int i = 0; i < N; ++i) problem_.set_duration(i, setup_.interval);
  // Move blocking is counted from the start of the horizon, so it is the same in every sample.
  for (std::size_t b = 0; b < setup_.blockings.size(); ++b) {
    setup_.blockings[b]->starts({0, N}, begins_.data());
    problem_.set_blocks(setup_.problem.blocked_inputs[b], begins_.data());
  }
  scratch_.assign(problem_.scratch_size(), 0.0);
  problem_.finish(scratch_);
  if (const std::string reason = solver_->why_not(problem_); !reason.empty())
    throw Error("controller: the solver cannot take this problem: " + reason);
  solver_->setup(problem_);
  const Model& vehicle = problem_.model();
  command_.inputs.assign(vehicle.input_count(), 0.0);
  const auto nx = static_cast<std::size_t>(vehicle.state_count()), nu = static_cast<std::size_t>(vehicle.input_count());
  for (std::vector<double>* motion : {&straight_, &slipless_, &largest_}) motion->assign(nx + nu, 0.0);
  nominal_parameters_ = nominal_values(vehicle.description().parameters);
  reference_parameters_ = ahead_parameters_ = nominal_parameters_;
  go_straight(1.0, nominal_parameters_.data(), slipless_);
  if (std::all_of(slipless_.begin(), slipless_.end(), [](double value) { return value == 0.0; }))
    throw Error(
        fmt::format("controller: the model '{}' does not say what drives it straight ahead; it cannot follow a path",
                    vehicle.description().name));
}

void Controller::reset() noexcept {
  solver_->reset();
  shifter_.forget();
  follower_.reset();
  has_plan_ = prepared_ = false;
  is_finished_ = true;
  fallbacks_ = 0;
}

/// Writes the speeds among the states, then the inputs.
void Controller::go_straight(double ground_speed, const double* parameters, std::vector<double>& motion) noexcept {
  const Model& vehicle = problem_.model();
  std::fill(motion.begin(), motion.end(), 0.0);
  vehicle.straight_motion(ground_speed, parameters, motion.data(), motion.data() + vehicle.state_count());
}

/// Inputs and speeds for straight motion at a ground speed, with the estimated slip as far as it is trusted.
void Controller::choose_straight_motion(double ground_speed, const double* parameters) noexcept {
  go_straight(ground_speed, nominal_parameters_.data(), slipless_);
  straight_ = slipless_;
  if (setup_.reference_speed == ReferenceSpeed::literal) return;
  go_straight(ground_speed, parameters, straight_);
  for (std::size_t j = 0; j < straight_.size(); ++j) {
    const double most = slipless_[j] / setup_.least_speed_factor;
    const bool trusted = straight_[j] * most >= 0.0 && std::abs(straight_[j]) <= std::abs(most);
    if (!trusted) straight_[j] = most;  // also if it is NaN
  }
}

/// References and bounds of the horizon that starts at an arc length of the path.
void Controller::set_reference(double arc_length, const double* parameters) noexcept {
  const Model& vehicle = problem_.model();
  const Roles& roles = vehicle.description().roles;
  const int N = problem_.intervals(), nx = vehicle.state_count(), nu = vehicle.input_count();
  int segment = reference_segment_;
  command_.reference = path_.point_at(arc_length, segment);
  reference_segment_ = segment;
  const double ground_speed = command_.reference.speed, distance = setup_.interval * std::abs(ground_speed);
  bound_speed(setup_.speed_bound_factor * std::abs(ground_speed) + setup_.speed_bound_offset);
  for (int i = 0; i <= N; ++i) {
    if (i == 0 || (setup_.ahead && i < N)) {
      const int np = vehicle.parameter_count();
      for (int j = 0; j < np; ++j)
        ahead_parameters_[j] = parameters[j] + (setup_.ahead ? problem_.interval_data(i)[j] : 0.0);
      choose_straight_motion(ground_speed, ahead_parameters_.data());
      for (int j = 0; j < nu; ++j)
        straight_[nx + j] =
            std::min(std::max(straight_[nx + j], problem_.input_lower(0, j)), problem_.input_upper(0, j));
    }
    const PathPoint target = path_.point_at(arc_length + i * distance, segment);
    double* x = problem_.state_reference(i);
    std::copy_n(straight_.data(), nx, x);
    roles.place(target.x, target.y, target.heading, x);
    if (i < N) std::copy_n(straight_.data() + nx, nu, problem_.input_reference(i));
  }
}

/// Writes how slip changes from where the vehicle is to the intervals of the horizon, at the places where it shall be.
void Controller::look_ahead(double arc_length, const double* parameters) noexcept {
  if (!setup_.ahead) return;
  int segment = reference_segment_;
  const PathPoint start = path_.point_at(arc_length, segment);
  const std::array here{start.x, start.y};
  const double distance = setup_.interval * std::abs(start.speed);
  for (int i = 0; i < problem_.intervals(); ++i) {
    const double way = (i + 0.5) * distance;  // to the middle of the interval, for which the slip holds
    const PathPoint point = path_.point_at(arc_length + way, segment);
    const std::array there{point.x, point.y};
    setup_.ahead->change(here.data(), there.data(), way, parameters, problem_.interval_data(i));
  }
}

/// Bounds the forward inputs by those for the given ground speed without slip.
void Controller::bound_speed(double most) noexcept {
  if (!std::isfinite(most) || most == bounded_speed_) return;
  bounded_speed_ = most;
  go_straight(most, nominal_parameters_.data(), largest_);
  const int nx = problem_.model().state_count(), nu = problem_.model().input_count();
  for (int i = 0; i < problem_.intervals(); ++i) {
    for (int j = 0; j < nu; ++j) {
      const double largest = largest_[nx + j];
      if (largest == 0.0) continue;
      problem_.input_lower(i, j) = std::min(0.0, largest);
      problem_.input_upper(i, j) = std::max(0.0, largest);
    }
  }
}

/// Cold start: the reference inputs, rolled out.
void Controller::start_cold() noexcept {
  const int nu = problem_.model().input_count();
  for (int i = 0; i < problem_.intervals(); ++i)
    std::copy_n(problem_.input_reference(i), nu, scratch_.data() + static_cast<std::ptrdiff_t>(i) * nu);
  problem_.structure().set_decisions(point_, scratch_.data(), problem_.given_parameters());
  point_.clear_multipliers();
  roll_out(problem_, point_, scratch_);
}

/// Calls the solver and takes the command from its plan. False if there is no usable plan.
bool Controller::find_plan(Clock::time_point deadline) noexcept {
  command_.report = solver_->feedback(point_, deadline);
  if (!is_usable(command_.report.status)) return false;
  problem_.structure().inputs_on(point_, 0, command_.inputs.data());
  // No solver should return such a command, and none must reach the robot.
  const bool is_number =
      std::all_of(command_.inputs.begin(), command_.inputs.end(), [](double value) { return std::isfinite(value); });
  if (!is_number) command_.report.status = Status::bad_input;
  return is_number;
}

const Controller::Command& Controller::control(const Estimate& estimate, Clock::time_point deadline) noexcept {
  finish();
  const Roles& roles = problem_.model().description().roles;
  const int nx = problem_.model().state_count(), np = problem_.model().parameter_count();
  follower_.advance(estimate.state[roles.position_x], estimate.state[roles.position_y]);
  std::copy_n(estimate.state.data(), nx, problem_.given_state());
  std::copy_n(estimate.parameters.data(), np, problem_.given_parameters());
  // What is prepared is linearised with the slip that was expected then.
  if (!prepared_) look_ahead(follower_.arc_length(), estimate.parameters.data());
  set_reference(follower_.arc_length(), estimate.parameters.data());
  command_.relaxed = problem_.finish(scratch_) > 0;
  bool from_plan = has_plan_;
  if (!has_plan_) {
    start_cold();
  } else if (!prepared_) {
    from_plan = shifter_.apply(1, problem_, point_);
    if (!from_plan) start_cold();
  }
  bool is_found = find_plan(deadline);
  if (!is_found && from_plan) {
    // The last plan may be a bad guess, e.g. after a jump of the estimate: try a simulation instead.
    start_cold();
    is_found = find_plan(deadline);
    command_.report.fallback_used = true;
  }
  command_.fallback = !is_found;
  fallbacks_ += command_.fallback;
  prepared_ = false;
  has_plan_ = is_found || from_plan;
  if (!is_found) {
    // Continue the last plan, which the shifter still has; without one, go straight ahead along the path.
    if (!from_plan || !shifter_.apply(1, problem_, point_)) start_cold();
    problem_.structure().inputs_on(point_, 0, command_.inputs.data());
  }
  for (std::size_t j = 0; j < command_.inputs.size(); ++j)
    command_.inputs[j] = std::min(std::max(command_.inputs[j], problem_.input_lower(0, static_cast<int>(j))),
                                  problem_.input_upper(0, static_cast<int>(j)));
  RHEC_ASSERT(all_finite(command_.inputs), "a command is finite");
  is_finished_ = false;
  return command_;
}

/// Work that the robot need not wait for: assess and keep the plan before the problem changes to the next sample.
void Controller::finish() noexcept {
  if (is_finished_) return;
  is_finished_ = true;
  solver_->finish(point_, command_.report);
  if (!has_plan_) return;
  shifter_.take(problem_, point_);
  if (!command_.fallback) has_plan_ = is_finite(problem_, point_);
}

void Controller::prepare() noexcept {
  finish();
  if (!has_plan_ || prepared_) return;
  // Prediction of the next sample: the plan's second node, and the reference one step further on.
  const int nx = problem_.model().state_count(), np = problem_.model().parameter_count();
  std::copy_n(point_.state(1), nx, problem_.given_state());
  std::copy_n(problem_.given_parameters(), np, reference_parameters_.data());
  const PathPoint reference = command_.reference;
  const double next = follower_.arc_length() + setup_.interval * std::abs(reference.speed);
  look_ahead(next, reference_parameters_.data());
  set_reference(next, reference_parameters_.data());
  command_.reference = reference;
  problem_.finish(scratch_);
  if (!shifter_.apply(1, problem_, point_)) return;
  solver_->prepare(point_);
  prepared_ = true;
}

}  // namespace rhec
