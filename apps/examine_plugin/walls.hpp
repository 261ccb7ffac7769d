#pragma once

#include <chrono>
#include <cstddef>

namespace rhec::apps {

/// The descriptor that the report of an examination goes to.
inline constexpr int report_descriptor = 3;

/// Limits what a plugin can do to this process and its user while it is examined: memory, processor time, size of
/// files; other processes can neither be started nor signalled. An attempt is told in the report, and ends this
/// process.
void build_walls(std::chrono::seconds time, std::size_t memory);

}  // namespace rhec::apps
