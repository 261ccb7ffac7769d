#include "rhec/sim/recording_solver.hpp"

#include <utility>

#include "rhec/core/timed_solver.hpp"

namespace rhec::sim {

RecordingSolver::RecordingSolver(std::shared_ptr<Solver> solver, Callback callback)
    : solver_(std::move(solver)), callback_(std::move(callback)) {}

void RecordingSolver::setup(const Ocp& ocp) {
  solver_->setup(ocp);
  guess_ = Iterate(ocp.capacity());
}

Report RecordingSolver::solve(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept {
  const auto* problem = dynamic_cast<const HorizonProblem*>(&ocp);
  // A point of another capacity is refused by the solver; to keep it would be to allocate here.
  if (!problem || !callback_ || point.capacity() != guess_.capacity()) return solver_->solve(ocp, point, deadline);
  guess_ = point;
  const Report report = solver_->solve(ocp, point, deadline);
  callback_(*problem, guess_, point, report);
  return report;
}

Robot with_hooks(Robot robot, const LoopHooks& hooks, std::function<std::int64_t()> step) {
  robot.wrap_solvers([](OcpKind, std::shared_ptr<Solver> solver) -> std::shared_ptr<Solver> {
    return std::make_shared<TimedSolver>(std::move(solver));
  });
  if (!hooks.solved) return robot;
  robot.wrap_solvers([solved = hooks.solved, step = std::move(step)](
                         OcpKind, std::shared_ptr<Solver> solver) -> std::shared_ptr<Solver> {
    return std::make_shared<RecordingSolver>(
        std::move(solver), [solved, step](const HorizonProblem& problem, const Iterate& guess, const Iterate& result,
                                          const Report& report) { solved(step(), problem, guess, result, report); });
  });
  return robot;
}

}  // namespace rhec::sim
