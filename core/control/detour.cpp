#include <algorithm>
#include <cmath>
#include <numbers>

#include "detour.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/control/controller.hpp"
#include "rhec/core/term/term_functions.hpp"

// A vehicle that stands where its path goes on. If it looks away from the path, and no plan turns it, its reference
// becomes a way back (Approach); if limits keep it from going on, the path backwards (Retreat).

namespace rhec {
namespace {

// A plan that covers less than this share of the path's way, and turns by less than this, is one to stand.
constexpr double standing_share = 0.1, standing_turn = 0.1;  // [1], [rad]
// A path that goes on by less than this share of what it is at its top speed has come to its stop.
constexpr double least_wanted = 0.01;
// It is so because the vehicle looks away from the path, and not because something is in its way, from this angle on.
constexpr double away = 0.25 * std::numbers::pi;

// Arcs to turn around on are wider by this factor again each time that the vehicle has not arrived, up to a limit.
constexpr double wider_again = 1.3, most_margin = 3.0;
// Going back is slower than turning around by this factor, and is done so many times in a row.
constexpr double retreat_share = 0.5;
constexpr int most_retreats = 3;
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
    } else if (radius < Detour::arc_margin * tightest.radius) {
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

/// Where the path stops there is a speed, too [m/s].
double detour_speed(const Path& path, double arc_length) noexcept {
  return std::max(std::abs(path.point_at(arc_length).speed), least_turning_share * path.top_speed());
}

}  // namespace

/// Where the vehicle is on the path, or on what it drives in place of it.
double Controller::arc_length() const noexcept {
  const Detour& detour = *detour_;
  return detour.approach.is_under_way()  ? detour.approach.arc_length()
         : detour.retreat.is_under_way() ? detour.retreat.arc_length()
                                         : follower_.arc_length();
}

double Controller::arc_length_after(double arc_length, double time, int& segment) const noexcept {
  const Detour& detour = *detour_;
  return detour.approach.is_under_way()  ? detour.approach.arc_length_after(arc_length, time)
         : detour.retreat.is_under_way() ? detour.retreat.arc_length_after(arc_length, time)
                                         : path_.arc_length_after(arc_length, time, segment);
}

PathPoint Controller::point_at(double arc_length, int& segment) const noexcept {
  const Detour& detour = *detour_;
  return detour.approach.is_under_way()  ? detour.approach.point_at(path_, arc_length)
         : detour.retreat.is_under_way() ? detour.retreat.point_at(path_, arc_length)
                                         : path_.point_at(arc_length, segment);
}

/// Moves on with the vehicle on its detour. False: it is on none, has come to its end, or does not get along.
bool Controller::goes_on_detour(const Estimate& estimate) noexcept {
  Detour& detour = *detour_;
  if (!detour.is_under_way()) return false;
  const Roles& roles = vehicle_->description().roles;
  const double x = estimate.state[roles.position_x], y = estimate.state[roles.position_y],
               heading = estimate.state[roles.heading];
  const bool turns = detour.approach.is_under_way();
  const double before = arc_length();
  turns ? detour.approach.advance(x, y, heading) : detour.retreat.advance(path_, x, y, heading);
  const double after = turns ? detour.approach.arc_length() : detour.retreat.arc_length();
  const double least = least_wanted * setup_.interval * path_.top_speed();
  const bool gets_along = std::abs(after - before) > least * pace_ || pace_ == 0.0;
  detour.stalled = gets_along ? 0.0 : detour.stalled + setup_.interval;
  if (detour.is_under_way() && detour.stalled < patience) return true;
  if (turns) {
    const bool has_arrived = detour.approach.has_arrived();
    if (has_arrived) follower_.reset(detour.approach.target());
    detour.margin = has_arrived ? Detour::arc_margin : std::min(detour.margin * wider_again, most_margin);
  } else {
    follower_.reset(after);
    has_plan_ = false;  // it leads back
  }
  detour.approach.end();
  detour.retreat.end();
  detour.stalled = 0.0;
  return false;
}

/// Whether the plan is to stand for its first intervals, where the reference goes on, and does not turn.
bool Controller::plans_to_stand(int intervals) const noexcept {
  const Roles& roles = vehicle_->description().roles;
  const double share = static_cast<double>(intervals) / problem_.intervals();
  const double *from = point_.state(0), *to = point_.state(intervals);
  const double way =
      std::hypot(to[roles.position_x] - from[roles.position_x], to[roles.position_y] - from[roles.position_y]);
  const double wanted = std::abs(arc_lengths_[static_cast<std::size_t>(intervals)] - arc_lengths_[0]);
  const double least = least_wanted * intervals * setup_.interval * path_.top_speed() * pace_;
  const double turn = roles.heading < 0 ? 0.0 : std::abs(to[roles.heading] - from[roles.heading]);
  return wanted > least && way < standing_share * wanted && turn < share * standing_turn;
}

/// What a command says of that. Of the first sample in which it stands, facing away, nothing is said of the latter: a
/// way back is looked for.
void Controller::note_standing(const Health& health) noexcept {
  Detour& detour = *detour_;
  is_lost_ = health.level == HealthLevel::lost;
  command_.turns_around = detour.approach.is_under_way();
  command_.goes_back = detour.retreat.is_under_way();
  // A plan may be to drive on later, in each sample anew.
  detour.rested = plans_to_stand(1) ? detour.rested + setup_.interval : 0.0;
  command_.stands = plans_to_stand(problem_.intervals()) || detour.rested > patience;
  const bool stands = command_.stands && vehicle_->description().roles.heading >= 0 && !detour.retreat.is_under_way();
  detour.standing = stands ? detour.standing + setup_.interval : 0.0;
  if (!stands) detour.searched = 0.0;
  if (follower_.arc_length() > detour.regained) detour.retreats = 0;
  const bool faces_away = stands && std::abs(command_.heading_error) > away;
  command_.faces_away = faces_away && (!setup_.turns_around || is_lost_ || detour.searched > 0.0);
}

/// Whether the way back keeps the limits of terms, soft ones, too, as well as the vehicle does now. Changes references.
bool Controller::approach_keeps_limits(double time) noexcept {
  if (limit_values_.empty()) return true;
  const int N = problem_.intervals(), nx = problem_.model().state_count(), nu = vehicle_->input_count();
  const Approach& approach = detour_->approach;
  bool is_first = true;
  for (double at = approach.arc_length(); at < approach.target();) {
    set_reference(at, problem_.given_parameters(), time);
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < nu; ++j)
        scratch_[static_cast<std::size_t>(i) * nu + j] = held_state_[j] < 0 ? input_reference(i, j) : 0.0;
    problem_.structure().set_decisions(relaxed_plan_, scratch_.data(), problem_.given_parameters());
    for (int i = 0; i <= N; ++i) std::copy_n(problem_.state_reference(i), nx, relaxed_plan_.state(i));
    problem_.evaluate_limits(relaxed_plan_, limit_values_.data(), scratch_);
    if (is_first) find_excess(0, detour_->excess_now);
    is_first = false;
    find_excess(N, detour_->excess_ahead);
    for (std::size_t l = 0; l < detour_->excess_now.size(); ++l)
      if (!(detour_->excess_ahead[l] <= detour_->excess_now[l] + limit_rounding)) return false;
    const double next = approach.arc_length_after(at, N * setup_.interval);
    if (!(next > at)) break;
    at = next;
    time += N * setup_.interval;
  }
  return true;
}

