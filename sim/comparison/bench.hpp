#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/sim/comparison/comparison.hpp"

namespace rhec::sim {

/// A problem of the reference's run, the guess that its solver was given, and its answer.
struct Recorded {
  SameProblems::Place place;
  std::unique_ptr<const HorizonProblem> problem;
  Iterate guess, reference;
  bool reference_is_usable = false;
};

/// Solves problems of a kind in their order, with one instance a seed.
class Bench {
 public:
  Bench(const Host& host, const Backend& backend, Settings options);

  /// Empty: it takes the problem, and is ready for it.
  std::string why_not(const Recorded& record);
  /// Puts the answer into `point`.
  Answer solve(const Recorded& record, Iterate& point);

 private:
  void make() { solver_ = host_->make_solver(backend_->solver, options_); }

  const Host* host_;
  const Backend* backend_;
  Settings options_;
  std::shared_ptr<Solver> solver_;
  std::unique_ptr<HorizonProblem> problem_;  ///< that the solver is set up for
  bool ready_ = false;
  std::int64_t seed_ = 0;
};

}  // namespace rhec::sim
