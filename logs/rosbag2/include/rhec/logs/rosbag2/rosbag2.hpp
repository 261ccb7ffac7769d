#pragma once

#include <filesystem>
#include <memory>

#include "rhec/logs/cdr/message_log.hpp"

namespace rhec::logs {

/// A file of rosbag2's SQLite storage (.db3). Messages that are compressed one by one are decompressed. Throws Error if
/// it is no such file.
RHEC_EXPORT std::unique_ptr<Log> open_db3(const std::filesystem::path& file, const MessageLogOptions& options = {});

/// A folder with metadata.yaml: its files, in their order, .db3 or .mcap. Files that are compressed as a whole (.zstd)
/// are decompressed beside the folder of temporary files, one at a time.
RHEC_EXPORT std::unique_ptr<Log> open_bag_folder(const std::filesystem::path& folder,
                                                 const MessageLogOptions& options = {});

/// A single file that is compressed as a whole: bag_0.db3.zstd, bag_0.mcap.zstd.
RHEC_EXPORT std::unique_ptr<Log> open_compressed(const std::filesystem::path& file,
                                                 const MessageLogOptions& options = {});

}  // namespace rhec::logs
