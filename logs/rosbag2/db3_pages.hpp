#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "rhec/logs/storage/input_file.hpp"

namespace rhec::logs {

/// A row of the table `messages`.
struct Db3Row {
  std::int64_t id = 0, topic_id = 0, timestamp = 0;
  std::span<const std::byte> data;  ///< valid during the call that hands it out
};

/// Messages out of the pages of a file of SQLite, page by page, without its tree: of a file that was cut, pages may be
/// there that nothing leads to any more. By https://www.sqlite.org/fileformat.html.
class Db3Pages {
 public:
  explicit Db3Pages(const std::filesystem::path& file);

  /// Whether the file ends within a page. SQLite takes what is missing of it for zeros, and rows in it for complete.
  bool is_cut_within_page() const noexcept;
  /// Hands out rows whose id is above `after`, in ascending order of ids as they lie in the file, until `take` returns
  /// false. A row that is not complete is left out.
  using Take = std::function<bool(const Db3Row& row)>;
  void read(std::int64_t after, const Take& take);

 private:
  std::int64_t page_count() const noexcept;
  bool read_page(std::int64_t number, std::vector<std::byte>& page);
  bool take_leaf(const Take& take);
  bool payload_of(std::span<const std::byte> cell, std::uint64_t size);

  InputFile file_;
  std::size_t page_size_ = 0, usable_ = 0;
  std::int64_t newest_ = 0, chained_ = 0;  ///< the last id handed out; pages of chains that were read
  std::vector<std::byte> page_, further_, payload_;
};

}  // namespace rhec::logs
