#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/estimation/estimate.hpp"
#include "rhec/core/estimation/health.hpp"
#include "rhec/core/estimation/sensor_watch.hpp"

namespace rhec {

class HeadingSearch;
class WalkingFilter;

/// What SensorWatch does; it has the same functions. Each function is described where it is defined, in the source that
/// its group names.
class SensorJudge {
 public:
  using Setup = SensorWatch::Setup;
  using Finding = SensorWatch::Finding;
  using Held = SensorWatch::Held;
  using Retraction = SensorWatch::Retraction;
  using Presence = SensorWatch::Presence;

  SensorJudge(std::shared_ptr<const Model> model, const Setup& setup);
  ~SensorJudge();

  const std::vector<Sensor>& sensors() const noexcept { return sensors_; }
  const std::vector<Sensor>& inputs() const noexcept { return input_names_; }
  const Setup& setup() const noexcept { return setup_; }
  bool is_active() const noexcept { return is_active_; }
  const std::vector<Held>& held() const noexcept { return held_; }
  int held_count() const noexcept { return held_count_; }
  std::span<const SensorHealth> sensor_states() const noexcept { return states_; }
  void begin_innovations() noexcept { innovation_count_ = 0; }
  std::span<const Innovation> innovations() const noexcept {
    return {innovations_.data(), static_cast<std::size_t>(innovation_count_)};
  }

