#include <algorithm>
#include <cmath>
#include <numbers>

#include "approach.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/control/controller.hpp"
#include "rhec/core/term/term_functions.hpp"

// A vehicle that looks away from its path, and that no plan turns: its reference becomes a way back (Approach).

namespace rhec {
namespace {

// A plan that covers less than this share of the path's way, and turns by less than this, is one to stand.
constexpr double standing_share = 0.1, standing_turn = 0.1;  // [1], [rad]
// It is so because the vehicle looks away from the path, and not because something is in its way, from this angle on.
constexpr double away = 0.25 * std::numbers::pi;

// A vehicle turns around on arcs that are wider than the tightest by this factor, so that it can correct what it does;
// by this factor wider again each time that it has not arrived, up to a limit.
constexpr double arc_margin = 1.15, wider_again = 1.3, most_margin = 3.0;
// It does so with no more than this lateral acceleration [m/s^2], so slowly that it turns by no more than this while it
// steers [rad], and at this share of the path's top speed where the path stops.
constexpr double turning_acceleration = 1.0, turn_while_steering = 0.5, least_turning_share = 0.3;
// A vehicle that is lost turns around after it has stood for so long, and gives up a way on which it has not moved on
// for so long [s].
constexpr double patience = 5.0;
// Where there is no way back, one is looked for again after so long [s].
constexpr double again = 1.0;
// What is not tighter by this share is as tight.
constexpr double tighter = 1e-3;
// Of inputs that are tried for it every one is at its least, its straight or its largest value; of more than this many,
// one at a time.
constexpr int most_combined_inputs = 4;
// How far an input is tried from what drives straight ahead, in typical magnitudes: not all have bounds.
constexpr double most_tried = 3.0;
// By so much more a limit is kept as well.
constexpr double limit_rounding = 1e-6;

/// How a vehicle turns in a trial, as far as it keeps its bounds, and forwards (sense 1) or in reverse (-1) at no more
/// than a speed: on arcs that are wider by `margin`.
Approach::Turn tightest_turn(const RhcProblem& problem, const Iterate& trial, double speed, double sense,
                             double margin) noexcept {
  const Roles& roles = problem.model().description().roles;
  Approach::Turn tightest{.radius = infinity};
  double time = 0.0, reached = 0.0;
  for (int i = 0; i < problem.intervals(); ++i) {
    const double *from = trial.state(i), *to = trial.state(i + 1), dt = problem.duration(i);
    bool is_within = true;
    for (int k = 0; k < problem.state_count(i + 1); ++k)
      is_within = is_within && to[k] >= problem.state_lower(i + 1)[k] && to[k] <= problem.state_upper(i + 1)[k];
    if (!is_within) break;
    time += dt;
    const double turn = std::abs(to[roles.heading] - from[roles.heading]), half = 0.5 * turn;
    const double middle = 0.5 * (to[roles.heading] + from[roles.heading]);
    const double chord = sense * (std::cos(middle) * (to[roles.position_x] - from[roles.position_x]) +
                                  std::sin(middle) * (to[roles.position_y] - from[roles.position_y]));
    const double way = half > 0.0 && half < std::numbers::pi ? chord * half / std::sin(half) : -1.0;
    if (!(way >= 0.0)) continue;
    const double radius = std::max(margin * way / turn, speed * dt), there = radius * turn / dt / margin;
    if (radius < (1.0 - tighter) * tightest.radius) {
      tightest = {radius, there};
      reached = time;
    } else if (radius < arc_margin * tightest.radius) {
      // One that stands gets faster.
      tightest.speed = std::max(tightest.speed, there);
    }
  }
  tightest.speed = std::min({speed, tightest.speed, std::sqrt(turning_acceleration * tightest.radius),
                             turn_while_steering * tightest.radius / reached});
  return tightest;
}

/// Of the trials of so many inputs: whether an input keeps its straight value (0), or has its least (1) or its largest
/// one (2).
int choice_of(int trial, int input, int inputs) noexcept {
  if (inputs > most_combined_inputs) return (trial + 1) / 2 == input + 1 ? 1 + trial % 2 : 0;
  for (int j = 0; j < input; ++j) trial /= 3;
  return trial % 3;
}

int trials_of(int inputs) noexcept {
  int trials = 1;
  for (int j = 0; j < inputs; ++j) trials = inputs > most_combined_inputs ? trials + 2 : trials * 3;
  return trials;
}

}  // namespace

/// Where the vehicle is on the path, or on its way back to it.
double Controller::arc_length() const noexcept {
  return approach_->is_under_way() ? approach_->arc_length() : follower_.arc_length();
}

double Controller::arc_length_after(double arc_length, double time, int& segment) const noexcept {
  return approach_->is_under_way() ? approach_->arc_length_after(arc_length, time)
                                   : path_.arc_length_after(arc_length, time, segment);
}

PathPoint Controller::point_at(double arc_length, int& segment) const noexcept {
  return approach_->is_under_way() ? approach_->point_at(path_, arc_length) : path_.point_at(arc_length, segment);
}

void Controller::forget_approach() noexcept {
  approach_->end();
  arc_margin_ = arc_margin;
  standing_ = stalled_ = searched_ = 0.0;
}

/// Moves on with the vehicle on its way back to the path. False: it is on none, has come to its end, or does not get
/// along.
bool Controller::goes_on_approaching(const Estimate& estimate) noexcept {
  if (!approach_->is_under_way()) return false;
  const Roles& roles = vehicle_->description().roles;
  const double before = approach_->arc_length();
  approach_->advance(estimate.state[roles.position_x], estimate.state[roles.position_y], estimate.state[roles.heading]);
  const bool gets_along = approach_->arc_length() > before || pace_ == 0.0;
  stalled_ = gets_along ? 0.0 : stalled_ + setup_.interval;
  if (approach_->is_under_way() && stalled_ < patience) return true;
  const bool has_arrived = approach_->has_arrived();
  if (has_arrived) follower_.reset(approach_->target());
  approach_->end();
  stalled_ = 0.0;
  arc_margin_ = has_arrived ? arc_margin : std::min(arc_margin_ * wider_again, most_margin);
  return false;
}

/// Whether a plan neither moves nor turns a vehicle that looks away from its path.
bool Controller::stands_looking_away() const noexcept {
  const Roles& roles = vehicle_->description().roles;
  if (roles.heading < 0 || !(std::abs(command_.heading_error) > away)) return false;
  const int N = problem_.intervals();
  const double *from = point_.state(0), *to = point_.state(N);
  const double way =
      std::hypot(to[roles.position_x] - from[roles.position_x], to[roles.position_y] - from[roles.position_y]);
  const double wanted = arc_lengths_[static_cast<std::size_t>(N)] - arc_lengths_[0];
  return way < standing_share * wanted && std::abs(to[roles.heading] - from[roles.heading]) < standing_turn;
}

/// What a command says of that. Of the first sample in which it stands so nothing is said: a way back is looked for.
void Controller::note_standing(const Health& health) noexcept {
  is_lost_ = health.level == HealthLevel::lost;
  standing_ = stands_looking_away() ? standing_ + setup_.interval : 0.0;
  if (standing_ == 0.0) searched_ = 0.0;
  command_.turns_around = approach_->is_under_way();
  command_.faces_away = standing_ > 0.0 && (!setup_.turns_around || is_lost_ || searched_ > 0.0);
}

/// Whether the way back keeps the limits of terms, soft ones, too, as well as the vehicle does now. Changes references.
bool Controller::approach_keeps_limits(double time) noexcept {
  if (limit_values_.empty()) return true;
  const int N = problem_.intervals(), nx = problem_.model().state_count(), nu = vehicle_->input_count();
  bool is_first = true;
  for (double at = approach_->arc_length(); at < approach_->target();) {
    set_reference(at, problem_.given_parameters(), time);
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < nu; ++j)
        scratch_[static_cast<std::size_t>(i) * nu + j] = held_state_[j] < 0 ? input_reference(i, j) : 0.0;
    problem_.structure().set_decisions(relaxed_plan_, scratch_.data(), problem_.given_parameters());
    for (int i = 0; i <= N; ++i) std::copy_n(problem_.state_reference(i), nx, relaxed_plan_.state(i));
    problem_.evaluate_limits(relaxed_plan_, limit_values_.data(), scratch_);
    if (is_first) find_excess(0, excess_now_);
    is_first = false;
    find_excess(N, excess_ahead_);
    for (std::size_t l = 0; l < excess_now_.size(); ++l)
      if (!(excess_ahead_[l] <= excess_now_[l] + limit_rounding)) return false;
    const double next = approach_->arc_length_after(at, N * setup_.interval);
    if (!(next > at)) break;
    at = next;
    time += N * setup_.interval;
  }
  return true;
}

