#include "rhec/sim/files/output_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <system_error>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void refuse(const fs::path& path, const std::string& what, const std::error_code& reason) {
  throw Error(fmt::format("{}: {} ({}); choose another output folder or mend its permissions", path.string(), what,
                          reason.message()));
}

}  // namespace

OutputFolder::OutputFolder(const fs::path& folder) {
  if (folder.empty()) throw Error("output folder: the path is empty; give the folder that results shall go to");
  folder_ = fs::absolute(folder).lexically_normal();
  if (!folder_.has_filename()) folder_ = folder_.parent_path();
  std::error_code failure;
  const fs::file_status status = fs::status(folder_, failure);
  if (fs::exists(status) && !fs::is_directory(status)) {
    throw Error(fmt::format("{}: is a file; results go to a folder: choose another name or move the file away",
                            folder_.string()));
  }
  // The temporary folder is inside an existing folder, since only that is known to be writable and on the right disk.
  const fs::path parent = fs::is_directory(status) ? folder_ : folder_.parent_path();
  fs::create_directories(parent, failure);
  if (failure) refuse(parent, "cannot be created", failure);
  // create_directory reports whether the folder is new, so the first unused name is ours.
  for (int attempt = 0;; ++attempt) {
    aside_ = parent / fmt::format(".{}.partial-{}", folder_.filename().string(), attempt);
    if (fs::create_directory(aside_, failure)) return;
    if (failure) refuse(parent, "cannot be written to", failure);
  }
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  fs::remove_all(aside_, ignored);
}

fs::path OutputFolder::file(std::string_view name) {
  const fs::path plain(name);
  if (committed_)
    throw Error(fmt::format("{}: '{}' comes too late, after the results were put into place", path().string(), name));
  if (name.empty() || plain != plain.filename() || name == "." || name == "..") {
    throw Error(
        fmt::format("{}: '{}' is no name of a file in this folder; expected a plain name", path().string(), name));
  }
  if (std::find(names_.begin(), names_.end(), plain) == names_.end()) names_.push_back(plain);
  return aside_ / plain;
}

void OutputFolder::write(std::string_view name, std::string_view content) {
  const fs::path destination = file(name);
  errno = 0;
  std::ofstream stream(destination, std::ios::binary | std::ios::trunc);
  stream.write(content.data(), static_cast<std::streamsize>(content.size()));
  stream.close();
  if (!stream) refuse(folder_ / fs::path(name), "cannot be written", std::error_code(errno, std::generic_category()));
}

void OutputFolder::commit() {
  std::error_code failure;
  for (const fs::path& name : names_) {
    if (!fs::is_regular_file(aside_ / name, failure)) {
      throw Error(fmt::format("{}: '{}' was announced but never written; nothing was put into place", path().string(),
                              name.string()));
    }
    if (fs::is_directory(folder_ / name, failure)) {
      throw Error(
          fmt::format("{}: a folder of this name is in the way of a result; move it away. Nothing was put into place",
                      (folder_ / name).string()));
    }
    // A rename would put a file in the place of the device.
    if (fs::is_other(fs::status(folder_ / name, failure)))
      throw Error(fmt::format("{}: is a device or a pipe; give the name of a file. Nothing was put into place",
                              (folder_ / name).string()));
  }
  committed_ = true;
  if (!fs::exists(folder_, failure)) {
    fs::rename(aside_, folder_, failure);
    if (!failure) return;
    // Another process created it meanwhile: continue file by file.
    fs::create_directories(folder_, failure);
  }
  for (const fs::path& name : names_) {
    fs::rename(aside_ / name, folder_ / name, failure);
    if (failure) refuse(folder_ / name, "cannot be put into place", failure);
  }
}

}  // namespace rhec::sim
