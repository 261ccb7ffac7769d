#pragma once

#include <filesystem>
#include <fstream>
#include <string_view>

namespace rhec::sim {

/// A text file that appears under its name when it is complete; without `close` it is removed. Throws Error if it
/// cannot be written.
class WholeFile {
 public:
  explicit WholeFile(const std::filesystem::path& file);
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;
  void write(std::string_view text);
  void close();

 private:
  std::filesystem::path file_, part_;
  std::ofstream stream_;
  bool is_closed_ = false;
};

}  // namespace rhec::sim
