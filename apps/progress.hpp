#pragma once

#include <unistd.h>

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

namespace rhec::apps {

/// A bar on a terminal; nothing where the output is read by a program.
class ProgressBar {
 public:
  explicit ProgressBar(std::string title) : title_(std::move(title)), terminal_(isatty(STDERR_FILENO) != 0) {}
  ~ProgressBar() { finish(); }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void show(double share) {
    const int percent = static_cast<int>(100.0 * share);
    if (!terminal_ || percent == shown_) return;
    shown_ = percent;
    const int filled = percent * width / 100;
    fmt::print(stderr, "\r{} [{:#<{}}{:.<{}}] {:3d} %", title_, "", filled, "", width - filled, percent);
    std::fflush(stderr);
  }
  void finish() {
    if (shown_ >= 0) fmt::print(stderr, "\r\033[K");
    shown_ = -1;
  }

 private:
  static constexpr int width = 40;
  std::string title_;
  bool terminal_;
  int shown_ = -1;
};

}  // namespace rhec::apps
