#pragma once

#include <vector>

#include "rhec/core/horizon_problem.hpp"

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

  void take(const HorizonProblem& problem, const Iterate& point) noexcept;
  void forget() noexcept { intervals_ = 0; }

  /// Writes into `guess` (which may be the point that was taken) the kept solution, seen from `steps` intervals further
  /// on. What the kept horizon does not reach: inputs as measured (RHE, where there is a measurement) or as last,
  /// clipped to their bounds; parameters as last; states by integration; multipliers of bounds zero. Interval 0 of `to`
  /// is interval `steps` of the kept horizon: 0 while an estimator's horizon grows. False, with the guess left as it
  /// was, where nothing of the kept horizon is left, nothing was kept or `to` is too large: start cold.
  bool apply(int steps, const HorizonProblem& to, Iterate& guess) noexcept;

 private:
  int control_of(const HorizonProblem& problem, int interval, int channel) const noexcept;
  void take_channel(const HorizonProblem& problem, const Iterate& point, int channel) noexcept;
  void move_decisions(int steps, const HorizonProblem& to, Iterate& guess) noexcept;
  void move_states(int steps, const HorizonProblem& to, Iterate& guess) noexcept;
  void move_costates(int steps, const HorizonProblem& to, Iterate& guess) const noexcept;
  void move_bounds(int steps, const HorizonProblem& to, Iterate& guess) const noexcept;
  double* row(std::vector<double>& v, int i, int width) const noexcept { return v.data() + i * width; }
  const double* row(const std::vector<double>& v, int i, int width) const noexcept { return v.data() + i * width; }

  int max_intervals_, nx_, nu_, np_, channels_;
  std::vector<int> free_inputs_;
  int intervals_ = 0;                                          ///< of what is kept; 0: nothing
  std::vector<double> states_, costates_, state_bounds_;       ///< per node; states with the carried channels
  std::vector<double> inputs_, parameters_;                    ///< per interval
  std::vector<double> free_bounds_;                            ///< per interval and free input: bound multiplier
  std::vector<double> channel_bounds_;                         ///< per interval and channel: its share of the block's
  std::vector<double> channel_gradients_;                      ///< per interval and channel: dL/d(value used there)
  std::vector<double> next_inputs_, next_parameters_, u_, p_;  ///< workspace
};

}  // namespace rhec
