#pragma once

#include <cstdint>

namespace rhec {

constexpr int response_batch = 8;

/// What the kernels of the Riccati recursion work on: plain pointers, so that units for different instruction sets
/// share nothing else. All rows have `stride` entries; see StageQp for the QP and Riccati for the rest.
struct RiccatiView {
  int intervals = 0;
  int states = 0;    ///< of the capacity: where the controls begin in a row
  int controls = 0;  ///< of the capacity
  int stride = 0;
  const int* state_counts = nullptr;
  const int* control_counts = nullptr;
  const int* identity_counts = nullptr;

  const double *AB = nullptr, *H = nullptr, *h = nullptr, *b = nullptr;
  const double *lower = nullptr, *upper = nullptr;
  const double* diagonal = nullptr;       ///< a row a stage, added to the diagonal of H; or null
  const std::int8_t* sides = nullptr;     ///< a row a stage: which bounds hold
  const std::uint8_t* special = nullptr;  ///< stages that are not for the kernels
  bool for_steps = true;  ///< whether a step will be asked for: otherwise `drift` and `T` are neither written nor read

  double* P = nullptr;  ///< n_s rows a node
  double* U = nullptr;  ///< n_w rows a stage: columns of the reduced Hessian, each as it is eliminated
  double* V = nullptr;  ///< n_w rows a stage: the policy w = p - V s, p being what stands beside the state's p
  /// 8 x 8 a stage, where a row is a register: rows [A - B V, B] of the next states that are moved; and columns of what
  /// leads from s to [next s; w].
  double *closed = nullptr, *T = nullptr;
  double* inverse = nullptr;      ///< n_w a stage: 1 / pivot, 0 where a control is fixed
  std::uint8_t* fixes = nullptr;  ///< a stage: whether any of its controls is fixed
  double* drift = nullptr;        ///< a row a stage: P_{i+1} b_i
  double* g = nullptr;  ///< a row a stage: gradient by z before anything is eliminated, where it fixes a control
  double* p = nullptr;  ///< a row a node: gradient of the value function; beside it the controls where s is 0

  double *values = nullptr, *costates = nullptr, *bounds = nullptr;  ///< rows of the step, an Iterate
};

/// The recursion over stages at which no state bound holds that must be kept by their controls.
struct RiccatiKernels {
  /// Factorises stages first, first - 1, ..., 0; returns the one that it leaves to the caller (a special one, or one
  /// whose pivot is not above `tolerance` times its diagonal entry), or -1.
  int (*factor)(const RiccatiView& view, int first, double tolerance);
  /// The same for gradients; only special stages are left to the caller.
  int (*solve_backward)(const RiccatiView& view, int first);
  /// Control, next state and costate of stages first, first + 1, ...; returns the special one, or N.
  int (*solve_forward)(const RiccatiView& view, int first);
  /// Sensitivities to `response_batch` gradients at once, each entry of a row beside those of the others: from
  /// gradients of the stages up to `last` (0 where `has_gradient` is) to the value functions' gradients (in place), and
  /// from those and the initial states to the sensitivities (in place) and their costates. What lies in rows without
  /// gradients is not looked at. There must be no special stage.
  void (*sensitivities_backward)(const RiccatiView& view, int last, const unsigned char* has_gradient,
                                 double* gradients);
  void (*sensitivities_forward)(const RiccatiView& view, int last, double* sensitivities, double* costates);
  /// sums += those of a batch, each sensitivity by its weight, over `count` entries, which are whole eights.
  void (*combine)(const double* batch, const double* weights, double* sums, long count);
  /// The covariance (rows of the stride) of node `first` carried on to the special stage that is returned, or to node
  /// N; on the way those of all nodes go to `all`, blocks of n_s x n_s, if it is not null.
  int (*carry_covariance)(const RiccatiView& view, int first, double* covariance, double* all);
  /// H + [A B]'P[A B] of one stage, as rows of `out`.
  void (*form)(const RiccatiView& view, int stage, double* out);
  /// The inverse of a symmetric matrix; both are `count` rows of `stride` entries. False where the matrix is not
  /// positive definite (as in `factor`) or has more than sixteen rows.
  bool (*invert)(const double* matrix, int count, int stride, double tolerance, double* inverse);
  /// batch := -inverse batch, of `count` rows of sensitivities.
  void (*answer)(const double* inverse, int count, int stride, double* batch);
  /// The solution x of matrix x = -p, by that inverse and one correction.
  void (*solve)(const double* matrix, const double* inverse, int count, int stride, const double* p, double* x);
};

}  // namespace rhec
