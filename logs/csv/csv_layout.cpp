#include "csv_layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/logs/signals/calendar.hpp"
#include "rhec/logs/signals/log.hpp"
#include "rhec/logs/signals/units.hpp"

namespace rhec::logs {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return result;
}

/// Whether bytes are UTF-8, as far as its marks go.
bool is_utf8(std::string_view text) {
  int following = 0;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool follows = (byte & 0xC0u) == 0x80u;
    if (follows != (following > 0)) return false;
    if (follows) {
      --following;
    } else {
      following = byte < 0x80u ? 0 : byte >= 0xF0u ? 3 : byte >= 0xE0u ? 2 : byte >= 0xC2u ? 1 : -1;
    }
    if (following < 0) return false;
  }
  return following == 0;
}

/// Spreadsheets save tables in Latin-1, too; names are UTF-8 everywhere else.
std::string in_utf8(std::string_view text) {
  if (is_utf8(text)) return std::string(text);
  std::string result;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80u) {
      result += c;
    } else {
      result += static_cast<char>(0xC0u | byte >> 6u);
      result += static_cast<char>(0x80u | (byte & 0x3Fu));
    }
  }
  return result;
}

bool is_number(std::string_view cell) {
  double value = missing;
  return (read_csv_number(cell, '.', value) || read_csv_number(cell, ',', value)) && !std::isnan(value);
}

/// A number that is written with this mark: "1,5", but not "15".
bool is_number_with(std::string_view cell, char mark) {
  double value = missing;
  return cell.find(mark) != std::string_view::npos && read_csv_number(cell, mark, value);
}

bool is_comment(std::string_view line) {
  return line.starts_with('#') || line.starts_with('%') || line.starts_with("//");
}

/// What a comment says.
std::string_view uncommented(std::string_view line) {
  while (line.starts_with('#') || line.starts_with('%') || line.starts_with('/') || line.starts_with(' '))
    line.remove_prefix(1);
  return line;
}

/// "speed (km/h)" as "speed" and "km/h"; "position[left]" has no unit.
CsvColumn column_of(std::string_view cell) {
  ClockName parts = parse_clock_name(cell);
  CsvColumn column{.name = std::move(parts.name), .unit = std::move(parts.unit), .text = std::string(cell)};
  if (!column.unit.empty()) return column;
  for (const auto& [open, close] : {std::pair('(', ')'), std::pair('[', ']')}) {
    const std::size_t begin = cell.rfind(open);
    if (begin == std::string_view::npos || begin == 0 || !cell.ends_with(close)) continue;
    const std::string_view unit = cell.substr(begin + 1, cell.size() - begin - 2);
    if (!is_blank(cell[begin - 1]) && unit_of_header(unit).empty() && !clock_unit(unit)) continue;
    column.name = trimmed_cell(cell.substr(0, begin));
    column.unit = trimmed_cell(unit);
  }
  return column;
}

/// "time_ms" counts milliseconds.
std::string unit_in_name_of_clock(std::string_view name) {
  const std::size_t begin = name.rfind('_');
  if (begin == std::string_view::npos) return {};
  const std::string_view unit = name.substr(begin + 1);
  return !unit.empty() && clock_unit(unit) ? std::string(unit) : std::string();
}

int find_clock(const CsvLayout& layout) {
  for (const char* name : {"time", "timestamp", "stamp", "t", "__time", "%time", "datetime", "utc", "date_time"}) {
    for (std::size_t i = 0; i < layout.columns.size(); ++i) {
      const std::string& own = layout.columns[i].name;
      const std::string found = own == "T" ? own : lower(own);  // T is a temperature
      const std::string unit = unit_in_name_of_clock(found);
      if (found == name || (!unit.empty() && found == fmt::format("{}_{}", name, unit))) return static_cast<int>(i);
    }
  }
  return -1;
}

/// The first column that has a date or a time of day, whatever it is called.
int column_of_dates(const CsvLayout& layout, std::string_view line) {
  int found = -1;
  for_each_cell(line, layout.separator, [&](std::string_view cell, std::size_t i) {
    if (found < 0 && i < layout.columns.size() && calendar_stamp(cell)) found = static_cast<int>(i);
  });
  return found;
}

std::vector<std::string_view> cells_of(std::string_view line, char separator) {
  std::vector<std::string_view> cells;
  for_each_cell(line, separator, [&](std::string_view cell, std::size_t) { cells.push_back(cell); });
  return cells;
}

