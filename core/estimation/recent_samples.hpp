#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "numbers.hpp"
#include "rhec/core/horizon/measured_interval.hpp"
#include "walking_filter.hpp"

namespace rhec {

/// What a filter knew after each of the newest samples, what was measured in them, and the inputs from one to the next:
/// so that what was believed can be tried anew from before a sensor was wrong. Only its constructor allocates.
///
/// Sensors may be a hundred times as quick as a receiver is. So that some of its positions are remembered however
/// quick they are, samples without one become a single one within a given time. What that one
/// says of an output is what is expected at its time, and the mean by which what was measured was off, with the
/// information of all: as good as the samples one by one, as far as the output's derivatives stay as they are.
class RecentSamples {
 public:
  struct Entry {
    double time = std::numeric_limits<double>::quiet_NaN();  ///< of the last of its samples [s]
    Eigen::VectorXd mean;                                    ///< behind them
    Eigen::MatrixXd covariance;
    std::vector<double> inputs;     ///< mean until the next one
    std::vector<double> expected;   ///< n_y, behind them
    MeasuredOutputs outputs;        ///< that were used
    MeasuredOutputs rejected;       ///< positions that were not
    MeasuredOutputs contradicting;  ///< as measured, of sensors that contradict inputs; the newest, if used or not
    bool has_position = false;      ///< of either kind
    bool is_kept = false;           ///< it stays one of its own
    int samples = 0;

    void note(const WalkingFilter& filter) noexcept {
      copy_numbers(filter.mean(), mean);
      copy_numbers(filter.covariance(), covariance);
    }
    /// What each sample may be judged by: several together say more than any gate was made for.
    Measured judged() const noexcept {
      const Measured all = outputs.measured();
      return samples > 1 ? Measured(all.values) : all;
    }
  };
  static constexpr std::size_t capacity = 512;

  explicit RecentSamples(const WalkingFilter& like);
  void forget() noexcept { count_ = connected_ = 0; }
  /// What was known before has nothing to do with what follows.
  void disconnect() noexcept { connected_ = 0; }
  /// Samples without a position become one over this time [s]; 0: none do.
  void join_within(double time) noexcept { apart_ = time; }

  /// Entries that are remembered, and those of them that are connected.
  int known() const noexcept { return at_most(count_); }
  int connected() const noexcept { return at_most(connected_); }
  Entry& entry(int ago) noexcept {
    return entries_[(newest_ + entries_.size() - static_cast<std::size_t>(ago)) % entries_.size()];
  }
  /// The newest sample stays one of its own, as where something begins behind it, or what the filter knew there has
  /// been made anew; its time [s].
  double keep_newest() noexcept {
    entry(0).is_kept = true;
    return entry(0).time;
  }

  /// The mean input (n_u, NaN where missing) since the newest sample.
  void note_inputs(const std::vector<double>& inputs) noexcept;
  struct Besides {
    Measured rejected;       ///< positions that were not used
    Measured contradicting;  ///< as they were measured, of sensors that contradict inputs
  };
  /// A sample that a filter has used, and what it expects of the outputs now (n_y). It may become one with those
  /// before.
  void remember(double time, const WalkingFilter& filter, const std::vector<double>& expected, Measured used,
                const Besides& besides, bool has_position) noexcept;

  /// A filter that knows what was known so many entries ago, and perhaps less, goes through what has been measured
  /// since: `take_in(entry)` at each of these, once it has been predicted.
  template <class TakeIn>
  void replay(int since, WalkingFilter& filter, TakeIn take_in) noexcept {
    for (int ago = since; ago > 0; --ago) {
      Entry& next = entry(ago - 1);
      filter.predict(entry(ago).inputs.data(), next.time - entry(ago).time);
      take_in(next);
    }
  }
  void go_back(int ago, WalkingFilter& filter) noexcept {
    copy_numbers(entry(ago).mean, filter.mean());
    copy_numbers(entry(ago).covariance, filter.covariance());
  }
  /// How many of the newest entries it takes to have so many positions, used or rejected, and what was known before;
  /// 0: so many are not remembered.
  int with_positions(int positions) noexcept { return with_positions(positions, connected()); }
  /// The same of all that are remembered.
  int with_positions_known(int positions) noexcept { return with_positions(positions, known()); }
  /// How many lie behind the newest one with a position; 0: none do, or such a one is not remembered.
  int since_position() noexcept;
  /// How many lie behind a time; -1: all that are left, so that nothing is known of it.
  int behind(double time) noexcept;
  /// How many begin at a time, or behind it.
  int since(double time) noexcept;

 private:
  int with_positions(int positions, int count) noexcept;
  static int at_most(std::int64_t count) noexcept {
    return static_cast<int>(count < static_cast<std::int64_t>(capacity) ? count : static_cast<std::int64_t>(capacity));
  }
  bool joins(double time, bool has_position) noexcept;
  void join(double time, const std::vector<double>& expected, Measured used) noexcept;

  std::vector<Entry> entries_{capacity};
  std::vector<double> values_, weights_;  ///< n_y, of one that is joined
  std::vector<bool> is_angle_;            ///< n_y
  std::size_t newest_ = 0;
  std::int64_t count_ = 0;
  std::int64_t connected_ = 0;  ///< of the newest, by what moves and by what is measured
  double apart_ = 0.0;          ///< [s]
};

}  // namespace rhec
