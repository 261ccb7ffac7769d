#include "rhec/logs/csv/csv_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <utility>

#include "csv_layout.hpp"
#include "rhec/logs/signals/clock.hpp"
#include "rhec/logs/signals/units.hpp"

namespace rhec::logs {
namespace {

constexpr std::size_t longest_line = std::size_t{1} << 20;
// Lines that are looked at to see how a table is written.
constexpr std::size_t most_first_lines = 200;
constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

/// Lines of a file, each of bounded length.
class Lines {
 public:
  explicit Lines(std::ifstream stream) : stream_(std::move(stream)), buffer_(longest_line) {}
  /// False at the end of the file. A longer line is cut, and `is_cut`.
  bool next() {
    stream_.getline(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    const auto count = static_cast<std::size_t>(stream_.gcount());
    if (count == 0) return false;
    is_cut_ = stream_.fail();
    line_ = {buffer_.data(), is_cut_ || stream_.eof() ? count : count - 1};
    stream_.clear(stream_.rdstate() & ~std::ios::failbit);
    return true;
  }
  std::string_view line() const noexcept { return line_; }
  bool is_cut() const noexcept { return is_cut_; }

 private:
  std::ifstream stream_;
  std::vector<char> buffer_;
  std::string_view line_;
  bool is_cut_ = false;
};

/// The cells of one line that are asked for.
class Cells {
 public:
  Cells(const CsvLayout& layout, std::vector<int> columns) : layout_(&layout), columns_(std::move(columns)) {
    cells_.resize(layout.columns.size());
  }
  void split(std::string_view line) {
    const std::size_t count = for_each_cell(line, layout_->separator, [&](std::string_view cell, std::size_t i) {
      if (i < cells_.size()) cells_[i] = cell;
    });
    const bool ends_with_separator = count == cells_.size() + 1 && trimmed_cell(line).ends_with(layout_->separator);
    if (count != cells_.size() && !ends_with_separator)
      throw RecordError(fmt::format("found {} cells, expected {}, as in the header", count, cells_.size()));
  }
  double number(std::size_t i) const {
    double value = no_number;
    const CsvColumn& column = column_of(i);
    if (!read_csv_number(cell(i), column.decimal_mark, value))
      throw RecordError(fmt::format("found {} in the column '{}', expected a number, with a decimal {}, or nothing",
                                    in_quotes(cell(i)), column.name,
                                    column.decimal_mark == ',' ? "comma as before" : "point"));
    return value;
  }
  Stamp stamp(std::size_t i, ClockUnit unit) const {
    if (cell(i).empty()) return no_stamp;
    std::string with_point(cell(i));
    if (column_of(i).decimal_mark == ',') std::ranges::replace(with_point, ',', '.');
    const std::optional<Stamp> stamp = stamp_of(with_point, unit);
    if (!stamp)
      throw RecordError(
          fmt::format("found {} in the clock '{}', expected a time: a number, or a date as in "
                      "2024-05-01T12:34:56.7Z",
                      in_quotes(cell(i)), column_of(i).name));
    return *stamp;
  }

 private:
  std::string_view cell(std::size_t i) const { return cells_[static_cast<std::size_t>(columns_[i])]; }
  const CsvColumn& column_of(std::size_t i) const { return layout_->columns[static_cast<std::size_t>(columns_[i])]; }
  const CsvLayout* layout_;
  std::vector<int> columns_;
  std::vector<std::string_view> cells_;
};

std::string_view text_of(const Record& record) {
  return {reinterpret_cast<const char*>(record.bytes.data()), record.bytes.size()};
}

class CsvReader final : public FieldReader {
 public:
  CsvReader(const CsvLayout& layout, std::vector<int> columns, int clock, bool is_received)
      : fields_(columns.size()), is_received_(is_received), cells_(layout, with(std::move(columns), clock)) {
    if (!is_received) unit_ = layout.unit_of_clock(clock);
  }
  Stamp read(const Record& record, double* values) override {
    cells_.split(text_of(record));
    for (std::size_t i = 0; i < fields_; ++i) values[i] = cells_.number(i);
    return is_received_ ? record.received : cells_.stamp(fields_, unit_);
  }

