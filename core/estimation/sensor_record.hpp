#pragma once

#include <algorithm>

#include "innovation.hpp"
#include "offset_watch.hpp"
#include "sensor_judge.hpp"

namespace rhec {

/// What a sensor has done in a row.
struct SensorJudge::Record {
  int failures = 0, passes = 0;
  double since = 0.0;                               ///< time of the first of these failures [s]
  Eigen::Vector2d place = Eigen::Vector2d::Zero();  ///< where the vehicle was then [m]
  int steady = 0;                                   ///< samples that count, since when it has failed by one error
  int agrees = 0;                      ///< samples that count, since when this error is one that would not have failed
  int right_again = 0;                 ///< failures in a row that it would not have if it were not off any more
  bool after_gap = false;              ///< the first failure came after a time in which the sensor had said nothing
  Innovation::OfSensor<1> first = {};  ///< of those innovations that failed
  Innovation::OfSensor<1> error;       ///< mean of them
  Innovation::OfSensor<1> steady_from = {};         ///< what that was when it became steady
  Innovation::OfSensor<Eigen::Dynamic> covariance;  ///< of the first of these
  Innovation::OfSensor<1> mean = {};                ///< since it is steady
  Innovation::OfSensor<1> variances = {};           ///< of the newest one's values
  int count = 0;                                    ///< of these

  /// A sample that counts has gone by while the sensor fails. `close_limit`: of one value.
  void note_time(double close_limit) noexcept {
    ++steady;
    agrees = error.size() == 1 && error[0] * error[0] < close_limit * covariance(0, 0) ? agrees + 1 : 0;
  }
  /// Of the mean of a value since it is steady: errors of an estimate that goes on without the sensor have to do with
  /// each other for about as many samples as it takes for good.
  double variance_of_mean(Eigen::Index value) const noexcept {
    return variances[value] / (1.0 + steady / double{OffsetWatch::for_good});
  }
  bool has_lasted() const noexcept { return std::min(steady, failures) >= OffsetWatch::for_good; }
  /// The first innovation that fails.
  void begin(const Innovation& innovation) noexcept {
    error = first = steady_from = innovation.value;
    covariance = innovation.covariance;
    begin_mean(innovation);
  }
  /// An innovation fails whose nu' S^-1 nu from the mean may be `limit`; that of the mean may be `close_limit` since it
  /// is steady.
  void note_failure(const Innovation& innovation, double limit, double close_limit) noexcept {
    // The error of a sensor that fails is a mean over so many of its measurements.
    constexpr double error_memory = 5.0;
    passes = 0;
    variances = innovation.covariance.diagonal();
    if (failures++ == 0 || error.size() != innovation.value.size()) return begin(innovation);
    const Innovation::OfSensor<1> rest = innovation.value - error;
    error += rest / error_memory;
    const Innovation::OfSensor<1> drift = error - steady_from;
    const bool is_steady =
        squared_size(rest, innovation.covariance) <= limit && squared_size(drift, innovation.covariance) <= close_limit;
    if (is_steady) {
      mean += (innovation.value - mean) / ++count;
      return;
    }
    steady = 0;
    steady_from = error;
    begin_mean(innovation);
  }

 private:
  void begin_mean(const Innovation& innovation) noexcept {
    mean = innovation.value;
    count = 1;
  }
};

}  // namespace rhec
