#pragma once

namespace rhec {

/// How long a row of `size` doubles is in memory: as long as registers of eight are wide.
[[gnu::always_inline]] constexpr int padded(int size) { return (size + 7) / 8 * 8; }

}  // namespace rhec
