#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "rhec/core/estimation/clocks.hpp"
#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/estimation/node_grid.hpp"
#include "rhec/core/estimation/sensor_watch.hpp"
#include "rhec/core/model/step_requirement.hpp"

namespace rhec {

/// The estimator of a robot: push stamped measurements and inputs as they arrive, and ask for the estimate at a time.
///
/// Nodes lie on a grid of `longest_interval` (NodeGrid), measurements at nodes or between them, at their own times. An
/// input holds from its stamp until the next; an interval uses the mean over its duration. A measurement may lack any
/// of its outputs (NaN).
///
/// Measurements and inputs may come in any order: nodes from the stamp of a late one on are made anew, so that the
/// estimate is what it would be had it come in time. That reaches back as far as the method remembers, which is its
/// horizon at least; what is older is dropped and counted, or, of an input, counts from there on. Works with any
/// EstimationMethod. Nothing throws after construction.
class RHEC_EXPORT Estimator {
 public:
  struct Timeline {
    double longest_interval = 0.2;  ///< [s]; a gap that would need more than 1000 nodes is divided into 1000
    double tolerance = 1e-6;        ///< stamps closer than this are one [s]
    std::size_t capacity = 4096;    ///< rows of inputs, and of measurements: of the horizon, and what waits
    /// By output, how much later than it was measured it is stamped [s]; none: not at all. Outputs of one measurement
    /// go to the times at which each was measured.
    std::vector<double> delays = {};
    /// By output, the standard deviation of the noise that the method takes it to have: what those that a measurement
    /// has of its own are held against. None: those of the judge; without one, measurements have none of their own.
    std::vector<double> output_sigmas = {};
    /// For so long a call whose deadline has passed goes on with what waits, beside one row and one node [s]: an
    /// estimator that is always late keeps up.
    double grace = 5e-4;
    /// With a judge, an input holds for so long at least where no other one follows [s], as commands do that are told
    /// only when they change; may be infinite.
    double input_hold = 0.0;
  };
  explicit Estimator(std::unique_ptr<EstimationMethod> method) : Estimator(std::move(method), Timeline{}) {}
  /// Throws Error if a number of the timeline is out of range.
  Estimator(std::unique_ptr<EstimationMethod> method, const Timeline& timeline);
  /// With a judge of stamps, inputs and measurements, as a robot needs it: see SensorWatch and Clocks. Estimates then
  /// have a health, innovations, and covariances that grow while nothing is measured.
  Estimator(std::unique_ptr<EstimationMethod> method, const Timeline& timeline, std::unique_ptr<SensorWatch> watch);

  /// Measured y (n_y, NaN where missing) at a time [s]. `sigmas` (n_y, or null): standard deviations of this
  /// measurement, e.g. as its receiver states them; those that are not above 0 are as always. A measurement counts for
  /// no more than one that is a hundred times more accurate than usual, and is missing if its deviation is infinite.
  void push_measurement(double time, const double* outputs, const double* sigmas = nullptr) noexcept;
  /// Measured u (n_u, of the vehicle alone; NaN where missing), which holds from a time [s] on. With a judge, until the
  /// next one is missed; what is missing of it is what it was for as long. Without, it holds until the next one comes.
  void push_input(double time, const double* inputs) noexcept;

  /// The estimate at a time [s], from all that was pushed with stamps up to it. Beyond the newest node it is integrated
  /// with the newest inputs, within the model's bounds; for an earlier or undefined time it is the newest node's.
  /// Before the first measurement it is empty (see `has_started`). What the deadline leaves no time for waits for the
  /// next call: the estimate is then predicted from an earlier node, and its report says `deadline`.
  const Estimate& estimate(double time, Clock::time_point deadline = Clock::time_point::max()) noexcept;
  bool has_started() const noexcept { return grid_.count() > 0; }
  /// Of the first node [s], once it is there: with delays it lies before the first stamp.
  double start_time() const noexcept { return grid_.start(); }

