#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"

namespace rhec::sim {

/// Identifies a run: the first 128 bits of the SHA-256 hash of its whole configuration.
struct RunIdentity {
  std::uint64_t high = 0, low = 0;
  bool operator==(const RunIdentity&) const = default;
  bool operator<(const RunIdentity& other) const noexcept {
    return high != other.high ? high < other.high : low < other.low;
  }
  RHEC_EXPORT std::string text() const;  ///< 32 hexadecimal digits
};
RHEC_EXPORT RunIdentity identity_of(std::string_view configuration);

/// Settings as canonical JSON in one line: keys are sorted, a number is written as the shortest text that parses to the
/// same double (8, 8.0 and 0.8e1 alike), infinity as ".inf".
RHEC_EXPORT std::string canonical_text(const Settings& settings);

}  // namespace rhec::sim
