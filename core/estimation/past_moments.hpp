#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "numbers.hpp"
#include "walking_filter.hpp"

namespace rhec {

/// What a filter knew at times in the past, apart by so much that a given number of them covers a given time, however
/// quick the sensors are: for measurements that are late by more than the newest samples reach back.
class PastMoments {
 public:
  PastMoments(std::size_t capacity, const WalkingFilter& like, int inputs) {
    Past empty{none, like.mean(), like.covariance(), std::vector<double>(static_cast<std::size_t>(inputs), none), 0.0};
    ring_.assign(capacity, empty);
  }
  /// They shall cover a time [s].
  void cover(double time) noexcept { apart_ = time / static_cast<double>(ring_.size()); }
  void forget() noexcept { count_ = 0; }

  /// The filter after a sample.
  void note(double time, const WalkingFilter& filter) noexcept {
    // Times that are sums of intervals are off by rounding.
    if (count_ > 0 && time - newest().time < (1.0 - 1e-6) * apart_) return;
    ++count_;
    Past& past = newest();
    past.time = time;
    past.duration = 0.0;
    copy_numbers(filter.mean(), past.mean);
    copy_numbers(filter.covariance(), past.covariance);
    std::ranges::fill(past.inputs, none);
  }
  /// The time goes on, with the mean input (NaN where missing).
  void advance(double duration, const double* inputs) noexcept {
    if (count_ > 0) add_to_mean(duration, inputs, newest().duration, newest().inputs);
  }
  /// Makes a filter know what was known at a time. False if that is too long ago.
  bool go_to(double time, WalkingFilter& filter) const noexcept {
    const auto known = std::min<std::int64_t>(count_, std::ssize(ring_));
    for (std::int64_t ago = 0; ago < known; ++ago) {
      const Past& past = ring_[place(count_ - 1 - ago)];
      if (past.time > time) continue;
      copy_numbers(past.mean, filter.mean());
      copy_numbers(past.covariance, filter.covariance());
      filter.predict(past.inputs.data(), time - past.time);
      return true;
    }
    return false;
  }

  /// Adds inputs over a duration to their mean over the time before, which becomes longer; NaN: none.
  static void add_to_mean(double duration, const double* inputs, double& before, std::vector<double>& mean) noexcept {
    before += duration;
    const double share = before > 0.0 ? duration / before : 1.0;
    for (std::size_t j = 0; j < mean.size(); ++j) {
      if (std::isnan(inputs[j])) continue;
      mean[j] = std::isnan(mean[j]) ? inputs[j] : mean[j] + share * (inputs[j] - mean[j]);
    }
  }

 private:
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  struct Past {
    double time;
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    std::vector<double> inputs;  ///< mean until the next one
    double duration;             ///< of these
  };
  std::size_t place(std::int64_t number) const noexcept { return static_cast<std::size_t>(number) % ring_.size(); }
  Past& newest() noexcept { return ring_[place(count_ - 1)]; }

  std::vector<Past> ring_;
  std::int64_t count_ = 0;
  double apart_ = 0.0;  ///< [s]
};

}  // namespace rhec
