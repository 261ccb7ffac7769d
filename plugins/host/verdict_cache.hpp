#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "file_stamp.hpp"
#include "verdict.hpp"

namespace rhec {

/// Verdicts that are kept in files, one for each plugin. One holds while the plugin's content, the libraries that were
/// loaded with it, and rhec's own library are the same. A file that cannot be read, or is damaged, is as good as none.
class VerdictCache {
 public:
  /// `folder` empty: that of the user, or none; see Examination.
  explicit VerdictCache(const std::filesystem::path& folder);

  /// The verdict of a plugin, if there is one that holds.
  std::optional<Verdict> find(const std::filesystem::path& plugin);
  /// Keeps a verdict of a plugin whose stamp was `examined` before it was examined, unless the file has changed since.
  /// Does nothing where the folder cannot be written to.
  void keep(const Verdict& verdict, const FileStamp& examined) const;

 private:
  bool same(const NeededLibrary& library);
  std::filesystem::path file_of(const std::filesystem::path& plugin) const;
  void write(const Verdict& verdict, const FileStamp& stamp, const std::string& hash) const;

  std::filesystem::path folder_;                                      ///< empty: nothing is kept
  std::string host_;                                                  ///< which rhec this is
  std::map<std::filesystem::path, std::optional<FileStamp>> stamps_;  ///< of libraries that were looked at
};

}  // namespace rhec
