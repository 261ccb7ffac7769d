#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "radau_plan.hpp"
#include "rhec/core/formula/tape.hpp"
#include "rhec/core/model/model.hpp"
#include "staged_steps.hpp"

namespace rhec {

/// Steps of Radau IIA of a formula and their derivatives, for eight intervals at a time: RadauPlan says what is
/// computed. An interval's result does not depend on those beside it: each is iterated until its own Newton step is
/// small, and then stays as it is. Where that does not happen, all of its results are NaN. Memory does not grow with
/// the number of steps: backwards through several of them, the states are computed anew for each.
class RadauSteps {
 public:
  static constexpr int lanes = 8;
  /// Newton's method converges quadratically: once a step is so small, in typical magnitudes of the states, what is
  /// left is rounding.
  static constexpr double newton_tolerance = 1e-10;
  static constexpr int most_iterations = 40;

  /// `scales`: typical magnitudes of the states.
  RadauSteps(std::shared_ptr<const RatesTapes> tapes, int nx, int np, int nu, bool ramp, std::vector<double> scales);
  /// Number of doubles, aligned to 64 bytes, that both calls need.
  std::size_t memory() const noexcept { return memory_; }
  void integrate(const Model::Intervals& request, const TapeKernels& kernels, double* memory) const noexcept;
  void integrate_rows(const IntervalRows& request, const TapeKernels& kernels, double* memory) const noexcept;

  /// Operations that one step takes for eight intervals, with as many Newton iterations as a smooth motion needs.
  long operations(bool with_jacobian, bool with_hessian) const;

 private:
  class Run;
  /// Where results of single steps, or of several, are written.
  struct Chain {
    Chain(const RatesStructure& of, bool ramp, bool single);
    RadauPlan plan;
    StoredRows next, jacobian, hessian;
  };
  const Chain& chain(int substeps) const noexcept { return substeps == 1 ? single_ : several_; }

  std::shared_ptr<const RatesTapes> tapes_;
  Chain single_, several_;
  std::vector<double> scales_;       ///< by unknown
  std::vector<int> slopes_, bends_;  ///< which results of the tapes are not always zero
  std::size_t memory_ = 0;
};

}  // namespace rhec