/// Begins a detour from the next sample on, where the vehicle stands and is to have one. Changes references.
void Controller::look_for_detour() noexcept {
  Detour& detour = *detour_;
  if (!setup_.turns_around || detour.standing == 0.0) return;
  // Who does not know where the vehicle heads will know better soon, mostly; if not, it is motion that tells.
  if (is_lost_ && detour.standing < patience) return;
  const bool faces_away = std::abs(command_.heading_error) > away;
  // One that does not face away may stand for a moment only.
  if (!faces_away && detour.standing < again) return;
  // For one that stands there is what there was.
  if (detour.searched > 0.0 && detour.standing - detour.searched < again) return;
  detour.searched = detour.standing;
  if (!(faces_away && turn_around()) && !go_back()) return;
  // The plan is one to stand.
  has_plan_ = false;
  detour.standing = detour.searched = detour.rested = 0.0;
}

/// Begins a way back to the path, as tight as the vehicle can turn. False: there is none.
bool Controller::turn_around() noexcept {
  const ModelDescription& about = vehicle_->description();
  const double speed = detour_speed(path_, follower_.arc_length());
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
    const Approach::Turn found = tightest_turn(problem_, relaxed_plan_, speed, sense, detour_->margin);
    const bool is_faster = found.radius < (1.0 + tighter) * best.radius && found.speed > best.speed;
    if (found.radius < (1.0 - tighter) * best.radius || is_faster) best = found;
  }
  const double* const state = problem_.given_state();
  const Pose pose{state[about.roles.position_x], state[about.roles.position_y], state[about.roles.heading]};
  Approach& approach = detour_->approach;
  if (!approach.begin(path_, follower_.section(), follower_.arc_length(), pose, best)) return false;
  if (approach_keeps_limits(now_)) return true;
  approach.end();
  return false;
}

/// Begins a retreat. False: there is none, or it would help nobody: one that waits for an obstacle stands where it is.
bool Controller::go_back() noexcept {
  Detour& detour = *detour_;
  if (obstacle_count_ > 0 || detour.retreats == most_retreats) return false;
  const double speed = retreat_share * detour_speed(path_, follower_.arc_length());
  if (!detour.retreat.begin(path_, follower_.section(), follower_.arc_length(), speed, command_.heading_error))
    return false;
  // A vehicle that does not drive backwards, by its bounds, does not.
  const double* const state = problem_.given_state();
  const Roles& roles = vehicle_->description().roles;
  const double sense = points_[0].in_reverse ? -1.0 : 1.0;
  set_reference(detour.retreat.arc_length(), problem_.given_parameters(), now_);
  problem_.finish(scratch_);  // with the bounds of this reference
  for (int i = 0; i < problem_.intervals(); ++i)
    for (int j = 0; j < vehicle_->input_count(); ++j)
      scratch_[static_cast<std::size_t>(i) * vehicle_->input_count() + j] =
          std::min(std::max(input_reference(i, j), input_lower(j)), input_upper(j));
  simulate(relaxed_plan_);
  double least = 0.0;
  for (int i = 1; i <= problem_.intervals(); ++i) {
    const double* const there = relaxed_plan_.state(i);
    const double ahead = (there[roles.position_x] - state[roles.position_x]) * std::cos(state[roles.heading]) +
                         (there[roles.position_y] - state[roles.position_y]) * std::sin(state[roles.heading]);
    least = std::min(least, sense * ahead);
  }
  if (!(-least > standing_share * speed * setup_.interval)) {
    detour.retreat.end();
    return false;
  }
  detour.retreats++;
  detour.regained = follower_.arc_length() + speed * problem_.intervals() * setup_.interval;
  return true;
}

}  // namespace rhec
