#pragma once

#include <optional>

#include "rhec/core/prior/matern.hpp"
#include "rhec/core/prior/prior_options.hpp"

namespace rhec {

/// A Matern process about a mean of its own, which is the last state and walks slowly: slip varies about a level that
/// nobody knows before, and that changes from field to field.
class RHEC_EXPORT MaternPrior : public Prior {
 public:
  struct Law : CommonPriorOptions {
    int states = 2;                   ///< smoothness nu + 1/2: 1, 2 or 3
    double length = 10.0;             ///< [s or m]
    std::optional<double> sigma;      ///< about the mean; none: 0.15 of the width of the bounds
    std::optional<double> mean_rate;  ///< of the mean's walk, per square root of [s or m]; none: 0.005 of that width
  };
  explicit MaternPrior(const Law& law) : law_(law) {}

  void set_up(const Variable& parameter) override;
  std::span<const ProcessState> states() const noexcept override;
  Along along() const noexcept override { return law_.along; }
  Course course() const noexcept override { return law_.course; }
  void start(double* mean, double* covariance) const noexcept override;
  void advance(double d, double* F, double* Q) const noexcept override;

 private:
  Law law_;
  Matern matern_;
  double mean_ = 0.0, mean_sigma_ = 0.0, mean_rate_ = 0.0;
};

}  // namespace rhec
