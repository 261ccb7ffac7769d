#pragma once

#include "rhec/core/ocp/solver_decorator.hpp"

namespace rhec {

/// Measures the times in a solver's reports. Solvers do not read the clock for this themselves, since it costs a few
/// percent of a real-time step.
class RHEC_EXPORT TimedSolver final : public SolverDecorator {
 public:
  using SolverDecorator::SolverDecorator;

  void setup(const Ocp& ocp) override;
  void prepare(const Iterate& guess) noexcept override;
  using Solver::solve;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override;
  Report feedback(Iterate& iterate, Clock::time_point deadline) noexcept override;
  void finish(Iterate& iterate, Report& report) noexcept override;
  void reset() noexcept override;

 private:
  void write_times(Clock::time_point start, Report& report) noexcept;

  double preparation_us_ = 0.0;  ///< since the last report
};

}  // namespace rhec
