#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/step_graph.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

namespace rhec {

/// What is evaluated of a vehicle: one Runge-Kutta step, one on which parameters run to other values, the outputs, and,
/// where steps are too long to be written out, the rates. A Jacobian comes with the values, a step's Hessian with both.
enum class ModelFunction {
  step,
  step_jacobian,
  step_hessian,
  ramp,
  ramp_jacobian,
  ramp_hessian,
  outputs,
  output_jacobian,
  output_hessian,  ///< alone
  rates,
  rates_jacobian,
  rates_hessian,  ///< alone
  count
};
RHEC_EXPORT std::string_view name_of(ModelFunction function) noexcept;

/// These functions as nodes of the vehicle's graph, each made when it is first asked for, since derivatives take time.
/// The results stand in this order, matrices row by row:
///
///     step, ramp          F (n_x), dF/dz (n_x x n_z), sum_r weights_r d2F_r/dz2 (n_z x n_z)
///     outputs             h (n_y), dh/dx (n_y x n_x)
///     output_hessian      sum_r weights_r d2h_r/dx2 (n_x x n_x), its lower half; zero above
///     rates               f (n_x), df/da (n_x x n_a) with a = [x; p; u]
///     rates_hessian       sum_r weights_r d2f_r/da2 (n_a x n_a), its lower half; zero above
class RHEC_EXPORT ModelFunctions {
 public:
  explicit ModelFunctions(const VehicleGraph& vehicle) : vehicle_(vehicle) {}

  std::vector<int> inputs(ModelFunction function);
  /// Of a step only where it is whole.
  std::vector<int> results(ModelFunction function);

  /// Instructions that a step may have, with its derivatives or without, to be one function. What is longer, or would
  /// be, is evaluated by the chain rule over its stages: its text would take a compiler too long, and does not fit in a
  /// processor's cache of instructions.
  static constexpr int longest_step = 8000;
  /// Whether a step, with a ramp or without, is one function.
  bool is_whole(ModelFunction step);

 private:
  const StepGraph& step(bool ramp);
  struct Outputs {
    std::vector<int> values;
    NodeMatrix jacobian, hessian;
    std::vector<int> weights;
  };
  const Outputs& outputs();
  struct Rates {
    NodeMatrix jacobian, hessian;
    std::vector<int> weights;
  };
  const Rates& rates();
  using Operations = std::array<long, 3>;  ///< of a step, with its Jacobian, with both
  const Operations& staged_operations(bool ramp);

  const VehicleGraph& vehicle_;
  std::optional<StepGraph> steady_, ramped_;
  std::optional<Outputs> outputs_;
  std::optional<Rates> rates_;
  std::optional<Operations> staged_, staged_ramp_;
  std::map<ModelFunction, bool> is_whole_;
};

/// A number that two formulas share only if they are the same, operation by operation, whatever the values of their
/// options (64-bit FNV-1a).
RHEC_EXPORT std::uint64_t fingerprint_of(const VehicleGraph& vehicle);

/// A formula's functions as C++: `kernels` is compiled for each instruction set, `table` once.
struct ModelCode {
  std::string kernels, table;
};
/// Of a formula called `formula`; the table defines `const rhec::StraightCode& rhec::<prefix>_kernels()`. A function of
/// more than `most` instructions is left to the interpreter.
RHEC_EXPORT ModelCode write_model_code(const VehicleGraph& vehicle, const std::string& prefix,
                                       const std::string& formula, const std::vector<std::string>& sets,
                                       int most = 40000);

}  // namespace rhec
