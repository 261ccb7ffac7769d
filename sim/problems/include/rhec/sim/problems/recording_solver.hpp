#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/core/ocp/solver_decorator.hpp"
#include "rhec/plugins/robot/robot.hpp"

namespace rhec::sim {

/// A solver that shows what it is asked and what it answers.
class RHEC_EXPORT RecordingSolver final : public SolverDecorator {
 public:
  /// Called after each solve of a HorizonProblem, in the caller's thread, once its report is complete: of a `feedback`
  /// whose iterate is usable that is after `finish`. `step` is what the function `step` said when the solve began,
  /// `guess` is the iterate as it came in, `result` as it went out. It must not throw, since `solve` does not.
  using Callback = std::function<void(std::int64_t step, const HorizonProblem& problem, const Iterate& guess,
                                      const Iterate& result, const Report& report)>;
  RecordingSolver(std::shared_ptr<Solver> solver, std::function<std::int64_t()> step, Callback callback);

  void setup(const Ocp& ocp) override;
  using Solver::solve;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override;
  Report feedback(Iterate& iterate, Clock::time_point deadline) noexcept override;
  void finish(Iterate& iterate, Report& report) noexcept override;

 private:
  bool keep_guess(const Iterate& guess) noexcept;

  std::function<std::int64_t()> step_;
  Callback callback_;
  const HorizonProblem* problem_ = nullptr;  ///< null where the problem is of another class, which nobody is told of
  Iterate guess_;
  std::int64_t asked_at_ = 0;  ///< step of the solve under way
  bool is_pending_ = false;    ///< a `feedback` is not finished
};

/// What a closed loop does in a sample, and its end.
enum class LoopPart {
  simulate,          ///< the vehicle moves, its sensors measure
  estimate,          ///< once the measurement is known
  control,           ///< once the estimate is known
  log_sample,        ///< what is kept of the sample
  prepare_control,   ///< for the next sample
  prepare_estimate,  ///< for the next sample
  end,               ///< of the loop
};

/// A sample of a loop once its estimate and its command are known, with those who found them.
struct LoopSample {
  std::int64_t step = 0;                         ///< absolute index of the newest node
  double time = 0.0;                             ///< [s]
  const Estimator* estimator = nullptr;          ///< never null
  const Estimate* estimate = nullptr;            ///< never null
  const Controller* controller = nullptr;        ///< null in the replay of a log
  const Controller::Command* command = nullptr;  ///< the same
};

/// What a caller can hang into a loop (a closed one, or the replay of a log).
struct LoopHooks {
  /// Told the share of the way that is done.
  std::function<void(double share)> progress = {};
  /// Told of each solve, as RecordingSolver::Callback is. `step` is the absolute index of the node that is the newest
  /// of an estimator's window and the first of a controller's; one step may solve several times.
  std::function<void(std::int64_t step, const HorizonProblem& problem, const Iterate& guess, const Iterate& result,
                     const Report& report)>
      solved = {};
  /// Told which part of a sample begins, in a closed loop: for who takes the time.
  std::function<void(LoopPart part)> begins = {};
  /// Told of each sample, before the next one is prepared: for who looks into windows and plans.
  std::function<void(const LoopSample& sample)> sampled = {};
};

/// A copy of a robot whose solvers' times are taken, and that tell `hooks.solved`, where somebody wants to be told;
/// `step` is asked at each solve. What the hooks and `step` refer to must outlive the estimators and controllers made
/// of it.
RHEC_EXPORT Robot with_hooks(Robot robot, const LoopHooks& hooks, std::function<std::int64_t()> step);

}  // namespace rhec::sim
