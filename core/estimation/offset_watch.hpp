#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "innovation_whiteness.hpp"
#include "rhec/core/estimation/estimate.hpp"
#include "walking_filter.hpp"

namespace rhec {

/// Watches whether outputs, or measured inputs, are off by little for long, which a gate on single innovations does not
/// see.
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
  static constexpr int for_good = 25;  ///< what has lasted for so many samples that count lasts for good
  struct Watched {
    int output = -1;  ///< -1: an input
    int input = -1;   ///< -1: an output
    /// Another output of the position, of another device, that measures the same: only their difference is known, and
    /// which of the two is off is not. -1: none, the output is not one of the position.
    int rival = -1;
    /// The state that is this output's bias and nothing else; -1: none.
    int bias = -1;
    /// Whether innovations are searched for it; else an offset is only adopted that something else says.
    bool is_searched = true;
  };
  /// `gate`: standard deviations by which an offset has to differ from none.
  OffsetWatch(const Model& model, const std::vector<Watched>& watched, const KalmanFilter::Noise& noise, double gate);

  void reset() noexcept;
  /// The estimate has jumped: what offsets have done to it is not known any more.
  void forget_onsets() noexcept;

  /// Takes offsets that are known out of outputs (n_y).
  void correct(double* outputs) const noexcept;
  /// The same of measured inputs (n_u).
  void correct_inputs(double* inputs) const noexcept;
  /// What goes along with the filter's predictions (`WalkingFilter::predict`).
  KalmanFilter::Deviations& sensitivities() noexcept { return sensitivities_; }
  /// What is not known of offsets that were adopted makes an innovation of a sensor's outputs (n_y) wider.
  void widen(const WalkingFilter& filter, const Sensor& sensor, const double* outputs, Innovation& innovation) noexcept;
  /// The same of the offset that is more probable than not. Once it counts, an innovation may be explained that nothing
  /// else explains.
  void widen_by_candidate(const WalkingFilter& filter, const Sensor& sensor, const double* outputs,
                          Innovation& innovation) const noexcept;
  /// What the filter has just used of the outputs. `excess`: squares of innovations have been so many times what was
  /// expected. `whiteness` (n_y, or none): of the output's sensor, null where it is not watched; errors that last for
  /// some samples are not mistaken for one that is constant. `counts`: the sample is one of those in which time is
  /// counted.
  void take(const WalkingFilter& filter, double excess, std::span<const InnovationWhiteness* const> whiteness = {},
            bool counts = true) noexcept;
  /// Whether innovations say that an output is off, or has come back.
  bool has_suspect() const noexcept { return suspect_ >= 0 || refuted_ >= 0; }
  /// The output of which they say that it is off; -1: none.
  int suspected() const noexcept {
    return suspect_ < 0 || refuted_ >= 0 ? -1 : outputs_[static_cast<std::size_t>(onsets_[suspect_].watched)];
  }
  /// Adopts that offset; the filter becomes what it would be without it.
  void adopt_suspected(WalkingFilter& filter) noexcept;
  /// The same of one that is probable, where something else says so, too.
  void adopt_candidate(WalkingFilter& filter) noexcept { adopt_lane(candidate_, filter); }
  /// Whether an innovation says that a sensor which was off is right again: it agrees with what the filter expects as
  /// it was measured, without what is taken out of it. Not of outputs of which it is not known whether it is they.
  bool is_right_again(const std::vector<int>& outputs, const Innovation& innovation) const noexcept;
  /// So it is: the filter becomes what is known with the offset that it had, of which nothing is taken out any more.
  void end(const std::vector<int>& outputs, WalkingFilter& filter) noexcept;
  /// Whether an output is watched by itself, and may be off by this much more, which is known well enough.
  bool can_be_off(int output, double change, double variance) const noexcept;
  /// Adopts that. What is not known of it is more than that, as of those that innovations have said.
  void adopt_mean(int output, double change, double variance) noexcept;
  /// Adopts that the offset of an output has changed by this much, known with a variance. `is_sure`: of two that
  /// measure the same it is this one.
  void adopt(int output, double change, double variance, bool is_sure = false) noexcept;
  bool is_watched(int output) const noexcept { return watched_of_[static_cast<std::size_t>(output)] >= 0; }

