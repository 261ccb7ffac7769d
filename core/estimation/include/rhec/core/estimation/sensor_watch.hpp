#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/estimation/estimate.hpp"
#include "rhec/core/estimation/health.hpp"
#include "rhec/core/estimation/sensor_watch_setup.hpp"

namespace rhec {

class FilterMemo;
class HeadingSearch;
class WalkingFilter;

/// Judges measurements before an estimator uses them (docs/health.md).
///
/// Beside the estimator a Kalman filter goes on from its last estimate. A sensor's measurement whose innovation is too
/// large for its covariance (a gate on nu' S^-1 nu) is not used; the gate of a sensor whose innovations are larger than
/// expected all the time is wider. Who is wrong is then found by filters that assume
/// different causes, and get all measurements:
///   - slip has jumped: the parameters are made anew, once. Where this explains a few samples in a row, the
///     measurements were right, and are given back as late ones. Slip that jumps within an interval is another one on
///     the next: it may be made anew there, too, if the measurements go on in the direction in which they were off.
///     Where it does not explain the next samples all this is taken back;
///   - what the sensor measures has moved for good: the states that it sees are made anew, once. Where this explains
///     more samples than a transient may last, the estimate follows. After a time in which the sensor had said nothing
///     it is rather the estimate that is off, and a few samples are enough, as they are for one that has come back;
///   - the measured inputs are wrong: they count as typical motion, at every sample. Where neither of the others lasts
///     and this does, the estimate goes on without inputs until they fit again.
/// Where a position fails, another sensor may be wrong that was believed: see docs/health.md.
/// A measurement that passes its gate again ends all of this. As long as it is open whether slip has jumped, what is
/// given out is the second moment of both answers (`widen`). Allocates in its constructor only.
class RHEC_EXPORT SensorWatch {
 public:
  using Setup = SensorWatchSetup;
  /// Throws Error if sizes do not match.
  SensorWatch(std::shared_ptr<const Model> model, const Setup& setup);
  ~SensorWatch();

  const std::vector<Sensor>& sensors() const noexcept { return sensors_; }
  const Setup& setup() const noexcept { return setup_; }
  std::shared_ptr<const FilterMemo> make_memo();  ///< see EstimationMethod::listen
  void reset() noexcept;
  /// Marks measured inputs that cannot be as missing (NaN).
  void clean_inputs(double* inputs) noexcept;
  /// The time goes on by `duration` [s], with the mean input (n_u); between two samples in parts, if it is long.
  /// `more_sigmas` (n_u, or null): nobody has said for some time what the inputs are, and they may be off by as much.
  void advance(double duration, const double* inputs, const double* more_sigmas = nullptr) noexcept;

  /// What an estimator has to do beyond using what is left of the outputs.
  struct Finding {
    bool release = false;  ///< measurements that were held back are right (`held`), and slip has jumped (`jumps`)
    /// The estimate has to go on from `mean` and `covariance`, which contain this measurement.
    bool rebase = false;
    bool retract = false;  ///< what was used was wrong, and slip had not jumped: see `retraction`
  };
  /// Judges outputs (n_y, NaN where missing; weights as in Measured) of a time [s]; those not to be used become NaN.
  Finding judge(double time, double* outputs, const double* weights = nullptr) noexcept;
  /// Whether a late measurement of a time passes; those outputs that do not become NaN. If the vehicle begins there,
  /// or, where it may, a search of its heading, moments are of that time, and `advance` or `search_on` go on from
  /// there.
  Finding judge_late(double time, double* outputs, const double* weights, bool may_search) noexcept;
  void remember_for(double time) noexcept;  ///< how late a measurement may be [s]
  /// With the first sample behind a time, or the last one, if there is no time for more: when it was; NaN: none.
  double search_on(double time, bool is_hasty) noexcept;
  bool is_heading_unknown() const noexcept;  ///< so that a position, also a late one, may begin a search of it
  /// Behind the last sample that was judged, and before late ones that may still change that: from there on, `advance`,
  /// and whether measurements pass their gates; those outputs that do not become NaN.
  void begin_ahead() noexcept;
  void advance_ahead(double duration, const double* inputs) noexcept;
  void judge_ahead(double* outputs, const double* weights = nullptr) noexcept;
  struct Held {
    double time = 0.0;  ///< [s]
    MeasuredOutputs outputs;
  };
  /// Measurements that were rejected and turned out right, before the last one; after `judge` has said so.
  const std::vector<Held>& held() const noexcept { return held_; }
  int held_count() const noexcept { return held_count_; }
  /// Times of samples behind which slip has jumped; after `judge` has said so.
  std::span<const double> jumps() const noexcept;
  struct Retraction {
    double jumps_from, outputs_from;  ///< behind these times [s]
    const double* outputs;            ///< those that are not missing here (n_y) were wrong
  };
  Retraction retraction() const noexcept;
  const Eigen::VectorXd& mean() const noexcept;
  const Eigen::MatrixXd& covariance() const noexcept;

