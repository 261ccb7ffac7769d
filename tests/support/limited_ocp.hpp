#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rhec/core/base/infinity.hpp"
#include "support/same_ocp.hpp"

namespace rhec::testing {

/// A limit on some entries z_k of a stage's row [s; w], in which w begins at the capacity's number of states.
struct Limit {
  enum class Kind {
    linear,    ///< sum of with_k z_k, such as a corridor
    product,   ///< with_0 z_0 z_1, such as a lateral acceleration
    squares,   ///< sum of with_k z_k^2, such as a circle of forces
    distance,  ///< sqrt(sum of (z_k - with_k)^2 + roundness^2), such as that from an obstacle's centre
  };
  static constexpr double roundness = 0.01;  ///< keeps a distance smooth at the centre

  Kind kind = Kind::linear;
  std::vector<int> of;       ///< which entries, each once; two of a product
  std::vector<double> with;  ///< coefficients or centre, as many; one of a product
  double lower = -infinity, upper = infinity;
  double linear_weight = infinity, quadratic_weight = 0.0;  ///< of the slack; hard by default

  double value(const double* z) const noexcept;
  /// The derivatives by z_k = of[k].
  void gradient(const double* z, double* derivatives) const noexcept;
  /// Those of second order, by z_j and z_k.
  double curvature(const double* z, std::size_t j, std::size_t k) const noexcept;
};

/// Another Ocp, which has no limits, with limits. They may change from sample to sample: clear them, and add others.
/// Unlike other problems it has memory, so it is for one thread at a time.
class LimitedOcp final : public SameOcp {
 public:
  /// With room for so many limits a stage. The other Ocp must outlive this one.
  LimitedOcp(const Ocp& of, int most);

  void clear_limits();
  /// Adds a limit to a stage, at most as many as there is room for.
  void add(int stage, const Limit& limit);
  const std::vector<Limit>& limits(int stage) const noexcept { return limits_[stage]; }

  Capacity capacity() const noexcept override;
  int limit_count(int stage) const noexcept override { return static_cast<int>(limits_[stage].size()); }
  const double* limit_lower(int stage) const noexcept override { return row(stage, 0); }
  const double* limit_upper(int stage) const noexcept override { return row(stage, 1); }
  const double* limit_linear(int stage) const noexcept override { return row(stage, 2); }
  const double* limit_quadratic(int stage) const noexcept override { return row(stage, 3); }
  double evaluate_stages(const Iterate& point, double* defects, double* costs,
                         std::span<double> scratch) const noexcept override;
  void simulate_interval(int interval, Iterate& point, std::span<double> scratch) const noexcept override;
  void evaluate_limits(const Iterate& point, double* values, std::span<double> scratch) const noexcept override;
  bool has_small_residuals() const noexcept override { return of_.has_small_residuals(); }
  bool can_roll_out() const noexcept override { return of_.can_roll_out(); }
  void mark_dynamics(int interval, std::uint8_t* states, std::uint8_t* controls) const noexcept override {
    of_.mark_dynamics(interval, states, controls);
  }
  void mark_limits(int stage, std::uint8_t* states, std::uint8_t* controls) const noexcept override;
  double linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                   std::span<double> scratch) const noexcept override;

 private:
  const double* row(int stage, int which) const noexcept;
  /// An iterate as the other Ocp knows it, without multipliers of bounds and limits.
  const Iterate& without_limits(const Iterate& point) const noexcept;

  const Ocp& of_;
  mutable Iterate plain_;
  mutable StageQp plain_qp_;
  int most_;
  std::vector<std::vector<Limit>> limits_;  ///< of each stage
  std::vector<double> rows_;                ///< bounds and weights: four rows for each stage
};

/// An iterate of the other Ocp as one of the limited one's, without multipliers of limits.
Iterate with_limits(const LimitedOcp& limited, const Iterate& of_other);

}  // namespace rhec::testing
