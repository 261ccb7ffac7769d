#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "correlated_errors.hpp"
#include "heading_search.hpp"
#include "information_loss.hpp"
#include "log_volume.hpp"
#include "numbers.hpp"
#include "offset_watch.hpp"
#include "past_moments.hpp"
#include "past_places.hpp"
#include "recent_samples.hpp"
#include "sensor_judge.hpp"
#include "sensor_record.hpp"
#include "stuck_values.hpp"
#include "walking_filter.hpp"

// What the sources of SensorJudge share.

namespace rhec {

// After so many failures in a row a sensor is suspect: it then has to pass a closer gate, and more than once.
inline constexpr int suspect_after = 3;
// Samples of a dispute after which a position may have been wrong before, when another sensor seemed to be.
inline constexpr int suspect_position = 4;
// Standard deviations of a closer gate, if gates are not closer themselves.
inline constexpr double close_gate = 3.0;
// The logarithm of odds that convince: a hundred to one.
inline constexpr double convincing = 4.6;
// Samples that one explanation may go through anew within one call.
inline constexpr int most_replayed = 512;
// In typical magnitudes, how far off a state can be that is found anew.
inline constexpr double displacement = 100.0;

/// Where the vehicle is [m]; 0 where it has no such coordinate.
inline Eigen::Vector2d position_of(const WalkingFilter& filter) noexcept {
  const Roles& roles = filter.model().description().roles;
  return {roles.position_x < 0 ? 0.0 : filter.mean()[roles.position_x],
          roles.position_y < 0 ? 0.0 : filter.mean()[roles.position_y]};
}

/// The sensor that an output belongs to; -1: none.
inline int sensor_of(int output, const std::vector<Sensor>& sensors) noexcept {
  for (std::size_t s = 0; s < sensors.size(); ++s)
    if (std::ranges::find(sensors[s].outputs, output) != sensors[s].outputs.end()) return static_cast<int>(s);
  return -1;
}

/// A filter, and how long what it assumes has explained the measurements.
struct SensorJudge::Hypothesis {
  WalkingFilter filter;
  bool is_active = false;
  int explained = 0, refuted = 0;
  /// Log likelihood of what is not disputed, more than by the filter without the sensor; where two are wrong, of what
  /// is measured by others, more than if all of it were right.
  double evidence = 0.0;
  bool is_informed = false;  ///< it has explained much before it was refuted
  // Of a sensor that has moved, while slip jumps as well: what was known after the last samples, how many had been
  // explained when slip was made anew, and how often in a row that was.
  Eigen::VectorXd before_mean = {};
  Eigen::MatrixXd before_covariance = {};
  int new_slip_since = 0, new_slips = 0;

  void begin() noexcept {
    is_active = true;
    explained = new_slip_since = new_slips = 0;
    evidence = 0.0;
    note_before();
  }
  void note_before() noexcept {
    copy_numbers(filter.mean(), before_mean);
    copy_numbers(filter.covariance(), before_covariance);
  }
};

/// An input, and an output that sees it, and nothing that has to do with it later: which of the two is wrong where they
/// contradict each other is not to be seen from them.
struct SensorJudge::Contradiction {
  int input = 0, output = 0;
  std::size_t sensor = 0;
};

/// What was known after the last samples, and the motion since then.
struct SensorJudge::Memory {
  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::size_t past_moments = 128;
  // Samples without a position that are remembered between two of them, at most.
  static constexpr double most_between_positions = 16.0;
  // Silence after which a sensor that disagrees is more likely right than the estimate [s], and in usual intervals.
  static constexpr double longest_gap = 1.0, usual_intervals_of_gap = 2.5;
  static bool is_gap(double duration, double usual_interval) noexcept {
    return duration > longest_gap && !(duration <= usual_intervals_of_gap * usual_interval);
  }
  // A heading that is less certain is still being searched [rad].
  static constexpr double known_heading = 0.35;
  // Disputes longer than this many times the proof, or as many steps, mean that nothing explains the sensors.
  static constexpr int hopeless = 3;
  // A hypothesis that has explained so many samples in a row has learnt how the vehicle moves.
  static constexpr int informed = 4;
  // Slip that would be beyond its bounds by so many standard deviations has not jumped.
  static constexpr double impossible_slip = 3.0;

