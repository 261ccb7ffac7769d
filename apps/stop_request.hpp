#pragma once

#include <atomic>
#include <csignal>
#include <cstdint>

namespace rhec::apps {

/// While an object of this class exists, the first SIGINT or SIGTERM requests a stop; one that comes a second or two
/// later ends the program as usual. An immediate repetition is ignored, since some programs (e.g. timeout) send the
/// signal twice.
class StopRequest {
 public:
  StopRequest();
  ~StopRequest();
  StopRequest(const StopRequest&) = delete;
  StopRequest& operator=(const StopRequest&) = delete;

  static bool asked() { return asked_; }

 private:
  static std::atomic<bool> asked_;             // lock-free, as a signal handler requires
  static std::atomic<std::int64_t> asked_at_;  // [s]
  static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<std::int64_t>::is_always_lock_free);
  struct sigaction interrupt_ {};
  struct sigaction terminate_ {};
};

}  // namespace rhec::apps