  // sensor_judge.cpp: the estimate, and what happens at a sample.
  std::shared_ptr<const FilterMemo> make_memo();
  const Eigen::VectorXd& mean() const noexcept;
  const Eigen::MatrixXd& covariance() const noexcept;
  void reset() noexcept;
  void restart(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept;
  void clean_inputs(double* inputs) noexcept;
  void advance(double duration, const double* inputs, const double* more_sigmas) noexcept;
  Finding judge(double time, double* outputs, const double* weights) noexcept;

  // sensor_verdict.cpp: what is said of the estimate, and of late samples.
  Finding judge_late(double time, double* outputs, const double* weights, bool may_search) noexcept;
  double search_on(double time, bool is_hasty) noexcept;
  void remember_for(double time) noexcept;
  void begin_ahead() noexcept;
  void advance_ahead(double duration, const double* inputs) noexcept;
  void judge_ahead(double* outputs, const double* weights) noexcept;
  void follow(const Estimate& estimate) noexcept;
  bool is_correlated() const noexcept;
  void scale(Estimate& estimate) const noexcept;
  bool is_in_doubt() const noexcept;
  void widen(Estimate& estimate) noexcept;
  void assess(const Estimate& estimate, std::span<const Presence> presence, Presence inputs, std::uint32_t reasons,
              Health& health) noexcept;
  void begin_predicting() noexcept;
  void predict(double duration, const double* inputs, const double* input_sigmas, Estimate& estimate) noexcept;

  // sensor_contradiction.cpp
  bool doubts_input(std::size_t input) const noexcept;

  // sensor_dispute.cpp
  Retraction retraction() const noexcept;
  std::span<const double> jumps() const noexcept;

  // sensor_start.cpp
  bool is_heading_unknown() const noexcept;

 private:
  struct Hypothesis;
  struct Memory;
  struct Record;
  struct Suspicion;
  struct Contradiction;

  // sensor_judge.cpp
  void note_sample(double time, const double* outputs) noexcept;
  void note_motion(double duration, const double* inputs) noexcept;
  void predict_blind(const double* inputs, double duration) noexcept;
  double position_interval() const noexcept;
  void note_offsets() noexcept;
  bool is_minor_offset(std::size_t sensor) const noexcept;
  void note_corrected(bool has_jumped) noexcept;
  void remember(double time, const double* outputs) noexcept;
  void forget_reasons() noexcept;
  Finding judge_each(double time, double* outputs) noexcept;
  void agree() noexcept;
  Finding doubt_bounds(bool is_disputed, bool is_placed) noexcept;
  Measured weighed(const double* outputs) const noexcept;
  bool is_expected(std::size_t sensor) const noexcept;
  bool is_heard(std::size_t sensor) const noexcept;

  // sensor_gate.cpp: which measurements are used, each by itself.
  bool admits(std::size_t sensor, const Innovation& innovation) noexcept;
  bool is_still_off(std::size_t sensor, const Innovation& innovation) const noexcept;
  double limit(std::size_t sensor, Eigen::Index degrees) const noexcept;
  bool end_offset() noexcept;
  bool follow_biases(WalkingFilter& filter) noexcept;
  void find_stuck(double* outputs) noexcept;

  // sensor_start.cpp: before there is an estimate to judge by.
  Finding place_start(const double* outputs, const double* weights) noexcept;
  bool is_heading_open(const WalkingFilter& filter, Measured outputs) noexcept;
  Finding open_heading(double time, const double* outputs) noexcept;
  bool is_searching() const noexcept;
  void begin_anew(const double* outputs) noexcept;
  void start_search(const double* outputs) noexcept;
  void search_from(WalkingFilter& filter, HeadingSearch& search, const double* outputs,
                   double sigma = infinity) noexcept;
  Finding search_heading(const double* outputs) noexcept;

  // sensor_dispute.cpp: hypotheses of what is wrong, and which of them lasts.
  Finding settle(double time, const double* outputs) noexcept;
  int entries_since_position() noexcept;
  int entries_since_believed() noexcept;
  void start_slip() noexcept;
  void start_moved(Hypothesis& hypothesis) noexcept;
  void start_blind() noexcept;
  bool replay_blind(int back) noexcept;
  void begin_edge(bool is_new) noexcept;
  void confront(Hypothesis& hypothesis, const double* outputs, bool counts) noexcept;
  void refute(Hypothesis& hypothesis) noexcept;
  Finding accept(Hypothesis& hypothesis) noexcept;
  bool fits(WalkingFilter& filter, const double* outputs) noexcept;
  double likelihood(WalkingFilter& filter, const double* outputs) noexcept;
  double disputed_nis(WalkingFilter& filter) noexcept;
  double consider_slip() noexcept;
  bool consider_slip_before() noexcept;
  double replay_with_new_slip(int back, const double* near) noexcept;
  bool retract_slip() noexcept;
  bool goes_on() noexcept;
  void consider_moved(double likelihood_of_new_slip, const double* outputs) noexcept;
  bool has_proved(const Hypothesis& moved, bool after_gap) const noexcept;
  bool may_follow() const noexcept;
  void note_followed(bool alone) noexcept;
  void think_again() noexcept;
  void test_inputs(const double* outputs) noexcept;
  void hold_back(double time, const double* outputs) noexcept;
  void acquit(const double* outputs) noexcept;
  void end_dispute() noexcept;
  bool is_within_bounds(const Eigen::VectorXd& mean) const noexcept;
  bool is_probably_slip() const noexcept;
  bool sees_position(int output) const noexcept;
  bool sees_position(const std::vector<int>& outputs) const noexcept;
  bool is_place_disputed() const noexcept;
  bool is_position_disputed() const noexcept;
  bool is_place_lost() const noexcept;
  bool is_motion_contradicted() const noexcept;
  bool is_placed_otherwise() const noexcept;

  // sensor_accusation.cpp: a position fails, and another sensor may be wrong that was believed.
  bool consider_other(const double* outputs, Finding& finding) noexcept;
  Finding accuse(const Suspicion& suspicion, const Record& error, const double* outputs) noexcept;
  bool replay_without(const Suspicion& suspicion, WalkingFilter& filter, bool change) noexcept;
  bool is_placed_by_other(int position) const noexcept;
  int offset_in_dispute() noexcept;

  /// The estimate goes on from elsewhere, and what was known of slip counts no longer.
  static constexpr Finding slip_is_new{.release = true, .rebase = true};

  // sensor_contradiction.cpp: a measured input is wrong, and a sensor that sees the same was blamed for it.
  bool consider_inputs() noexcept;
  bool distrust_instead() noexcept;
  bool distrust(const Contradiction& each) noexcept;
  bool is_explained_without_input(const Contradiction& each, WalkingFilter& filter) noexcept;
  bool distrust_again() noexcept;
  bool replay_without_input(const Contradiction& each, int ago, WalkingFilter& filter) noexcept;
  void forget_slip(WalkingFilter& filter) const noexcept;
  int entries_since_failure(const Contradiction& each) noexcept;
  void as_measured(const Sensor& sensor, double* outputs) const noexcept;
  void test_doubted() noexcept;

  // sensor_double_fault.cpp: a position has moved, and what others say since then is wrong, too.
  void consider_double_fault() noexcept;
  bool is_double_fault() const noexcept;
  void convict() noexcept;
  const double* not_accused() noexcept;
  bool passes_by_chance(std::size_t sensor) noexcept;

  // sensor_return.cpp: a position that comes back to where it was.
  int disputed_position() const noexcept;
  void note_jump() noexcept;
  void leave_place(double time, bool after_gap) noexcept;
  void consider_return(double time) noexcept;
  bool changes_slip(Hypothesis& each) noexcept;
  Finding come_back() noexcept;
  bool has_come_back() const noexcept;

  // sensor_receivers.cpp: two receivers, of which one has moved.
  bool follow_receiver() noexcept;
  bool distrust_receiver() noexcept;

  // sensor_verdict.cpp
  bool is_place_measured(std::span<const Presence> presence) const noexcept;
  void note_volume(const Estimate& estimate) noexcept;

  Setup setup_;
  std::vector<Sensor> sensors_;
  std::vector<Sensor> input_names_;   ///< names and units
  std::vector<double> limits_;        ///< of nu' S^-1 nu, by the number of values
  std::vector<double> close_limits_;  ///< those of a closer gate
  std::vector<Record> records_;       ///< by sensor
  std::vector<double> excesses_;      ///< by sensor, mean nu' S^-1 nu by degree of freedom, of late
  std::vector<double> heard_;         ///< by sensor, when it was measured last [s]; NaN: never
  bool is_unobserved_ = false;        ///< the motion since the last sample is not known
  double usual_volume_ = 0.0;         ///< mean log sqrt(det P) of late, where nothing was lacking; NaN: none yet
  std::unique_ptr<Hypothesis> own_;   ///< the estimate
  std::unique_ptr<Hypothesis> slip_;  ///< slip has jumped
  std::unique_ptr<Hypothesis> edge_;  ///< it goes on jumping
  std::unique_ptr<Hypothesis> moved_;
  std::unique_ptr<Hypothesis> back_;   ///< a position has come back
  std::unique_ptr<Hypothesis> blind_;  ///< measured inputs are wrong
  std::unique_ptr<Memory> memory_;
  bool is_active_ = false;
  bool is_disputed_ = false;
  bool is_blind_ = false;             ///< the estimate goes on without measured inputs
  double slip_probability_ = 0.0;     ///< that slip has jumped, while that is open
  int disputed_samples_ = 0;          ///< since the dispute began
  int unplaced_samples_ = 0;          ///< disputed ones in a row in which no position was used
  int trusted_samples_ = 0;           ///< in a row that fit measured inputs again
  int calm_samples_ = 0;              ///< without a finding, in a row
  int quiet_inputs_ = 0;              ///< without one of the inputs
  std::vector<SensorHealth> states_;  ///< by sensor
  SensorHealth inputs_;
  int off_input_ = -1;      ///< the one that `inputs_.offset` is of
  int doubted_input_ = -1;  ///< one that is not believed by itself
  std::uint32_t input_findings_ = 0;
  std::vector<std::uint32_t> findings_;  ///< by sensor, of the last sample
  std::vector<int> quiet_;               ///< by sensor, samples since the last finding
  std::vector<double> raw_;              ///< n_y, of the present sample
  std::vector<double> raw_weights_;      ///< its weights; none where all are 1
  std::vector<double> input_;            ///< n_u, mean since the last sample
  std::vector<double> believed_input_;   ///< n_u, the last one before the dispute
  std::vector<Held> held_;
  int held_count_ = 0;
  std::vector<Innovation> innovations_;
  int innovation_count_ = 0;
  Innovation scratch_;
};

}  // namespace rhec
