#pragma once

#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"

namespace rhec {

/// The guess for a horizon out of the solution of an earlier one, moved along by the steps between them.
///
/// `take` keeps a solution in the vehicle's terms: states and costates per node; inputs, parameters and their bounds'
/// multipliers per interval. So the problem may be filled anew, with blocks that start elsewhere or a horizon that has
/// grown, before `apply` writes the guess for what it is then:
///
///     shifter.take(problem, solution);
///     ... fill `problem` for the next sample ...
///     shifter.apply(1, problem, guess);
///
/// Memory is set aside by the constructor; nothing else allocates. An instance belongs to one caller.
class RHEC_EXPORT GuessShifter {
 public:
  /// For problems of the capacity and with the model and the blocked inputs of this one.
  explicit GuessShifter(const HorizonProblem& like);

  void take(const HorizonProblem& problem, const Iterate& iterate) noexcept;
  /// The same without a copy: what is left in the iterate is of no use until `apply` has written to it.
  void take(const HorizonProblem& problem, Iterate&& iterate) noexcept;
  void forget() noexcept { intervals_ = 0; }

  /// Writes into `guess` (which may be the iterate that was taken) the kept solution, seen from `steps` intervals
  /// further on. What the kept horizon does not reach: inputs as measured (RHE, where there is a measurement) or as
  /// last, clipped to their bounds; parameters as last; states by integration; multipliers of bounds zero. Interval 0
  /// of `to` is interval `steps` of the kept horizon: 0 while an estimator's horizon grows. False, with the guess left
  /// as it was, where nothing of the kept horizon is left, nothing was kept or `to` is too large: start cold.
  bool apply(int steps, HorizonProblem& to, Iterate& guess) noexcept;

 private:
  void take_structure(const HorizonProblem& problem) noexcept;
  /// Of the kept horizon: what a lifted variable's interval contributes to the costates of its block.
  double gradient(int interval, int lifted) const noexcept;
  int kept_control(int interval, int lifted) const noexcept { return controls_[interval * lifted_ + lifted]; }
  void move_rows(int steps, const HorizonProblem& to, Iterate& guess) const noexcept;
  bool is_one_block(int lifted, const HorizonProblem& to) const noexcept;
  void extend_lifted(int lifted, int steps, const HorizonProblem& to, Iterate& guess) const noexcept;
  void move_lifted(int lifted, int steps, const HorizonProblem& to, Iterate& guess) const noexcept;
  void move_lifted_bounds(int lifted, int steps, const HorizonProblem& to, Iterate& guess) noexcept;
  void add_intervals(int steps, HorizonProblem& to, Iterate& guess) noexcept;

  int nx_, nu_, lifted_, free_count_;
  int intervals_ = 0;           ///< of what is kept; 0: nothing
  bool any_start_ = false;      ///< of a block within what is kept
  Iterate kept_;                ///< as it was taken
  std::vector<int> controls_;   ///< per interval and lifted variable: the control that starts it there, or -1
  std::vector<double> shares_;  ///< per interval: its share of a block's multiplier
  std::vector<double> scratch_;
};

}  // namespace rhec
