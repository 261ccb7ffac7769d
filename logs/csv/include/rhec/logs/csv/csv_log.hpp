#pragma once

#include <filesystem>
#include <memory>

#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {

/// A table of text: a header that names the columns, then a line for each record; separated by commas, semicolons or
/// tabs. A column `time` (or `timestamp`, `stamp`, `t`, `__time`, `%time`) says when a line was measured, one called
/// `received` when it became known; without the latter it was known at once. A request may name another clock. Clocks
/// count seconds, or what the header says in brackets: `time [ms]`; counts since 1970 that are too large for seconds
/// are taken for milli-, micro- or nanoseconds. An empty cell, `nan` or `null` is a missing value. Cells of columns
/// that nobody asks for may hold anything.
///
/// Throws Error if the file cannot be read, or has no header.
RHEC_EXPORT std::unique_ptr<Log> open_csv(const std::filesystem::path& file);

}  // namespace rhec::logs
