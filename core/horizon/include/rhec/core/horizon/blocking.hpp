#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// Consecutive intervals of a run, counted 0, 1, 2, ... from its start: a horizon.
struct Window {
  std::int64_t first = 0;  ///< absolute index of the horizon's first interval
  int intervals = 0;       ///< number of intervals N
  /// The step k of this horizon: the index of its last node.
  std::int64_t step() const noexcept { return first + intervals; }
};

/// How a parameter moves from one block to the next.
enum class Transition {
  step,  ///< it jumps at the start of the block
  ramp   ///< it runs linearly to its new value over the interval that starts the block
};

/// Determines, for one parameter or input and one horizon, which consecutive intervals share one value (docs/method.md,
/// section 4; Wallace et al.). Const, thread-safe, allocation-free.
class RHEC_EXPORT Blocking {
 public:
  virtual ~Blocking() = default;

  /// Sets begins[i] = 1 if a block starts at interval i of the horizon, otherwise 0. `begins` has `window.intervals`
  /// entries; begins[0] is always 1. Returns the absolute index at which the first block really started: at most
  /// `window.first`, and less if the start of the horizon cuts that block.
  virtual std::int64_t starts(const Window& window, std::uint8_t* begins) const noexcept = 0;

  /// Why a horizon of this many intervals cannot be blocked this way; empty if it can.
  virtual std::string why_not(int intervals) const {
    return intervals >= 1 ? std::string() : "a horizon has at least one interval";
  }

  /// True if every horizon is one block, so that no memory is needed for blocks that start within it.
  virtual bool is_one_block() const noexcept { return false; }

  virtual Transition transition() const noexcept { return Transition::step; }

  /// Standard deviation per square root of a step of the random walk that links a block to the one before it; empty if
  /// the blocks are not linked.
  virtual std::optional<double> neighbour_sigma() const noexcept { return std::nullopt; }
};

}  // namespace rhec
