#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "rhec/core/formula/tape.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/step_graph.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

namespace rhec {

/// A Model whose formula is a graph that an interpreter evaluates: one operation after the other, each for all stages.
/// It needs no compiler. Integration and derivatives are graphs too (StepGraph); those of several Runge-Kutta steps in
/// an interval follow from them by the chain rule.
class RHEC_EXPORT GraphModel : public Model {
 public:
  /// Straight motion as nodes of the vehicle's graph, of `ground_speed` and the parameters.
  struct StraightMotion {
    int ground_speed = -1;
    std::vector<int> states;  ///< by state: what it becomes; -1 if it stays as it is
    std::vector<int> inputs;  ///< by input
  };

  /// Throws Error if the description has other numbers of variables than the graph, or if evaluation needs more than
  /// `most_stack` doubles for eight rows, which `integrate` and `observe` take from the stack.
  /// Without `straight`, motion is straight as Model says.
  GraphModel(const VehicleGraph& vehicle, ModelDescription description, const StraightMotion* straight = nullptr);
  static constexpr std::size_t most_stack = std::size_t{1} << 17;

  const ModelDescription& description() const noexcept override { return description_; }
  void integrate(const Intervals& request) const noexcept override;
  void observe(const Nodes& request) const noexcept override;
  void integrate_rows(const IntervalRows& request) const noexcept override;
  void observe_rows(const NodeRows& request) const noexcept override;
  std::size_t rows_scratch(int count) const noexcept override;
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override;
  void straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept override;
  bool has_second_derivatives() const noexcept override { return true; }
  std::vector<std::string> instruction_sets() const override;
  bool use_instruction_set(const std::string& name) override;

  /// Instructions that one evaluation takes, and registers: what it costs.
  struct Cost {
    int instructions = 0, runs = 0, registers = 0;
  };
  Cost cost_of_values() const noexcept { return cost_of(steady_.values); }
  Cost cost_of_jacobians() const noexcept { return cost_of(steady_.jacobians); }
  Cost cost_of_hessians() const noexcept { return cost_of(steady_.hessians); }

 private:
  /// A step's tapes: of F, of F and dF/dz, and of both with the Hessian, whose results stand in this order. The sources
  /// are those of whole rows, padded to multiples of eight.
  struct StepTapes {
    StepTapes() = default;
    StepTapes(const VehicleGraph& vehicle, bool ramp);
    Tape values, jacobians, hessians;
    std::vector<int> next_of_values, next_of_jacobians, next_of_hessians, rows_of_jacobians, jacobian_of_hessians,
        hessian_of_hessians;
  };
  struct Counts {
    int x = 0, u = 0, p = 0, y = 0;
    int z(bool ramp) const { return x + u + p + (ramp ? p : 0); }
  };

  static Cost cost_of(const Tape& tape) noexcept {
    return {tape.instruction_count(), tape.run_count(), tape.register_count()};
  }
  void integrate_values(const Intervals& request) const noexcept;
  const StepTapes& tapes(bool ramp) const noexcept { return ramp ? ramped_ : steady_; }
  void set_weights(const NodeRows& request, int first, int count, double* registers, int lanes) const noexcept;
  void store_outputs(const NodeRows& request, int first, int count, const Tape& tape, const double* registers,
                     int lanes) const noexcept;
  void add_curvature(const NodeRows& request, int first, int count, const double* registers, int lanes) const noexcept;

  ModelDescription description_;
  Counts n_;
  StepTapes steady_, ramped_;
  Tape rates_, outputs_, output_jacobians_, output_hessians_, straight_;
  std::vector<int> straight_states_;  ///< the states that straight motion sets
  std::vector<int> curved_;           ///< r * n_x + c, r >= c: where the outputs' Hessian is not always zero
  std::size_t stack_ = 0;             ///< doubles
  const TapeKernels* kernels_ = nullptr;
};

}  // namespace rhec
