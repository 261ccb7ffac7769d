#pragma once

namespace rhec {

/// An output with a scale error that is estimated: y = (1 + k) h(x) + b, where k is a state.
struct ScaledOutput {
  int output = 0, state = 0;  ///< its number, and that of k
  bool operator==(const ScaledOutput&) const = default;
};

}  // namespace rhec
