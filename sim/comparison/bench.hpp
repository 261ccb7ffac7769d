#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/sim/comparison/comparison.hpp"

namespace rhec::sim {

/// A problem from the reference's run, with its solver's initial guess and solution.
struct Recorded {
  SameProblems::Place place;
  std::unique_ptr<const HorizonProblem> problem;
  Iterate guess, reference;
  bool reference_is_usable = false;
};

/// Solves problems of one kind in order, with one solver instance per seed.
class Bench {
 public:
  Bench(const Host& host, const Backend& backend, Settings options);

  /// Empty: the solver accepts the problem and is set up for it.
  std::string why_not(const Recorded& record);
  /// Writes the solution to `point`.
  Answer solve(const Recorded& record, Iterate& point);

 private:
  void make() { solver_ = host_->make_solver(backend_->solver, options_); }

  const Host* host_;
  const Backend* backend_;
  Settings options_;
  std::shared_ptr<Solver> solver_;
  std::unique_ptr<HorizonProblem> problem_;  ///< the problem that the solver is set up for
  bool ready_ = false;
  std::int64_t seed_ = 0;
};

}  // namespace rhec::sim
