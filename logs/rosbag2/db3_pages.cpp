#include "db3_pages.hpp"

#include <algorithm>
#include <optional>

namespace rhec::logs {
namespace {

constexpr std::size_t head_of_file = 100, head_of_leaf = 8;
constexpr std::uint8_t leaf_of_table = 0x0D;
constexpr std::uint64_t longest_payload = std::uint64_t{1} << 28;
// Ids of messages count up; a page that says otherwise is no page of messages.
constexpr std::int64_t longest_step = 1'000'000;

std::uint64_t big_endian(std::span<const std::byte> bytes) noexcept {
  std::uint64_t value = 0;
  for (const std::byte each : bytes) value = value << 8 | std::to_integer<std::uint64_t>(each);
  return value;
}

/// Integers of SQLite, cut off the front of bytes.
class Cutter {
 public:
  explicit Cutter(std::span<const std::byte> bytes) noexcept : bytes_(bytes) {}
  std::span<const std::byte> left() const noexcept { return bytes_; }
  bool ok() const noexcept { return ok_; }

  std::uint64_t varint() noexcept {
    constexpr int longest = 9;
    std::uint64_t value = 0;
    for (int i = 0; i < longest; ++i) {
      const std::uint64_t byte = big_endian(take(1));
      if (!ok_) return 0;
      if (i == longest - 1) return value << 8 | byte;
      value = value << 7 | (byte & 0x7F);
      if ((byte & 0x80) == 0) return value;
    }
    return value;
  }
  std::span<const std::byte> take(std::uint64_t count) noexcept {
    if (count > bytes_.size()) {
      ok_ = false;
      return {};
    }
    const auto front = bytes_.first(static_cast<std::size_t>(count));
    bytes_ = bytes_.subspan(static_cast<std::size_t>(count));
    return front;
  }
  /// A column of this serial type, if it is an integer.
  std::optional<std::int64_t> integer(std::uint64_t type) noexcept {
    constexpr std::uint64_t sizes[] = {0, 1, 2, 3, 4, 6, 8};
    constexpr std::uint64_t zero = 8, one = 9;
    if (type == zero || type == one) return static_cast<std::int64_t>(type - zero);
    if (type == 0 || type >= std::size(sizes)) return std::nullopt;
    const auto bytes = take(sizes[type]);
    if (!ok_) return std::nullopt;
    const int unused = 64 - 8 * static_cast<int>(bytes.size());
    return static_cast<std::int64_t>(big_endian(bytes) << unused) >> unused;
  }

