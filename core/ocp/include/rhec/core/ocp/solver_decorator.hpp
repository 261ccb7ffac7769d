#pragma once

#include <memory>
#include <string>
#include <utility>

#include "rhec/core/ocp/solver.hpp"

namespace rhec {

/// A solver that forwards every call to another one. Derive from it to observe or change some of a solver's calls.
class RHEC_EXPORT SolverDecorator : public Solver {
 public:
  explicit SolverDecorator(std::shared_ptr<Solver> inner) : inner_(std::move(inner)) {}

  std::string why_not(const Ocp& ocp) const override { return inner_->why_not(ocp); }
  void setup(const Ocp& ocp) override { inner_->setup(ocp); }
  void prepare(const Iterate& guess) noexcept override { inner_->prepare(guess); }
  using Solver::solve;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override {
    return inner_->solve(iterate, deadline);
  }
  Report feedback(Iterate& iterate, Clock::time_point deadline) noexcept override {
    return inner_->feedback(iterate, deadline);
  }
  void finish(Iterate& iterate, Report& report) noexcept override { inner_->finish(iterate, report); }
  bool covariances(const Iterate& iterate, StageRange nodes, std::span<double> blocks) noexcept override {
    return inner_->covariances(iterate, nodes, blocks);
  }
  void reset() noexcept override { inner_->reset(); }

 protected:
  Solver& inner() noexcept { return *inner_; }

 private:
  std::shared_ptr<Solver> inner_;
};

}  // namespace rhec