  std::unique_ptr<RecentSamples> recent;
  std::unique_ptr<PastMoments> past;  ///< farther back than these
  std::vector<double> expected;       ///< n_y, behind the last sample
  /// Whether nothing was measured for long within so many of the newest of these.
  bool has_gap(int samples) noexcept {
    for (int ago = samples; ago > 0; --ago)
      if (is_gap(recent->entry(ago - 1).time - recent->entry(ago).time, loss->usual_interval())) return true;
    return false;
  }
  double now = unknown;            ///< of the last sample [s]
  double unplaced_from = unknown;  ///< since then no sensor has said where the vehicle is [s]
  // Before the last advance, and that.
  Eigen::VectorXd before_mean;
  Eigen::MatrixXd before_covariance;
  double duration = 0.0;
  bool has_advanced = false;            ///< since the last samples
  bool was_calm = true;                 ///< health was ok when the dispute began, and there had been none for some time
  bool was_input_off = false;           ///< a measured input was, at the last sample
  std::vector<std::uint8_t> was_minor;  ///< a sensor was off by no more than its noise, likewise
  bool was_open = false;       ///< what was disputed at the last sample was probably slip, and nothing was said of it
  int undisputed_samples = 0;  ///< in a row
  bool is_counted = true;      ///< the last sample has a position, or was to have one; true where there are none
  std::array<double, 2> jumps{};                        ///< behind which slip has been made anew for what is disputed
  int jump_count = 0;                                   ///< of these
  int since_release = std::numeric_limits<int>::max();  ///< such samples since slip was found to have jumped
  double disputed_from = unknown;                       ///< behind this time what is disputed was measured
  Retraction released{unknown, unknown, nullptr};       ///< what would have to be taken back of that
  std::vector<double> retracted;                        ///< n_y, not missing of outputs that were wrong then
  MeasuredOutputs replayed;                             ///< what counts of a sample that is replayed or remembered
  MeasuredOutputs contradicting;                        ///< what contradicts inputs, as it was measured
  /// How far slip that explains what is disputed is beyond its bounds, in its standard deviations.
  double slip_beyond = 0.0;
  StuckValues stuck;
  std::unique_ptr<OffsetWatch> offsets;
  std::unique_ptr<CorrelatedErrors> correlated;
  /// Of a measured input that is not believed by itself.
  struct Doubt {
    bool is_doubted = false;
    int agreed = 0;                  ///< measurements in a row of those who contradicted it that agree with it
    double least = 0.0, most = 0.0;  ///< of these, and what it said before
    int remembered = 0;              ///< samples for which it is the one that is suspected first
  };
  std::vector<Contradiction> contradictions;
  std::vector<Doubt> doubts;            ///< n_u
  std::vector<double> measured_inputs;  ///< n_u, of the last message
  std::vector<double> inputs_without;   ///< n_u, for what is tried
  std::vector<double> unknown_sigmas;   ///< n_u, standard deviations of inputs of which nothing is known
  std::vector<double> more_sigmas;      ///< n_u, scratch
  std::unique_ptr<InformationLoss> loss;
  std::unique_ptr<WalkingFilter> trial;     ///< for what is tried within one call
  std::unique_ptr<WalkingFilter> ahead;     ///< behind the last sample that was judged
  std::unique_ptr<WalkingFilter> unplaced;  ///< a filter that has used what is no position
  std::unique_ptr<HeadingSearch> search;    ///< null for a vehicle without a heading
  bool is_starting = false;                 ///< it is that of the start
  /// Whether a heading is to be searched, by what a filter knows of it; by so many times the usual limit.
  bool is_heading_unknown(const WalkingFilter& filter, double times = 1.0) const noexcept {
    if (!search) return false;
    const int heading = filter.model().description().roles.heading;
    const double limit = times * known_heading;
    return filter.covariance()(heading, heading) > limit * limit;
  }
  /// The same, of a heading that may be wrong, while it is not known who is.
  std::unique_ptr<HeadingSearch> second_thought;
  std::unique_ptr<Hypothesis> double_fault;  ///< a position has moved, and those who are accused are wrong
  std::vector<char> accused;                 ///< by sensor
  std::vector<double> not_accused;           ///< n_y: what the others have measured
  std::vector<double> first_errors;          ///< n_y: by how much rejected outputs were off when the dispute began
  int in_vain = 0;                           ///< samples in a row that it has not explained
  Eigen::MatrixXd factor;                    ///< of a covariance
  Eigen::VectorXd away;                      ///< of slip that has jumped from an estimate
  Eigen::VectorXd before_update;             ///< the mean
  Eigen::VectorXd before_slip;               ///< that of slip that may have jumped
  Eigen::VectorXd near_slip;                 ///< n_p, what such slip is nearly
  bool is_slip_near = false;                 ///< it began from that
  /// By how much measurements ask for slip beyond its bounds: a cumulative sum of standard deviations (Page 1954).
  double beyond_bounds = 0.0;
  int impossible_samples = 0;  ///< in a row in which that sum was too large
  PastPlaces places;
  std::size_t place = 0;  ///< that the position has come back to, while that is open
  Displacement jump;      ///< of a position that has moved, from where the estimate expected it
  bool is_jump_known = false;
  bool was_return = false;  ///< what was followed last

  /// After an update of a filter from a mean: how far slip would be beyond its bounds, in its standard deviations.
  static double slip_beyond_bounds(const WalkingFilter& filter, const Eigen::VectorXd& before,
                                   const KalmanFilter::Noise& noise) noexcept {
    double most = 0.0;
    const Eigen::Index nx = filter.model().state_count();
    for (Eigen::Index p = 0; p < std::ssize(noise.parameter_lower); ++p) {
      const double lower = noise.parameter_lower[static_cast<std::size_t>(p)],
                   upper = noise.parameter_upper[static_cast<std::size_t>(p)];
      const double mean = filter.mean()[nx + p], variance = filter.covariance()(nx + p, nx + p);
      if ((mean > lower && mean < upper) || !(variance > 0.0)) continue;
      double slip = before[nx + p];
      for (int j = 0; j < filter.model().output_count(); ++j)
        if (const KalmanFilter::Use use = filter.use(j); use.variance > 0.0) slip += use.gain[nx + p] * use.innovation;
      most = std::max(most, std::max(lower - slip, slip - upper) / std::sqrt(variance));
    }
    return most;
  }
  /// After an update: how much it was to move the slip that it has moved most, in standard deviations of that slip.
  static double usual_change_of_slip(const WalkingFilter& filter) noexcept {
    double most = 0.0;
    for (Eigen::Index p = filter.model().state_count(); p < filter.mean().size(); ++p) {
      double change = 0.0;
      for (int j = 0; j < filter.model().output_count(); ++j)
        if (const KalmanFilter::Use use = filter.use(j); use.variance > 0.0)
          change += use.gain[p] * use.gain[p] * use.variance;
      if (const double variance = filter.covariance()(p, p); variance > 0.0)
        most = std::max(most, std::sqrt(change / variance));
    }
    return most;
  }
};

}  // namespace rhec
