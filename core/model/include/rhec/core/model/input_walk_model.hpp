#pragma once

#include <memory>
#include <vector>

#include "rhec/core/base/call_memory.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// A vehicle some of whose inputs are not measured on some intervals, and walk there. Behind its own states x it has,
/// for each of these inputs, the state v_k: the input as it was on the interval before. What acts, and is kept, is
///
///     u_j = c_k v_k + s_k nu_j,    v_k+ = u_j,
///
/// with the model's own input nu_j, and c_k and s_k known data of the interval: c = 0, s = 1 where the input is
/// measured; c = 1 where it is not, and s the standard deviation by which it walks over the interval, in those that
/// nu_j has. Parameters that nothing tells from such an input can be held: then a known value acts in their place
/// (docs/method.md, "Inputs that are not measured").
///
/// Thread-safe and allocation-free as any model; calls for one so wide that its rows do not fit on the stack wait for
/// each other.
class RHEC_EXPORT InputWalkModel final : public Model {
 public:
  /// `inputs`: those that walk somewhere, increasing. Throws Error if there are none, one does not exist, or the
  /// vehicle depends on data of the interval.
  InputWalkModel(std::shared_ptr<const Model> vehicle, std::vector<int> inputs);

  const Model& vehicle() const noexcept { return *vehicle_; }
  const std::vector<int>& inputs() const noexcept { return inputs_; }

  /// Writes of an interval's data: how the k-th of these inputs acts, and the value of a parameter that is held there.
  /// Data that are all 0 hold nothing; inputs have to be set.
  static void set_measured(int k, double* data) noexcept { set_input(k, 0.0, 1.0, data); }
  static void set_walking(int k, double sigmas, double* data) noexcept { set_input(k, 1.0, sigmas, data); }
  void hold(int parameter, double value, double* data) const noexcept;

  const ModelDescription& description() const noexcept override { return description_; }
  int data_count() const noexcept override { return static_cast<int>(2 * (inputs_.size() + np_)); }
  void integrate(const Intervals& request) const noexcept override;
  void observe(const Nodes& request) const noexcept override;
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override;
  void straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept override;
  Operations operations() const noexcept override { return vehicle_->operations(); }
  bool has_second_derivatives() const noexcept override { return vehicle_->has_second_derivatives(); }

 private:
  struct Of;
  static void set_input(int k, double kept, double own, double* data) noexcept {
    data[2 * k] = kept;
    data[2 * k + 1] = own;
  }
  void integrate_some(const Intervals& request, std::ptrdiff_t first, std::ptrdiff_t count,
                      double* memory) const noexcept;
  Of of(std::ptrdiff_t variable, const double* data) const noexcept;

  std::shared_ptr<const Model> vehicle_;
  std::vector<int> inputs_;
  std::ptrdiff_t nx_, nu_, np_, n_;
  ModelDescription description_;
  CallMemory memory_;
};

}  // namespace rhec
