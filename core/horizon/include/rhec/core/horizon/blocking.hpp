#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// A view on consecutive intervals, counted 0, 1, 2, ... from the start of the run.
struct Window {
  std::int64_t first = 0;  ///< absolute index of the window's first interval
  int intervals = 0;       ///< number of intervals N
  /// The step k at which the window is looked at: the index of its last node.
  std::int64_t step() const noexcept { return first + intervals; }
};

/// How a parameter moves from one block to the next.
enum class Transition {
  step,  ///< it jumps at the block's start
  ramp   ///< it runs linearly to its new value over the interval that starts the block
};

/// Says, for one parameter or input and one window, which consecutive intervals share one value (docs/method.md,
/// section 4; Wallace et al.). Const, thread-safe, allocation-free.
class RHEC_EXPORT Blocking {
 public:
  virtual ~Blocking() = default;

  /// Marks the window's interval i with begins[i] = 1 where a block starts, 0 elsewhere. `begins` has
  /// `window.intervals` entries; begins[0] is 1 always. Returns the absolute index at which the first block really
  /// started: at most `window.first`, and less where the window's edge cuts that block.
  virtual std::int64_t starts(const Window& window, std::uint8_t* begins) const noexcept = 0;

  /// Why a horizon of so many intervals cannot be blocked this way; empty if it can.
  virtual std::string why_not(int intervals) const {
    return intervals >= 1 ? std::string() : "a horizon has at least one interval";
  }

  /// True where every window is one block: then nothing needs to be set aside for blocks that start within one.
  virtual bool is_one_block() const noexcept { return false; }

  virtual Transition transition() const noexcept { return Transition::step; }

  /// Standard deviation per square root of a step of the random walk that links a block to the one before it; none: the
  /// blocks are not linked.
  virtual std::optional<double> neighbour_sigma() const noexcept { return std::nullopt; }
};

}  // namespace rhec
