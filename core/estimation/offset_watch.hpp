#pragma once

#include <algorithm>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/estimation/estimate.hpp"
#include "walking_filter.hpp"

namespace rhec {

/// Watches whether outputs are off by little for long, which a gate on single innovations does not see.
///
/// An output that is off by a constant b since some time spoils the estimate by V b and the innovations by g b, with
/// sensitivities V and g that go through the filter beside it (separate-bias estimation: Friedland 1969). What the
/// innovations say of b then is least squares: b^ = sum(g nu / S) / sum(g^2 / S), and b^^2 times that sum is chi-square
/// distributed while the output is right. When it began is not known: several onsets go along (generalised likelihood
/// ratio: Willsky and Jones 1976), and one that has been there for ever. An offset that is adopted is taken out of what
/// is measured from then on; how far it may be off still, and what that does to the estimate, goes on to be estimated
/// in the same way. One that later innovations do not confirm is withdrawn.
///
/// Allocates in its constructor only.
class OffsetWatch {
 public:
  /// `outputs`: those that are watched; `gate`: standard deviations by which an offset has to differ from none.
  OffsetWatch(const Model& model, std::vector<int> outputs, const KalmanFilter::Noise& noise, double gate);

  void reset() noexcept;
  /// The estimate has jumped: what offsets have done to it is not known any more.
  void forget_onsets() noexcept;

  /// Takes offsets that are known out of outputs (n_y).
  void correct(double* outputs) const noexcept;
  /// Columns that go along with the filter's predictions (`WalkingFilter::predict`).
  Eigen::MatrixXd& sensitivities() noexcept { return sensitivities_; }
  /// What is not known of offsets that were adopted makes an innovation of a sensor's outputs (n_y) wider.
  void widen(const WalkingFilter& filter, const Sensor& sensor, const double* outputs, Innovation& innovation) noexcept;
  /// What the filter is about to use of the outputs, after `expect`. `excess`: squares of innovations have been so many
  /// times what was expected.
  void take(const WalkingFilter& filter, Measured outputs, double excess) noexcept;
  /// Whether innovations say that an output is off, or has come back.
  bool has_suspect() const noexcept { return suspect_ >= 0 || refuted_ >= 0; }
  /// Adopts that offset; the filter, after its update, becomes what it would be without it.
  void adopt_suspected(WalkingFilter& filter) noexcept;
  /// Adopts that the offset of an output has changed by this much, known with a variance.
  void adopt(int output, double change, double variance) noexcept;

  /// What said that outputs are off was wrong: offsets that have been adopted of late are none, or at least the filter
  /// does not know.
  void withdraw_recent(WalkingFilter& filter) noexcept;

  /// What an output is off by; 0 if it is right.
  double offset(int output) const noexcept { return known_[static_cast<std::size_t>(output)].value; }
  bool has_any() const noexcept;
  bool has_recent() const noexcept;  ///< one that was adopted of late
  /// Gives an estimate of [x; p] the mean and the covariance that it has if offsets are not known better than they are.
  void refine(Estimate& estimate) const noexcept;

 private:
  /// What has been learnt of a constant.
  struct Constant {
    double information = 0.0, score = 0.0;
    double squares = 0.0, count = 0.0;  ///< of innovations, relative to their variances
    double value() const noexcept { return information > 0.0 ? score / information : 0.0; }
    double explained() const noexcept { return score * value(); }
    /// b^^2 by its variance, where the variance of innovations is what is left of them, if that is more than expected.
    double significance() const noexcept {
      return explained() / std::max(1.0, (squares - explained()) / std::max(1.0, count - 1.0));
    }
    void fade(double share) noexcept { information *= share, score *= share, squares *= share, count *= share; }
  };
  struct Onset {
    int output = -1;  ///< -1: none
    int age = 0;      ///< [samples]
    Constant offset = {};
  };
  struct Known {
    bool is_recent() const noexcept;
    bool is_significant() const noexcept;
    bool is_off = false;
    int age = 0;  ///< [samples]
    double value = 0.0;
    Constant error;  ///< of the value, to be added to it
  };
  void begin(int output) noexcept;
  void note(int output, Constant& constant, Eigen::Index column, int off) noexcept;
  void withdraw(int watched, WalkingFilter& filter) noexcept;
  void clip(Eigen::VectorXd::SegmentReturnType parameters) const noexcept;

  std::vector<int> outputs_;
  std::vector<double> variances_, parameter_lower_, parameter_upper_;
  std::vector<bool> is_angle_;
  double limit_;
  std::vector<Onset> onsets_;  ///< first those of offsets that have been there for ever, one for each watched output
  std::vector<Known> known_;   ///< by output
  Eigen::MatrixXd sensitivities_;    ///< V, n rows: of onsets, and then of outputs that are watched
  int suspect_ = -1, refuted_ = -1;  ///< an onset; a watched output whose offset is none after all
  // Of the output that is being taken:
  Eigen::MatrixXd covariance_;
  Eigen::VectorXd gradient_, image_, correction_;
  double innovation_ = 0.0, variance_ = 0.0;
};

}  // namespace rhec
