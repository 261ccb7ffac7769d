#pragma once

#include <cstddef>

namespace rhec {

/// A request to `Model::integrate_rows`: that of `Model::Intervals`, on rows laid out in memory as in Iterate and
/// StageQp. z = [x; p; u], or [x; p; u; p_end] with `ramp`, where p runs to p_end on an interval. All rows are padded
/// to multiples of eight: the padding of z is ignored, that of results is set to 0. A null result pointer means 'not
/// requested'; the caller provides `scratch` (`Model::rows_scratch`).
struct IntervalRows {
  int count = 0;
  const double* z = nullptr;
  std::ptrdiff_t z_step = 0;  ///< distance between the rows of consecutive intervals
  bool ramp = false;
  const double* durations = nullptr;
  const double* data = nullptr;  ///< n_d entries per interval, without padding
  int substeps = 1;
  double* next_states = nullptr;
  std::ptrdiff_t next_step = 0;
  double* jacobians = nullptr;  ///< dF/dz: n_x rows per interval, `jacobian_row` apart
  std::ptrdiff_t jacobian_step = 0, jacobian_row = 0;
  const double* multipliers = nullptr;
  std::ptrdiff_t multiplier_step = 0;
  double* hessians = nullptr;  ///< sum_j multipliers_j d2F_j/dz2: n_z rows per interval, `hessian_row` apart
  std::ptrdiff_t hessian_step = 0, hessian_row = 0;
  double* scratch = nullptr;
};

/// The same for `Model::observe_rows`, on rows of states. Hessians are added to what is already there.
struct NodeRows {
  int count = 0;
  const double* states = nullptr;
  std::ptrdiff_t state_step = 0;
  const int* chosen = nullptr;  ///< indices of the requested outputs; null: all
  int chosen_count = 0;
  double* outputs = nullptr;  ///< one row per node, `output_step` apart
  std::ptrdiff_t output_step = 0;
  double* jacobians = nullptr;  ///< dh/dx: one row per output, consecutive, `jacobian_row` apart
  std::ptrdiff_t jacobian_row = 0;
  const double* multipliers = nullptr;  ///< one row per node, one entry per requested output
  std::ptrdiff_t multiplier_step = 0;
  double* hessians = nullptr;  ///< += sum_j multipliers_j d2h_j/dx2: n_x rows per node, `hessian_row` apart
  std::ptrdiff_t hessian_step = 0, hessian_row = 0;
  double* scratch = nullptr;
};

}  // namespace rhec
