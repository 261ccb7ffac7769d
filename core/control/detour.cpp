#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "detour.hpp"
#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/control/controller.hpp"
#include "rhec/core/term/term_functions.hpp"

// A vehicle that stands where its path goes on. If it looks away from the path, and no plan turns it, its reference
// becomes a way back (Approach), or a turn in several moves where there is no room for one (MultiPointTurn); if limits
// keep it from going on otherwise, the path backwards (Retreat).

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
constexpr int most_retreats = 3, most_turns = 6;
// It does so with no more than this lateral acceleration [m/s^2], so slowly that it turns by no more than this while it
// steers [rad], and at this share of the path's top speed where the path stops.
constexpr double turning_acceleration = 1.0, turn_while_steering = 0.5, least_turning_share = 0.3;
// A vehicle that is lost turns around after it has stood for so long, and gives up a way on which it has not moved on
// for so long [s].
constexpr double patience = 5.0;
// Where there is no way back, one is looked for again after so long [s].
constexpr double again = 1.0;
// A move of a turn in several ones turns by more than this, until the vehicle looks away by no more than that; all of
// them together turn by no more than this [rad].
constexpr double least_move = 0.1, most_rotation = 1.5 * std::numbers::pi;
// What is off by this share of its typical magnitude and grows by more than this factor is not steady.
constexpr double small_change = 1e-3, steady_growth = 1.05;
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
TurningCircle turn_in_trial(const RhcProblem& problem, const Iterate& trial, double speed, double sense,
                            double margin) noexcept {
  const Roles& roles = problem.model().description().roles;
  TurningCircle tightest{.radius = infinity};
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
  tightest.steering = reached;
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

/// Whether the path, where the vehicle is on it, leads against its heading.
bool goes_in_reverse(const PathFollower& follower) noexcept {
  return follower.path().point_at(follower.arc_length()).in_reverse;
}

/// Of a vehicle with a heading, against the path itself [rad].
double heading_error(const PathFollower& follower, double heading) noexcept {
  return angle_difference(heading, follower.path().point_at(follower.arc_length()).heading);
}

}  // namespace

/// Where the vehicle is on the path, or on what it drives in place of it.
double Controller::arc_length() const noexcept {
  const DetourWay* const way = detour_->way();
  return way ? way->arc_length() : follower_.arc_length();
}

double Controller::arc_length_after(double arc_length, double time, int& segment) const noexcept {
  const DetourWay* const way = detour_->way();
  return way ? way->arc_length_after(arc_length, time) : path_.arc_length_after(arc_length, time, segment);
}

PathPoint Controller::point_at(double arc_length, int& segment) const noexcept {
  const DetourWay* const way = detour_->way();
  return way ? way->point_at(path_, arc_length) : path_.point_at(arc_length, segment);
}

/// Moves on with the vehicle on its detour. False: it is on none, has come to its end, or does not get along.
bool Controller::goes_on_detour(const Estimate& estimate) noexcept {
  Detour& detour = *detour_;
  DetourWay* const way = detour.way();
  if (!way) return false;
  const Roles& roles = vehicle_->description().roles;
  const Pose vehicle{estimate.state[roles.position_x], estimate.state[roles.position_y], estimate.state[roles.heading]};
  const double before = way->arc_length();
  if (way->advance(path_, vehicle, setup_.interval)) has_plan_ = false;
  const double least = least_wanted * setup_.interval * path_.top_speed();
  const bool gets_along = std::abs(way->arc_length() - before) > least * pace_ || pace_ == 0.0 || way->waits();
  detour.stalled = gets_along ? 0.0 : detour.stalled + setup_.interval;
  // A turn in moves on which the vehicle is stuck is planned anew.
  if (way->is_under_way() && (way == &detour.turn || detour.stalled < patience)) return true;
  if (const std::optional<double> place = way->goes_on_at(path_, vehicle.x, vehicle.y)) follower_.reset(*place);
  if (way->has_arrived())
    detour.margin = Detour::arc_margin;
  else if (way == &detour.approach)
    detour.margin = std::min(detour.margin * wider_again, most_margin);
  if (way != &detour.approach) has_plan_ = false;  // it leads back
  way->end();
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
  const DetourWay* const way = detour.way();
  command_.turns_around = way && way != &detour.retreat;
  command_.goes_back = way && way->point_at(path_, way->arc_length()).in_reverse != goes_in_reverse(follower_);
  // A plan may be to drive on later, in each sample anew: a way on is looked for soon.
  detour.rested = plans_to_stand(1) ? detour.rested + setup_.interval : 0.0;
  command_.stands = plans_to_stand(problem_.intervals()) || detour.rested > patience;
  const bool stands = (command_.stands || detour.rested > again) && vehicle_->description().roles.heading >= 0 &&
                      (!way || way == &detour.approach);
  detour.standing = stands ? detour.standing + setup_.interval : 0.0;
  if (!stands) detour.searched = 0.0;
  if (follower_.arc_length() > detour.regained) {
    detour.turns = detour.retreats = 0;
    detour.least_off = std::numbers::pi;
  }
  const bool faces_away = stands && std::abs(command_.heading_error) > away;
  command_.faces_away = faces_away && command_.stands && (!setup_.turns_around || is_lost_ || detour.searched > 0.0);
}

