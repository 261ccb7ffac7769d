#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "chain_rule.hpp"
#include "rhec/core/formula/tape.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// What is evaluated of dx/dt = f(a), a = [x; p; u], for the chain rule.
struct RatesTapes {
  Tape rates;   ///< of a: f (n_x)
  Tape slopes;  ///< of a: f, df/da (n_x x n_a, row by row)
  Tape bends;   ///< of a and mu: sum_r mu_r d2f_r/da2 (n_a x n_a), its lower half; zero above

  RatesStructure structure(int nx, int np, int nu) const;
};

/// Rows of registers of eight lanes, as the kernels write them; `zero` is the one that is always zero.
StoredRows stored_rows(const std::vector<std::uint32_t>& registers, int rows, std::uint32_t zero);

/// Runge-Kutta steps of a formula that is too long for its steps to be written out: the formula and its derivatives are
/// evaluated at each stage, for eight intervals at a time, and ChainRule does the rest. Memory does not grow with the
/// number of steps: backwards through several of them, the states are computed anew for each.
class StagedSteps {
 public:
  static constexpr int lanes = 8;

  StagedSteps(std::shared_ptr<const RatesTapes> tapes, int nx, int np, int nu, bool ramp);
  /// Number of doubles, aligned to 64 bytes, that both calls need.
  std::size_t memory() const noexcept { return memory_; }
  void integrate(const Model::Intervals& request, const TapeKernels& kernels, double* memory) const noexcept;
  void integrate_rows(const IntervalRows& request, const TapeKernels& kernels, double* memory) const noexcept;

  bool is_compiled() const noexcept { return tapes_->rates.is_compiled(); }
  /// Operations that one step takes for eight intervals: of the tapes and of the chain rule.
  long operations(bool with_jacobian, bool with_hessian) const;

 private:
  class Run;
  /// Where results of single steps, or of several, are written.
  struct Chain {
    Chain(const RatesStructure& of, const ChainRulePlaces& at, bool single);
    ChainRule rule;
    StoredRows jacobian, hessian;
  };

  std::shared_ptr<const RatesTapes> tapes_;
  RatesStructure structure_;
  ChainRulePlaces at_;
  Chain single_, several_;
  StoredRows next_;
  std::vector<int> slopes_, bends_;  ///< which results of the tapes are not always zero
  std::size_t memory_ = 0;
};

}  // namespace rhec
