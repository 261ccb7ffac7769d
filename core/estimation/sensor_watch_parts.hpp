#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include <Eigen/Cholesky>

#include "heading_search.hpp"
#include "offset_watch.hpp"
#include "rhec/core/estimation/sensor_watch.hpp"
#include "stuck_values.hpp"
#include "walking_filter.hpp"

// What the sources of SensorWatch share.

namespace rhec {

/// A filter, and how long what it assumes has explained the measurements.
struct SensorWatch::Hypothesis {
  WalkingFilter filter;
  bool is_active = false;
  int explained = 0, refuted = 0;
  double evidence = 0.0;     ///< log likelihood of what is not disputed, more than by the filter without the sensor
  bool is_informed = false;  ///< it has explained much before it was refuted
};

/// What was known after the last samples, and the motion since then.
struct SensorWatch::Memory {
  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::size_t remembered_samples = 64;
  // A heading that is less certain is still being searched [rad].
  static constexpr double known_heading = 0.35;
  // Disputes longer than this many times the proof mean that nothing explains the sensors.
  static constexpr int hopeless = 3;

  struct Entry {
    double time = unknown;
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    std::vector<double> inputs;
  };
  std::vector<Entry> entries{remembered_samples};
  std::size_t newest = 0;
  std::int64_t count = 0;
  // Before the last advance, and that.
  Eigen::VectorXd before_mean;
  Eigen::MatrixXd before_covariance;
  double duration = 0.0;
  bool has_advanced = false;  ///< since the last samples
  bool was_calm = true;       ///< health was ok when the dispute began
  StuckValues stuck;
  std::unique_ptr<OffsetWatch> offsets;
  std::unique_ptr<WalkingFilter> trial;   ///< for what is tried within one call
  std::unique_ptr<HeadingSearch> search;  ///< null for a vehicle without a heading
  /// The same, of a heading that may be wrong, while it is not known who is.
  std::unique_ptr<HeadingSearch> second_thought;
  std::vector<double> first_errors;    ///< n_y: by how much rejected outputs were off when the dispute began
  int in_vain = 0;                     ///< samples in a row that it has not explained
  Eigen::LLT<Eigen::MatrixXd> factor;  ///< of a covariance
  Eigen::VectorXd away;                ///< of slip that has jumped from an estimate

  /// log sqrt(det P); NaN where P is not positive definite, as of a parameter that is known.
  double log_volume(const Eigen::MatrixXd& covariance) noexcept {
    factor.compute(covariance);
    return factor.info() == Eigen::Success ? factor.matrixLLT().diagonal().array().log().sum() : unknown;
  }
};

}  // namespace rhec