  /// An output that is off for good, and has a state for its bias: from then on that state is what it is off by, for
  /// nothing distinguishes them. The filter becomes that. Which output; -1: none.
  int hand_over(WalkingFilter& filter) noexcept;
  /// The state that is an output's bias has changed by this much, known with a variance; false if there is none.
  bool move_bias(int output, double change, double variance, WalkingFilter& filter) noexcept;

  /// What said that outputs are off was wrong: offsets that have been adopted of late are none, or at least the filter
  /// does not know.
  void withdraw_recent(WalkingFilter& filter) noexcept;

  /// Nothing is taken out any more of an output.
  void forget(int output) noexcept {
    if (const int k = watched_of_[static_cast<std::size_t>(output)]; k >= 0) known_[static_cast<std::size_t>(k)] = {};
  }
  /// Nothing is taken out any more of outputs of the position.
  void forget_receivers() noexcept;

  /// What an output is off by; 0 if it is right.
  double offset(int output) const noexcept {
    const int k = watched_of_[static_cast<std::size_t>(output)];
    return k < 0 ? 0.0 : known_[static_cast<std::size_t>(k)].value;
  }
  /// What an input is off by; 0 if it is right.
  double input_offset(int input) const noexcept {
    for (std::size_t k = 0; k < inputs_.size(); ++k)
      if (inputs_[k] == input) return known_[k].value;
    return 0.0;
  }
  /// The output that says otherwise, where it is not known which of the two is off; -1: none.
  int rival(int output) const noexcept {
    const int k = watched_of_[static_cast<std::size_t>(output)];
    return k < 0 || known_[static_cast<std::size_t>(k)].is_sure ? -1 : rivals_[static_cast<std::size_t>(k)];
  }
  bool has_any() const noexcept;
  /// Whether it is known that an output is off, and not its rival; whether there is one.
  bool is_sure(int output) const noexcept {
    const int k = watched_of_[static_cast<std::size_t>(output)];
    return k >= 0 && known_[static_cast<std::size_t>(k)].is_sure;
  }
  bool has_sure() const noexcept {
    return std::ranges::any_of(known_, [](const Known& each) { return each.is_sure; });
  }
  /// Whether estimates are to be refined: there is one, or one is not improbable.
  bool is_in_doubt() const noexcept { return candidate_ >= 0 || has_any(); }
  /// Which of those that are watched is more probably off than not, though that has not said enough yet; -1: none.
  int probable() const noexcept { return candidate_ >= 0 && probability_ > 0.5 ? onsets_[candidate_].watched : -1; }
  /// The output that is watched as this one; -1: it is an input.
  int watched_output(int watched) const noexcept { return outputs_[static_cast<std::size_t>(watched)]; }
  bool has_recent() const noexcept;                                  ///< one that was adopted of late
  bool has_any_but(const std::vector<int>& outputs) const noexcept;  ///< of others than these
  /// Gives an estimate of [x; p] the mean and the covariance that it has if offsets are not known better than they are.
  /// One that is not adopted yet, and the other one of two outputs of which one is off, count with their probability:
  /// the mean stays, and the covariance is the second moment of both answers about it.
  void refine(Estimate& estimate) const noexcept;

