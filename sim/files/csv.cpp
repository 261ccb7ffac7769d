#include "rhec/sim/files/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <system_error>
#include <utility>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

bool means_missing(std::string_view field) {
  if (field.empty()) return true;
  const auto same = [](char c, char lower) { return c == lower || c == lower - 'a' + 'A'; };
  return field.size() == 3 && same(field[0], 'n') && same(field[1], 'a') && same(field[2], 'n');
}

// A finite number, NaN for a missing value, or nothing.
std::optional<double> number_in(std::string_view field) {
  if (means_missing(field)) return std::numeric_limits<double>::quiet_NaN();
  // from_chars does not accept a plus sign.
  if (field.front() == '+' && field.size() > 1 && field[1] != '-') field.remove_prefix(1);
  double value = 0.0;
  const auto [end, failure] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (failure != std::errc() || end != field.data() + field.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

// Calls visit(field, index) for each field of a line and returns their number.
template <class Visit>
int for_each_field(std::string_view line, Visit visit) {
  int count = 0;
  while (true) {
    const std::size_t comma = line.find(',');
    visit(trimmed(line.substr(0, comma)), count++);
    if (comma == std::string_view::npos) return count;
    line.remove_prefix(comma + 1);
  }
}

// A field, shortened for messages.
std::string quoted(std::string_view field) {
  constexpr std::size_t most = 40;
  std::string text;
  for (char c : field.substr(0, most)) text += c >= ' ' && c <= '~' ? c : '?';
  return fmt::format("'{}{}'", text, field.size() > most ? "..." : "");
}

// Removes the first line from the text and returns it.
std::string_view take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return line;
}

bool is_header(std::string_view line, const CsvOptions& options) {
  if (options.header != CsvHeader::optional) return options.header == CsvHeader::required;
  bool any_number = false, any_name = false;
  for_each_field(line, [&](std::string_view field, int) {
    const std::optional<double> number = number_in(field);
    any_number = any_number || (number && !std::isnan(*number));
    any_name = any_name || !number;
  });
  return any_name && !any_number;
}

/// What other programs write in the place of a comma, where a field that is no number has it.
std::string_view foreign_separator(std::string_view field) {
  field = trimmed(field);
  for (const auto& [sign, name] : {std::pair{';', "semicolons"}, std::pair{'\t', "tabs"}, std::pair{' ', "blanks"}})
    if (field.find(sign) != std::string_view::npos) return name;
  return {};
}

[[noreturn]] void refuse(std::string_view field, int column, const std::string& name, std::int64_t line) {
  if (const std::string_view found = foreign_separator(field); !found.empty() && column == 0)
    throw Error(fmt::format("{}:{}: {} in {}; expected numbers separated by commas", name, line, found, quoted(field)));
  throw Error(fmt::format("{}:{}: field {} is {}; expected a finite number, or nothing or 'nan' where it is missing",
                          name, line, column + 1, quoted(field)));
}

void require_count(int found, int expected, const std::string& name, std::int64_t line) {
  if (found == expected) return;
  throw Error(
      fmt::format("{}:{}: {} field(s) where {} are expected; every line must have the same number, separated by commas",
                  name, line, found, expected));
}

}  // namespace

CsvTable parse_csv(std::string_view text, const std::string& name, const CsvOptions& options) {
  CsvTable table;
  table.name = name;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  while (!text.empty() && (is_blank(text.back()) || text.back() == '\n')) text.remove_suffix(1);
  if (text.empty())
    throw Error(fmt::format("{}: the file is empty; expected lines of numbers separated by commas", name));

  int columns = options.columns;
  std::int64_t line_number = options.first_line - 1;
  const auto settle_columns = [&](int found) {
    if (columns == 0) columns = found;
    require_count(found, columns, name, line_number);
    table.missing.assign(static_cast<std::size_t>(columns), 0);
  };

  std::string_view rest = text;
  if (std::string_view first = take_line(rest); is_header(first, options)) {
    ++line_number;
    settle_columns(for_each_field(first, [&](std::string_view field, int) { table.header.emplace_back(field); }));
    text = rest;
  }
  table.first_row_line = line_number + 1;
  // Estimating the size from the first line avoids most reallocations.
  const std::size_t first_length = std::min(text.find('\n'), text.size()) + 1;
  const auto first_fields = static_cast<std::size_t>(
      std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(first_length - 1), ','));
  table.values.reserve((text.size() / first_length + 1) * (first_fields + 1));

  while (!text.empty()) {
    ++line_number;
    const std::string_view line = take_line(text);
    if (trimmed(line).empty() && columns != 1) {
      throw Error(fmt::format("{}:{}: a blank line within the data; remove it", name, line_number));
    }
    const std::size_t row_start = table.values.size();
    const int found = for_each_field(line, [&](std::string_view field, int column) {
      const std::optional<double> number = number_in(field);
      if (!number) refuse(field, column, name, line_number);
      table.values.push_back(*number);
    });
    if (table.missing.empty()) settle_columns(found);
    require_count(found, columns, name, line_number);
    for (std::size_t column = 0; column < table.missing.size(); ++column) {
      if (std::isnan(table.values[row_start + column])) ++table.missing[column];
    }
  }
  return table;
}

std::string read_text(const std::filesystem::path& file) {
  std::error_code failure;
  if (std::filesystem::is_directory(file, failure)) {
    throw Error(fmt::format("{}: is a folder; expected a file", file.string()));
  }
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    throw Error(fmt::format("{}: cannot be read ({}); check the path and the permissions", file.string(),
                            std::generic_category().message(errno)));
  }
  std::string text;
  const auto size = std::filesystem::file_size(file, failure);
  if (!failure) text.reserve(size);
  text.assign(std::istreambuf_iterator<char>(stream), {});
  return text;
}

CsvTable read_csv(const std::filesystem::path& file, const CsvOptions& options) {
  return parse_csv(read_text(file), file.string(), options);
}

void check_time_order(const CsvTable& table, int column) {
  if (column < 0 || column >= table.columns()) {
    throw Error(fmt::format("{}: there is no column {} to hold the time; the file has {} column(s)", table.name,
                            column + 1, table.columns()));
  }
  for (std::int64_t row = 0; row < table.rows(); ++row) {
    const double time = table.at(row, column);
    if (std::isnan(time)) {
      throw Error(fmt::format("{}:{}: the time is missing; every row needs one in column {}", table.name,
                              table.line_of(row), column + 1));
    }
    if (row > 0 && time < table.at(row - 1, column)) {
      throw Error(
          fmt::format("{}:{}: time runs backwards, from {} s to {} s; sort the rows by time, or cut the log where its "
                      "clock was set back",
                      table.name, table.line_of(row), table.at(row - 1, column), time));
    }
  }
}

}  // namespace rhec::sim
