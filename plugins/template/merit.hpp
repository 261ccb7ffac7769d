#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "rhec/core/ocp/ocp.hpp"

/// The merit function of plain_sqp's line search: the objective, an augmented Lagrangian of the bounds (Nocedal &
/// Wright, Numerical Optimization, 17.4) and an l1 penalty on the defects of the dynamics,
///
///     sum_i l_i  +  weight/2 sum_v (v + m/weight - nearest value within the bounds)^2  +  price sum |defects|
///
/// with a multiplier m for every variable v that has bounds.
class Merit {
 public:
  Merit() = default;
  explicit Merit(const rhec::Ocp& ocp)
      : multipliers(ocp.capacity()),
        scratch(ocp.scratch_size()),
        defects_(static_cast<std::size_t>(ocp.capacity().intervals) * ocp.capacity().states) {}

  double weight = 1.0, price = 0.0;
  rhec::Iterate multipliers;  ///< m, stored as bound multipliers
  std::vector<double> scratch;

  double operator()(const rhec::Ocp& ocp, rhec::Iterate& point) noexcept {
    double sum = ocp.evaluate(point, defects_.data(), scratch) + cost_of_bounds(ocp, point);
    for (int i = 0; i < ocp.intervals(); ++i)
      for (int j = 0; j < ocp.state_count(i + 1); ++j) sum += price * std::abs(defects_[i * ocp.capacity().states + j]);
    return sum;
  }

  /// The second term. Its derivatives are stored as the point's bound multipliers: the next m.
  double cost_of_bounds(const rhec::Ocp& ocp, rhec::Iterate& point) const noexcept {
    double sum = 0.0;
    const auto add = [&](const double* value, const double* lower, const double* upper, const double* multiplier,
                         double* derivative, int n) {
      for (int j = 0; j < n; ++j) {
        const double shifted = value[j] + multiplier[j] / weight;
        const double outside = shifted - std::min(std::max(shifted, lower[j]), upper[j]);
        derivative[j] = weight * outside;
        sum += 0.5 * weight * outside * outside;
      }
    };
    for (int i = 0; i <= ocp.intervals(); ++i) {
      if (i == 0 && ocp.initial_state()) {  // a given state is not a variable
        std::fill_n(point.state_bound(0), ocp.state_count(0), 0.0);
      } else {
        add(point.state(i), ocp.state_lower(i), ocp.state_upper(i), multipliers.state_bound(i), point.state_bound(i),
            ocp.state_count(i));
      }
      if (i == ocp.intervals()) break;
      add(point.control(i), ocp.control_lower(i), ocp.control_upper(i), multipliers.control_bound(i),
          point.control_bound(i), ocp.control_count(i));
    }
    return sum;
  }

 private:
  std::vector<double> defects_;
};
