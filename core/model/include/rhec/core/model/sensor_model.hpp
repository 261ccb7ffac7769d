#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/motion_outputs.hpp"

namespace rhec {

class Reserve;

/// A vehicle with what its sensors do to the outputs h:
///
///     y_j = (1 + k_j) h_j + b_j
///
/// with biases b and scale errors k, which are states that stay as they are; process noise (StateNoiseModel) lets them
/// drift. Outputs of motion become outputs of the state as well: their values at a node are states m,
///
///     m_{i+1} = h_m(x_{i+1}, u_i, p_i)
///
/// with the parameter at the interval's end where it is a ramp, the limit from the left. So whoever knows y = h(x)
/// knows these. The states are [x; b; k; m], inputs and parameters the vehicle's. At the first node there is no
/// interval that ends, and m is what its prior says.
class RHEC_EXPORT SensorModel final : public Model {
 public:
  /// Which outputs have a bias or a scale error, ascending.
  struct Errors {
    std::vector<int> biased, scaled;
  };
  /// The states are called `<output>_bias`, `<output>_scale`, and as the output of motion with `_at_node`. Throws Error
  /// if an output does not exist, is named twice, or if a state has such a name already.
  SensorModel(std::shared_ptr<const Model> vehicle, Errors errors);

  const Model& vehicle() const noexcept { return *vehicle_; }
  const Errors& errors() const noexcept { return errors_; }
  /// The states: where biases, scale errors and values of motion begin.
  int first_bias() const noexcept { return nx_; }
  int first_scale() const noexcept { return first_bias() + static_cast<int>(errors_.biased.size()); }
  int first_motion() const noexcept { return first_scale() + static_cast<int>(errors_.scaled.size()); }
  const MotionOutputs& motion() const noexcept { return motion_; }

  const ModelDescription& description() const noexcept override { return description_; }
  int data_count() const noexcept override { return vehicle_->data_count(); }
  void integrate(const Intervals& request) const noexcept override;
  void observe(const Nodes& request) const noexcept override;
  /// Of the values of motion it is zero: they follow at the nodes.
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override;
  void straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept override;
  Operations operations() const noexcept override { return vehicle_->operations(); }
  bool has_second_derivatives() const noexcept override { return vehicle_->has_second_derivatives(); }
  std::size_t rows_scratch(int count) const noexcept override;

 private:
  template <class Use>
  void with_memory(Use use) const noexcept;
  void integrate_some(const Intervals& request, std::ptrdiff_t first, std::ptrdiff_t count,
                      double* memory) const noexcept;
  void observe_one(const Nodes& request, std::ptrdiff_t i, double* memory) const noexcept;

  std::shared_ptr<const Model> vehicle_;
  Errors errors_;
  MotionOutputs motion_;
  ModelDescription description_;
  int nx_ = 0;                                       ///< of the vehicle
  std::vector<int> bias_of_, scale_of_, motion_of_;  ///< by output: the state; -1: none
  std::size_t memory_ = 0;
  std::shared_ptr<Reserve> reserve_;  ///< null where derivatives fit on the stack
};

}  // namespace rhec
