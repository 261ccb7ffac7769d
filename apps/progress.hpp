#pragma once

#include <unistd.h>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>

namespace rhec::apps {

/// A progress bar on a terminal; prints nothing elsewhere.
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

/// What is done at present, in words: one line, redrawn, on a terminal; prints nothing elsewhere.
class StageLine {
 public:
  explicit StageLine(std::string title) : title_(std::move(title)), terminal_(isatty(STDERR_FILENO) != 0) {}
  ~StageLine() {
    if (shown_) fmt::print(stderr, "\r\033[K");
  }
  StageLine(const StageLine&) = delete;
  StageLine& operator=(const StageLine&) = delete;

  void show(const std::string& text) {
    const auto now = std::chrono::steady_clock::now();
    if (!terminal_ || now < next_) return;
    next_ = now + std::chrono::milliseconds(200);
    fmt::print(stderr, "\r{}: {}\033[K", title_, text);
    std::fflush(stderr);
    shown_ = true;
  }

 private:
  std::string title_;
  bool terminal_;
  std::chrono::steady_clock::time_point next_{};
  bool shown_ = false;
};

/// Progress, rate and remaining time of many runs: one line, redrawn, on a terminal; one line per minute elsewhere.
class RateLine {
 public:
  struct State {
    std::int64_t total = 0, there = 0, made = 0;  ///< `there` before the start, `made` since
    double seconds = 0.0;                         ///< since the start
    bool ends = false;                            ///< stopping: only runs under way are finished
  };

  explicit RateLine(std::string title) : title_(std::move(title)), terminal_(isatty(STDERR_FILENO) != 0) {}
  ~RateLine() { finish(); }
  RateLine(const RateLine&) = delete;
  RateLine& operator=(const RateLine&) = delete;

  void show(const State& state) {
    const auto now = Clock::now();
    if (now < next_) return;
    next_ = now + (terminal_ ? std::chrono::milliseconds(200) : std::chrono::milliseconds(60000));
    const double share =
        state.total > 0 ? static_cast<double>(state.there + state.made) / static_cast<double>(state.total) : 1.0;
    const double rate = state.seconds > 0.0 ? static_cast<double>(state.made) / state.seconds : 0.0;
    const std::int64_t left = std::max<std::int64_t>(0, state.total - state.there - state.made);
    const std::string text = fmt::format("{}: {:.1f} %, {} of {} runs, {:.1f} a second, {}", title_, 100.0 * share,
                                         state.there + state.made, state.total, rate,
                                         state.ends    ? "the last ones are finished (again: ends at once)"
                                         : rate == 0.0 ? "time left unknown"
                                                       : duration(static_cast<double>(left) / rate) + " left");
    fmt::print(stderr, "{}{}{}", terminal_ ? "\r" : "", text, terminal_ ? "\033[K" : "\n");
    std::fflush(stderr);
    shown_ = true;
  }
  void finish() {
    if (shown_ && terminal_) fmt::print(stderr, "\r\033[K");
    shown_ = false;
  }

 private:
  using Clock = std::chrono::steady_clock;

  static std::string duration(double seconds) {
    if (seconds < 60.0) return fmt::format("{:.0f} s", seconds);
    if (seconds < 3600.0) return fmt::format("{:.0f} min", seconds / 60.0);
    return fmt::format("{:.1f} h", seconds / 3600.0);
  }

  std::string title_;
  bool terminal_;
  Clock::time_point next_ = Clock::now() + (terminal_ ? std::chrono::seconds(0) : std::chrono::seconds(60));
  bool shown_ = false;
};

}  // namespace rhec::apps
