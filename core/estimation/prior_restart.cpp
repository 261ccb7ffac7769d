#include "prior_restart.hpp"

#include <cmath>
#include <limits>

#include "rhec/core/qp/kkt.hpp"

namespace rhec {
namespace {

/// Two objectives that differ by no more than rounding are equal: the earlier result stays.
bool is_better(double objective, double than) noexcept { return objective + 1e-9 * (1.0 + std::abs(objective)) < than; }

// Defects up to this size leave the objective what it is.
constexpr double small_defect = 1e-3;

int measured_count(const RheProblem& problem) noexcept {
  const int outputs = problem.model().output_count();
  int count = 0;
  const auto add = [&](const double* row) {
    for (int j = 0; j < outputs; ++j) count += !std::isnan(row[j]);
  };
  for (int i = 0; i <= problem.intervals(); ++i) {
    add(problem.output(i));
    for (int k = 0; i < problem.intervals() && k < problem.between(i).count(); ++k) add(problem.between(i).outputs(k));
  }
  return count;
}

}  // namespace

PriorRestart::PriorRestart(const RheProblem& problem)
    : simulated_(problem.capacity()), scratch_(problem.scratch_size(), 0.0) {}

/// The objective with the states simulated from the first one, i.e. without defects.
double PriorRestart::objective_from_start(const RheProblem& problem, const Iterate& iterate) noexcept {
  simulated_ = iterate;
  problem.simulate(simulated_, scratch_);
  const double objective = problem.evaluate(simulated_, nullptr, scratch_);
  return std::isnan(objective) ? std::numeric_limits<double>::infinity() : objective;
}

bool PriorRestart::is_convincing(const RheProblem& problem, const Report& report) noexcept {
  if (!is_usable(report.status) || !(report.kkt.defect <= small_defect)) return false;
  // The least objective has as many degrees of freedom as there are measurements: what is decided has a prior each.
  constexpr double sigmas = 3.0;
  const double freedom = measured_count(problem);
  return report.objective <= freedom + sigmas * std::sqrt(2.0 * freedom);
}

bool PriorRestart::reconsider(const RheProblem& problem, Solver& solver, const Iterate& prior, StageQp& qp,
                              Iterate& point, Report& report, Clock::time_point deadline) noexcept {
  const bool was_usable = is_usable(report.status);
  const double found = was_usable ? objective_from_start(problem, point) : std::numeric_limits<double>::infinity();
  const double expected = problem.evaluate(prior, nullptr, scratch_);
  if (!is_better(expected, found)) return was_usable;
  point = prior;
  if (!was_usable) solver.reset();
  const int iterations = report.iterations;
  report = solver.solve(point, deadline);
  report.iterations += iterations;
  if (is_usable(report.status) && !is_better(expected, objective_from_start(problem, point))) return true;
  point = prior;
  if (was_usable) report.status = Status::iteration_limit;
  report.objective = expected;
  report.kkt = kkt_residual(problem, point, qp, scratch_);
  return false;
}

}  // namespace rhec
