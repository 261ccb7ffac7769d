#pragma once

#include <string_view>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"

namespace rhec {

/// A length along the timeline as a configuration gives it, in intervals: an integer as it is, and a time such as "3 s"
/// as many intervals of `step` [s] as cover it. Anything else stays as it is, for its reader to refuse; but throws
/// Error for a number with another unit, or a time that is negative or too long.
RHEC_EXPORT Settings span_in_intervals(const Settings& length, double step);

/// A copy of a map in which the value of a key, if there is one, is in intervals.
RHEC_EXPORT Settings with_span_in_intervals(const Settings& map, std::string_view key, double step);

/// A copy of a tree in which all values are, whatever their keys.
RHEC_EXPORT Settings all_spans_in_intervals(const Settings& tree, double step);

}  // namespace rhec