/// How far the reference, from one place to another, keeps the limits of terms, soft ones, too, and the path's room as
/// well as the vehicle does now, which is where a detour begins (`is_begin`). Changes references.
double Controller::limits_kept_until(double from, double to, double time, bool is_begin) noexcept {
  const int N = problem_.intervals(), nx = problem_.model().state_count(), nu = vehicle_->input_count();
  Detour& detour = *detour_;
  for (double at = from; at < to;) {
    set_reference(at, problem_.given_parameters(), time);
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < nu; ++j)
        scratch_[static_cast<std::size_t>(i) * nu + j] = held_state_[j] < 0 ? input_reference(i, j) : 0.0;
    problem_.structure().set_decisions(relaxed_plan_, scratch_.data(), problem_.given_parameters());
    for (int i = 0; i <= N; ++i) std::copy_n(problem_.state_reference(i), nx, relaxed_plan_.state(i));
    if (is_begin && !limit_values_.empty()) {
      // The first node has no limits of states, which are given: those of the second one, at the same place.
      place_terms(1, 0, time);
      std::copy_n(problem_.state_reference(0), nx, relaxed_plan_.state(1));
      problem_.evaluate_limits(relaxed_plan_, limit_values_.data(), scratch_);
      find_excess(1, detour.excess_now);
      place_terms(1, 1, time);
      std::copy_n(problem_.state_reference(1), nx, relaxed_plan_.state(1));
    }
    if (!limit_values_.empty()) problem_.evaluate_limits(relaxed_plan_, limit_values_.data(), scratch_);
    for (int i = 0; i <= N; ++i) {
      find_excess(i, detour.excess_ahead);
      bool is_kept = true;
      for (std::size_t l = 0; l < detour.excess_now.size(); ++l)
        is_kept = is_kept && detour.excess_ahead[l] <= detour.excess_now[l] + limit_rounding;
      if (detour.turn.is_under_way()) {
        const double beyond = beyond_room(path_, detour.turn.beside(path_, points_[i].x, points_[i].y));
        if (is_begin && i == 0) detour.beyond_now = beyond;
        is_kept = is_kept && beyond <= detour.beyond_now + limit_rounding;
      }
      if (!is_kept) return i > 0 ? arc_lengths_[i - 1] : at;
    }
    is_begin = false;
    // At no pace the reference stays: of what follows nothing is known.
    if (!(arc_lengths_[N] > at)) return at;
    at = arc_lengths_[N];
    time += N * setup_.interval;
  }
  return to;
}

/// Begins a detour from the next sample on, where the vehicle stands and is to have one, or is stuck on its turn in
/// several moves. Changes references.
void Controller::look_for_detour() noexcept {
  Detour& detour = *detour_;
  if (!setup_.turns_around) return;
  const bool is_stuck = detour.turn.is_under_way() && detour.stalled >= again;
  const bool faces_away = std::abs(command_.heading_error) > away;
  if (!is_stuck) {
    if (detour.standing == 0.0) return;
    // Who does not know where the vehicle heads will know better soon, mostly; if not, it is motion that tells.
    if (is_lost_ && detour.standing < patience) return;
    // One that does not face away may stand for a moment only, and on its way round for as long as that may last.
    if (!faces_away && (detour.standing < again || detour.approach.is_under_way())) return;
    // For one that stands there is what there was.
    if (detour.searched > 0.0 && detour.standing - detour.searched < again) return;
    detour.searched = detour.standing;
  }
  const Roles& roles = vehicle_->description().roles;
  const double* const state = problem_.given_state();
  if (is_stuck) follower_.reset(detour.turn.beside(path_, state[roles.position_x], state[roles.position_y]).arc_length);
  if (std::abs(heading_error(follower_, state[roles.heading])) < detour.least_off - least_move)
    detour.turns = detour.retreats = 0;
  if (is_stuck) {
    // It does not get to the end of a move: from where it is, there are others.
    detour.margin = std::min(detour.margin * wider_again, most_margin);
    if (!turn_in_moves()) detour.turn.end();
  } else if (!(faces_away && turn_around()) && !((faces_away || obstacle_count_ == 0) && turn_in_moves()) &&
             !go_back()) {
    return;
  }
  // The plan is one to stand.
  has_plan_ = false;
  detour.standing = detour.searched = detour.rested = detour.stalled = 0.0;
}

/// The tightest turn forwards (sense 1) or in reverse (-1), within the bounds of the last reference, of a vehicle that
/// is where it is, at no more than a speed [m/s].
TurningCircle Controller::tightest_turn(double speed, double sense) noexcept {
  const ModelDescription& about = vehicle_->description();
  const int nu = vehicle_->input_count();
  TurningCircle best{.radius = infinity};
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
    const TurningCircle found = turn_in_trial(problem_, relaxed_plan_, speed, sense, detour_->margin);
    const bool is_faster = found.radius < (1.0 + tighter) * best.radius && found.speed > best.speed;
    if (found.radius < (1.0 - tighter) * best.radius || is_faster) best = found;
  }
  return best;
}

