#pragma once

#include <optional>
#include <vector>

#include "rhec/core/horizon/shift.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "sequences.hpp"
#include "ticks.hpp"

namespace rhec::bench {

/// Solves a sequence as a robot's loop would, one sample after the other from the solution before, with everything in
/// place beforehand: nothing is parsed or allocated.
class RtiLoop {
 public:
  /// The sequence must outlive the loop. Throws Error where the solver cannot take it.
  RtiLoop(const Sequence& sequence, std::shared_ptr<Solver> solver);

  /// Begins anew at the first sample, with a solver that has forgotten all.
  void restart() noexcept;
  /// The next sample: what is known of it is set, the guess moved on, the step prepared; then the newest data are set
  /// and the step is taken and judged. The first one has no solution before it and is solved from its guess.
  const Report& step() noexcept;

  struct Times {
    Ticks::Count begin, prepared, answered, end;
    double total_us() const noexcept { return Ticks::microseconds(begin, end); }
    /// From the newest data to the new point, which is not judged yet; where the loop looks inside.
    double feedback_us() const noexcept { return Ticks::microseconds(prepared, answered); }
  };
  const Times& times() const noexcept { return times_; }
  const Report& report() const noexcept { return report_; }
  int sample() const noexcept { return next_ - 1; }
  const HorizonProblem& problem() const noexcept { return *problem_; }
  const Iterate& guess() const noexcept { return guess_; }  ///< of the last step, where `keep_guess` asks for it
  const Iterate& point() const noexcept { return point_; }
  Solver& solver() noexcept { return *solver_; }
  bool keep_guess = false;
  /// At the clock within a step too: the processor has to finish all that it has begun first, which takes longer.
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

/// How far the objective of each sample's step lies above that of the optimum it is on the way to, relative to it. What
/// a controller is judged by is what its inputs do, so its states are simulated; an estimator's are taken as they are.
std::vector<double> excess_objectives(const Sequence& sequence, const std::shared_ptr<Solver>& solver,
                                      const std::shared_ptr<Solver>& converging);

}  // namespace rhec::bench
