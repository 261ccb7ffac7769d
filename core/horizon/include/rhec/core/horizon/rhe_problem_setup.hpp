#pragma once

#include <vector>

namespace rhec {

/// Pseudo-Huber loss on a group of outputs (docs/method.md, section 2): with s the weighted squared residual of the
/// group, 2 delta^2 (sqrt(1 + s / delta^2) - 1) replaces s. It is smooth, so that its exact Hessian exists.
struct RobustLoss {
  std::vector<int> outputs;  ///< these share one loss, e.g. the two coordinates of a position fix
  double delta = 3.0;        ///< in standard deviations: transition from quadratic to linear
};

/// What a RheProblem is made of.
struct RheProblemSetup {
  int max_intervals = 15;
  int substeps = 1;
  int most_between = 0;                ///< measurements that an interval can have between its nodes
  std::vector<double> output_weights;  ///< n_y, diagonal of Ry = 1 / sigma^2
  std::vector<double> input_weights;   ///< n_u, diagonal of Ru
  std::vector<RobustLoss> robust;
  std::vector<int> one_block;                            ///< parameters with one value over the whole horizon
  std::vector<double> state_lower, state_upper;          ///< n_x; empty: the model's own bounds
  std::vector<double> input_lower, input_upper;          ///< n_u; empty: none, since inputs are measured
  std::vector<double> parameter_lower, parameter_upper;  ///< n_p; empty: the model's own bounds
};

}  // namespace rhec