/// Begins a way back to the path, as tight as the vehicle can turn. False: there is none.
bool Controller::turn_around() noexcept {
  const double speed = detour_speed(path_, follower_.arc_length());
  const TurningCircle turn = tightest_turn(speed, goes_in_reverse(follower_) ? -1.0 : 1.0);
  const Roles& roles = vehicle_->description().roles;
  const double* const state = problem_.given_state();
  const Pose pose{state[roles.position_x], state[roles.position_y], state[roles.heading]};
  Approach& approach = detour_->approach;
  if (!approach.begin(path_, follower_.section(), follower_.arc_length(), pose, turn)) return false;
  if (!(limits_kept_until(approach.arc_length(), approach.target(), now_, true) < approach.target())) return true;
  approach.end();
  return false;
}

/// Whether what a state is off by stays as small, within the horizon, where the vehicle is driven straight ahead as by
/// its last reference: a trailer folds in reverse.
bool Controller::is_steady() noexcept {
  const ModelDescription& about = vehicle_->description();
  const int N = problem_.intervals(), nx = vehicle_->state_count(), nu = vehicle_->input_count();
  double* const given = problem_.given_state();
  std::swap_ranges(given, given + nx, problem_.state_reference(0));
  const auto drive = [&] {
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < nu; ++j) scratch_[static_cast<std::size_t>(i) * nu + j] = input_reference(i, j);
    simulate(relaxed_plan_);
    return relaxed_plan_.state(N);
  };
  std::vector<double>& undisturbed = detour_->undisturbed;
  std::copy_n(drive(), nx, undisturbed.data());
  bool is_steady = true;
  for (int k = 0; k < nx && is_steady; ++k) {
    if (k == about.roles.position_x || k == about.roles.position_y) continue;
    const auto at = static_cast<std::size_t>(k);
    const double is = given[k], off = small_change * about.states[at].scale;
    given[k] = is + off;
    is_steady = std::abs(drive()[k] - undisturbed[at]) < steady_growth * off;
    given[k] = is;
  }
  std::swap_ranges(given, given + nx, problem_.state_reference(0));
  return is_steady;
}

/// Begins a turn in several moves, until the vehicle is aligned with the path, within limits and room. False: there is
/// none, or it has helped nobody.
bool Controller::turn_in_moves() noexcept {
  Detour& detour = *detour_;
  if (detour.turns == most_turns) return false;
  const double speed = retreat_share * detour_speed(path_, follower_.arc_length());
  const Roles& roles = vehicle_->description().roles;
  const double* const state = problem_.given_state();
  MultiPointTurn::Begin begin{.vehicle = {state[roles.position_x], state[roles.position_y], state[roles.heading]},
                              .forwards = {},
                              .backwards = {},
                              .section = follower_.section(),
                              .arc_length = follower_.arc_length()};
  const double error = heading_error(follower_, state[roles.heading]);
  MultiPointTurn best;
  double least = infinity;
  for (const bool in_reverse : {false, true}) {
    // Bounds of inputs are those of a reference that leads this way.
    begin.in_reverse = in_reverse;
    TurningCircle& turn = in_reverse ? begin.backwards : begin.forwards;
    turn = {.radius = 1.0, .speed = speed};
    detour.turn.begin(begin);
    detour.turn.add(std::numbers::pi);
    set_reference(0.0, problem_.given_parameters(), now_);
    problem_.finish(scratch_);
    turn = is_steady() ? tightest_turn(speed, in_reverse ? -1.0 : 1.0) : TurningCircle{.radius = infinity};
  }
  for (const int rotation : {1, -1}) {
    for (const bool in_reverse : {false, true}) {
      begin.rotation = rotation;
      begin.in_reverse = in_reverse;
      detour.turn.begin(begin);
      double left = -rotation * error;
      if (left < 0.0) left += 2.0 * std::numbers::pi;
      if (left > most_rotation) continue;
      while (left > least_move && detour.turn.add(left)) {
        const double from = detour.turn.last_start(), from_time = detour.turn.last_start_time();
        detour.turn.end_last_at(
            limits_kept_until(from, detour.turn.length(), now_ + from_time, detour.turn.moves() == 1));
        if (!(detour.turn.last_angle() > least_move)) break;
        left -= detour.turn.last_angle();
      }
      if (left > least_move || !(detour.turn.time() < least)) continue;
      least = detour.turn.time();
      best = detour.turn;
    }
  }
  detour.turn = best;
  detour.turn.set_off();
  if (!detour.turn.is_under_way()) return false;
  detour.turns++;
  detour.note_place(error, follower_.arc_length() + speed * problem_.intervals() * setup_.interval);
  return true;
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
  const double sense = goes_in_reverse(follower_) ? -1.0 : 1.0;
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
  detour.note_place(command_.heading_error, follower_.arc_length() + speed * problem_.intervals() * setup_.interval);
  return true;
}

}  // namespace rhec
