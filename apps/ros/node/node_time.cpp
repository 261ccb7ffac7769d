#include "node_time.hpp"

#include <algorithm>
#include <chrono>

namespace rhec::apps::ros {

logs::Stamp NodeTime::now() const {
  if (is_simulated_) return simulated_;
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

Clock::time_point NodeTime::instant() const {
  if (!is_simulated_) return Clock::now();
  return Clock::time_point(std::chrono::duration_cast<Clock::duration>(std::chrono::nanoseconds(simulated_)));
}

std::optional<double> NodeTime::take(logs::Stamp clock, Clock::time_point received) {
  last_heard_ = received;
  const double back = heard_ ? logs::seconds_between(clock, simulated_) : 0.0;
  const bool has_jumped = back > least_jump;
  simulated_ = has_jumped || !heard_ ? clock : std::max(simulated_, clock);
  heard_ = true;
  return has_jumped ? std::optional(back) : std::nullopt;
}

double NodeTime::silence(Clock::time_point computer) const {
  if (!is_simulated_ || !heard_) return 0.0;
  return std::max(0.0, std::chrono::duration<double>(computer - last_heard_).count());
}

}  // namespace rhec::apps::ros
