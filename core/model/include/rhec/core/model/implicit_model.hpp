#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

class RadauSteps;
class Reserve;
struct TapeKernels;

/// A vehicle with the same formula that is integrated by implicit steps: those of Radau IIA with three stages, of order
/// 5 (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.5), in the place of classical
/// Runge-Kutta steps. They are L-stable: a mode that decays is damped by steps of any length, however short its time
/// constant, and only the motion that is seen decides how many steps an interval needs.
///
/// The stages are solved by Newton's method with the Jacobian of each stage, to rounding, and derivatives follow from
/// the implicit function theorem: first and second derivatives are those of what was computed. Where Newton's method
/// does not converge, all results of that interval are NaN. A step costs what some tens of Runge-Kutta steps cost.
class RHEC_EXPORT ImplicitModel final : public Model {
 public:
  /// Throws Error if the vehicle has no graph, of which the derivatives of f are made, or depends on data of the
  /// interval.
  explicit ImplicitModel(std::shared_ptr<const Model> vehicle);

  const std::shared_ptr<const Model>& vehicle() const noexcept { return vehicle_; }

  const ModelDescription& description() const noexcept override { return vehicle_->description(); }
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
  /// With as many Newton iterations as a smooth motion needs.
  Operations operations() const noexcept override;
  bool has_second_derivatives() const noexcept override { return true; }
  /// Those of the integration; the vehicle's outputs are computed as it has them.
  std::vector<std::string> instruction_sets() const override;
  bool use_instruction_set(const std::string& name) override;
  const VehicleGraph* graph() const noexcept override { return vehicle_->graph(); }

 private:
  const RadauSteps& steps(bool ramp) const noexcept { return ramp ? *ramped_ : *steady_; }

  std::shared_ptr<const Model> vehicle_;
  std::shared_ptr<const RadauSteps> steady_, ramped_;  ///< no ramp without parameters
  const TapeKernels* kernels_;
  std::size_t memory_ = 0;
  std::shared_ptr<Reserve> reserve_;  ///< null where `integrate` needs no more than the stack gives
};

/// Whether this is an ImplicitModel, with or without process noise (StateNoiseModel).
RHEC_EXPORT bool is_implicit(const Model& model) noexcept;

}  // namespace rhec
