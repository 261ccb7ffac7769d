#pragma once

#include <cstddef>

namespace rhec {

/// What `Model::integrate_rows` is asked for: the same as `Model::integrate`, over rows that lie in memory as those of
/// Iterate and StageQp do. z = [x; p; u], or [x; p; u; p_end] with `ramp`, where p runs to p_end on an interval. All
/// rows are multiples of eight long: of z what is beyond is not looked at, of results it becomes 0 up to the next
/// multiple of eight. A null result pointer means 'not asked for'; the caller lends `scratch` (`Model::rows_scratch`).
struct IntervalRows {
  int count = 0;
  const double* z = nullptr;
  std::ptrdiff_t z_step = 0;  ///< from one interval's row to the next
  bool ramp = false;
  const double* durations = nullptr;
  int substeps = 1;
  double* next_states = nullptr;
  std::ptrdiff_t next_step = 0;
  double* jacobians = nullptr;  ///< dF/dz: n_x rows an interval, `jacobian_row` apart
  std::ptrdiff_t jacobian_step = 0, jacobian_row = 0;
  const double* multipliers = nullptr;
  std::ptrdiff_t multiplier_step = 0;
  double* hessians = nullptr;  ///< sum_j multipliers_j d2F_j/dz2: n_z rows an interval, `hessian_row` apart
  std::ptrdiff_t hessian_step = 0, hessian_row = 0;
  double* scratch = nullptr;
};

/// The same for `Model::observe_rows`, with rows of states; but Hessians are added to what is there.
struct NodeRows {
  int count = 0;
  const double* states = nullptr;
  std::ptrdiff_t state_step = 0;
  const int* chosen = nullptr;  ///< which of the model's outputs, or null: all
  int chosen_count = 0;
  double* outputs = nullptr;  ///< a row for each node, `output_step` apart
  std::ptrdiff_t output_step = 0;
  double* jacobians = nullptr;  ///< dh/dx: a row for each output, one after the other, `jacobian_row` apart
  std::ptrdiff_t jacobian_row = 0;
  const double* multipliers = nullptr;  ///< a row for each node, of as many as there are outputs
  std::ptrdiff_t multiplier_step = 0;
  double* hessians = nullptr;  ///< plus sum_j multipliers_j d2h_j/dx2: n_x rows a node, `hessian_row` apart
  std::ptrdiff_t hessian_step = 0, hessian_row = 0;
  double* scratch = nullptr;
};

}  // namespace rhec
