#pragma once

#include <string>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/graph_model.hpp"

namespace rhec {

/// A model made from one formula, a template over its number type:
///
///     template <class Scalar>
///     struct Formula {
///       static constexpr int state_count = ..., input_count = ..., parameter_count = ..., output_count = ...;
///       Scalar length{1.0};                          // options, shown by options(): formula_options.hpp
///       template <class Visitor> void options(Visitor&& option) { option("length", length, "of the drawbar [m]"); }
///       void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const;
///       void outputs(const Scalar* x, Scalar* y) const;  // or (x, u, p, y)
///       // Where no single variable is the speed: Model::straight_motion. A state that is left out stays as it is.
///       void straight_motion(const Scalar& ground_speed, const Scalar* p, Scalar* x, Scalar* u) const;
///     };
///
/// where Scalar behaves like a double: + - * /, sqrt exp log sin cos tan tanh asin acos atan atan2 hypot pow, called
/// without `std::` after a `using std::sin;`. It is not always a double: a formula does not compare values or branch on
/// them (smooth_min, smooth_max, smooth_abs). Everything else (integration, first and second derivatives, evaluation of
/// several stages at once) follows from its graph. Outputs that depend on u or p are outputs of motion (MotionOutputs).
/// `rhec_add_model(<name> ...)` in CMake compiles that, and defines
/// `const rhec::StraightCode& rhec::<name>_kernels()`; without them, the interpreter evaluates it.
template <template <class> class Formula>
class FormulaModel : public GraphModel {
 public:
  using Options = FormulaOptions<Formula>;

  /// Throws Error as GraphModel does, and as `trace`.
  FormulaModel(const Formula<double>& formula, const ModelDescription& description,
               const StraightCode* kernels = nullptr)
      : GraphModel(traced(formula, description), description, kernels) {}
  FormulaModel(const Formula<double>& formula, const ModelDescription& description, const StraightCode& kernels)
      : FormulaModel(formula, description, &kernels) {}

 private:
  static VehicleGraph traced(const Formula<double>& formula, const ModelDescription& description) {
    try {
      return trace<Formula>(
          formula, {names_of(description.states), names_of(description.inputs), names_of(description.parameters)});
    } catch (const Error& mistake) {
      throw Error("model '" + description.name + "': " + mistake.what());
    }
  }
};

}  // namespace rhec
