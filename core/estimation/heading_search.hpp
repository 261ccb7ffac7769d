#pragma once

#include <memory>
#include <vector>

#include "rhec/core/base/infinity.hpp"
#include "walking_filter.hpp"

namespace rhec {

/// Finds the heading of a vehicle whose place is measured: filters that start with headings around the circle, until
/// one explains the measurements so much better than all that differ that these cannot be meant, and well by itself.
/// Takes motion.
///
/// Where an antenna is says where the vehicle is only together with its heading: each filter has a place of its own, by
/// the first position. What none of them explains is not used if what came before went together. Evidence fades: a
/// vehicle that stands for hours would else collect as much of it from noise as one that moves does in a second.
class HeadingSearch {
 public:
  static constexpr int starts = 16;
  /// `gate`: a measurement that is less probable than so many standard deviations is not explained.
  HeadingSearch(const std::shared_ptr<const Model>& model, const WalkingFilter::Setup& setup, double gate);

  bool is_active() const noexcept { return is_active_; }
  void cancel() noexcept { is_active_ = false; }
  /// Starts from moments of [x; p], and of measured outputs (n_y, NaN where missing) the position: where there is one,
  /// it alone says where the vehicle is. `sigma`: standard deviation of the heading, where something is known of it
  /// [rad].
  void start(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance, Measured outputs,
             double sigma = infinity) noexcept;
  void predict(const double* inputs, double duration) noexcept;
  /// Uses outputs (n_y, NaN where missing). True once the heading is found; then it is active no more.
  bool update(const std::vector<Sensor>& sensors, Measured outputs) noexcept;
  /// The filter that explains the measurements best.
  const WalkingFilter& best() const noexcept { return headings_[best_].filter; }
  /// The mean of that filter, and about it the covariance of all, by how well they explain the measurements.
  void moments(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const noexcept;
  /// Samples in a row that it has explained.
  int explained() const noexcept { return headings_[best_].explained; }

 private:
  struct Heading {
    WalkingFilter filter;
    double log_likelihood = 0.0;  ///< of measurements
    double prior = 0.0;           ///< logarithm
    double surprise = 0.0;        ///< of the last measurement
    bool is_explaining = false;   ///< that one
    double log_probability() const noexcept { return prior + log_likelihood; }
    int explained = 0;  ///< samples in a row
  };
  void place(WalkingFilter& filter, Measured outputs) noexcept;
  bool weigh(const Sensor& sensor, Measured outputs) noexcept;
  bool is_settled() const noexcept;
  void restart(Measured outputs) noexcept;
  bool sees_position(const WalkingFilter& filter, Measured outputs) const noexcept;

  double gate_;
  std::vector<Heading> headings_;
  std::vector<double> position_;  ///< n_y, outputs without what is no position
  std::vector<double> used_;      ///< n_y, outputs without what no heading explains
  Eigen::VectorXd mean_;          ///< from which it begins anew
  Eigen::MatrixXd variances_;
  bool is_explained_ = true;  ///< all of the last sample, by some heading
  int unplaced_ = 0;          ///< positions in a row that no heading explains, and that were not used
  int explained_places_ = 0;  ///< such in a row that one does
  Innovation innovation_;
  std::size_t best_ = 0;
  bool is_active_ = false;
};

}  // namespace rhec
