#pragma once

#include <cstdint>
#include <optional>

#include "rhec/core/base/clock.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::apps::ros {

/// The time that a node lives in: that of the computer, or that of /clock, which may stand still, run at another rate,
/// and jump back when a simulator or a recording begins anew.
class NodeTime {
 public:
  explicit NodeTime(bool is_simulated) : is_simulated_(is_simulated) {}

  bool is_simulated() const noexcept { return is_simulated_; }
  /// False before the first message of /clock.
  bool is_known() const noexcept { return !is_simulated_ || heard_; }
  /// As stamps of messages have it; 0 while it is not known.
  logs::Stamp now() const;
  /// The same for intervals: the clock that never jumps, or the time of /clock.
  Clock::time_point instant() const;
  /// When something came that the computer received at a time.
  Clock::time_point instant_of(Clock::time_point received) const { return is_simulated_ ? instant() : received; }

  /// Takes a message of /clock. Returns how far the time has jumped back [s], if it has; then it goes on from there. A
  /// message that is a little behind (`least_jump`), as of two publishers or out of order, changes nothing.
  std::optional<double> take(logs::Stamp clock, Clock::time_point received);
  static constexpr double least_jump = 0.5;  ///< [s]

  /// How long nothing has come on /clock, on the computer's clock [s]; 0 for a time that is the computer's.
  double silence(Clock::time_point computer) const;

 private:
  bool is_simulated_;
  bool heard_ = false;
  logs::Stamp simulated_ = 0;
  Clock::time_point last_heard_;
};

}  // namespace rhec::apps::ros
