#pragma once

#include <filesystem>
#include <memory>

#include "rhec/logs/cdr/message_log.hpp"

namespace rhec::logs {

/// A log in MCAP: with or without chunks, compressed or not (lz4, zstd), indexed or not. Of a file that was cut, what
/// is before the cut is read; a chunk whose checksum is wrong is passed over.
///
/// Without an index the file is gone through once to learn its topics. Throws Error if it is no MCAP file.
RHEC_EXPORT std::unique_ptr<Log> open_mcap(const std::filesystem::path& file, const MessageLogOptions& options = {});

}  // namespace rhec::logs
