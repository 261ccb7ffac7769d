#include "rhec/core/ocp/timed_solver.hpp"

#include <utility>

namespace rhec {

void TimedSolver::setup(const Ocp& ocp) {
  inner().setup(ocp);
  preparation_us_ = 0.0;
}

void TimedSolver::prepare(const Iterate& guess) noexcept {
  const auto start = Clock::now();
  inner().prepare(guess);
  preparation_us_ += microseconds_since(start);
}

Report TimedSolver::solve(Iterate& iterate, Clock::time_point deadline) noexcept {
  const auto start = Clock::now();
  Report report = inner().solve(iterate, deadline);
  write_times(start, report);
  return report;
}

Report TimedSolver::feedback(Iterate& iterate, Clock::time_point deadline) noexcept {
  const auto start = Clock::now();
  Report report = inner().feedback(iterate, deadline);
  write_times(start, report);
  return report;
}

void TimedSolver::finish(Iterate& iterate, Report& report) noexcept {
  const auto start = Clock::now();
  const double preparation_us = report.preparation_us, feedback_us = report.feedback_us;
  inner().finish(iterate, report);
  report.preparation_us = preparation_us;
  report.feedback_us = feedback_us;
  preparation_us_ += microseconds_since(start);
}

void TimedSolver::reset() noexcept {
  inner().reset();
  preparation_us_ = 0.0;
}

void TimedSolver::write_times(Clock::time_point start, Report& report) noexcept {
  report.feedback_us = microseconds_since(start);
  report.preparation_us = std::exchange(preparation_us_, 0.0);
}

}  // namespace rhec
