#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "rhec/core/horizon_problem.hpp"
#include "rhec/core/solver.hpp"
#include "rhec/plugins/robot.hpp"

namespace rhec::sim {

/// A solver that shows what it is asked and what it answers, and else is the one it is made of.
class RHEC_EXPORT RecordingSolver final : public Solver {
 public:
  /// Called after each solve of a HorizonProblem, in the caller's thread. `guess` is the point as it came in, `result`
  /// as it went out. It must not throw, since `solve` does not.
  using Callback = std::function<void(const HorizonProblem& problem, const Iterate& guess, const Iterate& result,
                                      const Report& report)>;
  RecordingSolver(std::shared_ptr<Solver> solver, Callback callback);

  std::string why_not(const Ocp& ocp) const override { return solver_->why_not(ocp); }
  void setup(const Ocp& ocp) override;
  void prepare(const Ocp& ocp, const Iterate& guess) noexcept override { solver_->prepare(ocp, guess); }
  using Solver::solve;
  Report solve(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept override;
  bool covariances(const Ocp& ocp, const Iterate& point, StageRange nodes, std::span<double> blocks) noexcept override {
    return solver_->covariances(ocp, point, nodes, blocks);
  }
  void reset() noexcept override { solver_->reset(); }

 private:
  std::shared_ptr<Solver> solver_;
  Callback callback_;
  Iterate guess_;
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
  const Estimator* estimator = nullptr;          ///< null where the truth takes its place
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
