#pragma once

namespace rhec {

// A bank of Kalman filters side by side: entry e of member m lies at e * members + m, and `members` is a multiple of
// eight. Matrices are column-major and dense, with both halves of the symmetric ones. Members that fill up the last
// eight have weight 0.

/// The moments of all members, for the state [x; z] with x the vehicle's state and z the states of all processes.
struct BankView {
  int members;
  int vehicle_states, states;  ///< n_x, and the size n of [x; z]
  double *mean, *covariance;   ///< n, n x n
  double* work;                ///< room for 2 n^2 + 3 n entries
};

/// One process of every member: entries first .. first + count - 1 of [x; z].
struct BankProcess {
  int first, count;
  const double *F, *Q;  ///< count x count
  const double* ramp;   ///< one entry: 1 if the parameter runs to its next value over the interval, 0 if it is held
};

/// A step of the vehicle at the mean of every member: next state and Jacobian [x; u; p; p_end].
struct BankStep {
  int inputs, processes;
  const BankProcess* process;
  const double *next_states, *jacobian;  ///< n_x, n_x x (n_x + n_u + 2 n_p)
  const double* input_variances;         ///< n_u, the same for all
};

/// One measured output: the prediction at the mean of every member, and its gradient by x.
struct BankOutput {
  const double *predicted, *gradient, *variance;  ///< 1, n_x, 1
  double measured;
  double period;  ///< 2 pi for an angle, else 0
};

struct BankKernels {
  /// mean_m <- keep_m mean_m + take_m average, and so with the second moments about the new mean: every member becomes
  /// the mixture of itself and of all. `weights`, `keep` and `take` have one entry; keep + take = 1.
  void (*mix)(const BankView& bank, const double* weights, const double* keep, const double* take);
  /// Time update. A member whose result is not finite keeps what it has.
  void (*predict)(const BankView& bank, const BankStep& step);
  /// Measurement update with one output after the other, all linearised at the same point (Joseph's form). Adds
  /// min(r^2 / S, gate) to `squares` and writes S to `variances` (count entries). A member whose result is not finite
  /// keeps what it has; its S is 1.
  void (*update)(const BankView& bank, const BankOutput* outputs, int count, double gate, double* squares,
                 double* variances);
  /// mean <- next_mean, covariance <- T P T' with the covariance P of a wider vector, `wide`, and T of n rows. A member
  /// whose result is not finite keeps what it has.
  void (*narrow)(const BankView& bank, const BankView& wide, const double* transition, const double* next_mean);
  /// What [x; z] is given outputs linearised about `point` (n entries): a step from there, to the mean and the
  /// covariance of the view, which stay. `outputs` predict at `point`. An innovation counts as no more than `gate`,
  /// squared and in variances. `moved` (1 entry): the largest squared change of the first `judged` entries, in their
  /// variances. A member whose result is not finite goes to its mean. `work` has count (n + count + 1) entries or more.
  void (*move_point)(const BankView& bank, const BankOutput* outputs, int count, int judged, double gate, double* point,
                     double* moved);
  /// r^2 / S of each output on its own (count entries), before any update.
  void (*surprise)(const BankView& bank, const BankOutput* outputs, int count, double* squares);
  /// Mean (n) and covariance (n x n) of the mixture.
  void (*moments)(const BankView& bank, const double* weights, double* mean, double* covariance);
};

}  // namespace rhec
