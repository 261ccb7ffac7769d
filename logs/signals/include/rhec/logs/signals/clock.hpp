#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {

/// What one count of a clock is, in nanoseconds; 0: seconds, unless the counts are too large for seconds since 1970.
using ClockUnit = double;
/// From a header such as "time [ms]"; empty for a unit that is not one of time.
RHEC_EXPORT std::optional<ClockUnit> clock_unit(std::string_view unit) noexcept;

/// A time as text, exact to the nanosecond where it is written in decimals; empty for what is no finite time within 292
/// years of the epoch.
RHEC_EXPORT std::optional<Stamp> stamp_of(std::string_view text, ClockUnit unit) noexcept;
/// The same of a number.
RHEC_EXPORT std::optional<Stamp> stamp_of(double count, ClockUnit unit) noexcept;

/// "time [ms]" as "time" and "ms".
struct ClockName {
  std::string name, unit;
};
RHEC_EXPORT ClockName parse_clock_name(std::string_view text);

}  // namespace rhec::logs