 private:
  static std::vector<int> with(std::vector<int> columns, int clock) {
    columns.push_back(clock);
    return columns;
  }
  std::size_t fields_;
  bool is_received_;
  Cells cells_;
  ClockUnit unit_ = 0.0;
};

class CsvLog final : public Log {
 public:
  explicit CsvLog(const std::filesystem::path& file) : Log(file.string()), file_(file) {
    Lines lines = open();
    std::vector<std::string> first;
    for (std::size_t size = 0; first.size() < most_first_lines && size < longest_line && lines.next();
         size += first.back().size())
      first.emplace_back(lines.line());
    layout_ = csv_layout(name(), first);
    topics_.push_back({.name = "", .type = "table"});
  }

  std::unique_ptr<FieldReader> reader(int, const FieldRequest& request) const override {
    std::vector<int> columns;
    for (const std::string& field : request.fields) columns.push_back(layout_.column(field));
    const bool is_received = request.clock == received_clock && layout_.received < 0;
    const int clock = request.clock.empty() || is_received ? layout_.clock : layout_.column(request.clock);
    if (clock < 0 && !is_received)
      throw Error(
          fmt::format("{} has no column 'time'; name the column that says when a line was measured: its columns "
                      "are {}; e.g. `signals.clock: {}`",
                      name(), fmt::join(layout_.names(), ", "), layout_.columns.front().name));
    return std::make_unique<CsvReader>(layout_, std::move(columns), clock, is_received);
  }

  std::vector<std::string> fields_of(const Record& record) const override {
    std::vector<std::string> fields;
    for_each_cell(text_of(record), layout_.separator, [&](std::string_view cell, std::size_t i) {
      double value = no_number;
      const bool is_clock = static_cast<int>(i) == layout_.clock || static_cast<int>(i) == layout_.received;
      if (i < layout_.columns.size() && !is_clock && read_csv_number(cell, layout_.columns[i].decimal_mark, value))
        fields.push_back(layout_.columns[i].name);
    });
    return fields;
  }

  std::optional<Damage> read(const std::vector<bool>& wanted, const Take& take) const override {
    if (wanted.empty() || !wanted.front()) return std::nullopt;
    Lines lines = open();
    for (int i = 0; i < layout_.header_lines; ++i) lines.next();
    const int known = layout_.received >= 0 ? layout_.received : layout_.clock;
    Cells clock(layout_, {std::max(known, 0)});
    const ClockUnit unit = known >= 0 ? layout_.unit_of_clock(known) : 0.0;
    for (std::int64_t number = layout_.header_lines + 1; lines.next(); ++number) {
      const std::string_view line = lines.line();
      Record record{.topic = 0, .received = no_stamp, .place = number, .bytes = std::as_bytes(std::span(line))};
      try {
        if (lines.is_cut()) throw RecordError(fmt::format("found a line of more than {} bytes", longest_line));
        if (trimmed_cell(line).empty()) continue;
        clock.split(line);
        if (known >= 0) record.received = clock.stamp(0, unit);
        if (known >= 0 && record.received == no_stamp) continue;
      } catch (const RecordError& error) {
        return damage_at(record, error);
      }
      if (!take(record)) break;
    }
    return std::nullopt;
  }

  std::string unit_of(int, std::string_view field) const override {
    const int column = layout_.find(field);
    return column < 0 ? std::string() : unit_of_header(layout_.columns[static_cast<std::size_t>(column)].unit);
  }

  Damage damage_at(const Record& record, const RecordError& error) const override {
    return {fmt::format("{}:{}: {}; mend the line, or cut the table there", name(), record.place, error.what())};
  }

 private:
  Lines open() const {
    errno = 0;
    std::ifstream stream(file_, std::ios::binary);
    if (!stream || std::filesystem::is_directory(file_))
      throw Error(fmt::format("{}: cannot be read: {}", name(), errno != 0 ? std::strerror(errno) : "it is a folder"));
    return Lines(std::move(stream));
  }

  std::filesystem::path file_;
  CsvLayout layout_;
};

}  // namespace

std::unique_ptr<Log> open_csv(const std::filesystem::path& file) { return std::make_unique<CsvLog>(file); }

}  // namespace rhec::logs
