#include "rhec/core/timed_solver.hpp"

#include <utility>

namespace rhec {

void TimedSolver::setup(const Ocp& ocp) {
  solver_->setup(ocp);
  preparation_us_ = 0.0;
}

void TimedSolver::prepare(const Ocp& ocp, const Iterate& guess) noexcept {
  const auto start = Clock::now();
  solver_->prepare(ocp, guess);
  preparation_us_ += microseconds_since(start);
}

Report TimedSolver::solve(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept {
  const auto start = Clock::now();
  Report report = solver_->solve(ocp, point, deadline);
  write_times(start, report);
  return report;
}

Report TimedSolver::feedback(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept {
  const auto start = Clock::now();
  Report report = solver_->feedback(ocp, point, deadline);
  write_times(start, report);
  return report;
}

void TimedSolver::finish(const Ocp& ocp, Iterate& point, Report& report) noexcept {
  const auto start = Clock::now();
  const double preparation_us = report.preparation_us, feedback_us = report.feedback_us;
  solver_->finish(ocp, point, report);
  report.preparation_us = preparation_us;
  report.feedback_us = feedback_us;
  preparation_us_ += microseconds_since(start);
}

void TimedSolver::reset() noexcept {
  solver_->reset();
  preparation_us_ = 0.0;
}

void TimedSolver::write_times(Clock::time_point start, Report& report) noexcept {
  report.feedback_us = microseconds_since(start);
  report.preparation_us = std::exchange(preparation_us_, 0.0);
}

}  // namespace rhec
