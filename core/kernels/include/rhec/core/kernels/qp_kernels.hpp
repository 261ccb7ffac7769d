#pragma once

namespace rhec {

// Views are made by naming their members, all at once: what is cleared first and filled then has to reach the cache
// before it can be read, which takes longer than most kernels.

/// What the kernels over stage QPs and iterates work on: rows of `stride` entries, one a stage, 0 .. N.
struct QpView {
  int intervals = 0;
  int first = 0, last = 0;                   ///< stages to be looked at
  int states = 0, controls = 0, stride = 0;  ///< of the capacity
  const int* state_counts = nullptr;
  const int* control_counts = nullptr;
  const int* identity_counts = nullptr;
  bool initial_state_is_given = false;
  const double *AB = nullptr, *h = nullptr, *b = nullptr, *lower = nullptr, *upper = nullptr;
  const double *values = nullptr, *costates = nullptr, *bounds = nullptr;  ///< rows of an Iterate
};

/// Largest absolute values, not yet divided by the size of the terms.
struct KktParts {
  double stationarity, defect, bound_violation, complementarity, largest_term;
};

/// What a step that solves a QP without its inactive bounds does to them.
struct StepParts {
  bool is_finite;  ///< and no bound is not a number
  bool violates;   ///< some bound, by more than the tolerance
  double largest_costate;
};

/// The largest of some violations, if it is above 0, and how many are.
struct ViolationParts {
  double largest;
  int count;
};

/// Inner loops over the stages of a QP and an iterate.
struct QpKernels {
  KktParts (*kkt)(const QpView& view);
  StepParts (*check_step)(const QpView& view, double tolerance);
  /// Marks with 1 the stages of which a multiplier is not zero or bounds coincide; true where a lower bound is above
  /// its upper one by more than the tolerance, or one of them is not a number.
  bool (*mark_bounds)(const QpView& view, double tolerance, unsigned char* marks);
  /// violations = max(least - values, values - most), of `count` entries, which are whole eights.
  ViolationParts (*find_violations)(const double* values, const double* least, const double* most, long count,
                                    double* violations);
  /// least = lower - tolerance (1 + |lower|) and most = upper + tolerance (1 + |upper|), of `count` entries.
  void (*widen_bounds)(const double* lower, const double* upper, double tolerance, long count, double* least,
                       double* most);
  /// to += from.
  void (*add)(const double* from, double* to, long count);
};

}  // namespace rhec
