#pragma once

namespace rhec {

// Views are made by naming their members, all at once: what is cleared first and filled then has to reach the cache
// before it can be read, which takes longer than most kernels.

/// Where a model has written next states (to b) and its Jacobian's rows (to AB): what is left to fill.
struct DynamicsView {
  int first, last;             ///< intervals
  int states, stride;          ///< of the capacity
  int vehicle_states, lifted;  ///< what a state is made of
  const int* control_of;       ///< of each interval's lifted variables: the control that starts its block, or -1
  const double* values;        ///< rows of the point
  double *AB, *b;
  bool has_lifted_rows;  ///< those of lifted variables are there already
  bool any_start;        ///< a block starts somewhere
};

/// Where costs go: their matrices, their vectors, or both. What is not wanted is null.
struct CostView {
  int intervals, states, controls, stride;
  const int* control_counts;
  double *H, *h;
  bool adds_to_curvature;  ///< H holds the curvature of the intervals' dynamics, to which costs are added
};

/// An estimator's measurements, NaN where missing, with weights 1 / variance. Rows of outputs are whole eights, those
/// of inputs are a stage's, with inputs where its controls begin.
struct MeasurementView {
  int vehicle_states, output_count, input_count;
  const double *outputs, *inputs;       ///< rows of all nodes and intervals
  const double *predicted, *jacobians;  ///< of the range's nodes; Jacobians as rows of whole eights
  const double *output_weights, *input_weights;
  const double *periods, *inverse_periods;  ///< a row each: of an angle a full turn and its inverse, else 0
  const double* values;                     ///< rows of the point
  double* room;                             ///< for two rows of outputs
  /// Where H holds curvature already: what to add the squares to, and not to clear. Their pulls 2 weight (predicted -
  /// measured) go to rows of outputs of the range's nodes. Null: it does not.
  double* pulls;
  /// Of all stages: 1 where H is zero but for what measurements write to. Null: of none.
  const unsigned char* is_clean;
};

/// A controller's references, a row [x; p; u] a stage. A column's reference may be anything where its weight is 0.
struct TrackingView {
  const double *values, *references;
  const double *stage_weights, *terminal_weights, *periods, *inverse_periods;  ///< one row each
};

/// Rows of a point, their bounds and multipliers.
struct GuessView {
  int rows, stride;
  int vehicle_states, states, used;  ///< columns: those of the vehicle, those of a state, those that are kept
  const double *values, *multipliers, *lower, *upper;
};

/// Inner loops that turn a model, a point and data into the stages of a QP.
struct TranscriptionKernels {
  /// Bounds of steps from a point: lower - point and upper - point.
  void (*write_bounds)(const double* lower, const double* upper, const double* point, double* step_lower,
                       double* step_upper, long count);
  /// Marks rows of a and b, `count` of them and `stride` long: 2 where they are equal, 1 where their first `columns`
  /// entries are, 0 otherwise. Rows of a go to `kept`, which may begin with, or before, those of b.
  void (*match)(const double* a, const double* b, double* kept, int count, int stride, int columns,
                unsigned char* marks);
  /// Copies rows: of controls what their bounds allow, of multipliers those whose bound there is; of lifted variables
  /// no multiplier, and nothing of columns that are not used.
  void (*adopt)(const GuessView& from, double* values, double* multipliers);
  /// H += sum_j weights_j J_j J_j' over its first `columns` columns and h += sum_j pulls_j J_j (null: not), with the
  /// `count` rows J_j of one stage; rows are as long as `columns` needs in multiples of eight.
  void (*add_products)(const double* J, const double* weights, const double* pulls, int count, int columns, int stride,
                       double* H, double* h);
  /// weights (z - reference)^2 of stages first .. last; returns the sum where vectors are wanted. Differences of
  /// entries whose turn is not 0 are taken on a circle of that length.
  double (*write_tracking)(const CostView& view, const TrackingView& tracked, int first, int last);
  /// Rows of lifted variables in AB, and b = F(s, w) - s_next.
  void (*complete_dynamics)(const DynamicsView& view);
  /// Zeros to what is used of stages first .. last.
  void (*clear_costs)(const CostView& view, int first, int last);
  /// Squares of measured outputs and inputs, without the curvature of anything; returns their sum.
  double (*write_measurements)(const CostView& view, const MeasurementView& measured, int first, int last);
};

}  // namespace rhec