 private:
  std::span<const std::byte> bytes_;
  bool ok_ = true;
};

/// A row of four columns: the id, which is that of the cell, two integers and a blob.
std::optional<Db3Row> row_of(std::int64_t id, std::span<const std::byte> payload) noexcept {
  constexpr std::uint64_t least_blob = 12;
  Cutter whole(payload);
  const std::uint64_t size = whole.varint();
  const std::size_t head = payload.size() - whole.left().size();
  if (!whole.ok() || size < head || size > payload.size()) return std::nullopt;
  Cutter types(payload.subspan(head, static_cast<std::size_t>(size) - head));
  const std::uint64_t id_type = types.varint(), topic_type = types.varint(), time_type = types.varint(),
                      data_type = types.varint();
  const bool is_blob = data_type >= least_blob && data_type % 2 == 0;
  if (!types.ok() || !types.left().empty() || id_type != 0 || !is_blob) return std::nullopt;
  Cutter columns(payload.subspan(static_cast<std::size_t>(size)));
  const std::optional<std::int64_t> topic = columns.integer(topic_type), time = columns.integer(time_type);
  const auto data = columns.take((data_type - least_blob) / 2);
  if (!topic || !time || !columns.ok() || !columns.left().empty()) return std::nullopt;
  return Db3Row{id, *topic, *time, data};
}

}  // namespace

Db3Pages::Db3Pages(const std::filesystem::path& file) : file_(file) {
  std::vector<std::byte> head(head_of_file);
  constexpr std::size_t size_at = 16, reserved_at = 20, least = 512;
  if (file_.left() < std::ssize(head) || !file_.read(head)) return;
  const std::uint64_t size = big_endian(std::span(head).subspan(size_at, 2));
  page_size_ = size == 1 ? 65536 : static_cast<std::size_t>(size);
  const auto reserved = std::to_integer<std::size_t>(head[reserved_at]);
  if (page_size_ < least || (page_size_ & (page_size_ - 1)) != 0) page_size_ = 0;
  usable_ = page_size_ > reserved ? page_size_ - reserved : 0;
}

bool Db3Pages::is_cut_within_page() const noexcept {
  return page_size_ > 0 && file_.size() % static_cast<std::int64_t>(page_size_) != 0;
}

std::int64_t Db3Pages::page_count() const noexcept { return file_.size() / static_cast<std::int64_t>(page_size_); }

bool Db3Pages::read_page(std::int64_t number, std::vector<std::byte>& page) {
  if (number < 1 || number > page_count()) return false;
  file_.seek((number - 1) * static_cast<std::int64_t>(page_size_));
  page.resize(page_size_);
  return file_.read(page);
}

void Db3Pages::read(std::int64_t after, const Take& take) {
  if (page_size_ == 0 || usable_ == 0) return;
  newest_ = after;
  chained_ = 0;
  // The first page is that of the schema.
  for (std::int64_t number = 2; read_page(number, page_); ++number)
    if (std::to_integer<std::uint8_t>(page_[0]) == leaf_of_table && !take_leaf(take)) return;
}

bool Db3Pages::take_leaf(const Take& take) {
  constexpr std::size_t count_at = 3;
  const auto count = static_cast<std::size_t>(big_endian(std::span(page_).subspan(count_at, 2)));
  if (count > (usable_ - head_of_leaf) / 2) return true;
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(big_endian(std::span(page_).subspan(head_of_leaf + 2 * i, 2)));
    if (at < head_of_leaf + 2 * count || at >= usable_) return true;
    Cutter cell(std::span<const std::byte>(page_).subspan(at, usable_ - at));
    const std::uint64_t size = cell.varint();
    const auto id = static_cast<std::int64_t>(cell.varint());
    if (!cell.ok() || size > longest_payload || id <= newest_ || id > newest_ + longest_step) continue;
    if (!payload_of(cell.left(), size)) continue;
    const std::optional<Db3Row> row = row_of(id, payload_);
    if (!row) continue;
    newest_ = id;
    if (!take(*row)) return false;
  }
  return true;
}

/// What of it lies in the cell, and what in a chain of pages behind it. Each page of a file is in one chain at most, so
/// that chains which lead in circles, or which many cells share, end.
bool Db3Pages::payload_of(std::span<const std::byte> cell, std::uint64_t size) {
  const std::size_t most = usable_ - 35, least = (usable_ - 12) * 32 / 255 - 23;
  std::size_t local = static_cast<std::size_t>(size);
  if (size > most) {
    const auto fits = static_cast<std::size_t>(least + (size - least) % (usable_ - 4));
    local = fits <= most ? fits : least;
  }
  if (local > cell.size()) return false;
  payload_.assign(cell.begin(), cell.begin() + static_cast<std::ptrdiff_t>(local));
  if (size <= most) return true;
  if (cell.size() < local + 4) return false;
  auto next = static_cast<std::int64_t>(big_endian(cell.subspan(local, 4)));
  while (payload_.size() < size) {
    if (chained_ >= page_count() || !read_page(next, further_)) return false;
    ++chained_;
    const std::size_t part = std::min<std::size_t>(usable_ - 4, static_cast<std::size_t>(size) - payload_.size());
    payload_.insert(payload_.end(), further_.begin() + 4, further_.begin() + 4 + static_cast<std::ptrdiff_t>(part));
    next = static_cast<std::int64_t>(big_endian(std::span(further_).first(4)));
  }
  return true;
}

}  // namespace rhec::logs
