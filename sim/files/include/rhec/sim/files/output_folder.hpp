#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// A results folder whose files appear all at once: files go to a temporary folder on the same disk, and `commit` moves
/// them into place. Until then, the folder's previous content is unchanged. Files with other names are never touched.
/// Without `commit`, the destructor removes what was written.
class RHEC_EXPORT OutputFolder {
 public:
  /// Creates the temporary folder and all parent folders. Throws Error if that fails or if the path is a file.
  explicit OutputFolder(const std::filesystem::path& folder);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// The final location of the results.
  const std::filesystem::path& path() const noexcept { return folder_; }
  /// Temporary path of the file `name`, for callers that write it themselves; `name` has no folders.
  std::filesystem::path file(std::string_view name);
  /// Writes a whole file. Throws Error if it cannot be written, e.g. because the disk is full.
  void write(std::string_view name, std::string_view content);

  /// Moves every file into place, each in one atomic step. Throws Error, before replacing anything, if a temporary file
  /// is missing or a folder blocks its destination. Nothing can be written afterwards.
  void commit();

 private:
  std::filesystem::path folder_, aside_;
  std::vector<std::filesystem::path> names_;
  bool committed_ = false;
};

}  // namespace rhec::sim
