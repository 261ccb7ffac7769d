#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "rhec/core/control/path.hpp"
#include "rhec/core/control/path_follower.hpp"
#include "rhec/core/estimation/estimate.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/shift.hpp"
#include "rhec/core/place/slip_ahead.hpp"

namespace rhec {

struct Detour;
struct TurningCircle;

enum class ReferenceSpeed {
  ground,  ///< the path's speed is over ground: the wheels turn faster by the estimated slip
  literal  ///< the path's speed is the wheels' speed (as in the paper; under slip the vehicle lags and cuts corners)
};

/// Path-following controller: estimate in, input out (docs/method.md, section 3).
///
/// At the first call, and where `locate` asks for it, the vehicle's place is searched for on the whole path; from then
/// on the closest point of the path is searched for ahead of the last one. The local reference is that point and those
/// that a vehicle passes in N_c intervals from there at the path's speeds: it brakes in time for what comes, and goes
/// through stops, where it may change its direction. If the solver fails, and fails again from a simulation, the
/// plan of the last sample is continued to its last input, and the failure is counted. Without a plan the vehicle goes
/// straight ahead. Where a map knows the slip that is ahead, the plan and its reference count with it.
///
/// Rates of inputs, (u_i - u_{i-1}) / dt, can have weights and bounds, in the problem of an InputRateModel. u_{-1} is
/// the input applied last; before the first command, what drives straight ahead, unless `applied` has said what it is.
///
/// A vehicle that looks away from the path, or that limits keep from going on, goes round by arcs that it can drive,
/// turns in several moves, or goes back along the path until it is aligned (docs/paths.md).
///
/// Terms of the problem (RhcProblem::Setup) get the reference of each node, and the obstacles of `set_obstacles`.
/// Allocates in its constructor only.
class RHEC_EXPORT Controller {
 public:
  struct Setup {
    RhcProblem::Setup problem;
    double interval = 0.2;  ///< dt [s]
    ReferenceSpeed reference_speed = ReferenceSpeed::ground;
    /// Estimated speed factors below this are not trusted.
    double least_speed_factor = 0.3;
    /// The inputs that drive straight ahead are bounded between 0 and what they would be at a speed of
    /// factor * speed + offset without slip; an infinite factor leaves the model's bounds.
    double speed_bound_factor = 2.5, speed_bound_offset = 1.0;
    std::vector<std::shared_ptr<const Blocking>> blockings;  ///< one for each of problem.blocked_inputs
    std::vector<double> rate_weights;                        ///< n_u, of squared rates; empty: 0
    std::vector<double> rate_lower, rate_upper;  ///< n_u, bounds of rates [unit of the input / s]; empty: none
    PathFollower::Window search;
    bool turns_around = true;  ///< turns around, or goes back, where it cannot go on; false: it stands
    /// Share of the path's speeds while an estimate's health is not `ok`. It changes over time, so that the vehicle
    /// slows, stops on the path, and starts again. A heading is not found without motion: while it is searched for the
    /// first time all is as with `ok`, and later, where the place is known (reason::heading), the share is `heading`.
    struct Pace {
      double degraded = 0.6, lost = 0.0, heading = 0.3;
      double seconds = 3.0;  ///< from the full speed to a stop, and back [s]
    } pace = {};
    /// What slip to expect ahead; null: that of the estimate, everywhere.
    std::shared_ptr<const SlipAhead> ahead = nullptr;
  };
  /// Throws Error if the model has no position or speed to follow a path with, no vehicle can follow the path
  /// (Path::why_not_drivable), or sizes do not match.
  Controller(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Path path, Setup setup);
  Controller(const Controller&) = delete;  // the follower points into the path
  Controller& operator=(const Controller&) = delete;
  ~Controller();

  struct Command {
    std::vector<double> inputs;  ///< u_k, n_u: to be applied until the next call
    PathPoint reference;         ///< the closest point of the path
    Report report;               ///< objective and KKT residual may be missing before `finish`
    bool fallback = false;       ///< the solver failed; the last plan is continued, if there is one
    double heading_error = 0.0;  ///< heading of the estimate - that of the reference, in (-pi, pi] [rad]
    bool relaxed = false;        ///< a state bound was out of reach from the estimate and was relaxed
    double pace = 1.0;           ///< share of the path's speeds that is driven at present
    /// The vehicle faces away from the path and stands: it shall not turn around, cannot, or has no room to. It stays
    /// there until somebody turns it, or the path is another.
    bool faces_away = false;
    bool turns_around = false;  ///< the reference is a way round, or a turn in several moves
    bool goes_back = false;     ///< it leads against the path's direction: along the path, or in a move of that turn
    /// The plan covers less than a tenth of the way that it should, or has begun with standing for five seconds:
    /// something is in the way, limits leave no other, or the vehicle faces away.
    bool stands = false;
    /// By limit of the terms (TermFunctions::limit_names), how far what follows next is beyond it: the plan's first
    /// interval and the node at its end; 0: it is kept. Of this sample from `finish` on.
    std::vector<double> violations;
  };
  /// The input for an estimate. Valid until the next call.
  const Command& control(const Estimate& estimate, Clock::time_point deadline = Clock::time_point::max()) noexcept;
  /// Completes the last command's report with the objective and the KKT residual of its plan, and its violations.
  /// `prepare` and the next `control` do that too; only the last command of a run needs this call.
  void finish() noexcept;
  /// Says which inputs (n_u) the vehicle has had, where they are not the last command, as when it was driven by hand.
  /// Matters to rates alone. NaN: the last command, or what drives straight ahead.
  void applied(const double* inputs) noexcept;
  /// Searches the whole path for the vehicle at the next call, as at the first one.
  void locate() noexcept;
  /// The next call searches near this place of the path [m], as of laps, or all of it where the number is not finite.
  void locate(double arc_length) noexcept;
  /// Says which obstacles there are from now on, as they were at a time on the clock of the estimates [s]. Where the
  /// terms have no room for all, it is those that come closest to the plan that there is, or, before the first one, to
  /// where the vehicle is on the path. Returns how many they are. They move on with their velocities. One that has a
  /// number that is not finite is left out; at a time that is not, all are at rest.
  int set_obstacles(std::span<const Obstacle> obstacles, double time) noexcept;
  void prepare() noexcept;  ///< does work for the next sample in advance; calling it is optional
  void reset() noexcept;

