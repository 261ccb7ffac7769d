#pragma once

#include <cstdint>

namespace rhec {

constexpr int response_batch = 8;

/// Arguments of the kernels of the Riccati recursion: plain pointers, so that units for different instruction sets
/// share nothing else. All rows have `stride` entries; see StageQp for the QP and Riccati for the rest.
struct RiccatiView {
  int intervals = 0;
  int states = 0;    ///< of the capacity: column of the first control in a row
  int controls = 0;  ///< of the capacity
  int stride = 0;
  const int* state_counts = nullptr;
  const int* control_counts = nullptr;
  const int* identity_counts = nullptr;

  const double *AB = nullptr, *H = nullptr, *h = nullptr, *b = nullptr;
  const double *lower = nullptr, *upper = nullptr;
  const double* diagonal = nullptr;       ///< one row per stage, added to the diagonal of H; or null
  const std::int8_t* sides = nullptr;     ///< one row per stage: which bounds are active
  const std::uint8_t* special = nullptr;  ///< stages that the kernels skip
  bool keeps_carried = false;  ///< all stages carry the same states, which are given: sensitivities of these are zero
  bool for_steps = true;       ///< whether a step is needed; otherwise `drift` and `T` are neither written nor read
  double* own_H = nullptr;  ///< H, where `factor` may write a stage with two free controls that is not convex; or null
  bool* is_reflected = nullptr;  ///< set where it has

  double* P = nullptr;  ///< n_s rows per node
  double* U = nullptr;  ///< n_w rows per stage: columns of the reduced Hessian, each as it is eliminated
  double* V = nullptr;  ///< n_w rows per stage: the policy w = p - V s, with the p stored in the control columns
  /// 8 x 8 per stage, if a row fits into one register: rows [A - B V, B] of the next states that are not identity rows;
  /// and the columns that map s to [next s; w].
  double *closed = nullptr, *T = nullptr;
  double* inverse = nullptr;      ///< n_w per stage: 1 / pivot, 0 if a control is fixed
  std::uint8_t* fixes = nullptr;  ///< per stage: whether any of its controls is fixed
  double* drift = nullptr;        ///< one row per stage: P_{i+1} b_i
  double* g = nullptr;  ///< one row per stage: gradient with respect to z before elimination, if a control is fixed
  double* p = nullptr;  ///< one row per node: gradient of the value function; beside it, controls at s = 0

  double *values = nullptr, *costates = nullptr, *bounds = nullptr;  ///< rows of the step, an Iterate
};

/// The recursion over stages without active state bounds that their controls must meet.
struct RiccatiKernels {
  /// Factorises stages first, first - 1, ..., 0. Returns the stage that it leaves to the caller (a special one, or one
  /// whose pivot is not above `tolerance` times its diagonal entry), or -1. Where it may write H, it reflects the
  /// negative eigenvalues of a stage with two free controls, as far as its shape is compiled, and goes on.
  int (*factor)(const RiccatiView& view, int first, double tolerance);
  /// The same for gradients; only special stages are left to the caller.
  int (*solve_backward)(const RiccatiView& view, int first);
  /// Computes control, next state and costate of stages first, first + 1, ...; returns the next special stage, or N.
  int (*solve_forward)(const RiccatiView& view, int first);
  /// Sensitivities to `response_batch` gradients at once, interleaved: each entry of a row holds those of all
  /// gradients. Backward: from the gradients of the stages up to `last` (zero unless `has_gradient` is set) to those of
  /// the value functions, in place. Forward: from these and the initial states to the sensitivities, in place, and
  /// their costates, unless that is null. Rows without gradients are not read. There must be no special stage. Carried
  /// states do not change if the view says so; there are no costates then.
  void (*sensitivities_backward)(const RiccatiView& view, int last, const unsigned char* has_gradient,
                                 double* gradients);
  void (*sensitivities_forward)(const RiccatiView& view, int last, double* sensitivities, double* costates);
  /// sums += weighted sum of the sensitivities of a batch, for `count` entries, a multiple of eight.
  void (*combine)(const double* batch, const double* weights, double* sums, long count);
  /// The same for `number` batches, each with weights of its own.
  void (*combine_batches)(const double* const* batches, const double* const* weights, int number, double* sums,
                          long count);
  /// Propagates the covariance (rows of the stride) from node `first` to the next special stage, which is returned, or
  /// to node N. Writes those of all nodes on the way to `all`, blocks of n_s x n_s, if it is not null.
  int (*carry_covariance)(const RiccatiView& view, int first, double* covariance, double* all);
  /// Replaces the covariance of node 0, given what H says of it (rows of the stride), by that of node N given what H
  /// says of all nodes: the covariance recursion of the Kalman filter. It needs no factorisation, but stages whose
  /// controls are coupled in H neither to each other nor to the states. False, with a covariance of no meaning, if it
  /// finds others, or an H that is not positive semidefinite.
  bool (*filter_covariance)(const RiccatiView& view, double* covariance);
  /// H + [A B]'P[A B] of one stage, as rows of `out`.
  void (*form)(const RiccatiView& view, int stage, double* out);
  /// The inverse of a symmetric matrix; both have `count` rows of `stride` entries. False if the matrix is not positive
  /// definite (as in `factor`) or has more than sixteen rows.
  bool (*invert)(const double* matrix, int count, int stride, double tolerance, double* inverse);
  /// batch := -inverse batch, for `count` rows of sensitivities.
  void (*answer)(const double* inverse, int count, int stride, double* batch);
  /// Solves matrix x = -p with that inverse and one step of iterative refinement.
  void (*solve)(const double* matrix, const double* inverse, int count, int stride, const double* p, double* x);
};

}  // namespace rhec
