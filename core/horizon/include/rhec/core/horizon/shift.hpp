#pragma once

#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"

namespace rhec {

/// The initial guess for a horizon: the solution of an earlier one, shifted by the steps between them (real-time
/// iteration, docs/method.md, section 7).
///
/// `take` keeps a solution in terms of the vehicle: states and costates per node; inputs, parameters and their bound
/// multipliers per interval. The problem may then be filled for the next sample, with other block starts or a longer
/// horizon, before `apply` writes the guess:
///
///     shifter.take(problem, solution);
///     ... fill `problem` for the next sample ...
///     shifter.apply(1, problem, guess);
///
/// The constructor allocates, nothing else does. One caller at a time.
class RHEC_EXPORT GuessShifter {
 public:
  /// For problems with the capacity, model and blocked inputs of this one.
  explicit GuessShifter(const HorizonProblem& like);

  void take(const HorizonProblem& problem, const Iterate& iterate) noexcept;
  /// The same without a copy: the iterate has no useful content until `apply` has written to it.
  void take(const HorizonProblem& problem, Iterate&& iterate) noexcept;
  void forget() noexcept { intervals_ = 0; }
  /// What was taken last.
  const Iterate& kept() const noexcept { return kept_; }

  /// Writes into `guess` (which may be the iterate that was taken) the kept solution, shifted by `steps` intervals.
  /// Beyond its end: inputs as measured (RHE, if there is a measurement) or the last ones, clipped to their bounds; the
  /// last parameters; states by integration; zero bound multipliers. Interval 0 of `to` is interval `steps` of the kept
  /// horizon: 0 while an estimator's horizon grows. Returns false and leaves the guess unchanged if the horizons do not
  /// overlap, nothing was kept, or `to` is too large: use a cold start.
  bool apply(int steps, HorizonProblem& to, Iterate& guess) noexcept;

 private:
  void take_structure(const HorizonProblem& problem) noexcept;
  /// Contribution of an interval of the kept horizon to the costates of a lifted variable's block.
  double gradient(int interval, int lifted) const noexcept;
  int kept_control(int interval, int lifted) const noexcept { return controls_[interval * lifted_ + lifted]; }
  void move_rows(int steps, const HorizonProblem& to, Iterate& guess) const noexcept;
  void move_limits(int steps, const HorizonProblem& to, Iterate& guess) const noexcept;
  bool is_one_block(int lifted, const HorizonProblem& to) const noexcept;
  void extend_lifted(int lifted, int steps, const HorizonProblem& to, Iterate& guess) const noexcept;
  void move_lifted(int lifted, int steps, const HorizonProblem& to, Iterate& guess) const noexcept;
  void move_lifted_bounds(int lifted, int steps, const HorizonProblem& to, Iterate& guess) noexcept;
  void add_intervals(int steps, HorizonProblem& to, Iterate& guess) noexcept;

  int nx_, nu_, lifted_, free_count_;
  int intervals_ = 0;           ///< of the kept horizon; 0: nothing is kept
  bool any_start_ = false;      ///< whether a block starts within the kept horizon
  Iterate kept_;                ///< as taken
  std::vector<int> controls_;   ///< per interval and lifted variable: the control that starts its block there, or -1
  std::vector<double> shares_;  ///< per interval: its share of a block's multiplier
  std::vector<double> scratch_;
};

}  // namespace rhec
