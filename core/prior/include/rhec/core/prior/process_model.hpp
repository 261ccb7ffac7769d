#pragma once

#include <memory>
#include <vector>

#include "rhec/core/base/call_memory.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/parts_of_intervals.hpp"

namespace rhec {

/// A vehicle whose parameters are Gaussian Markov processes (docs/method.md, section 8). Its state is [x; z], where the
/// process z_j of each parameter has a given number of states, the first of which is the parameter itself; its input is
/// [u; w] with as many noises w_j ~ N(0, I) as there are states:
///
///     z_j+ = F_j z_j + L_j w_j,
///
/// and the vehicle's parameter runs from z_j[0] to z_j+[0] over the interval, or is held at z_j[0]. F_j and L_j are
/// known data of the interval, so that a problem takes on another prior by other data.
///
/// It has no parameters of its own. Thread-safe and allocation-free as any model; calls for one so wide that its rows
/// do not fit on the stack wait for each other.
class RHEC_EXPORT ProcessModel final : public Model, public PartsOfIntervals {
 public:
  /// `counts`: states of each parameter's process. Throws Error if they do not fit the vehicle.
  ProcessModel(std::shared_ptr<const Model> vehicle, std::vector<int> counts);

  const Model& vehicle() const noexcept { return *vehicle_; }
  /// Index in [x; z] of a process's first state, and its number of states.
  int first_state(int parameter) const noexcept { return first_[parameter]; }
  int process_states(int parameter) const noexcept { return counts_[parameter]; }

  /// Where a process's part of the interval data is, of `process_data_count(n)` numbers for n states: 1 if the
  /// parameter runs to its next value, 0 if it is held; F; L (column-major, n x n).
  double* process_data(int parameter, double* data) const noexcept { return data + data_first_[parameter]; }
  const double* process_data(int parameter, const double* data) const noexcept { return data + data_first_[parameter]; }
  /// Where that of the vehicle is, if it depends on data of the interval itself.
  double* vehicle_data(double* data) const noexcept { return data + (data_count_ - vehicle_data_); }
  const double* vehicle_data(const double* data) const noexcept { return data + (data_count_ - vehicle_data_); }
  static constexpr int process_data_count(int states) noexcept { return 1 + 2 * states * states; }

  const ModelDescription& description() const noexcept override { return description_; }
  int data_count() const noexcept override { return data_count_; }
  /// A ramp's processes are there where a straight line has led them.
  void data_of_part(const double* data, double share, double* part) const noexcept override;
  void integrate(const Intervals& request) const noexcept override;
  void observe(const Nodes& request) const noexcept override;
  /// Of the vehicle, with the parameters at rest.
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override;
  Operations operations() const noexcept override { return vehicle_->operations(); }
  bool has_second_derivatives() const noexcept override { return vehicle_->has_second_derivatives(); }

 private:
  void integrate(const Intervals& request, double* memory) const noexcept;
  void write_jacobian(const double* vehicle, const double* data, double* jacobian) const noexcept;
  void write_hessian(const double* vehicle, const double* data, double* hessian) const noexcept;

  std::shared_ptr<const Model> vehicle_;
  std::vector<int> counts_, first_, data_first_;
  int nx_, nu_, np_;
  std::ptrdiff_t vehicle_data_;  ///< numbers of an interval that the vehicle depends on
  int n_, noises_ = 0, data_count_ = 0;
  ModelDescription description_;
  CallMemory memory_;
};

}  // namespace rhec
