#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/model/model.hpp"
#include "rhec/core/term/model_layer.hpp"

namespace rhec {

/// A vehicle some of whose inputs are states, and whose inputs are then the rates at which these change. With c the
/// values of these inputs on the interval before, and v their rates:
///
///     x_{i+1} = F(x_i, [c_{i+1}; other inputs], p, dt_i),      c_{i+1} = c_i + dt_i v_i.
///
/// An input is still constant on an interval and jumps at nodes: v is (u_i - u_{i-1}) / dt_i. So a cost of rates and a
/// limit of rates are a weight and bounds of inputs, and bounds of the vehicle's inputs are bounds of states. States
/// are [x; c]. Inputs keep their order; one that is a rate is called NAME_rate. Thread-safe and allocation-free as any
/// model.
class RHEC_EXPORT InputRateModel final : public Model, public ModelLayer {
 public:
  /// `rated` are indices of the vehicle's inputs, increasing. Throws Error if there are none, if they are not that, or
  /// if the vehicle has too many variables.
  InputRateModel(std::shared_ptr<const Model> vehicle, std::vector<int> rated);

  const Model& vehicle() const noexcept { return *vehicle_; }
  const std::vector<int>& rated() const noexcept { return rated_; }
  const Model& below() const noexcept override { return *vehicle_; }
  StageVariables variables_below(const StageVariables& own) const override;

  const ModelDescription& description() const noexcept override { return description_; }
  int data_count() const noexcept override { return vehicle_->data_count(); }
  void integrate(const Intervals& request) const noexcept override;
  void integrate_rows(const IntervalRows& request) const noexcept override;
  void observe(const Nodes& request) const noexcept override;
  std::size_t rows_scratch(int count) const noexcept override;
  /// Of [x; c], where c changes by v and the vehicle moves by c.
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override;
  void straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept override;
  bool has_second_derivatives() const noexcept override { return vehicle_->has_second_derivatives(); }

 private:
  void write_inputs(const double* held, const double* given, double duration, double* inputs) const noexcept;
  template <class Shape>
  void integrate_rows_of(const IntervalRows& request, const Shape& shape) const noexcept;
  template <class Shape>
  void widen(const IntervalRows& request, const Shape& shape) const noexcept;

  std::shared_ptr<const Model> vehicle_;
  std::vector<int> rated_;
  ModelDescription description_;
};

/// The name of the rate of an input: NAME_rate.
RHEC_EXPORT std::string rate_name(const Variable& input);

}  // namespace rhec