/// What separates cells: what makes as many of the lines of data as of the header, and as many as can be.
char separator_of(std::string_view header, std::string_view data) {
  char best = ',';
  std::size_t most = 0;
  for (const char each : {';', '\t', ',', ' '}) {
    const std::size_t count = cells_of(header, each).size(), below = cells_of(data, each).size();
    const bool agrees = data.empty() || count == below || count + 1 == below;
    // A blank is within names more often than it separates them.
    const bool is_blank_in_name = each == ' ' && (most > 0 || !agrees || data.empty());
    const std::size_t points = count < 2 || is_blank_in_name ? 0 : 2 * count + (agrees ? 1000000 : 0);
    if (points > most) {
      most = points;
      best = each;
    }
  }
  return best;
}

/// Whether a line below the header has units alone: "s;km/h;;deg".
bool is_line_of_units(const std::vector<std::string_view>& cells) {
  bool has_one = false;
  for (std::string_view cell : cells) {
    if (cell.size() > 2 && (cell.front() == '[' || cell.front() == '(')) cell = cell.substr(1, cell.size() - 2);
    if (cell.empty()) continue;
    if (is_number(cell) || (unit_of_header(cell).empty() && !clock_unit(cell))) return false;
    has_one = true;
  }
  return has_one;
}

void set_units(const std::vector<std::string_view>& cells, std::vector<CsvColumn>& columns) {
  for (std::size_t i = 0; i < std::min(cells.size(), columns.size()); ++i) {
    std::string_view cell = cells[i];
    if (cell.size() > 2 && (cell.front() == '[' || cell.front() == '(')) cell = cell.substr(1, cell.size() - 2);
    if (!cell.empty()) columns[i].unit = cell;
  }
}

/// Decimal commas, where lines of data have them and no points.
void set_decimal_marks(CsvLayout& layout, const std::vector<std::string>& lines, std::size_t first) {
  std::vector<std::pair<bool, bool>> has(layout.columns.size());  // commas, points
  for (std::size_t i = first; i < lines.size(); ++i)
    for_each_cell(lines[i], layout.separator, [&](std::string_view cell, std::size_t column) {
      if (column >= has.size()) return;
      has[column].first = has[column].first || is_number_with(cell, ',');
      has[column].second = has[column].second || is_number_with(cell, '.');
    });
  const auto any = [&](bool std::pair<bool, bool>::*which) {
    return std::any_of(has.begin(), has.end(), [&](const auto& each) { return each.*which; });
  };
  const bool is_usual = any(&std::pair<bool, bool>::first) && !any(&std::pair<bool, bool>::second);
  for (std::size_t i = 0; i < has.size(); ++i)
    layout.columns[i].decimal_mark = !has[i].second && (has[i].first || is_usual) ? ',' : '.';
}

/// The line of the header: behind comments, or the last of these, where numbers follow it. "sep=;" says what separates.
std::size_t header_line(const std::vector<std::string>& lines, std::optional<char>& separator) {
  std::size_t i = 0;
  if (!lines.empty() && lower(lines[0]).starts_with("sep=") && lines[0].size() > 4) {
    separator = lines[0][4];
    ++i;
  }
  std::optional<std::size_t> last_comment;
  for (; i < lines.size(); ++i) {
    if (trimmed_cell(lines[i]).empty()) continue;
    if (!is_comment(lines[i]) || (!last_comment && lower(lines[i]).starts_with("%time"))) break;
    last_comment = i;
  }
  if (!last_comment) return i;
  if (i >= lines.size()) return *last_comment;
  const char used = separator ? *separator : separator_of(uncommented(lines[*last_comment]), lines[i]);
  const std::vector<std::string_view> cells = cells_of(lines[i], used);
  const bool is_header = cells_of(uncommented(lines[*last_comment]), used).size() == cells.size();
  return is_header && std::any_of(cells.begin(), cells.end(), is_number) ? *last_comment : i;
}

}  // namespace

std::vector<std::string> CsvLayout::names() const {
  std::vector<std::string> names;
  for (const CsvColumn& column : columns) names.push_back(column.name);
  return names;
}

int CsvLayout::find(std::string_view name) const {
  const auto found = std::find_if(columns.begin(), columns.end(),
                                  [&](const CsvColumn& each) { return each.name == name || each.text == name; });
  return found == columns.end() ? -1 : static_cast<int>(found - columns.begin());
}

int CsvLayout::column(std::string_view name) const {
  const int found = find(name);
  if (found < 0) throw Error(fmt::format("{} has no column '{}'{}", file, name, suggestion_for(name, names())));
  return found;
}

