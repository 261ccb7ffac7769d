#pragma once

#include <pybind11/pybind11.h>

#include <mutex>

namespace rhec::python {

/// Holds an object's mutex. Who waits for it lets other Python threads go on: the one that holds it may need the
/// interpreter to let go of it.
class Lock {
 public:
  explicit Lock(std::mutex& mutex) : mutex_(mutex) {
    if (mutex_.try_lock()) return;
    const pybind11::gil_scoped_release others_go_on;
    mutex_.lock();
  }
  ~Lock() { mutex_.unlock(); }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

 private:
  std::mutex& mutex_;
};

}  // namespace rhec::python
