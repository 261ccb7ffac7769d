#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

namespace rhec {

/// Hands out consecutive arrays from memory that the caller provides. The first one is aligned to 64 bytes, so that
/// rows of multiples of eight stay aligned. The memory must hold seven doubles more than the arrays in total.
class Scratch {
 public:
  explicit Scratch(double* memory) : next_(memory) {
    const auto beyond = reinterpret_cast<std::uintptr_t>(memory) % 64;
    if (beyond != 0) next_ += (64 - beyond) / sizeof(double);
  }
  double* take(std::ptrdiff_t size) { return std::exchange(next_, next_ + size); }
  /// The memory not taken yet.
  double* rest() const { return next_; }

 private:
  double* next_;
};

}  // namespace rhec
