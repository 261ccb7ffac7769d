#include "rhec/sim/problems/recording_solver.hpp"

#include <string_view>
#include <utility>

#include "rhec/core/ocp/timed_solver.hpp"

namespace rhec::sim {
namespace {

/// Times solvers, and records their solves if there is a callback.
class SolverHooks final : public RobotHooks {
 public:
  SolverHooks(RecordingSolver::Callback solved, std::function<std::int64_t()> step)
      : solved_(std::move(solved)), step_(std::move(step)) {}
  std::shared_ptr<Solver> wrap_solver(std::string_view, std::shared_ptr<Solver> solver) const override {
    auto timed = std::make_shared<TimedSolver>(std::move(solver));
    if (!solved_) return timed;
    return std::make_shared<RecordingSolver>(std::move(timed), step_, solved_);
  }

 private:
  RecordingSolver::Callback solved_;
  std::function<std::int64_t()> step_;
};

}  // namespace

RecordingSolver::RecordingSolver(std::shared_ptr<Solver> solver, std::function<std::int64_t()> step, Callback callback)
    : SolverDecorator(std::move(solver)), step_(std::move(step)), callback_(std::move(callback)) {}

void RecordingSolver::setup(const Ocp& ocp) {
  SolverDecorator::setup(ocp);
  problem_ = callback_ ? dynamic_cast<const HorizonProblem*>(&ocp) : nullptr;
  guess_ = Iterate(ocp.capacity());
  is_pending_ = false;
}

/// False if there is nothing to report: the solver refuses an iterate of another capacity, which could not be copied
/// without allocation.
bool RecordingSolver::keep_guess(const Iterate& guess) noexcept {
  is_pending_ = false;
  if (!problem_ || guess.capacity() != guess_.capacity()) return false;
  guess_ = guess;
  asked_at_ = step_();
  return true;
}

Report RecordingSolver::solve(Iterate& iterate, Clock::time_point deadline) noexcept {
  const bool is_told = keep_guess(iterate);
  const Report report = inner().solve(iterate, deadline);
  if (is_told) callback_(asked_at_, *problem_, guess_, iterate, report);
  return report;
}

Report RecordingSolver::feedback(Iterate& iterate, Clock::time_point deadline) noexcept {
  const bool is_told = keep_guess(iterate);
  const Report report = inner().feedback(iterate, deadline);
  // Without a usable iterate, the caller does not call `finish`.
  is_pending_ = is_told && is_usable(report.status);
  if (is_told && !is_pending_) callback_(asked_at_, *problem_, guess_, iterate, report);
  return report;
}

void RecordingSolver::finish(Iterate& iterate, Report& report) noexcept {
  inner().finish(iterate, report);
  if (std::exchange(is_pending_, false)) callback_(asked_at_, *problem_, guess_, iterate, report);
}

Robot with_hooks(Robot robot, const LoopHooks& hooks, std::function<std::int64_t()> step) {
  robot.add_hooks(std::make_shared<SolverHooks>(hooks.solved, std::move(step)));
  if (hooks.robot) robot.add_hooks(hooks.robot);
  return robot;
}

}  // namespace rhec::sim
