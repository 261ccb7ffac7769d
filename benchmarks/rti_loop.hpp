#pragma once

#include <optional>
#include <vector>

#include "rhec/core/horizon/shift.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "sequences.hpp"
#include "ticks.hpp"

namespace rhec::bench {

/// Solves a sequence as a robot's control loop would, each sample from the solution of the one before. Everything is
/// set up beforehand: nothing is parsed or allocated.
class RtiLoop {
 public:
  /// The sequence must outlive the loop. Throws Error if the solver cannot take it.
  RtiLoop(const Sequence& sequence, std::shared_ptr<Solver> solver);

  /// Restarts at the first sample and resets the solver.
  void restart() noexcept;
  /// Solves the next sample: sets the known data, shifts the guess and prepares the step; then sets the newest data,
  /// takes the step and assesses it. The first sample is solved from the sequence's guess, without preparation.
  const Report& step() noexcept;

  struct Times {
    Ticks::Count begin, prepared, answered, end;
    double total_us() const noexcept { return Ticks::microseconds(begin, end); }
    /// From the newest data to the new iterate, before its assessment; only with `looks_inside`.
    double feedback_us() const noexcept { return Ticks::microseconds(prepared, answered); }
  };
  const Times& times() const noexcept { return times_; }
  const Report& report() const noexcept { return report_; }
  int sample() const noexcept { return next_ - 1; }
  const HorizonProblem& problem() const noexcept { return *problem_; }
  const Iterate& guess() const noexcept { return guess_; }  ///< of the last step, if `keep_guess` is set
  const Iterate& point() const noexcept { return point_; }
  Solver& solver() noexcept { return *solver_; }
  bool keep_guess = false;
  /// Also reads the clock within a step. That takes longer: the processor must complete all pending instructions first.
  bool looks_inside = false;

 private:
  const Sequence* sequence_;
  std::shared_ptr<Solver> solver_;
  HorizonProblem* problem_;
  GuessShifter shifter_;
  Iterate point_, guess_;
  std::vector<double> scratch_;
  int next_ = 0;
  Times times_{};
  Report report_;
};

/// For each sample, how far the objective after the step lies above that of the optimum to which `converging` solves
/// from there, relative to the latter. A controller's states are simulated with its inputs; an estimator's are taken as
/// they are.
std::vector<double> excess_objectives(const Sequence& sequence, const std::shared_ptr<Solver>& solver,
                                      const std::shared_ptr<Solver>& converging);

}  // namespace rhec::bench