 private:
  static constexpr int block = 4;  ///< of lanes that are calculated together
  using Lanes = Eigen::Array<double, block, 1>;
  /// What has been learnt of a constant that an output is off by.
  struct Constant {
    double information = 0.0, score = 0.0;
    double squares = 0.0, count = 0.0;  ///< of innovations, relative to their variances
    double value() const noexcept { return information > 0.0 ? score / information : 0.0; }
    double explained() const noexcept { return score * value(); }
    /// b^^2 by its variance, where the variance of innovations is what is left of them, if that is more than expected.
    double significance() const noexcept {
      return explained() / std::max(1.0, (squares - explained()) / std::max(1.0, count - 1.0));
    }
  };
  struct Onset {
    int watched = -1;                        ///< -1: none
    int age = 0;                             ///< [samples that count]
    double excess = 1.0, correlation = 1.0;  ///< of innovations when it began
    std::size_t first = 0;                   ///< so many innovations of its sensor were known then
    double left_out = 0.0;  ///< of the first one's square by its variance, since it counts as no more than it may
  };
  struct Known {
    bool is_recent() const noexcept;
    bool is_off = false, is_sure = false;
    int age = 0;  ///< [samples that count]
    double value = 0.0;
    double by_x = 0.0, by_y = 0.0;  ///< derivatives of the output by the position
  };
  int lane_of_known(std::size_t watched) const noexcept { return static_cast<int>(onsets_.size() + watched); }
  Constant constant(int lane) const noexcept {
    return {information_[lane], score_[lane], squares_[lane], count_[lane]};
  }
  void set(int lane, const Constant& constant) noexcept;
  void begin(const Onset& onset) noexcept;
  bool has_young(int watched) const noexcept;
  void begin_inputs(const WalkingFilter& filter, double excess) noexcept;
  void age(const WalkingFilter& filter, bool counts) noexcept;
  double find_candidate(const WalkingFilter& filter, double excess) noexcept;
  void note(const WalkingFilter& filter, int output, const KalmanFilter::Use& use, double correlation) noexcept;
  void mark(int lane, int watched) noexcept;
  void adopt_lane(int lane, WalkingFilter& filter) noexcept;
  void adopt_mean_of(int watched, double change, double variance) noexcept;
  void adopt_of(int watched, double change, double variance, bool is_sure) noexcept;
  void widen_by(const WalkingFilter& filter, const Sensor& sensor, const double* outputs, int output, int lane,
                Innovation& innovation) const noexcept;
  bool is_significant(std::size_t watched) const noexcept;
  bool is_possible(int watched, double change) const noexcept;
  bool leaves_possible(int lane, const WalkingFilter& filter) const noexcept;
  bool ends(int watched, const Constant& change) const noexcept;
  void withdraw(std::size_t watched, WalkingFilter& filter) noexcept;
  void find_used_lanes() noexcept;
  void clip(Eigen::VectorXd::SegmentReturnType parameters) const noexcept;

  std::vector<int> outputs_, inputs_;  ///< that are watched; in the place of one there is no other
  std::vector<int> rivals_, biases_;
  std::vector<char> searched_;
  std::vector<int> first_slot_, slots_;  ///< by watched output, its places for onsets
  std::vector<int> watched_of_;          ///< by output, which of these it is; -1: none
  std::vector<double> most_offset_;      ///< by watched output
  int position_x_, position_y_;          ///< states
  std::vector<double> parameter_lower_, parameter_upper_;
  double limit_;
  std::vector<Onset> onsets_;  ///< first those of offsets that have been there for ever, one for each watched output
  std::vector<Known> known_;   ///< by watched output; what is not known of its value is to be added to it
  // Lanes: those of onsets, and then of what is known of watched outputs.
  KalmanFilter::Deviations sensitivities_;  ///< V
  Eigen::ArrayXd information_, score_, squares_, count_;
  Eigen::ArrayXd is_sure_;           ///< 1 in lanes of offsets of which that is known
  Eigen::ArrayXXd is_off_;           ///< 1 in lanes of an output, by output
  int suspect_ = -1, refuted_ = -1;  ///< an onset; a watched output whose offset is none after all
  int candidate_ = -1;               ///< an onset that has not said enough yet
  double probability_ = 0.0;         ///< that this one is right
};

}  // namespace rhec
