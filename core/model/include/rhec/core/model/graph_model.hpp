#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/formula/straight_code.hpp"
#include "rhec/core/formula/tape.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

namespace rhec {

class Reserve;
class StagedSteps;

/// Throws Error if a description has other numbers of variables, or gives a role to a variable that does not exist.
RHEC_EXPORT void check_description(const ModelDescription& description, const FormulaCounts& counts);

/// A Model whose formula is a graph. Integration and derivatives are graphs too (ModelFunctions); those of several
/// Runge-Kutta steps in an interval follow from them by the chain rule, and so do those of a step that is too long to
/// be written out (ModelFunctions::is_whole), from the formula's own derivatives. What evaluates them is straight code
/// that was compiled of the same graph (rhec_add_model in CMake), or else an interpreter, which takes one operation
/// after the other, each for all stages, and needs no compiler. Both give the same bits on the same instruction set.
class RHEC_EXPORT GraphModel : public Model {
 public:
  /// Throws Error if the description has other numbers of variables than the graph.
  /// Without `vehicle.straight`, motion is straight as Model says. `code` was compiled of a formula; where that is
  /// another one, or where it has no code for a function, the interpreter takes its place.
  GraphModel(const VehicleGraph& vehicle, ModelDescription description, const StraightCode* code = nullptr);
  /// Doubles that `integrate` and `observe` take from the stack at most. Where they need more, which takes some forty
  /// states, they share memory that the model has from its set-up: then calls from several threads wait for each other.
  /// `integrate_rows` and `observe_rows` never do, for they have the caller's.
  static constexpr std::size_t most_stack = std::size_t{1} << 15;

  const ModelDescription& description() const noexcept override { return description_; }
  void integrate(const Intervals& request) const noexcept override;
  void observe(const Nodes& request) const noexcept override;
  void integrate_rows(const IntervalRows& request) const noexcept override;
  void observe_rows(const NodeRows& request) const noexcept override;
  std::size_t rows_scratch(int count) const noexcept override;
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override;
  void straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept override;
  Operations operations() const noexcept override;
  bool has_second_derivatives() const noexcept override { return true; }
  /// Of a compiled model: "interpreted", and those that it was compiled for; else those of the interpreter.
  std::vector<std::string> instruction_sets() const override;
  bool use_instruction_set(const std::string& name) override;

  bool is_compiled() const noexcept;
  const VehicleGraph* graph() const noexcept override { return &vehicle_; }
  const VehicleGraph& vehicle() const noexcept { return vehicle_; }

  /// Instructions that one evaluation of eight intervals takes, and registers: what it costs. Of a step that is not
  /// written out these are those of the formula, four times, and of the chain rule, and there are no runs.
  struct Cost {
    int instructions = 0, runs = 0, registers = 0;
  };
  Cost cost_of_values() const noexcept { return cost_of(tapes_.steady.values, false, false); }
  Cost cost_of_jacobians() const noexcept { return cost_of(tapes_.steady.jacobians, true, false); }
  Cost cost_of_hessians() const noexcept { return cost_of(tapes_.steady.hessians, true, true); }

 private:
  class TapeMaker;
  struct Counts {
    int x = 0, u = 0, p = 0, y = 0;
    int z(bool ramp) const { return x + u + p + (ramp ? p : 0); }
  };
  /// A step's tapes: of F, of F and dF/dz, and of both with the Hessian, whose results stand in this order, and where
  /// these are written. What is too long has no tape, and is `staged`.
  struct StepTapes {
    StepTapes() = default;
    StepTapes(TapeMaker& maker, const Counts& counts, bool ramp);
    Tape values, jacobians, hessians;
    StoredRows next_of_values, next_of_jacobians, next_of_hessians, rows_of_jacobians, jacobian_of_hessians,
        hessian_of_hessians;
    std::shared_ptr<const StagedSteps> staged;  ///< null where all of it has a tape
  };
  struct Tapes {
    Tapes() = default;
    Tapes(TapeMaker& maker, const Counts& counts);
    StepTapes steady, ramped;
    Tape outputs, output_jacobians, output_hessians;
    StoredRows output_values, values_of_output_jacobians, output_slopes;
    std::vector<int> curved;  ///< r * n_x + c, r >= c: where the outputs' Hessian is not always zero
    int most_registers = 0;
  };

  Cost cost_of(const Tape& tape, bool with_jacobian, bool with_hessian) const noexcept;
  /// Calls use(memory) with aligned memory for `size` doubles.
  template <class Use>
  void with_memory(std::size_t size, Use use) const noexcept;
  void integrate_values(const Intervals& request) const noexcept;
  static bool is_staged(const StepTapes& of, int substeps, bool with_jacobian, bool with_hessian) noexcept;
  void observe(const Nodes& request, int first, int count, double* registers) const noexcept;
  const StepTapes& steps(bool ramp) const noexcept { return ramp ? tapes_.ramped : tapes_.steady; }
  void use(const TapeKernels& kernels, const StraightSet* set);
  void set_weights(const NodeRows& request, int first, int count, double* registers, int lanes) const noexcept;
  void store_outputs(const NodeRows& request, int first, int count, bool with_jacobians, const double* registers,
                     int lanes) const noexcept;
  void add_curvature(const NodeRows& request, int first, int count, const double* registers, int lanes) const noexcept;

  VehicleGraph vehicle_;  ///< alone, without what was made of it
  ModelDescription description_;
  Counts n_;
  const StraightCode* code_;  ///< null: none that belongs to this formula
  Tapes tapes_;
  Tape rates_, straight_;
  std::vector<int> straight_states_;  ///< the states that straight motion sets
  std::size_t memory_of_steps_ = 0;   ///< doubles for any tape, and for the chain rule of whole steps
  std::shared_ptr<Reserve> reserve_;  ///< null where nothing needs more than the stack gives
  const TapeKernels* kernels_ = nullptr;
};

}  // namespace rhec
