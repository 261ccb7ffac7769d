#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// A folder of results that appear all at once: files are written aside, on the same disk, and put into place by
/// `commit`. Until then, and for ever if something fails before, what the folder held stays as it was. Files of other
/// names that it holds stay in any case. Without `commit` the destructor removes what was written.
class RHEC_EXPORT OutputFolder {
 public:
  /// Creates the place aside, and the folders above. Throws Error if that cannot be done, or if the path is a file.
  explicit OutputFolder(const std::filesystem::path& folder);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// Where results will be.
  const std::filesystem::path& path() const noexcept { return folder_; }
  /// Where to write the file that will be called `name`, for writers of their own; a plain name, without folders.
  std::filesystem::path file(std::string_view name);
  /// Writes a whole file. Throws Error if it cannot be written, e.g. because the disk is full.
  void write(std::string_view name, std::string_view content);

  /// Puts every file into place; each is replaced in one step. Throws Error, before anything is replaced, if a file
  /// is missing aside or a folder is in its way. Nothing more can be written after it.
  void commit();

 private:
  std::filesystem::path folder_, aside_;
  std::vector<std::filesystem::path> names_;
  bool committed_ = false;
};

}  // namespace rhec::sim
