#pragma once

#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/derivatives.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

namespace rhec {

/// How second derivatives of a step are accumulated: by the chain rule from those of f at each Runge-Kutta stage, or by
/// differentiating the adjoint of the whole step; `by_count` takes what has fewer operations. Of a long step it may be
/// only the values that are wanted, or these and the Jacobian.
enum class StepCurvature { no_derivatives, no_hessian, stages, whole, by_count };

/// One step of the classical Runge-Kutta method as a graph, F(z) with z = [x; p; u], or [x; p; u; p_end] for a ramp, on
/// which p runs linearly over an interval of which the step is a part:
///
///     p(c) = p + (p_end - p) (fraction + c share),   c in {0, 1/2, 1}
///
/// with its Jacobian and the Hessian of sum_r weights_r F_r.
struct RHEC_EXPORT StepGraph {
  std::vector<int> z, weights;
  int h = -1;                     ///< length of the step [s]
  int fraction = -1, share = -1;  ///< of a ramp: where the step begins, and its part of the interval
  std::vector<int> next;          ///< F
  NodeMatrix jacobian, hessian;   ///< empty if they are not wanted

  /// The independent variables in the order in which a tape takes them: z, then h, the ramp's two, and the weights.
  std::vector<int> arguments() const;

  static StepGraph make(const VehicleGraph& vehicle, bool ramp, StepCurvature curvature = StepCurvature::by_count);
};

}  // namespace rhec
