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

/// A solver decorator that reports each problem and its solution to a callback.
class RHEC_EXPORT RecordingSolver final : public SolverDecorator {
 public:
  /// Called after each solve of a HorizonProblem, in the caller's thread, once its report is complete: after `finish`
  /// for a `feedback` with a usable iterate. `step` is the value of the function `step` when the solve began, `guess`
  /// the iterate on entry, `result` the iterate on return. It must not throw, since `solve` does not.
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
  const HorizonProblem* problem_ = nullptr;  ///< null for problems of other classes, which are not reported
  Iterate guess_;
  std::int64_t asked_at_ = 0;  ///< step of the solve under way
  bool is_pending_ = false;    ///< a `feedback` awaits `finish`
};

/// The parts of a closed-loop sample, and the loop's end.
enum class LoopPart {
  simulate,          ///< simulate vehicle and sensors
  estimate,          ///< estimate once the measurement is known
  control,           ///< control once the estimate is known
  log_sample,        ///< log the sample
  prepare_control,   ///< for the next sample
  prepare_estimate,  ///< for the next sample
  end,               ///< end of the loop
};

/// A sample of a loop once its estimate and command are known, with the estimator and controller.
struct LoopSample {
  std::int64_t step = 0;                         ///< absolute index of the newest node
  double time = 0.0;                             ///< [s]
  const Estimator* estimator = nullptr;          ///< never null
  const Estimate* estimate = nullptr;            ///< never null
  const Controller* controller = nullptr;        ///< null in the replay of a log
  const Controller::Command* command = nullptr;  ///< null in the replay of a log
};

/// Callbacks for a loop (closed loop or log replay).
struct LoopHooks {
  /// Called with the completed fraction of the path or log.
  std::function<void(double share)> progress = {};
  /// Called after each solve, like RecordingSolver::Callback. `step` is the absolute index of the newest node of an
  /// estimator's window or the first node of a controller's; one step may solve several times.
  std::function<void(std::int64_t step, const HorizonProblem& problem, const Iterate& guess, const Iterate& result,
                     const Report& report)>
      solved = {};
  /// Called when a part of a closed-loop sample begins, e.g. for timing.
  std::function<void(LoopPart part)> begins = {};
  /// Called for each sample before the next one is prepared, e.g. to inspect windows and plans.
  std::function<void(const LoopSample& sample)> sampled = {};
  /// Called when a measurement of a closed loop arrives [s], with the stamp that it bears [s] and its outputs (n_y, NaN
  /// where missing); and when inputs (n_u) as measured become known, with the time from which they were applied.
  std::function<void(double arrival, double stamp, const double* outputs)> measured = {};
  std::function<void(double stamp, const double* inputs)> moved = {};
  /// Added to the robot's own, e.g. to let other estimators see what the loop's estimator sees.
  std::shared_ptr<const RobotHooks> robot = {};
};

/// A copy of a robot whose solvers are timed and call `hooks.solved` if it is set; `step` is called at each solve.
/// Anything that the hooks and `step` refer to must outlive the estimators and controllers made from the copy.
RHEC_EXPORT Robot with_hooks(Robot robot, const LoopHooks& hooks, std::function<std::int64_t()> step);

}  // namespace rhec::sim
