#pragma once

#include <span>
#include <vector>

#include "rhec/core/base/clock.hpp"
#include "rhec/core/ocp/ocp.hpp"
#include "rhec/core/qp/riccati.hpp"

namespace rhec {

/// A start for problems with a given initial state and unstable dynamics, where the simulation of a guess' controls
/// leads to numbers of any size: the trajectory of a linear-quadratic regulator (Anderson and Moore, Optimal control:
/// linear quadratic methods, 1990, chapter 4) about the states and controls at which the objective of each stage is
/// least, and then about what that led to. Limits and bounds of states are left out, and controls are clipped to
/// theirs. Deterministic. Allocates in `setup` alone.
class RHEC_EXPORT TrackingStart {
 public:
  void setup(const Ocp& ocp);

  /// Replaces `to`, which may be the guess, by a trajectory without defects and multipliers. False, and `to` is left as
  /// it was, where there is none that violates less than half of what the guess does, or violates no more and costs
  /// less than half, slacks included. `scratch` has the Ocp's `scratch_size()`.
  bool find(const Ocp& ocp, const Iterate& guess, Clock::time_point deadline, std::span<double> scratch,
            Iterate& to) noexcept;

 private:
  struct Quality {
    double violation, cost;  ///< of bounds and hard limits; objective and slacks
  };
  Quality quality_of(const Ocp& ocp, const Iterate& iterate, std::span<double> scratch) noexcept;
  void follow(const Ocp& ocp, const Iterate& from, Iterate& to, std::span<double> scratch) noexcept;

  bool is_possible_ = false;
  StageQp qp_;
  Riccati riccati_;
  ActiveSet no_bounds_;
  Iterate from_, to_, step_, best_;
  std::vector<double> limits_;
};

}  // namespace rhec