  /// By sensor.
  std::span<const SensorHealth> sensor_states() const noexcept { return states_; }
  /// False while there is nothing to judge by: before the first estimate, and while a heading is searched.
  bool is_active() const noexcept { return is_active_; }
  /// Goes on from moments of [x; p] that somebody else has given.
  void restart(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept;
  /// Goes on from an estimate.
  void follow(const Estimate& estimate) noexcept;
  /// Moments of [x; p] after a time without measurements: [mean; covariance] of an estimate, predicted by `duration`
  /// with an input (n_u), each of which may be off by `input_sigmas` besides its noise (n_u, or null).
  void predict(double duration, const double* inputs, const double* input_sigmas, Estimate& estimate) noexcept;
  void begin_predicting() noexcept;  ///< the first such prediction follows, from the last sample on

  /// By how much larger a covariance is to be, since innovations are correlated (Health::covariance_factor).
  double covariance_factor() const noexcept;
  /// Whether estimates are to be widened: slip may have jumped, or a sensor is off.
  bool is_in_doubt() const noexcept;
  /// Gives an estimate at the last sample the covariance that it has if slip may have jumped, with the probability w
  /// that the likelihoods say: (1 - w) P + w (P1 + d d'), where P1 and d are the covariance with such slip and how far
  /// its mean is from the estimate's (Bar-Shalom, Li and Kirubarajan 2001). The mean stays: no measurement moves it.
  void widen(Estimate& estimate) noexcept;

  void begin_innovations() noexcept { innovation_count_ = 0; }
  /// Those judged since then, the first ones if there are very many.
  std::span<const Innovation> innovations() const noexcept {
    return {innovations_.data(), static_cast<std::size_t>(innovation_count_)};
  }
  enum class Presence : std::uint8_t {
    present,
    overdue,  ///< a measurement was to be expected
    silent    ///< it has said nothing for too long
  };
  /// `presence`: by sensor; `inputs`: that of the measured inputs; `reasons`: those that belong to no sensor.
  void assess(const Estimate& estimate, std::span<const Presence> presence, Presence inputs, std::uint32_t reasons,
              Health& health) noexcept;

 private:
  struct Hypothesis;
  struct Memory;
  struct Suspicion;
  struct Record;
  bool admits(std::size_t sensor, const Innovation&innovation) noexcept, passes_by_chance(std::size_t sensor) noexcept;
  bool follow_biases(WalkingFilter&filter) noexcept, follow_receiver() noexcept, distrust_receiver() noexcept;
  bool is_still_off(std::size_t sensor, const Innovation& innovation) const noexcept;
  Measured weighed(const double* outputs) const noexcept;
  const double* not_accused() noexcept;
  void find_stuck(double*outputs) noexcept, note_sample(double time, const double*outputs) noexcept;
  void note_motion(double duration, const double*inputs) noexcept, forget_reasons() noexcept;
  bool is_searching() const noexcept, is_expected(std::size_t s) const noexcept, is_heard(std::size_t s) const noexcept;
  void start_search(const double*) noexcept, begin_anew(const double*outputs) noexcept, think_again() noexcept;
  void search_from(WalkingFilter& filter, HeadingSearch& search, const double* outputs,
                   double sigma = infinity) noexcept;
  Finding search_heading(const double*outputs) noexcept, place_start(const double*, const double*weights) noexcept;
  bool is_heading_open(const WalkingFilter& filter, Measured outputs) noexcept;
  Finding open_heading(double time, const double*outputs) noexcept, judge_each(double time, double*outputs) noexcept;
  void start(Hypothesis&hypothesis) noexcept, start_moved(Hypothesis&hypothesis) noexcept;
  bool fits(WalkingFilter& filter, const double* outputs) noexcept;
  void refute(Hypothesis&hypothesis) noexcept, consider_double_fault() noexcept;
  double disputed_nis(WalkingFilter&filter) noexcept, likelihood(WalkingFilter&filter, const double*outputs) noexcept;
  void confront(Hypothesis& hypothesis, const double* outputs, bool counts) noexcept;
  Finding settle(double time, const double* outputs) noexcept;
  Finding accept(Hypothesis&hypothesis) noexcept, come_back() noexcept;
  double consider_slip() noexcept, replay_with_new_slip(int back, const double*near) noexcept;
  bool retract_slip() noexcept, replay_without(const Suspicion&suspicion, WalkingFilter&filter, bool change) noexcept;
  Finding accuse(const Suspicion& suspicion, const Record& error, const double* outputs) noexcept;
  bool consider_other(const double*outputs, Finding&finding) noexcept, is_placed_by_other(int position) const noexcept;
  void consider_moved(double likelihood_of_new_slip, const double* outputs) noexcept;
  bool is_double_fault() const noexcept, has_proved(const Hypothesis&moved, bool after_gap) const noexcept;
  void consider_return(double time) noexcept, leave_place(double time, bool after_gap) noexcept;
  void note_jump() noexcept, note_followed(bool alone) noexcept, begin_edge(bool is_new) noexcept, convict() noexcept;
  bool has_come_back() const noexcept, changes_slip(Hypothesis&each) noexcept, end_offset() noexcept;
  bool goes_on() noexcept, may_follow() const noexcept, consider_slip_before() noexcept;
  int disputed_position() const noexcept, offset_in_dispute() noexcept;
  void hold_back(double time, const double*outputs) noexcept, acquit(const double*) noexcept, end_dispute() noexcept;
  bool sees_position(int output) const noexcept, sees_position(const std::vector<int>&outputs) const noexcept;
  bool is_position_disputed() const noexcept, is_place_disputed() const noexcept;
  bool is_place_lost() const noexcept, is_placed_otherwise() const noexcept;
  bool is_within_bounds(const Eigen::VectorXd&mean) const noexcept, is_probably_slip() const noexcept;
  void note_offsets() noexcept, note_corrected(bool has_jumped) noexcept, test_inputs(const double*outputs) noexcept;
  void remember(double time, const double*outputs) noexcept, note_volume(const Estimate&estimate) noexcept;
  double limit(std::size_t sensor, Eigen::Index degrees) const noexcept;

  Setup setup_;
  std::vector<Sensor> sensors_;
  std::vector<double> limits_, close_limits_;  ///< of nu' S^-1 nu, by the number of values
  std::vector<Record> records_;                ///< by sensor
  std::vector<double> excesses_;               ///< by sensor, mean nu' S^-1 nu by degree of freedom, of late
  std::vector<double> heard_;                  ///< by sensor, when it was measured last [s]; NaN: never
  bool is_unobserved_ = false;                 ///< the motion since the last sample is not known
  double usual_volume_ = 0.0;  ///< mean log sqrt(det P) of late, where nothing was lacking; NaN: none yet
  std::unique_ptr<Hypothesis> own_, slip_, edge_, moved_, back_, blind_;  ///< edge_: slip that goes on jumping
  std::unique_ptr<Memory> memory_;
  bool is_active_ = false, is_disputed_ = false, is_blind_ = false;
  double slip_probability_ = 0.0;  ///< that slip has jumped, while that is open
  int disputed_samples_ = 0, unplaced_samples_ = 0, trusted_samples_ = 0, calm_samples_ = 0;
  std::vector<SensorHealth> states_;  ///< by sensor
  SensorHealth inputs_;
  std::uint32_t input_findings_ = 0;
  std::vector<std::uint32_t> findings_;                             ///< by sensor, of the last sample
  std::vector<int> quiet_;                                          ///< by sensor, samples since the last finding
  std::vector<double> raw_, raw_weights_, input_, believed_input_;  ///< weights: none where all are 1
  std::vector<Held> held_;
  std::vector<Innovation> innovations_;
  int held_count_ = 0, innovation_count_ = 0;
  Innovation scratch_;
};

}  // namespace rhec
