#pragma once

#include <memory>
#include <vector>

#include "rhec/core/estimation/rhythm.hpp"
#include "walking_filter.hpp"

namespace rhec {

/// How much less is known of states and slip because measurements were lacking: that have not come, or were not used.
///
/// Two Kalman filters go along where the judge of measurements is, from what it knew before something was lacking. One
/// uses what it used; the other one all that was to be expected. Only their covariances matter: derivatives are taken
/// at the judge's mean, and measurements have no innovations. It ends when both know as much again.
class InformationLoss {
 public:
  InformationLoss(const std::shared_ptr<const Model>& model, const WalkingFilter::Setup& setup);
  void reset() noexcept;

  bool is_active() const noexcept { return is_active_; }
  void end() noexcept;
  /// Samples that count since something was lacking, while it is active.
  int samples_since() const noexcept { return samples_since_; }
  /// By how much the volume of the covariance's ellipsoid is too large: a logarithm, 0 while it is not active.
  double excess() const noexcept { return excess_; }
  static constexpr double most_volume = 2.0;  ///< of the volume without loss: more is much
  /// Samples that count in a row after which it was more.
  int samples_above() const noexcept { return samples_above_; }

  /// A sample at a time [s] with these outputs (n_y, NaN where missing).
  void note(double time, const double* measured) noexcept;
  /// These have come, too, behind samples that were noted before: they are not lacking. `counts` as of `update`.
  void note_late(double time, const double* measured, bool counts = true) noexcept;
  /// Whether an output has come with it, or late before it, or was to come.
  bool is_expected(int output) const noexcept {
    const auto j = static_cast<std::size_t>(output);
    return expected_[j] || has_come_late_[j];
  }
  /// Usual intervals of samples, and of those of an output [s]; NaN: not known.
  double usual_interval() const noexcept { return samples_.interval(); }
  double usual_interval(int output) const noexcept {
    return outputs_[static_cast<std::size_t>(output)].rhythm.interval();
  }

  /// From the judge's moments before `duration` [s] with an input (n_u). `more_sigmas` (n_u, or null) as in
  /// SensorJudge::advance: nobody has said what the input is.
  void predict(const WalkingFilter& judge, const double* inputs, double duration, const double* more_sigmas) noexcept;
  /// That sample, before the judge uses what is left of it (n_y). `counts`: one of a quick sensor beside a slow one
  /// that says where the vehicle is does not.
  void update(const WalkingFilter& judge, Measured used, bool counts = true) noexcept;
  /// After the judge has gone elsewhere at this sample, or by itself.
  void follow(const WalkingFilter& judge) noexcept;

 private:
  /// Of an output.
  struct Expected {
    Rhythm rhythm;
    double counted;  ///< time of its last sample that came or was to come [s]; NaN: none
    bool waits;      ///< it has come late since the last sample
    bool was_due(double time) noexcept;
  };
  void begin(const WalkingFilter& judge) noexcept;
  void find_excess() noexcept;

  WalkingFilter actual_, complete_;
  std::vector<Expected> outputs_;         ///< n_y
  std::vector<bool> expected_;            ///< n_y, of the last sample
  std::vector<bool> has_come_late_;       ///< n_y, since the sample before
  std::vector<double> values_, weights_;  ///< n_y, what counts of it
  Rhythm samples_;
  double since_last_ = 0.0;  ///< [s]
  double excess_ = 0.0;
  Eigen::MatrixXd factor_;  ///< of a covariance
  int missed_ = 0;          ///< samples since the last one that have not come
  int samples_since_ = 0, samples_above_ = 0;
  bool is_active_ = false;
};

}  // namespace rhec
