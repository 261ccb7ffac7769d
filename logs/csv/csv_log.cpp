#include "rhec/logs/csv/csv_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <utility>

#include "rhec/logs/signals/clock.hpp"

namespace rhec::logs {
namespace {

constexpr std::size_t longest_line = std::size_t{1} << 20;
constexpr double missing = std::numeric_limits<double>::quiet_NaN();

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

struct Column {
  std::string name;  ///< without its unit
  std::string unit;  ///< as in brackets behind the name
  std::string text;  ///< the whole cell
};

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

/// The end of the cell that a line begins with; a separator within quotes is text.
std::size_t cell_end(std::string_view line, char separator) {
  const std::size_t end = line.find(separator);
  if (end == std::string_view::npos || line.substr(0, end).find('"') == std::string_view::npos) return end;
  bool is_quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"') is_quoted = !is_quoted;
    if (line[i] == separator && !is_quoted) return i;
  }
  return std::string_view::npos;
}

template <class Visit>
std::size_t for_each_cell(std::string_view line, char separator, const Visit& visit) {
  for (std::size_t count = 0;; ++count) {
    const std::size_t end = cell_end(line, separator);
    visit(trimmed(line.substr(0, end)), count);
    if (end == std::string_view::npos) return count + 1;
    line.remove_prefix(end + 1);
  }
}

/// A number, NaN where it is missing; false for anything else.
bool read_number(std::string_view cell, double& value) {
  value = missing;
  if (cell.empty() || cell == "nan" || cell == "NaN" || cell == "NAN" || cell == "null" || cell == "None") return true;
  if (cell == "true" || cell == "True" || cell == "false" || cell == "False") {
    value = cell.front() == 't' || cell.front() == 'T' ? 1.0 : 0.0;
    return true;
  }
  if (cell.front() == '+') cell.remove_prefix(1);
  const auto [end, failure] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  return failure == std::errc() && end == cell.data() + cell.size() && std::isfinite(value);
}

bool is_number(std::string_view cell) {
  double value = missing;
  return read_number(cell, value) && !std::isnan(value);
}

Column column_of(std::string_view cell) {
  ClockName parts = parse_clock_name(cell);
  return {.name = std::move(parts.name), .unit = std::move(parts.unit), .text = std::string(cell)};
}

struct Layout {
  std::string file;
  char separator = ',';
  std::vector<Column> columns;

  std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const Column& column : columns) names.push_back(column.name);
    return names;
  }
  int find(std::string_view name) const {
    const auto found = std::find_if(columns.begin(), columns.end(),
                                    [&](const Column& each) { return each.name == name || each.text == name; });
    return found == columns.end() ? -1 : static_cast<int>(found - columns.begin());
  }
  int find_clock() const {
    for (const char* name : {"time", "timestamp", "stamp", "t", "__time", "%time", "Time", "Timestamp"})
      if (const int column = find(name); column >= 0) return column;
    return -1;
  }
  int column(std::string_view name) const {
    const int found = find(name);
    if (found < 0) throw Error(fmt::format("{} has no column '{}'{}", file, name, suggestion_for(name, names())));
    return found;
  }
  ClockUnit unit_of_clock(int column) const {
    const Column& clock = columns[static_cast<std::size_t>(column)];
    if (const auto unit = clock_unit(clock.unit)) return *unit;
    throw Error(
        fmt::format("{}: the clock '{}' counts [{}]; expected [s], [ms], [us] or [ns]", file, clock.name, clock.unit));
  }
};

/// The cells of one line that are asked for.
class Cells {
 public:
  Cells(const Layout& layout, std::vector<int> columns) : layout_(&layout), columns_(std::move(columns)) {
    cells_.resize(layout.columns.size());
  }
  void split(std::string_view line) {
    const std::size_t count = for_each_cell(line, layout_->separator, [&](std::string_view cell, std::size_t i) {
      if (i < cells_.size()) cells_[i] = cell;
    });
    if (count != cells_.size())
      throw RecordError(fmt::format("found {} cells, expected {}, as in the header", count, cells_.size()));
  }
  double number(std::size_t i) const {
    double value = missing;
    if (!read_number(cell(i), value))
      throw RecordError(fmt::format("found {} in the column '{}', expected a number, with a decimal point, or nothing",
                                    in_quotes(cell(i)), name(i)));
    return value;
  }
  Stamp stamp(std::size_t i, ClockUnit unit) const {
    if (cell(i).empty()) return no_stamp;
    const std::optional<Stamp> stamp = stamp_of(cell(i), unit);
    if (!stamp)
      throw RecordError(fmt::format("found {} in the clock '{}', expected a time", in_quotes(cell(i)), name(i)));
    return *stamp;
  }

