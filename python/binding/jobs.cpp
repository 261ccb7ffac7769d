#include "jobs.hpp"

#include <pybind11/stl.h>

#include <chrono>
#include <condition_variable>
#include <exception>
#include <optional>
#include <thread>
#include <utility>

namespace rhec::python {
namespace {

namespace py = pybind11;

constexpr std::chrono::milliseconds patience{50};

/// The thread that works, and how it ended.
class Worker {
 public:
  Worker(Job& job, const std::function<void(Job&)>& work)
      : thread_([this, &job, &work] {
          try {
            work(job);
          } catch (const Job::GivenUp&) {  // who stopped it knows why
          } catch (...) {
            failure_ = std::current_exception();
          }
          const std::lock_guard lock(mutex_);
          is_done_ = true;
          done_.notify_all();
        }) {}
  ~Worker() { thread_.join(); }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  bool wait_for(std::chrono::milliseconds time) {
    std::unique_lock lock(mutex_);
    return done_.wait_for(lock, time, [this] { return is_done_; });
  }
  void wait() {
    std::unique_lock lock(mutex_);
    done_.wait(lock, [this] { return is_done_; });
  }
  const std::exception_ptr& failure() const noexcept { return failure_; }

 private:
  std::mutex mutex_;
  std::condition_variable done_;
  bool is_done_ = false;
  std::exception_ptr failure_;
  std::thread thread_;
};

/// With the interpreter held: throws what a signal or the progress raises.
void look(const py::object& progress, Job& job) {
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  warn_of(job.take_notes());
  if (progress.is_none()) return;
  const auto [share, text] = job.state();
  progress(share, text);
}

}  // namespace

void Job::show(double share, const std::string& text) {
  if (stopped_) throw GivenUp{};
  const std::lock_guard lock(mutex_);
  share_ = share;
  text_ = text;
}

void Job::tell(const std::vector<std::string>& notes) {
  const std::lock_guard lock(mutex_);
  notes_.insert(notes_.end(), notes.begin(), notes.end());
}

std::vector<std::string> Job::take_notes() {
  const std::lock_guard lock(mutex_);
  return std::exchange(notes_, {});
}

std::pair<double, std::string> Job::state() const {
  const std::lock_guard lock(mutex_);
  return {share_, text_};
}

void warn_of(const std::vector<std::string>& notes) {
  if (!notes.empty()) py::module_::import("rhec._errors").attr("warn_of")(notes);
}

void do_watched(const py::object& progress, const std::function<void(Job&)>& work) {
  Job job;
  Worker worker(job, work);
  const auto wait = [&worker](bool to_the_end) {
    const py::gil_scoped_release others_go_on;
    if (!to_the_end) return worker.wait_for(patience);
    worker.wait();
    return true;
  };
  try {
    while (!wait(false)) look(progress, job);
    look(progress, job);
  } catch (py::error_already_set&) {
    job.stop();
    wait(true);
    throw;
  }
  if (worker.failure()) std::rethrow_exception(worker.failure());
}

}  // namespace rhec::python
