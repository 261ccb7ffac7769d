#pragma once

namespace rhec {

// Initialise all members of a view at once, by designated initialisers: a view that is zeroed first and filled later
// has to reach the cache before it can be read, which takes longer than most kernels.

/// Dynamics of a QP: the model has written next states (to b) and the rows of its Jacobian (to AB); the rest is
/// missing.
struct DynamicsView {
  int first, last;             ///< intervals
  int states, stride;          ///< of the capacity
  int vehicle_states, lifted;  ///< the parts of a stage state
  const int* control_of;       ///< per interval and lifted variable: the control that starts its block, or -1
  const double* values;        ///< rows of the iterate
  double *AB, *b;
  bool has_lifted_rows;  ///< the rows of lifted variables are already there
  bool any_start;        ///< whether any block starts within the horizon
};

/// Where to write costs: matrices, vectors, or both. Null: not wanted.
struct CostView {
  int intervals, states, controls, stride;
  const int* control_counts;
  double *H, *h;
  bool adds_to_curvature;  ///< H already holds the curvature of the dynamics, to which costs are added
};

/// Rows of gradients at points, and sums over measurements by their parts of these points (PointSums): `W` by rows, and
/// v.
struct SumsView {
  const double* G;
  long G_step;  ///< at least the columns, filled up to a multiple of eight
  int points;   ///< at most nine
  const double* W;
  long W_step;
  const double* v;
};
struct ProductSizes {
  int rows, inner, columns;
};

/// An estimator's measurements, NaN where missing, with weights 1 / variance. Rows of outputs are padded to multiples
/// of eight; rows of inputs are rows of a stage, with the inputs in the control columns.
struct MeasurementView {
  int vehicle_states, output_count, input_count;
  const double *outputs, *inputs;       ///< rows for all nodes and intervals
  const double *predicted, *jacobians;  ///< for the nodes of the range; rows of Jacobians are padded
  const double* output_weights;         ///< of the first node of the range
  long output_weights_step;             ///< to those of the next one: 0, or a row
  const double* input_weights;
  const double *periods, *inverse_periods;  ///< one row each: 2 pi and its inverse for an angle, else 0
  const double* values;                     ///< rows of the iterate
  double* room;                             ///< for two rows of outputs
  /// If H already holds curvature, the squares are added to it. Their gradients with respect to the outputs, 2 weight
  /// (predicted - measured), then go to these rows of outputs, for the nodes of the range. Null: H is overwritten.
  double* pulls;
  /// For all stages: 1 if H is zero except for the entries that measurements write. Null: for none.
  const unsigned char* is_clean;
};

/// A controller's references: one row [x; p; u] per stage. References of columns with weight 0 are arbitrary.
struct TrackingView {
  const double *values, *references;
  const double *stage_weights, *terminal_weights, *periods, *inverse_periods;  ///< one row each
};

/// Rows of an iterate, their bounds and multipliers.
struct GuessView {
  int rows, stride;
  int vehicle_states, states, used;  ///< columns: vehicle states, stage states, and all columns to keep
  const double *values, *multipliers, *lower, *upper;
};

/// Inner loops that write the stages of a QP from a model, an iterate and data.
struct TranscriptionKernels {
  /// Bounds of steps from an iterate: lower - point and upper - point.
  void (*write_bounds)(const double* lower, const double* upper, const double* point, double* step_lower,
                       double* step_upper, long count);
  /// Compares `count` rows of a and b of length `stride`: marks 2 if they are equal, 1 if their first `columns` entries
  /// are equal, otherwise 0. Copies the rows of a to `kept`, which may overlap b if it does not start behind it.
  void (*match)(const double* a, const double* b, double* kept, int count, int stride, int columns,
                unsigned char* marks);
  /// Copies rows. Controls are clipped to their bounds, and multipliers without a bound become zero, as do all
  /// multipliers of lifted variables. Unused columns become zero.
  void (*adopt)(const GuessView& from, double* values, double* multipliers);
  /// H += sum_j weights_j J_j J_j' in its first `columns` columns and h += sum_j pulls_j J_j (null: not), with the
  /// `count` rows J_j of one stage. Rows of J have length `columns`, padded to a multiple of eight.
  void (*add_products)(const double* J, const double* weights, const double* pulls, int count, int columns, int stride,
                       double* H, double* h);
  /// Adds G'WG to H and G'v to h, either of which may be null.
  void (*add_sums)(const SumsView& sums, int columns, int stride, double* H, double* h);
  /// Rows C J, with entries behind their ends zero: `to` has rows of `width`, a multiple of eight, as have at least
  /// those of J.
  void (*multiply_rows)(const double* C, long c_step, const double* J, long j_step, const ProductSizes& sizes,
                        int width, double* to);
  /// weights (z - reference)^2 of stages first .. last; returns their sum if vectors are wanted. Differences of entries
  /// with a non-zero period are taken on the circle.
  double (*write_tracking)(const CostView& view, const TrackingView& tracked, int first, int last);
  /// Rows of lifted variables in AB, and b = F(s, w) - s_next.
  void (*complete_dynamics)(const DynamicsView& view);
  /// Sets the used entries of stages first .. last to zero.
  void (*clear_costs)(const CostView& view, int first, int last);
  /// Squares of measured outputs and inputs, without second derivatives of the outputs; returns their sum.
  double (*write_measurements)(const CostView& view, const MeasurementView& measured, int first, int last);
};

}  // namespace rhec