 private:
  std::string_view cell(std::size_t i) const { return cells_[static_cast<std::size_t>(columns_[i])]; }
  const std::string& name(std::size_t i) const { return layout_->columns[static_cast<std::size_t>(columns_[i])].name; }
  const Layout* layout_;
  std::vector<int> columns_;
  std::vector<std::string_view> cells_;
};

std::string_view text_of(const Record& record) {
  return {reinterpret_cast<const char*>(record.bytes.data()), record.bytes.size()};
}

class CsvReader final : public FieldReader {
 public:
  CsvReader(const Layout& layout, std::vector<int> columns, int clock, bool is_received)
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
    layout_.file = name();
    Lines lines = open();
    lines.next();
    read_header(lines.line());
    topics_.push_back({.name = "", .type = "table"});
  }

  std::unique_ptr<FieldReader> reader(int, const FieldRequest& request) const override {
    std::vector<int> columns;
    for (const std::string& field : request.fields) columns.push_back(layout_.column(field));
    const bool is_received = request.clock == received_clock && received_ < 0;
    const int clock = request.clock.empty() || is_received ? clock_ : layout_.column(request.clock);
    if (clock < 0)
      throw Error(
          fmt::format("{} has no column 'time'; name the column that says when a line was measured: its columns "
                      "are {}; e.g. `signals.clock: {}`",
                      name(), fmt::join(layout_.names(), ", "), layout_.columns.front().name));
    return std::make_unique<CsvReader>(layout_, std::move(columns), clock, is_received);
  }

  std::vector<std::string> fields_of(const Record& record) const override {
    std::vector<std::string> fields;
    for_each_cell(text_of(record), layout_.separator, [&](std::string_view cell, std::size_t i) {
      double value = missing;
      const bool is_clock = static_cast<int>(i) == clock_ || static_cast<int>(i) == received_;
      if (i < layout_.columns.size() && !is_clock && read_number(cell, value))
        fields.push_back(layout_.columns[i].name);
    });
    return fields;
  }

  std::optional<Damage> read(const std::vector<bool>& wanted, const Take& take) const override {
    if (wanted.empty() || !wanted.front()) return std::nullopt;
    Lines lines = open();
    lines.next();
    const int known = received_ >= 0 ? received_ : clock_;
    Cells clock(layout_, {std::max(known, 0)});
    const ClockUnit unit = known >= 0 ? layout_.unit_of_clock(known) : 0.0;
    for (std::int64_t number = 2; lines.next(); ++number) {
      const std::string_view line = lines.line();
      Record record{.topic = 0, .received = no_stamp, .place = number, .bytes = std::as_bytes(std::span(line))};
      try {
        if (lines.is_cut()) throw RecordError(fmt::format("found a line of more than {} bytes", longest_line));
        if (trimmed(line).empty()) continue;
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

  void read_header(std::string_view line) {
    if (line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
    const auto count = [&](char c) { return std::count(line.begin(), line.end(), c); };
    for (const char separator : {';', '\t'})
      if (count(separator) > count(layout_.separator)) layout_.separator = separator;
    bool has_number = line.find('\0') != std::string_view::npos;
    for_each_cell(line, layout_.separator, [&](std::string_view cell, std::size_t) {
      layout_.columns.push_back(column_of(cell));
      has_number = has_number || is_number(cell);
    });
    if (trimmed(line).empty() || has_number)
      throw Error(
          fmt::format("{}:1: found {}, expected a header: the names of the columns; write one, such as "
                      "'time,speed,steering'",
                      name(), trimmed(line).empty() ? std::string("nothing") : in_quotes(line)));
    for (std::size_t i = 0; i < layout_.columns.size(); ++i)
      if (!layout_.columns[i].name.empty() && layout_.find(layout_.columns[i].name) != static_cast<int>(i))
        throw Error(fmt::format("{}:1: two columns are called '{}'; give each a name of its own", name(),
                                layout_.columns[i].name));
    clock_ = layout_.find_clock();
    received_ = layout_.find(received_clock);
  }

  std::filesystem::path file_;
  Layout layout_;
  int clock_ = -1, received_ = -1;
};

}  // namespace

std::unique_ptr<Log> open_csv(const std::filesystem::path& file) { return std::make_unique<CsvLog>(file); }

}  // namespace rhec::logs
