#pragma once

#include <span>
#include <vector>

#include "rhec/core/base/clock.hpp"
#include "rhec/core/ocp/ocp.hpp"

namespace rhec {

/// Looks for a trajectory that violates less, where a method that looks around one point finds none. The gradient of a
/// violation can vanish where it has no minimum: that of the distance from an obstacle does at its centre, and its part
/// across does on the line through it. So a claim that constraints cannot be met is worth more where moves of some size
/// have failed, too.
///
/// A direct search (Kolda, Lewis and Torczon, Optimization by direct search, SIAM Review 45, 2003) over the controls
/// and a free initial state, one component at a time, in patterns over the whole horizon and about the node that
/// violates most. Deterministic. Allocates in `setup` alone.
class RHEC_EXPORT StartSearch {
 public:
  void setup(const Ocp& ocp);

  /// A solve begins: no other start was tried.
  void begin() noexcept;
  /// Counts one more start; false if there have been three.
  bool take_start() noexcept;
  int starts() const noexcept { return starts_; }

  /// Where limits seem impossible to meet: `find` from the last point, then from the guess, for a point that violates
  /// less than nine tenths of the least of all of them so far. It takes a start. Where this is false, that claim is as
  /// good as it gets.
  bool find_other(const Ocp& ocp, const Iterate& guess, const Iterate& last, Clock::time_point deadline,
                  std::span<double> scratch, Iterate& to) noexcept;

  /// The sum by which hard limits and bounds are violated by the trajectory that an iterate's controls lead to from its
  /// first state; infinite where that is not finite.
  double violation(const Ocp& ocp, const Iterate& of, std::span<double> scratch) noexcept;

  /// Searches from the controls of `around`. Replaces `to`, which may be the same, by a trajectory that violates less
  /// than `least`, without defects and multipliers. False if there is none: `to` is left as it was.
  bool find(const Ocp& ocp, const Iterate& around, double least, Clock::time_point deadline, std::span<double> scratch,
            Iterate& to) noexcept;

 private:
  struct Move;
  double violation_of_trial(const Ocp& ocp, std::span<double> scratch) noexcept;
  void set_scales(const Ocp& ocp) noexcept;
  void move(const Ocp& ocp, const Move& by) noexcept;

  int starts_ = 0;      ///< other ones of this solve
  double least_ = 0.0;  ///< violation of all of them, and of the guess
  Iterate best_, trial_;
  std::vector<double> limits_;
  std::vector<double> control_scales_, state_scales_;  ///< the first step of each component
  int worst_node_ = 0, trial_worst_node_ = 0;          ///< which violates most, of the best and of the last trial
};

}  // namespace rhec
