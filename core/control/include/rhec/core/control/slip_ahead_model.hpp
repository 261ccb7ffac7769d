#pragma once

#include <memory>

#include "rhec/core/model/model.hpp"
#include "rhec/core/term/model_layer.hpp"

namespace rhec {

/// A vehicle whose parameters differ from interval to interval by known amounts, the data of an interval (n_p numbers):
///
///     x_{i+1} = F(x_i, u_i, p + data_i, dt_i).
///
/// So a controller that is given p now plans with the slip that is ahead. Thread-safe and allocation-free as any model.
class RHEC_EXPORT SlipAheadModel final : public Model, public ModelLayer {
 public:
  /// Throws Error if the vehicle has data of its own, or too many parameters.
  explicit SlipAheadModel(std::shared_ptr<const Model> vehicle);
  const Model& vehicle() const noexcept { return *vehicle_; }

  const Model& below() const noexcept override { return *vehicle_; }
  StageVariables variables_below(const StageVariables& own) const override;

  const ModelDescription& description() const noexcept override { return vehicle_->description(); }
  int data_count() const noexcept override { return vehicle_->parameter_count(); }
  void integrate(const Intervals& request) const noexcept override;
  void integrate_rows(const IntervalRows& request) const noexcept override;
  void observe(const Nodes& request) const noexcept override { vehicle_->observe(request); }
  void observe_rows(const NodeRows& request) const noexcept override { vehicle_->observe_rows(request); }
  std::size_t rows_scratch(int count) const noexcept override;
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override {
    vehicle_->rates(x, u, p, dxdt);
  }
  void straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept override {
    vehicle_->straight_motion(ground_speed, p, state, inputs);
  }
  Operations operations() const noexcept override { return vehicle_->operations(); }
  bool has_second_derivatives() const noexcept override { return vehicle_->has_second_derivatives(); }

 private:
  std::shared_ptr<const Model> vehicle_;
};

}  // namespace rhec
