#pragma once

namespace rhec {

/// What the kernels over stage programs and iterates work on: rows of `stride` entries, one a stage, 0 .. N.
struct ProgramView {
  int intervals = 0;
  int states = 0, controls = 0, stride = 0;  ///< of the capacity
  const int* state_counts = nullptr;
  const int* control_counts = nullptr;
  bool initial_state_is_given = false;
  const double *F = nullptr, *h = nullptr, *b = nullptr, *lower = nullptr, *upper = nullptr;
  const double *values = nullptr, *costates = nullptr, *bounds = nullptr;  ///< rows of an Iterate
};

/// Largest absolute values, not yet divided by the size of the terms.
struct KktParts {
  double stationarity, defect, bound_violation, complementarity, largest_term;
};

/// What a step that solves a program without its inactive bounds does to them.
struct StepParts {
  bool is_finite;
  bool violates;           ///< some bound, by more than the tolerance
  double largest_costate;
};

/// Inner loops over whole horizons.
struct ProgramKernels {
  KktParts (*kkt)(const ProgramView& view);
  StepParts (*check_step)(const ProgramView& view, double tolerance);
  /// Marks with 1 the stages of which a multiplier is not zero or bounds coincide; true where a lower bound is above its
  /// upper one by more than the tolerance, or one of them is not a number.
  bool (*mark_bounds)(const ProgramView& view, double tolerance, unsigned char* marks);
  /// out = a - b.
  void (*subtract)(const double* a, const double* b, double* out, long count);
  /// to = from + step.
  void (*add)(const double* from, const double* step, double* to, long count);
  /// H += 2 sum_j w_j J_j J_j' over its first `columns` columns (null: not) and h += 2 sum_j w_j r_j J_j, with the `count`
  /// rows J_j of one stage; rows are as long as `columns` needs in multiples of eight.
  void (*add_squares)(const double* J, const double* weights, const double* residuals, int count, int columns, double* H,
                      double* h, int stride);
  /// Adds weights (z - reference)^2 of one stage: gradient, diagonal of H (null: not); returns the sum. Differences of
  /// entries whose `turn` is not 0 are taken on a circle of that length.
  double (*add_tracking)(const double* z, const double* reference, const double* weights, const double* turn, double* H,
                         double* h, int columns, int stride);
};

}  // namespace rhec
