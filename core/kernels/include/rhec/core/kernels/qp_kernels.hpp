#pragma once

#include <cstdint>

namespace rhec {

// Initialise all members of a view at once, by designated initialisers: a view that is zeroed first and filled later
// has to reach the cache before it can be read, which takes longer than most kernels.

/// Arguments of the kernels on stage QPs and iterates: rows of `stride` entries, one per stage 0 .. N.
struct QpView {
  int intervals = 0;
  int first = 0, last = 0;                   ///< stages to visit
  int states = 0, controls = 0, stride = 0;  ///< sizes of the capacity
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

/// How a step that was found without the inactive bounds meets them.
struct StepParts {
  bool is_finite;  ///< states, controls and costates; and no bound is NaN
  bool violates;   ///< a bound is violated by more than the tolerance
  double largest_costate;
};

/// The largest violation, if above 0, and the number of violations above 0.
struct ViolationParts {
  double largest;
  int count;
};

/// The limits of all stages of a QP, as StageQp stores them: `limits` rows of G each, of `stride` entries, and four
/// rows of `row` entries: lower and upper bounds, linear and quadratic prices. What stages do not use is zero.
struct LimitView {
  int intervals = 0;
  int controls = 0;  ///< of the capacity
  int limits = 0, row = 0, stride = 0;
  const int* counts = nullptr;  ///< of limits
  const double *G = nullptr, *sides = nullptr;
};

/// Inner loops over the stages of a QP and an iterate.
struct QpKernels {
  KktParts (*kkt)(const QpView& view);
  StepParts (*check_step)(const QpView& view, double tolerance);
  /// Marks with 1 the stages at which a multiplier is non-zero or two bounds coincide. Returns true if a lower bound
  /// exceeds its upper bound by more than the tolerance, or a bound is NaN.
  bool (*mark_bounds)(const QpView& view, double tolerance, unsigned char* marks);
  /// violations = max(least - values, values - most) for `count` entries, a multiple of eight.
  ViolationParts (*find_violations)(const double* values, const double* least, const double* most, long count,
                                    double* violations);
  /// The largest of each eight of `count` entries, a multiple of eight.
  void (*largest_of_eight)(const double* values, long count, double* largest);
  /// least = lower - tolerance (1 + |lower|) and most = upper + tolerance (1 + |upper|) for `count` entries.
  void (*widen_bounds)(const double* lower, const double* upper, double tolerance, long count, double* least,
                       double* most);
  /// to += from.
  void (*add)(const double* from, double* to, long count);
  /// Whether all numbers of the limits make sense: G is finite, no bound is NaN or out of reach, none exceeds its upper
  /// one by more than the tolerance, and no price is NaN, negative or zero.
  bool (*limits_are_sound)(const LimitView& view, double tolerance);
  /// values := G z of all stages, rows of `view.row` entries. Returns whether one is out of its bounds by more than the
  /// tolerance.
  bool (*limit_values)(const LimitView& view, const double* z, double tolerance, double* values);
  /// The same for eight steps at once, interleaved, without the controls that `held` marks (rows as those of z), of
  /// which `states` is the first column. Only the columns that a stage has are read.
  void (*limit_sensitivities)(const LimitView& view, const int* control_counts, int states, const std::int8_t* held,
                              const double* steps, double* values);
};

}  // namespace rhec
