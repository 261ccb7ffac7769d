#pragma once

#include <pybind11/pybind11.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

namespace rhec::python {

/// How far a long call is, told by the threads that work and read by the one that waits.
class Job {
 public:
  /// Thrown by `show` where the work is to be given up.
  struct GivenUp {};

  /// `text` says what is done at present, where that is not the title of the bar.
  void show(double share, const std::string& text = {});
  /// What one should know of a configuration though it can be used: warnings in Python, soon.
  void tell(const std::vector<std::string>& notes);
  /// Whether to stop: Ctrl-C was pressed, or what shows the progress has failed.
  bool is_stopped() const noexcept { return stopped_; }
  void stop() noexcept { stopped_ = true; }
  std::pair<double, std::string> state() const;
  /// What was told since the last call.
  std::vector<std::string> take_notes();

 private:
  std::atomic<bool> stopped_ = false;
  mutable std::mutex mutex_;
  double share_ = 0.0;
  std::string text_;
  std::vector<std::string> notes_;
};

/// Warns of each of them, as rhec.Note, at the caller's line outside of the package. Throws where that is made an
/// error.
void warn_of(const std::vector<std::string>& notes);

/// Does work in a thread of its own, while this one looks for signals and calls progress(share, text) several times a
/// second; None: nothing. Other Python threads go on. What the work throws is thrown here; where a signal raises
/// KeyboardInterrupt, the work is stopped first, and has left nothing half-written.
void do_watched(const pybind11::object& progress, const std::function<void(Job&)>& work);

}  // namespace rhec::python
