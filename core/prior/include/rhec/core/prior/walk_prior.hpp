#pragma once

#include "rhec/core/prior/prior_options.hpp"

namespace rhec {

/// A random walk: the variance of the change grows in proportion to the advance. Without noise, a constant.
class RHEC_EXPORT WalkPrior : public Prior {
 public:
  struct Walk : CommonPriorOptions {
    double rate = 0.0;  ///< standard deviation of the change per square root of [s or m]
  };
  explicit WalkPrior(const Walk& walk) : walk_(walk) {}

  void set_up(const Variable& parameter) override;
  std::span<const ProcessState> states() const noexcept override;
  Along along() const noexcept override { return walk_.along; }
  Course course() const noexcept override { return walk_.course; }
  void start(double* mean, double* covariance) const noexcept override;
  void advance(double d, double* F, double* Q) const noexcept override;

 private:
  Walk walk_;
  double mean_ = 0.0, sigma_ = 1.0;
};

}  // namespace rhec
