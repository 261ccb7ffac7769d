#pragma once

#include <memory>
#include <vector>

#include "rhec/core/base/call_memory.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// A vehicle with process noise of some of its states, as further inputs xi and further parameters w behind its own:
///
///     x_{i+1} = F(x_i, u_i, p_i, dt_i) + sqrt(dt_i) (E xi_i + G w_i),   E, G: the unit vectors of these states
///
/// With E[xi_i^2] = sigma^2, white, a state's variance grows by sigma^2 a second: what an interval adds at its end does
/// not depend on how a drive is divided into intervals (a random walk beside the vehicle's own motion). No sensor
/// measures xi; it is expected to be 0 (ModelDescription::noisy_states). So whatever knows the noise of inputs, a
/// filter or a window, knows process noise. Noise w that is a parameter (ModelDescription::blocked_noises) can be
/// constant over a block of intervals. Where a parameter runs from one value to another over an interval, its mean is
/// the noise. Thread-safe and allocation-free as any model; calls for one so wide that its rows do not fit on the stack
/// wait for each other.
class RHEC_EXPORT StateNoiseModel final : public Model {
 public:
  /// `states`: those whose noise is an input, `blocked`: those whose noise is a parameter; both increasing. Throws
  /// Error if there are none, a state does not exist or is in both, or the vehicle has process noise already.
  explicit StateNoiseModel(std::shared_ptr<const Model> vehicle, std::vector<int> states,
                           std::vector<int> blocked = {});

  const Model& vehicle() const noexcept { return *vehicle_; }
  std::shared_ptr<const Model> shared_vehicle() const noexcept { return vehicle_; }
  const std::vector<int>& states() const noexcept { return states_; }
  const std::vector<int>& blocked() const noexcept { return blocked_; }

  const ModelDescription& description() const noexcept override { return description_; }
  int data_count() const noexcept override { return vehicle_->data_count(); }
  void integrate(const Intervals& request) const noexcept override;
  void integrate_rows(const IntervalRows& request) const noexcept override;
  void observe(const Nodes& request) const noexcept override { vehicle_->observe(request); }
  void observe_rows(const NodeRows& request) const noexcept override { vehicle_->observe_rows(request); }
  std::size_t rows_scratch(int count) const noexcept override;
  /// Without noise.
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override {
    vehicle_->rates(x, u, p, dxdt);
  }
  void straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept override;
  Operations operations() const noexcept override { return vehicle_->operations(); }
  bool has_second_derivatives() const noexcept override { return vehicle_->has_second_derivatives(); }

 private:
  void integrate_some(const Intervals& request, std::ptrdiff_t first, std::ptrdiff_t count,
                      double* memory) const noexcept;
  void integrate_in_place(const IntervalRows& request) const noexcept;

  std::shared_ptr<const Model> vehicle_;
  std::vector<int> states_, blocked_;
  ModelDescription description_;
  CallMemory memory_;  ///< for derivatives
};

}  // namespace rhec