  /// Does work for the next sample in advance; optional, but always saves time later.
  void prepare() noexcept;
  /// Goes through the computation of the next estimate, without effect. Optional, for a loop that has slept since the
  /// last one and will be asked in a moment: code and data are in the processor's caches then.
  void rehearse() noexcept {
    if (has_started()) method_->rehearse();
  }
  void reset() noexcept;
  /// Goes on from moments of [x; p] (n, n x n) at the newest node, e.g. after the vehicle was carried. False if there
  /// is no node yet, sizes do not match, a number is not finite, or the method cannot.
  bool reset(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept;
  /// The drive has ended: completes what is kept beyond it, such as a map of slip.
  void end_drive() noexcept { method_->end_drive(); }
  /// What slip to expect ahead, of an estimator that remembers places; else null.
  std::shared_ptr<const SlipAhead> slip_ahead() const noexcept { return method_->slip_ahead(); }

  struct Counts {
    std::int64_t nodes = 0;       ///< up to now, including those without a measurement
    std::int64_t estimates = 0;   ///< estimates computed
    std::int64_t fallbacks = 0;   ///< estimates for which the solver failed
    std::int64_t late = 0;        ///< measurements that came behind the newest node's
    std::int64_t dropped = 0;     ///< measurements too late, too many, or with a stamp that cannot be
    std::int64_t rejected = 0;    ///< measurements of one sensor that failed their gate or were stuck
    std::int64_t rebased = 0;     ///< times that the estimate went on from a jump, or without knowing the motion
    std::int64_t clocks_set = 0;  ///< times that the clock of a sensor, or of the inputs, was set
    std::int64_t missing = 0;     ///< single outputs that were NaN or otherwise not valid
    std::int64_t integrated = 0;  ///< intervals whose Runge-Kutta steps were held against twice as many: one in 16
    std::int64_t coarse = 0;      ///< of these, those where a next state was off by more than `coarse_error`
    int coarse_state = -1;        ///< the state that was off most; -1: none
  };
  /// Null where nobody judges.
  const SensorWatch* watch() const noexcept { return watch_.get(); }
  const Counts& counts() const noexcept { return counts_; }
  /// In typical magnitudes of a state, of an interval: what noise of sensors will not hide.
  static constexpr double coarse_error = 10.0 * StepRequirement::state_tolerance;
  const EstimationMethod& method() const noexcept { return *method_; }
  const Model& model() const noexcept { return method_->model(); }

 private:
  const double* weigh(const double* sigmas) noexcept;
  void push(double time, Measured outputs) noexcept;
  void push_judged(double time, Measured outputs, bool may_be_used = false) noexcept;
  double place_on_timeline(double stamp, int source) noexcept;
  double place_on_timeline(double stamp, const double* outputs) noexcept;
  void note_delivery(double time, Measured outputs) noexcept;
  double judged_until(double time) const noexcept;
  double longest_lag(std::size_t sensor) const noexcept;
  bool is_worth_waiting_for(std::size_t sensor) const noexcept;
  bool may_begin_search(Measured outputs) const noexcept;
  std::size_t merge_waiting(std::size_t row) noexcept;
  bool has_waiting(double until) const noexcept;
  void estimate_for_judge(Clock::time_point deadline) noexcept;
  bool judge_waiting(double until, Clock::time_point deadline) noexcept;
  bool judge_ahead(double until, Clock::time_point deadline) noexcept;
  /// Whether measurements are used that are not judged yet.
  bool goes_ahead() const noexcept { return used_ > watched_ + timeline_.tolerance; }
  SensorWatch::Finding judge(double time, MeasuredOutputs& outputs, Clock::time_point deadline) noexcept;
  SensorWatch::Finding judge_late(double time, MeasuredOutputs& outputs, Clock::time_point deadline) noexcept;
  int inputs_source() const noexcept { return static_cast<int>(presence_.size()); }
  double longest_silence(int source) const noexcept;
  /// For how long a message of inputs holds where none follows [s].
  double input_hold() const noexcept;
  double usual_age(int source) const noexcept;
  void hold_missing_inputs(double time) noexcept;
  template <class Function>
  void through_motion(double from, double to, Clock::time_point deadline, const Function& advance) noexcept;
  void guess_input(double since, double begin, double end) noexcept;
  void note_ages(double time) noexcept;
  SensorWatch::Presence presence(int source, double time) const noexcept;
  void assess(Estimate& estimate, double time) noexcept;
  void rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept;
  bool take_in(double until, Clock::time_point deadline) noexcept;
  void add_node() noexcept;
  void clip(Estimate& estimate) const noexcept;
  void predict_to(double time, Clock::time_point deadline) noexcept;
  void check_integration() noexcept;
  void clear_estimates() noexcept;
  void clear_deliveries() noexcept;

  std::unique_ptr<EstimationMethod> method_;
  Timeline timeline_;
  NodeGrid grid_;
  bool stale_ = false;
  Estimate estimate_, predicted_;
  Counts counts_;
  StepError step_error_;
  Clock::duration solving_{};        ///< how long the last estimate took behind its nodes, if it had a deadline
  double worst_error_ = 0.0;         ///< of the intervals that were coarse
  std::size_t measured_inputs_ = 0;  ///< all but process noise, which is 0
  std::vector<double> input_, next_, values_, delayed_, sigmas_, weights_;
  // With a judge:
  std::unique_ptr<SensorWatch> watch_;
  std::unique_ptr<Clocks> clocks_;         ///< of the sensors, and last of the inputs
  std::unique_ptr<MeasuredRows> waiting_;  ///< measurements that are not judged yet
  double watched_ = 0.0;                   ///< time of the last sample that was judged
  MeasuredOutputs merged_;
  /// Of a sensor: how far its measurements come behind the newest one of all, mean and variance, and its newest one
  /// [s].
  struct Delivery {
    double lag = 0.0, variance = 0.0, newest = 0.0;
  };
  std::vector<Delivery> deliveries_;
  /// How old the newest message of a source is when somebody asks for an estimate [s].
  struct Age {
    double newest;       ///< stamp of that message; NaN: none
    double last, usual;  ///< at the last estimate, and before the next message comes, on average
    double variance;     ///< of that age
  };
  std::vector<Age> ages_;    ///< of the sensors, and last of the inputs
  double newest_row_ = 0.0;  ///< stamp of the newest measurement of all [s]; NaN: none
  double ahead_ = 0.0;       ///< how far the judge has looked ahead [s]; NaN: not since the last sample that was judged
  double used_ = 0.0;        ///< up to there measurements have been used before they were judged [s]
  /// What an input was when it was measured last, and when [s]; NaN: never.
  struct HeldInput {
    double value, time;
  };
  std::vector<HeldInput> held_inputs_;
  std::vector<double> input_sigmas_;
  std::vector<SensorWatch::Presence> presence_;
};

}  // namespace rhec
