#pragma once

#include <filesystem>
#include <memory>

#include "rhec/logs/cdr/message_log.hpp"

namespace rhec::logs {

/// Whether files of a bag (.mcap, .db3, compressed or not) lie in a folder.
RHEC_EXPORT bool has_bag_files(const std::filesystem::path& folder);

/// A file of rosbag2's SQLite storage (.db3). Messages that are compressed one by one are decompressed. Throws Error if
/// it is no such file.
RHEC_EXPORT std::unique_ptr<Log> open_db3(const std::filesystem::path& file, const MessageLogOptions& options = {});

/// A folder with metadata.yaml: its files, in their order, .db3 or .mcap; without metadata.yaml, which a recorder that
/// was killed has not written, the files of the one bag that is there. Files that are compressed as a whole (.zstd) are
/// decompressed into the folder of temporary files; one that is damaged gives what is before. Throws Error for a file
/// that would take more than a thousand times its size, or more than nine tenths of the room that there is.
RHEC_EXPORT std::unique_ptr<Log> open_bag_folder(const std::filesystem::path& folder,
                                                 const MessageLogOptions& options = {});

/// A single file that is compressed as a whole: bag_0.db3.zstd, bag_0.mcap.zstd.
RHEC_EXPORT std::unique_ptr<Log> open_compressed(const std::filesystem::path& file,
                                                 const MessageLogOptions& options = {});

}  // namespace rhec::logs