ClockUnit CsvLayout::unit_of_clock(int column) const {
  const CsvColumn& counting = columns[static_cast<std::size_t>(column)];
  const std::string unit = counting.unit.empty() ? unit_in_name_of_clock(counting.name) : counting.unit;
  if (const auto found = clock_unit(unit)) return *found;
  throw Error(
      fmt::format("{}: the clock '{}' counts [{}]; expected [s], [ms], [us] or [ns]", file, counting.name, unit));
}

CsvLayout csv_layout(const std::string& file, const std::vector<std::string>& first_lines) {
  std::vector<std::string> lines = first_lines;
  for (std::string& line : lines) line = in_utf8(line);
  if (!lines.empty() && lines[0].starts_with("\xEF\xBB\xBF")) lines[0].erase(0, 3);
  std::optional<char> separator;
  const std::size_t at = header_line(lines, separator);
  const std::string_view line = at >= lines.size()                      ? std::string_view()
                                : lower(lines[at]).starts_with("%time") ? lines[at]
                                : is_comment(lines[at])                 ? uncommented(lines[at])
                                                                        : std::string_view(lines[at]);
  CsvLayout layout{.file = file, .columns = {}, .header_lines = static_cast<int>(at) + 1};
  std::size_t next = at + 1;
  while (next < lines.size() && trimmed_cell(lines[next]).empty()) ++next;
  layout.separator =
      separator ? *separator : separator_of(line, next < lines.size() ? lines[next] : std::string_view());
  bool has_number = line.find('\0') != std::string_view::npos;
  for (const std::string_view cell : cells_of(line, layout.separator)) {
    layout.columns.push_back(column_of(cell));
    has_number = has_number || is_number(cell);
  }
  if (trimmed_cell(line).empty() || has_number)
    throw Error(
        fmt::format("{}:{}: found {}, expected a header: the names of the columns; write one, such as "
                    "'time,speed,steering'",
                    file, std::min(at, std::max<std::size_t>(lines.size(), 1) - 1) + 1,
                    trimmed_cell(line).empty() ? std::string("nothing") : in_quotes(line)));
  for (std::size_t i = 0; i < layout.columns.size(); ++i)
    if (!layout.columns[i].name.empty() && layout.find(layout.columns[i].name) != static_cast<int>(i))
      throw Error(fmt::format("{}:{}: two columns are called '{}'; give each a name of its own", file, at + 1,
                              layout.columns[i].name));
  if (next < lines.size()) {
    const std::vector<std::string_view> cells = cells_of(lines[next], layout.separator);
    if (is_line_of_units(cells)) {
      set_units(cells, layout.columns);
      layout.header_lines = static_cast<int>(++next);
    }
  }
  set_decimal_marks(layout, lines, next);
  layout.clock = find_clock(layout);
  if (layout.clock < 0 && next < lines.size()) layout.clock = column_of_dates(layout, lines[next]);
  layout.received = layout.find(received_clock);
  return layout;
}

std::string_view trimmed_cell(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

std::size_t csv_cell_end(std::string_view line, char separator) {
  const std::size_t end = line.find(separator);
  if (end == std::string_view::npos || line.substr(0, end).find('"') == std::string_view::npos) return end;
  bool is_quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"') is_quoted = !is_quoted;
    if (line[i] == separator && !is_quoted) return i;
  }
  return std::string_view::npos;
}

bool read_csv_number(std::string_view cell, char decimal_mark, double& value) {
  value = missing;
  if (cell.empty()) return true;
  for (const char* none : {"nan", "NaN", "NAN", "null", "NULL", "None", "NA", "N/A", "n/a", "-"})
    if (cell == none) return true;
  if (cell == "true" || cell == "True" || cell == "TRUE" || cell == "false" || cell == "False" || cell == "FALSE") {
    value = cell.front() == 't' || cell.front() == 'T' ? 1.0 : 0.0;
    return true;
  }
  std::array<char, 64> with_point{};
  if (decimal_mark == ',') {
    if (cell.size() > with_point.size() || cell.find('.') != std::string_view::npos) return false;
    std::ranges::replace_copy(cell, with_point.begin(), ',', '.');
    cell = {with_point.data(), cell.size()};
  }
  if (cell.front() == '+') cell.remove_prefix(1);
  const auto [end, failure] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  return failure == std::errc() && end == cell.data() + cell.size() && std::isfinite(value);
}

}  // namespace rhec::logs