  /// True once the vehicle has passed the end of the path, or has come to a stop there.
  bool finished() const noexcept { return follower_.finished(); }
  const PathFollower& follower() const noexcept { return follower_; }
  const Path& path() const noexcept { return path_; }
  const RhcProblem& problem() const noexcept { return problem_; }
  const Iterate& plan() const noexcept { return point_; }
  const Command& command() const noexcept { return command_; }  ///< the last one
  /// The vehicle itself; the problem's model has further states if there are rates.
  const Model& vehicle() const noexcept { return *vehicle_; }
  // The vehicle's inputs (n_u) in the plan and its reference on an interval, and an input's bounds.
  void plan_inputs(int interval, double* inputs) const noexcept;
  double input_reference(int interval, int input) const noexcept;
  double input_lower(int input) const noexcept;
  double input_upper(int input) const noexcept;
  std::int64_t fallbacks() const noexcept { return fallbacks_; }

 private:
  void find_place(const Estimate& estimate) noexcept;
  void go_straight(double ground_speed, const double* parameters, std::vector<double>& motion) noexcept;
  void choose_straight_motion(double ground_speed, const double* parameters) noexcept;
  void choose_straight_motion_within_bounds(double ground_speed) noexcept;
  void choose_pace(const Health& health) noexcept;
  void find_points(double arc_length) noexcept;
  void bound_speed() noexcept;
  void set_reference(double arc_length, const double* parameters, double time) noexcept;
  void place_terms(int node, int point, double time) noexcept;
  void look_ahead(double arc_length, const double* parameters) noexcept;
  void write_held_inputs() noexcept;
  void start_cold() noexcept;
  void start_at_rest() noexcept;
  void keep_within_bounds() noexcept;
  bool find_plan(Clock::time_point deadline) noexcept;
  bool find_better(bool is_found, void (Controller::*start)() noexcept, Clock::time_point deadline) noexcept;
  bool find_at_a_price(bool is_found, Clock::time_point deadline) noexcept;
  void choose_price() noexcept;
  double plan_violation() noexcept;
  double distance_from_plan(const Obstacle& obstacle) const noexcept;
  bool plans_to_stand(int intervals) const noexcept;
  void note_standing(const Health& health) noexcept;
  void find_excess(int last, std::vector<double>& most) const noexcept;
  double limits_kept_until(double from, double to, double time, bool is_begin) noexcept;
  double arc_length() const noexcept;
  double arc_length_after(double arc_length, double time, int& segment) const noexcept;
  PathPoint point_at(double arc_length, int& segment) const noexcept;
  void simulate(Iterate& point) noexcept;
  bool goes_on_detour(const Estimate& estimate) noexcept;
  void look_for_detour() noexcept;
  TurningCircle tightest_turn(double speed, double sense) noexcept;
  bool turn_around() noexcept;
  bool is_steady() noexcept;
  bool turn_in_moves() noexcept;
  bool go_back() noexcept;

  Setup setup_;
  std::shared_ptr<const Model> vehicle_;
  std::vector<int> held_state_;  ///< n_u: the problem's state that holds an input, or -1
  Path path_;
  PathFollower follower_;
  std::unique_ptr<Detour> detour_;  ///< while the vehicle turns around, or goes back
  RhcProblem problem_;
  std::shared_ptr<Solver> solver_;
  GuessShifter shifter_;
  Iterate point_;
  Iterate relaxed_plan_;  ///< that violates hard limits least, while another one is looked for; or a trial of inputs
  Command command_;
  bool has_plan_ = false, prepared_ = false, is_lost_ = false;
  bool is_finished_ = true, is_located_ = false;  ///< the last plan was assessed; the place on the path is known
  // For which the inputs' bounds were made [m/s].
  double bounded_forwards_ = std::numeric_limits<double>::quiet_NaN(), bounded_in_reverse_ = bounded_forwards_;
  int reference_segment_ = 0;                             ///< segment of the path where the last reference began
  std::vector<PathPoint> points_;                         ///< N_c + 1: the reference
  std::vector<double> arc_lengths_, obstacle_distances_;  ///< of these; of the obstacles from the plan [m]
  std::int64_t fallbacks_ = 0;
  std::vector<double> scratch_, straight_, slipless_, largest_, smallest_, limit_values_;
  std::vector<double> nominal_parameters_, reference_parameters_, ahead_parameters_;
  std::vector<double> last_inputs_;            ///< n_u, applied last; NaN: not known
  std::vector<std::uint8_t> begins_, drives_;  ///< n_u: whether an input moves the vehicle that drives straight ahead
  std::vector<Obstacle> obstacles_;  ///< room for as many as the terms regard; the first `obstacle_count_` are there
  std::size_t obstacle_count_ = 0;
  double pace_ = 1.0, wanted_pace_ = 1.0;  ///< share of the path's speeds
  double seen_ = 0.0, now_ = 0.0;          ///< when the obstacles were there; time of the last estimate [s]
};

}  // namespace rhec
