#include "rhec/logs/storage/whole_file.hpp"

#include <cerrno>
#include <cstring>
#include <system_error>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"

namespace rhec::logs {

WholeFile::WholeFile(const std::filesystem::path& file) : file_(file), part_(file.string() + ".part") {
  std::error_code ignored;  // the stream says what is wrong
  if (std::filesystem::is_directory(file_, ignored))
    throw Error(fmt::format("{}: is a folder; give the name of a file", file_.string()));
  if (std::filesystem::is_other(std::filesystem::status(file_, ignored)))  // in whose place a rename would put a file
    throw Error(fmt::format("{}: is a device or a pipe; give the name of a file", file_.string()));
  if (file_.has_parent_path()) std::filesystem::create_directories(file_.parent_path(), ignored);
  errno = 0;
  stream_.open(part_, std::ios::binary | std::ios::trunc);
  if (!stream_) throw Error(fmt::format("{}: cannot be written: {}", file_.string(), std::strerror(errno)));
}

WholeFile::~WholeFile() {
  if (is_closed_) return;
  stream_.close();
  std::error_code ignored;  // nothing is left to be done about it
  std::filesystem::remove(part_, ignored);
}

void WholeFile::write(std::span<const std::byte> bytes) {
  stream_.write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
  if (!stream_) throw Error(fmt::format("{}: cannot be written; is there room on the disk?", file_.string()));
}

void WholeFile::close() {
  stream_.close();
  if (!stream_) throw Error(fmt::format("{}: cannot be written; is there room on the disk?", file_.string()));
  std::error_code failure;
  std::filesystem::rename(part_, file_, failure);
  if (failure) throw Error(fmt::format("{}: cannot be put in place: {}", file_.string(), failure.message()));
  is_closed_ = true;
}

}  // namespace rhec::logs
