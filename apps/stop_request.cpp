#include "stop_request.hpp"

#include <ctime>

namespace rhec::apps {

std::atomic<bool> StopRequest::asked_ = false;
std::atomic<std::int64_t> StopRequest::asked_at_ = 0;

StopRequest::StopRequest() {
  asked_ = false;
  struct sigaction action {};
  action.sa_handler = [](int number) {
    struct timespec now {};
    clock_gettime(CLOCK_MONOTONIC, &now);
    if (!asked_) {
      asked_at_ = now.tv_sec;
      asked_ = true;
    } else if (now.tv_sec - asked_at_ > 1) {
      std::signal(number, SIG_DFL);
      std::raise(number);
    }
  };
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, &interrupt_);
  sigaction(SIGTERM, &action, &terminate_);
}

StopRequest::~StopRequest() {
  sigaction(SIGINT, &interrupt_, nullptr);
  sigaction(SIGTERM, &terminate_, nullptr);
}

}  // namespace rhec::apps
