#pragma once

#include <memory>
#include <vector>

#include "walking_filter.hpp"

namespace rhec {

/// Finds the heading of a vehicle whose place is known: filters that start with headings around the circle, until one
/// explains the measurements so much better than all that differ that these cannot be meant, and well by itself. Takes
/// motion.
class HeadingSearch {
 public:
  static constexpr int starts = 16;
  /// `gate`: a measurement that is less probable than so many standard deviations is not explained.
  HeadingSearch(const std::shared_ptr<const Model>& model, const WalkingFilter::Setup& setup, double gate);

  bool is_active() const noexcept { return is_active_; }
  void cancel() noexcept { is_active_ = false; }
  /// Starts from moments of [x; p], of which all but the heading is used.
  void start(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept;
  void predict(const double* inputs, double duration) noexcept;
  /// Uses outputs (n_y, NaN where missing). True once the heading is found; then it is active no more.
  bool update(const std::vector<Sensor>& sensors, Measured outputs) noexcept;
  /// The filter that explains the measurements best.
  const WalkingFilter& best() const noexcept { return headings_[best_].filter; }
  /// Samples in a row that it has explained.
  int explained() const noexcept { return headings_[best_].explained; }

 private:
  struct Heading {
    WalkingFilter filter;
    double log_likelihood = 0.0;
    int explained = 0;  ///< samples in a row
  };
  double gate_;
  std::vector<Heading> headings_;
  Innovation innovation_;
  std::size_t best_ = 0;
  bool is_active_ = false;
};

}  // namespace rhec
