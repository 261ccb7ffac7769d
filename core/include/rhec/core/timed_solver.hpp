#pragma once

#include <memory>
#include <string>

#include "rhec/core/solver.hpp"

namespace rhec {

/// A solver that takes the time of another one, and else is that one: for who wants the times of a Report. Reading a
/// clock costs a few percent of a real-time step, so that solvers do not do it by themselves.
class RHEC_EXPORT TimedSolver final : public Solver {
 public:
  explicit TimedSolver(std::shared_ptr<Solver> solver) : solver_(std::move(solver)) {}

  std::string why_not(const Ocp& ocp) const override { return solver_->why_not(ocp); }
  void setup(const Ocp& ocp) override;
  void prepare(const Ocp& ocp, const Iterate& guess) noexcept override;
  using Solver::solve;
  Report solve(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept override;
  Report feedback(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept override;
  void finish(const Ocp& ocp, Iterate& point, Report& report) noexcept override;
  bool covariances(const Ocp& ocp, const Iterate& point, StageRange nodes, std::span<double> blocks) noexcept override {
    return solver_->covariances(ocp, point, nodes, blocks);
  }
  void reset() noexcept override;

 private:
  void write_times(Clock::time_point start, Report& report) noexcept;

  std::shared_ptr<Solver> solver_;
  double preparation_us_ = 0.0;  ///< since the last answer
};

}  // namespace rhec
