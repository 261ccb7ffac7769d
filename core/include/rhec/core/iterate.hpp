#pragma once

#include <vector>

#include "rhec/core/export.hpp"

namespace rhec {

/// The sizes that memory is set aside for: the largest structure that a problem can take.
struct Capacity {
  int intervals = 0;  ///< N
  int states = 0;     ///< n_s, at any node
  int controls = 0;   ///< n_w, on any interval

  bool operator==(const Capacity&) const = default;
};

/// A primal-dual point of an Ocp. Rows have the capacity's length, whatever a stage really uses. With the Lagrangian
///
///     L = sum_i l_i(s_i, w_i) + sum_i costate_{i+1}' (F_i(s_i, w_i) - s_{i+1}) + sum_i state_bound_i' s_i +
///     control_bound_i' w_i
///
/// a bound multiplier is positive at an upper bound, negative at a lower one and zero between. costate_0 belongs to a
/// given initial state; it is zero where the initial state is free.
class RHEC_EXPORT Iterate {
 public:
  Iterate() = default;
  explicit Iterate(const Capacity& capacity);

  const Capacity& capacity() const noexcept { return capacity_; }

  double* state(int node) noexcept { return states_.data() + node * capacity_.states; }
  double* control(int interval) noexcept { return controls_.data() + interval * capacity_.controls; }
  double* costate(int node) noexcept { return costates_.data() + node * capacity_.states; }
  double* state_bound(int node) noexcept { return state_bounds_.data() + node * capacity_.states; }
  double* control_bound(int interval) noexcept { return control_bounds_.data() + interval * capacity_.controls; }
  const double* state(int node) const noexcept { return states_.data() + node * capacity_.states; }
  const double* control(int interval) const noexcept { return controls_.data() + interval * capacity_.controls; }
  const double* costate(int node) const noexcept { return costates_.data() + node * capacity_.states; }
  const double* state_bound(int node) const noexcept { return state_bounds_.data() + node * capacity_.states; }
  const double* control_bound(int interval) const noexcept {
    return control_bounds_.data() + interval * capacity_.controls;
  }

  bool is_finite() const noexcept;
  void clear_multipliers() noexcept;

 private:
  Capacity capacity_;
  std::vector<double> states_, controls_, costates_, state_bounds_, control_bounds_;
};

}  // namespace rhec
