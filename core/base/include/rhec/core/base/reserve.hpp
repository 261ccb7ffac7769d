#pragma once

#include <cstddef>
#include <mutex>

#include "rhec/core/base/aligned.hpp"

namespace rhec {

/// Memory of a model from its set-up on, for calls that bring none and need more than a stack should give: such calls
/// wait for each other.
class Reserve {
 public:
  /// Allocates.
  explicit Reserve(std::size_t doubles) : memory_(doubles) {}
  std::size_t size() const noexcept { return memory_.size(); }
  /// Calls `use` with all of it, while nobody else has it.
  template <class Use>
  void lend(Use use) {
    const std::lock_guard lock(in_use_);
    use(memory_.data());
  }

 private:
  std::mutex in_use_;
  AlignedDoubles memory_;
};

}  // namespace rhec
