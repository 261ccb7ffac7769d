#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string_view>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"

namespace rhec {

/// What an object takes of memory, by the number of its intervals [bytes].
struct MemoryNeed {
  double by_interval, beside;
  double of(int intervals) const noexcept { return beside + by_interval * intervals; }
};

/// The need of what `make` makes for a number of intervals: found by making it for `few` and for twice as many, where
/// the allocator is asked before and after, until three such measurements in a row agree; other threads may allocate
/// meanwhile. What `make` throws goes through. None where they do not agree, or where the allocator does not tell.
RHEC_EXPORT std::optional<MemoryNeed> measure_memory_need(
    const std::function<std::shared_ptr<const void>(int intervals)>& make, int few);

/// What this process can still allocate [bytes]: the least of what the machine has free, with swap, of what its control
/// groups leave and of its own limits (RLIMIT_AS, RLIMIT_DATA). Infinite where nothing is known.
RHEC_EXPORT double free_memory();

/// What asks for memory: so many intervals, each with room for so many values of a kind.
struct MemoryQuestion {
  int intervals;
  int rooms = 0;                    ///< in each interval
  std::string_view rooms_key = {};  ///< the key that says how many
};

/// Refuses what needs more than is free, before it is made: an error at `place` with what it needs. Where that is
/// surely little, nothing is measured. `make` makes it for fewer intervals, too; Error of too few means more.
RHEC_EXPORT void require_memory(const Settings& place, const MemoryQuestion& question,
                                const std::function<std::shared_ptr<const void>(int intervals)>& make);

}  // namespace rhec
