#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "rhec/core/estimation/estimate.hpp"
#include "rhec/core/estimation/health.hpp"
#include "rhec/core/estimation/sensor_watch_setup.hpp"

namespace rhec {

class FilterMemo;
class SensorJudge;

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

  const std::vector<Sensor>& sensors() const noexcept;
  /// The measured inputs, with their names and units.
  const std::vector<Sensor>& inputs() const noexcept;
  std::string in_words(const Health& health) const;
  const Setup& setup() const noexcept;
  std::shared_ptr<const FilterMemo> make_memo();  ///< see EstimationMethod::listen
  void reset() noexcept;
  /// Marks measured inputs as missing (NaN) that cannot be, or are doubted.
  void clean_inputs(double* inputs) noexcept;
  /// Whether a measured input is doubted by itself, since a sensor that contradicts it is right.
  bool doubts_input(std::size_t input) const noexcept;
  bool doubts_any_input() const noexcept;
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
  const std::vector<Held>& held() const noexcept;
  int held_count() const noexcept;
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
  std::span<const SensorHealth> sensor_states() const noexcept;
  /// False while there is nothing to judge by: before the first estimate, and while a heading is searched.
  bool is_active() const noexcept;
  /// Goes on from moments of [x; p] that somebody else has given.
  void restart(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept;
  /// Goes on from an estimate.
  void follow(const Estimate& estimate) noexcept;
  /// Moments of [x; p] after a time without measurements: [mean; covariance] of an estimate, predicted by `duration`
  /// with an input (n_u), each of which may be off by `input_sigmas` besides its noise (n_u, or null).
  void predict(double duration, const double* inputs, const double* input_sigmas, Estimate& estimate) noexcept;
  void begin_predicting() noexcept;  ///< the first such prediction follows, from the last sample on

  /// Whether innovations are correlated, so that covariances are to be larger (Health::covariance_factor).
  bool is_correlated() const noexcept;
  /// Makes the covariance of an estimate as large as it is to be then.
  void scale(Estimate& estimate) const noexcept;
  /// Whether estimates are to be widened: slip may have jumped, or a sensor is off.
  bool is_in_doubt() const noexcept;
  /// Gives an estimate at the last sample the covariance that it has if slip may have jumped, with the probability w
  /// that the likelihoods say: (1 - w) P + w (P1 + d d'), where P1 and d are the covariance with such slip and how far
  /// its mean is from the estimate's (Bar-Shalom, Li and Kirubarajan 2001). The mean stays: no measurement moves it.
  void widen(Estimate& estimate) noexcept;

  void begin_innovations() noexcept;
  /// Those judged since then, the first ones if there are very many.
  std::span<const Innovation> innovations() const noexcept;
  enum class Presence : std::uint8_t {
    present,
    overdue,  ///< a measurement was to be expected
    silent    ///< it has said nothing for too long
  };
  /// `presence`: by sensor; `inputs`: that of the measured inputs; `reasons`: those that belong to no sensor.
  void assess(const Estimate& estimate, std::span<const Presence> presence, Presence inputs, std::uint32_t reasons,
              Health& health) noexcept;

 private:
  std::unique_ptr<SensorJudge> judge_;
};

}  // namespace rhec
