#pragma once

#include <optional>
#include <string_view>

#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {

/// A date and a time of day, as people and loggers write them, since 1970: "2024-05-01T12:34:56.789Z", with a blank or
/// an underscore in the place of the T, "2024/05/01", "01.05.2024", an offset such as "+02:00"; without one it is UTC.
/// A time of day alone counts from midnight. Fractions have a point or a comma. Empty for anything else.
RHEC_EXPORT std::optional<Stamp> calendar_stamp(std::string_view text) noexcept;

}  // namespace rhec::logs
