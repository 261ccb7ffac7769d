#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

namespace rhec {

/// Arrays one after the other, cut out of memory that the caller lends. The first begins where registers and cache
/// lines do, so that whole rows of eight stay aligned; seven doubles more than what is taken are enough.
class Scratch {
 public:
  explicit Scratch(double* memory) : next_(memory) {
    const auto beyond = reinterpret_cast<std::uintptr_t>(memory) % 64;
    if (beyond != 0) next_ += (64 - beyond) / sizeof(double);
  }
  double* take(std::ptrdiff_t size) { return std::exchange(next_, next_ + size); }
  /// What nobody has taken yet.
  double* rest() const { return next_; }

 private:
  double* next_;
};

}  // namespace rhec