/// Begins a way back to the path, as tight as the vehicle can turn, from the next sample on, where it is to have one.
/// Changes references.
void Controller::look_for_way_back() noexcept {
  if (!setup_.turns_around || standing_ == 0.0) return;
  // Who does not know where the vehicle heads will know better soon, mostly; if not, it is motion that tells.
  if (is_lost_ && standing_ < patience) return;
  // For one that stands there is what there was.
  if (searched_ > 0.0 && standing_ - searched_ < again) return;
  searched_ = standing_;
  const ModelDescription& about = vehicle_->description();
  const double here = std::abs(path_.point_at(follower_.arc_length()).speed);
  const double speed = std::max(here, least_turning_share * path_.top_speed());
  const double sense = points_[0].in_reverse ? -1.0 : 1.0;
  const int nu = vehicle_->input_count();
  Approach::Turn best{.radius = infinity};
  for (int trial = 1; trial < trials_of(nu); ++trial) {
    for (int i = 0; i < problem_.intervals(); ++i) {
      for (int j = 0; j < nu; ++j) {
        const double straight = input_reference(i, j), most = most_tried * about.inputs[j].scale;
        const int choice = choice_of(trial, j, nu);
        scratch_[static_cast<std::size_t>(i) * nu + j] = choice == 0   ? straight
                                                         : choice == 1 ? std::max(input_lower(j), straight - most)
                                                                       : std::min(input_upper(j), straight + most);
      }
    }
    simulate(relaxed_plan_);
    const Approach::Turn found = tightest_turn(problem_, relaxed_plan_, speed, sense, arc_margin_);
    const bool is_faster = found.radius < (1.0 + tighter) * best.radius && found.speed > best.speed;
    if (found.radius < (1.0 - tighter) * best.radius || is_faster) best = found;
  }
  const double* const state = problem_.given_state();
  const Pose pose{state[about.roles.position_x], state[about.roles.position_y], state[about.roles.heading]};
  if (!approach_->begin(path_, follower_.section(), follower_.arc_length(), pose, best)) return;
  if (!approach_keeps_limits(now_)) return approach_->end();
  // The plan is one to stand.
  has_plan_ = false;
  standing_ = searched_ = 0.0;
}

}  // namespace rhec
