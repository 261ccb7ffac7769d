#pragma once

namespace rhec {

/// Length in memory of a row of `size` doubles: rounded up to a multiple of eight, the widest register.
[[gnu::always_inline]] constexpr int padded(int size) { return (size + 7) / 8 * 8; }

}  // namespace rhec
