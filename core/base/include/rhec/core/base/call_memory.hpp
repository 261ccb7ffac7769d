#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>

#include "rhec/core/base/reserve.hpp"

namespace rhec {

/// Memory of a model for calls that bring none: on the stack, or, where a call needs more than that should give, in
/// reserve.
class CallMemory {
 public:
  /// `row`: doubles that a call needs for a row at least. Allocates.
  explicit CallMemory(std::size_t row)
      : rows_(static_cast<int>(std::max<std::size_t>(1, on_stack / std::max<std::size_t>(row, 1)))),
        reserve_(row > on_stack ? std::make_unique<Reserve>(row) : nullptr) {}
  /// For how many there is room.
  int rows() const noexcept { return rows_; }
  /// Calls `use` with it.
  template <class Use>
  void lend(const Use& use) const noexcept {
    if (reserve_) return reserve_->lend(use);
    std::array<double, on_stack> memory;
    use(memory.data());
  }

 private:
  static constexpr std::size_t on_stack = 4096;

  int rows_;
  std::unique_ptr<Reserve> reserve_;
};

}  // namespace rhec
