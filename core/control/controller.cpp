#include "rhec/core/control/controller.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "detour.hpp"
#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/control/input_rate_model.hpp"
#include "rhec/core/control/slip_ahead_model.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"

namespace rhec {
namespace {

// A heading whose standard deviation is larger does not count in the search for the vehicle's place [rad].
constexpr double known_heading = 0.5;
// A vehicle that is beyond hard limits is no faster than its reference by more than this factor.
constexpr double most_haste = 1.25;
// A sum of violations of hard limits that is none; by how much the price of violations rises from sample to sample, and
// how high it becomes, relative to the objective.
constexpr double violated = 1e-4, price_rise = 1.5, highest_price = 1e3;

bool is_finite(const Obstacle& it) noexcept {
  const double numbers[] = {it.x,       it.y,          it.semi_axis_along, it.semi_axis_across,
                            it.heading, it.velocity_x, it.velocity_y};
  return std::ranges::all_of(numbers, [](double number) { return std::isfinite(number); });
}

double finite_size(double value) noexcept { return std::isfinite(value) ? std::abs(value) : 0.0; }

double first_price(const Report& report) noexcept { return 1.0 + finite_size(report.objective); }

bool is_done(Status status) noexcept { return status == Status::solved || status == Status::step_taken; }

/// The sum by which a plan violates hard limits, from their values.
double hard_violation(const RhcProblem& problem, const double* values) noexcept {
  double sum = 0.0;
  for (int i = 0; i <= problem.intervals(); ++i, values += problem.capacity().limit_row()) {
    const double *lower = problem.limit_lower(i), *upper = problem.limit_upper(i);
    for (int r = 0; r < problem.limit_count(i); ++r)
      if (problem.is_hard_limit(i, r)) sum += std::max({0.0, lower[r] - values[r], values[r] - upper[r]});
  }
  return sum;
}

/// The problem's state that holds an input whose rate has a weight or bounds, or -1.
std::vector<int> find_held_states(const Model& model, const Controller::Setup& setup) {
  const ModelDescription& about = model.description();
  const std::size_t nu = about.inputs.size();
  for (const auto* each : {&setup.rate_weights, &setup.rate_lower, &setup.rate_upper})
    if (!each->empty() && each->size() != nu)
      throw Error(fmt::format("controller: rates: {} numbers; expected {}, one for each input", each->size(), nu));
  std::vector<int> held(nu, -1);
  auto next = static_cast<int>(about.states.size());
  for (std::size_t j = 0; j < nu; ++j) {
    const double weight = setup.rate_weights.empty() ? 0.0 : setup.rate_weights[j];
    const double lower = setup.rate_lower.empty() ? -infinity : setup.rate_lower[j];
    const double upper = setup.rate_upper.empty() ? infinity : setup.rate_upper[j];
    if (!(weight >= 0.0) || !std::isfinite(weight))
      throw Error(fmt::format("controller: the weight {} of the rate of '{}'; expected a finite number of at least 0",
                              weight, about.inputs[j].name));
    if (!(lower <= 0.0) || !(upper >= 0.0))
      throw Error(
          fmt::format("controller: bounds [{}, {}] of the rate of '{}'; expected 0 between them, since an input "
                      "must be able to stay as it is",
                      lower, upper, about.inputs[j].name));
    if (weight > 0.0 || std::isfinite(lower) || std::isfinite(upper)) held[j] = next++;
  }
  return held;
}

/// Moves weights, bounds and blocks of inputs that are states to where the problem of an InputRateModel has them.
RhcProblem::Setup with_rates(RhcProblem::Setup problem, const Controller::Setup& setup, const std::vector<int>& held,
                             const ModelDescription& about) {
  const auto bounds_of = [](std::vector<double>& lower, std::vector<double>& upper,
                            const std::vector<Variable>& variables) {
    if (lower.empty())
      for (const Variable& variable : variables) lower.push_back(variable.lower);
    if (upper.empty())
      for (const Variable& variable : variables) upper.push_back(variable.upper);
  };
  bounds_of(problem.state_lower, problem.state_upper, about.states);
  bounds_of(problem.input_lower, problem.input_upper, about.inputs);
  for (std::size_t j = 0; j < held.size(); ++j) {
    if (held[j] < 0) continue;
    const int input = static_cast<int>(j);
    problem.rates.push_back({input, held[j]});
    problem.state_weights.push_back(problem.input_weights[j]);
    problem.terminal_weights.push_back(problem.input_weights[j]);
    problem.state_lower.push_back(problem.input_lower[j]);
    problem.state_upper.push_back(problem.input_upper[j]);
    problem.input_weights[j] = setup.rate_weights.empty() ? 0.0 : setup.rate_weights[j];
    problem.input_lower[j] = setup.rate_lower.empty() ? -infinity : setup.rate_lower[j];
    problem.input_upper[j] = setup.rate_upper.empty() ? infinity : setup.rate_upper[j];
    std::erase(problem.blocked_inputs, input);
  }
  return problem;
}

RhcProblem make_problem(std::shared_ptr<const Model> model, const Controller::Setup& setup,
                        const std::vector<int>& held) {
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
  std::vector<int> rated;
  for (std::size_t j = 0; j < held.size(); ++j)
    if (held[j] >= 0) rated.push_back(static_cast<int>(j));
  if (rated.empty()) return {std::move(model), setup.problem};
  RhcProblem::Setup problem = with_rates(setup.problem, setup, held, model->description());
  return {std::make_shared<InputRateModel>(std::move(model), std::move(rated)), std::move(problem)};
}

}  // namespace

Controller::Controller(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Path path, Setup setup)
    : setup_(std::move(setup)),
      vehicle_(std::move(model)),
      held_state_(find_held_states(*vehicle_, setup_)),
      path_(std::move(path)),
      follower_(path_, setup_.search),
      detour_(std::make_unique<Detour>()),
      problem_(make_problem(vehicle_, setup_, held_state_)),
      solver_(std::move(solver)),
      shifter_(problem_),
      point_(problem_.capacity()),
      relaxed_plan_(problem_.capacity()) {
  if (const std::string& reason = path_.why_not_drivable(); !reason.empty()) throw Error(reason);
  const Setup::Pace& pace = setup_.pace;
  const auto is_share = [](double each) { return each >= 0.0 && each <= 1.0; };
  if (!(is_share(pace.degraded) && is_share(pace.lost) && is_share(pace.heading) && pace.seconds > 0.0))
    throw Error(
        fmt::format("controller: paces {}, {} and {} within {} s; expected shares of the speed from 0 to 1, and a "
                    "positive time",
                    pace.degraded, pace.lost, pace.heading, pace.seconds));
  const int N = setup_.problem.max_intervals;
  problem_.set_intervals(N);
  begins_.assign(N, 0);
  points_.resize(static_cast<std::size_t>(N) + 1);
  arc_lengths_.assign(points_.size(), 0.0);
  for (int i = 0; i < N; ++i) problem_.set_duration(i, setup_.interval);
  // Move blocking is counted from the start of the horizon, so it is the same in every sample.
  for (std::size_t b = 0; b < setup_.blockings.size(); ++b) {
    const int input = setup_.problem.blocked_inputs[b];
    setup_.blockings[b]->starts({0, N}, begins_.data());
    problem_.set_blocks(input, begins_.data());
    // Within a block an input that is a state does not change.
    for (int i = 1; held_state_[input] >= 0 && i < N; ++i)
      if (!begins_[i]) problem_.input_lower(i, input) = problem_.input_upper(i, input) = 0.0;
  }
  if (const TermFunctions* terms = problem_.terms().functions()) {
    obstacles_.resize(static_cast<std::size_t>(terms->most_obstacles()));
    obstacle_distances_.resize(obstacles_.size());
  }
  scratch_.assign(problem_.scratch_size(), 0.0);
  problem_.finish(scratch_);
  if (const std::string reason = solver_->why_not(problem_); !reason.empty())
    throw Error("controller: the solver cannot take this problem: " + reason);
  solver_->setup(problem_);
  const Model& vehicle = *vehicle_;
  command_.inputs.assign(vehicle.input_count(), 0.0);
  detour_->forget();
  detour_->undisturbed.assign(static_cast<std::size_t>(vehicle.state_count()), 0.0);
  if (const TermFunctions* terms = problem_.terms().functions(); terms && terms->limit_count() > 0) {
    for (auto* excess : {&command_.violations, &detour_->excess_now, &detour_->excess_ahead})
      excess->assign(static_cast<std::size_t>(terms->limit_count()), 0.0);
    limit_values_.assign((static_cast<std::size_t>(N) + 1) * problem_.capacity().limit_row(), 0.0);
  }
  last_inputs_.assign(vehicle.input_count(), std::numeric_limits<double>::quiet_NaN());
  const auto nx = static_cast<std::size_t>(vehicle.state_count()), nu = static_cast<std::size_t>(vehicle.input_count());
  for (std::vector<double>* motion : {&straight_, &slipless_, &largest_, &smallest_}) motion->assign(nx + nu, 0.0);
  nominal_parameters_ = nominal_values(vehicle.description().parameters);
  reference_parameters_ = ahead_parameters_ = nominal_parameters_;
  go_straight(1.0, nominal_parameters_.data(), slipless_);
  for (std::size_t j = 0; j < nu; ++j) drives_.push_back(slipless_[nx + j] != 0.0);
  if (std::all_of(slipless_.begin(), slipless_.end(), [](double value) { return value == 0.0; }))
    throw Error(fmt::format(
        "controller: the model '{}' does not say what drives it straight ahead; it cannot follow a path: give an "
        "input or a state the role 'speed', or the model its straight motion (docs/equations.md)",
        vehicle.description().name));
}

Controller::~Controller() = default;

void Controller::reset() noexcept {
  solver_->reset();
  shifter_.forget();
  follower_.reset();
  locate();
  has_plan_ = prepared_ = false;
  is_finished_ = true;
  fallbacks_ = 0;
  command_.report = {};
  problem_.terms().set_price(std::numeric_limits<double>::infinity());
  obstacle_count_ = 0;
  pace_ = wanted_pace_ = 1.0;
  std::fill(last_inputs_.begin(), last_inputs_.end(), std::numeric_limits<double>::quiet_NaN());
}

void Controller::locate() noexcept {
  is_located_ = false;
  detour_->forget();
}

void Controller::locate(double arc_length) noexcept {
  locate();
  is_located_ = std::isfinite(arc_length);
  if (is_located_) follower_.reset(arc_length);
}

void Controller::applied(const double* inputs) noexcept {
  for (std::size_t j = 0; j < last_inputs_.size(); ++j)
    if (!std::isnan(inputs[j])) last_inputs_[j] = inputs[j];
}

/// How close an obstacle comes to the last plan, or to where the vehicle is on the path, in a circle about it [m].
double Controller::distance_from_plan(const Obstacle& obstacle) const noexcept {
  const Roles& roles = vehicle_->description().roles;
  const double radius = std::max(obstacle.semi_axis_along, obstacle.semi_axis_across);
  if (!has_plan_) {
    const PathPoint point = path_.point_at(follower_.arc_length());
    return std::hypot(obstacle.x - point.x, obstacle.y - point.y) - radius;
  }
  double least = std::numeric_limits<double>::infinity(), since = now_ - seen_;
  for (int i = 0; i <= problem_.intervals(); ++i) {
    const double* state = point_.state(i);
    const double x = obstacle.x + since * obstacle.velocity_x, y = obstacle.y + since * obstacle.velocity_y;
    least = std::min(least, std::hypot(x - state[roles.position_x], y - state[roles.position_y]));
    if (i < problem_.intervals()) since += problem_.duration(i);
  }
  return least - radius;
}

int Controller::set_obstacles(std::span<const Obstacle> obstacles, double time) noexcept {
  obstacle_count_ = 0;
  seen_ = std::isfinite(time) ? time : now_;
  const std::size_t room = obstacles_.size();
  for (Obstacle obstacle : obstacles) {
    // One of which nobody knows when it was there is taken to stay there.
    if (!std::isfinite(time)) obstacle.velocity_x = obstacle.velocity_y = 0.0;
    if (!is_finite(obstacle) || room == 0) continue;
    const double distance = obstacles.size() > room ? distance_from_plan(obstacle) : 0.0;
    if (obstacle_count_ == room) {
      const auto farthest = std::ranges::max_element(obstacle_distances_);
      if (!(distance < *farthest)) continue;
      // In the order in which they were given, so that rows stay those of the same ones.
      const auto k = farthest - obstacle_distances_.begin();
      std::copy(farthest + 1, obstacle_distances_.end(), farthest);
      std::copy(obstacles_.begin() + k + 1, obstacles_.end(), obstacles_.begin() + k);
      --obstacle_count_;
    }
    obstacle_distances_[obstacle_count_] = distance;
    obstacles_[obstacle_count_++] = obstacle;
  }
  return static_cast<int>(obstacle_count_);
}

void Controller::plan_inputs(int interval, double* inputs) const noexcept {
  problem_.structure().inputs_on(point_, interval, inputs);
  for (std::size_t j = 0; j < held_state_.size(); ++j)
    if (const int held = held_state_[j]; held >= 0)
      inputs[j] = point_.state(interval)[held] + problem_.duration(interval) * inputs[j];
}

double Controller::input_reference(int interval, int input) const noexcept {
  const int held = held_state_[input];
  return held < 0 ? problem_.input_reference(interval)[input] : problem_.state_reference(interval + 1)[held];
}

double Controller::input_lower(int input) const noexcept {
  const int held = held_state_[input];
  return held < 0 ? problem_.input_lower(0, input) : problem_.setup().state_lower[held];
}

double Controller::input_upper(int input) const noexcept {
  const int held = held_state_[input];
  return held < 0 ? problem_.input_upper(0, input) : problem_.setup().state_upper[held];
}

/// Writes the speeds among the states, then the inputs.
void Controller::go_straight(double ground_speed, const double* parameters, std::vector<double>& motion) noexcept {
  const Model& vehicle = *vehicle_;
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

/// The same with inputs that keep their bounds.
void Controller::choose_straight_motion_within_bounds(double ground_speed) noexcept {
  choose_straight_motion(ground_speed, ahead_parameters_.data());
  const int nx = vehicle_->state_count(), nu = vehicle_->input_count();
  for (int j = 0; j < nu; ++j)
    straight_[nx + j] = std::min(std::max(straight_[nx + j], input_lower(j)), input_upper(j));
}

/// Where the vehicle shall be at each node of a horizon that starts at an arc length.
void Controller::find_points(double arc_length) noexcept {
  int segment = reference_segment_;
  points_[0] = point_at(arc_length, segment);
  arc_lengths_[0] = arc_length;
  reference_segment_ = segment;
  points_[0].speed *= pace_;
  const int N = problem_.intervals();
  const double change = setup_.interval / setup_.pace.seconds;
  double pace = pace_, behind = 0.0;  // time on the path that a slower pace has lost
  for (int i = 1; i <= N; ++i) {
    const double last = pace;
    pace += std::min(std::max(wanted_pace_ - pace, -change), change);
    behind += (1.0 - 0.5 * (last + pace)) * setup_.interval;
    segment = reference_segment_;
    const double there = arc_length_after(arc_length, i * setup_.interval - behind, segment);
    points_[i] = point_at(there, segment);
    points_[i].speed *= pace;
    arc_lengths_[i] = there;
  }
}

/// The pace moves on by one interval towards what an estimate's health allows.
void Controller::choose_pace(const Health& health) noexcept {
  const bool is_starting = (health.reasons & reason::starting) != 0;
  const bool is_heading_sought = (health.reasons & reason::heading) != 0;
  wanted_pace_ = is_starting || health.level == HealthLevel::ok ? 1.0
                 : health.level == HealthLevel::degraded        ? setup_.pace.degraded
                 : is_heading_sought                            ? std::max(setup_.pace.heading, setup_.pace.lost)
                                                                : setup_.pace.lost;
  const double change = setup_.interval / setup_.pace.seconds;
  pace_ += std::min(std::max(wanted_pace_ - pace_, -change), change);
  command_.pace = pace_;
}

/// References and bounds of the horizon that starts at an arc length of the path.
void Controller::set_reference(double arc_length, const double* parameters, double time) noexcept {
  const Model& vehicle = *vehicle_;
  const Roles& roles = vehicle.description().roles;
  const int N = problem_.intervals(), nx = vehicle.state_count(), nu = vehicle.input_count();
  find_points(arc_length);
  bound_speed();
  double chosen_speed = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i <= N; ++i) {
    if (i == 0 || (setup_.ahead && i < N)) {
      const int np = vehicle.parameter_count();
      for (int j = 0; j < np; ++j)
        ahead_parameters_[j] = parameters[j] + (setup_.ahead ? problem_.interval_data(i)[j] : 0.0);
      chosen_speed = std::numeric_limits<double>::quiet_NaN();
    }
    const auto choose = [&](double speed) {
      if (speed == chosen_speed) return;
      chosen_speed = speed;
      choose_straight_motion_within_bounds(speed);
    };
    const PathPoint& target = points_[i];
    choose(target.speed);
    double* x = problem_.state_reference(i);
    std::copy_n(straight_.data(), nx, x);
    roles.place(target.x, target.y, target.heading, x);
    place_terms(i, i, time);
    if (i < N) choose(0.5 * (target.speed + points_[i + 1].speed));
    for (int j = 0; j < nu && i < N; ++j) {
      // The inputs on an interval are states at its end.
      const int held = held_state_[j];
      (held < 0 ? problem_.input_reference(i)[j] : problem_.state_reference(i + 1)[held]) = straight_[nx + j];
    }
  }
}

/// Says to the terms of a node what is at a point of the reference. Their limits are beside the path, also where the
/// reference is a way back to it, or backwards.
void Controller::place_terms(int node, int point, double time) noexcept {
  const DetourWay* const way = detour_->way();
  const PathPoint& target = points_[point];
  const double along = way ? way->path_beside(path_, arc_lengths_[point]) : arc_lengths_[point];
  const PathPoint place = way ? path_.point_at(along) : target;
  problem_.terms().place(node, {.time = time + point * setup_.interval,
                                .x = place.x,
                                .y = place.y,
                                .heading = place.heading + (place.in_reverse ? std::numbers::pi : 0.0),
                                .speed = target.speed,
                                .arc_length = along,
                                .left = place.left,
                                .right = place.right,
                                .obstacles = {obstacles_.data(), obstacle_count_},
                                .seen = seen_});
}

/// The inputs applied last, which are given states where their rates count.
void Controller::write_held_inputs() noexcept {
  for (std::size_t j = 0; j < held_state_.size(); ++j) {
    const int held = held_state_[j];
    if (held < 0) continue;
    const double last = last_inputs_[j];
    problem_.given_state()[held] = std::isfinite(last) ? last : problem_.state_reference(1)[held];
  }
}

/// Writes how slip changes from where the vehicle is to the intervals of the horizon, at the places where it shall be.
void Controller::look_ahead(double arc_length, const double* parameters) noexcept {
  if (!setup_.ahead) return;
  int segment = reference_segment_;
  const PathPoint start = point_at(arc_length, segment);
  const std::array here{start.x, start.y};
  for (int i = 0; i < problem_.intervals(); ++i) {
    // At the middle of the interval, for which the slip holds.
    segment = reference_segment_;
    const double place = arc_length_after(arc_length, (i + 0.5) * setup_.interval, segment);
    const PathPoint point = point_at(place, segment);
    const double way = place - arc_length;
    const std::array there{point.x, point.y};
    setup_.ahead->change(here.data(), there.data(), way, parameters, problem_.interval_data(i));
  }
}

/// Bounds the inputs that drive straight ahead further, by those for the fastest reference of the horizon without slip,
/// in the directions that it goes. Where it only stands, forwards is one of them.
void Controller::bound_speed() noexcept {
  double fastest = 0.0, least = 0.0, most = 0.0;
  for (const PathPoint& point : points_) {
    fastest = std::max(fastest, std::abs(point.speed));
    least = std::min(least, point.speed);
    most = std::max(most, point.speed);
  }
  double bound = setup_.speed_bound_factor * fastest + setup_.speed_bound_offset;
  if (!std::isfinite(bound)) return;
  // Nor does a vehicle race back to within its limits.
  if (command_.report.status == Status::relaxed) bound = std::min(bound, most_haste * fastest);
  const double forwards = most > 0.0 || least == 0.0 ? bound : 0.0, in_reverse = least < 0.0 ? -bound : 0.0;
  if (forwards == bounded_forwards_ && in_reverse == bounded_in_reverse_) return;
  bounded_forwards_ = forwards;
  bounded_in_reverse_ = in_reverse;
  go_straight(forwards, nominal_parameters_.data(), largest_);
  go_straight(in_reverse, nominal_parameters_.data(), smallest_);
  const int nx = vehicle_->state_count(), nu = vehicle_->input_count();
  for (int i = 0; i < problem_.intervals(); ++i) {
    for (int j = 0; j < nu; ++j) {
      const auto [lower, upper] = std::minmax({0.0, smallest_[nx + j], largest_[nx + j]});
      if (lower == 0.0 && upper == 0.0) continue;
      // Within the input's own bounds.
      const int held = held_state_[j];
      const RhcProblem::Setup& own = problem_.setup();
      const double least_own = held >= 0 ? own.state_lower[held] : own.input_lower[j];
      const double most_own = held >= 0 ? own.state_upper[held] : own.input_upper[j];
      const auto within = [&](double speed) { return std::min(std::max(speed, least_own), most_own); };
      if (held >= 0) {
        problem_.set_state_bounds(held, within(lower), within(upper));
        continue;
      }
      problem_.input_lower(i, j) = within(lower);
      problem_.input_upper(i, j) = within(upper);
    }
  }
}

/// Simulates the vehicle with the inputs that `scratch_` holds by interval, as far as their bounds and those of their
/// rates let them follow.
void Controller::simulate(Iterate& point) noexcept {
  const int nu = vehicle_->input_count();
  for (int j = 0; j < nu; ++j) {
    if (held_state_[j] < 0) continue;
    double held = problem_.given_state()[held_state_[j]];
    for (int i = 0; i < problem_.intervals(); ++i) {
      double& input = scratch_[static_cast<std::size_t>(i) * nu + j];
      const double dt = problem_.duration(i), rate = (input - held) / dt;
      input = std::min(std::max(rate, problem_.input_lower(i, j)), problem_.input_upper(i, j));
      held += dt * input;
    }
  }
  problem_.structure().set_decisions(point, scratch_.data(), problem_.given_parameters());
  point.clear_multipliers();
  roll_out(problem_, point, scratch_);
}

/// Cold start: the reference inputs, rolled out.
void Controller::start_cold() noexcept {
  const int nu = vehicle_->input_count();
  for (int i = 0; i < problem_.intervals(); ++i)
    for (int j = 0; j < nu; ++j) scratch_[static_cast<std::size_t>(i) * nu + j] = input_reference(i, j);
  simulate(point_);
}

/// Another start, where no plan is found from that: the vehicle comes to a stop.
void Controller::start_at_rest() noexcept {
  choose_straight_motion_within_bounds(0.0);
  const int nx = vehicle_->state_count(), nu = vehicle_->input_count();
  for (int i = 0; i < problem_.intervals(); ++i)
    std::copy_n(straight_.data() + nx, nu, scratch_.data() + static_cast<std::ptrdiff_t>(i) * nu);
  simulate(point_);
}

/// Calls the solver and takes the command from its plan. False if there is no usable plan.
bool Controller::find_plan(Clock::time_point deadline) noexcept {
  command_.report = solver_->feedback(point_, deadline);
  if (!is_usable(command_.report.status)) return false;
  plan_inputs(0, command_.inputs.data());
  // No solver should return such a command, and none must reach the robot.
  const bool is_number =
      std::all_of(command_.inputs.begin(), command_.inputs.end(), [](double value) { return std::isfinite(value); });
  if (!is_number) command_.report.status = Status::bad_input;
  return is_number;
}

/// Looks for a plan from another guess. Where neither keeps hard limits, it is the one that violates them least.
bool Controller::find_better(bool is_found, void (Controller::*start)() noexcept, Clock::time_point deadline) noexcept {
  if (is_found) {
    solver_->finish(point_, command_.report);
    is_found = is_usable(command_.report.status);
  }
  const double violation = is_found ? plan_violation() : 0.0;
  if (is_found) relaxed_plan_ = point_;
  const Report first = command_.report;
  (this->*start)();
  const bool is_better = find_plan(deadline) && (!is_found || plan_violation() <= violation);
  if (!is_better && is_found) {
    point_ = relaxed_plan_;
    command_.report = first;
    plan_inputs(0, command_.inputs.data());
  }
  command_.report.fallback_used = true;
  return is_better || is_found;
}

/// Where hard limits cannot be kept, as outside a corridor, their violation has a price, an l1 penalty (Nocedal &
/// Wright 2006, section 17.2), until a plan keeps them: a vehicle that a solver has no plan for does not come back.
bool Controller::find_at_a_price(bool is_found, Clock::time_point deadline) noexcept {
  if (limit_values_.empty()) return is_found;
  HorizonTerms& terms = problem_.terms();
  if (std::isinf(terms.price())) {
    if (is_found || command_.report.status == Status::bad_input) return is_found;
    terms.set_price(first_price(command_.report));
    if (std::isinf(terms.price()) || is_past(deadline)) return false;
    start_cold();
    is_found = find_plan(deadline);
    command_.report.fallback_used = true;
  }
  if (is_found && is_done(command_.report.status) && plan_violation() > violated)
    command_.report.status = Status::relaxed;
  return is_found;
}

/// What violations of hard limits cost at the next sample, once the plan's limits have been evaluated. A low price
/// leads to better minima; it rises until it is an exact one.
void Controller::choose_price() noexcept {
  HorizonTerms& terms = problem_.terms();
  const double price = terms.price();
  const Status status = command_.report.status;
  if (std::isinf(price) && (is_done(status) || status == Status::relaxed)) return;
  const double violation = hard_violation(problem_, limit_values_.data());
  if (violation <= violated) {
    terms.set_price(std::numeric_limits<double>::infinity());
  } else if (std::isinf(price)) {
    terms.set_price(first_price(command_.report));
  } else {
    const double most = highest_price * (1.0 + finite_size(command_.report.objective - price * violation));
    terms.set_price(std::max(price, std::min(price_rise * price, most)));
  }
}

/// What is applied keeps the bounds, whatever a solver says.
void Controller::keep_within_bounds() noexcept {
  for (std::size_t k = 0; k < command_.inputs.size(); ++k) {
    const int j = static_cast<int>(k), held = held_state_[k];
    double& input = command_.inputs[k];
    double lower = problem_.input_lower(0, j), upper = problem_.input_upper(0, j);
    if (held >= 0) {
      // Bounds of rates come first: an input that was applied beyond its bounds returns as fast as it may.
      const double last = problem_.given_state()[held], dt = problem_.duration(0);
      const double least = last + dt * lower, most = last + dt * upper;
      lower = std::min(std::max(problem_.setup().state_lower[held], least), most);
      upper = std::max(std::min(problem_.setup().state_upper[held], most), least);
    }
    input = std::min(std::max(input, lower), upper);
    // A vehicle that stands because it is lost does not correct what it believes to be its place.
    if (pace_ == 0.0 && wanted_pace_ == 0.0 && drives_[k]) input = std::min(std::max(0.0, lower), upper);
    last_inputs_[k] = input;
  }
}

/// Moves along the path with the vehicle. At first its place may be anywhere; a heading counts where it is known.
void Controller::find_place(const Estimate& estimate) noexcept {
  const Roles& roles = vehicle_->description().roles;
  const double x = estimate.state[roles.position_x], y = estimate.state[roles.position_y];
  if (goes_on_detour(estimate)) return;
  if (!is_located_ && std::isfinite(x) && std::isfinite(y)) {
    double heading = std::numeric_limits<double>::quiet_NaN();
    if (roles.heading >= 0 && std::isfinite(estimate.state[roles.heading])) {
      const bool has_covariance = estimate.covariance.rows() > roles.heading;
      const double variance = has_covariance ? estimate.covariance(roles.heading, roles.heading) : 0.0;
      if (!(variance > known_heading * known_heading)) heading = estimate.state[roles.heading];
    }
    follower_.locate(x, y, heading);
    is_located_ = true;
  }
  follower_.advance(x, y);
}

const Controller::Command& Controller::control(const Estimate& estimate, Clock::time_point deadline) noexcept {
  finish();
  const int nx = vehicle_->state_count(), np = vehicle_->parameter_count();
  find_place(estimate);
  std::copy_n(estimate.state.data(), nx, problem_.given_state());
  std::copy_n(estimate.parameters.data(), np, problem_.given_parameters());
  // What is prepared is linearised with the slip that was expected then.
  if (!prepared_) look_ahead(arc_length(), estimate.parameters.data());
  now_ = estimate.time;
  choose_pace(estimate.health);
  set_reference(arc_length(), estimate.parameters.data(), now_);
  command_.reference = points_[0];
  const int heading = vehicle_->description().roles.heading;
  command_.heading_error = heading >= 0 ? angle_difference(estimate.state[heading], command_.reference.heading) : 0.0;
  write_held_inputs();
  command_.relaxed = problem_.finish(scratch_) > 0;
  bool from_plan = has_plan_;
  if (!has_plan_) {
    start_cold();
  } else if (!prepared_) {
    from_plan = shifter_.apply(1, problem_, point_);
    if (!from_plan) start_cold();
  }
  bool is_found = find_plan(deadline);
  if (from_plan) {
    // The last plan may be a bad guess, e.g. after a jump of the estimate: try a simulation instead.
    if (!is_found || command_.report.status == Status::relaxed)
      is_found = find_better(is_found, &Controller::start_cold, deadline);
  } else if (!limit_values_.empty() && (!is_found || command_.report.status == Status::relaxed)) {
    // Straight ahead leads over limits, to where no plan may be near that keeps them.
    is_found = find_better(is_found, &Controller::start_at_rest, deadline);
  }
  is_found = find_at_a_price(is_found, deadline);
  command_.fallback = !is_found;
  fallbacks_ += command_.fallback;
  prepared_ = false;
  has_plan_ = is_found || from_plan;
  if (!is_found) {
    // Continue the last plan, which the shifter still has; without one, go straight ahead along the path.
    if (!from_plan || !shifter_.apply(1, problem_, point_)) {
      start_cold();
    } else {
      // Its inputs, from where the vehicle is: the limits that they keep are not those of the plan as it was.
      roll_out(problem_, point_, scratch_);
      if (!is_finite(problem_, point_)) shifter_.apply(1, problem_, point_);
    }
    plan_inputs(0, command_.inputs.data());
  }
  note_standing(estimate.health);
  keep_within_bounds();
  RHEC_ASSERT(all_finite(command_.inputs), "a command is finite");
  is_finished_ = false;
  return command_;
}

/// Work that the robot need not wait for: assess and keep the plan before the problem changes to the next sample.
void Controller::finish() noexcept {
  if (is_finished_) return;
  is_finished_ = true;
  solver_->finish(point_, command_.report);
  if (!limit_values_.empty()) {
    // Of the limits that the vehicle meets next, whose data are still those of this sample.
    problem_.evaluate_limits(point_, limit_values_.data(), scratch_);
    find_excess(1, command_.violations);
    if (!command_.fallback) choose_price();
  }
  if (has_plan_) {
    shifter_.take(problem_, point_);
    if (!command_.fallback) has_plan_ = is_finite(problem_, point_);
  }
  look_for_detour();
}

double Controller::plan_violation() noexcept {
  problem_.evaluate_limits(point_, limit_values_.data(), scratch_);
  return hard_violation(problem_, limit_values_.data());
}

/// By limit, how far the values that have been evaluated are beyond it up to a node, at most; 0: they keep it.
void Controller::find_excess(int last, std::vector<double>& most) const noexcept {
  std::fill(most.begin(), most.end(), 0.0);
  const HorizonTerms& terms = problem_.terms();
  for (int i = 0; i <= last; ++i) {
    const TermFunctions::Rows* rows = terms.rows(i, problem_.intervals(), true);
    const double* values = limit_values_.data() + static_cast<std::ptrdiff_t>(i) * problem_.capacity().limit_row();
    for (int r = 0; rows && r < rows->limits; ++r) {
      const int limit = rows->first_limit + r;
      const double beyond = std::max(terms.lower(i)[limit] - values[r], values[r] - terms.upper(i)[limit]);
      double& known = most[static_cast<std::size_t>(limit)];
      known = std::max(known, beyond);
    }
  }
}

void Controller::prepare() noexcept {
  finish();
  if (!has_plan_ || prepared_) return;
  // Prediction of the next sample: the plan's second node, and the reference one step further on.
  const int nx = problem_.model().state_count(), np = problem_.model().parameter_count();
  std::copy_n(point_.state(1), nx, problem_.given_state());
  std::copy_n(problem_.given_parameters(), np, reference_parameters_.data());
  int segment = reference_segment_;
  const double next = arc_length_after(arc_length(), setup_.interval, segment);
  look_ahead(next, reference_parameters_.data());
  set_reference(next, reference_parameters_.data(), now_ + setup_.interval);
  problem_.finish(scratch_);
  if (!shifter_.apply(1, problem_, point_)) return;
  solver_->prepare(point_);
  prepared_ = true;
}

}  // namespace rhec
