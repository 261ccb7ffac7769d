#include "report_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/csv.hpp"

namespace rhec::sim {
namespace {

constexpr double bins_per_decade = 10.0;

std::string_view next_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return line;
}

void split(std::string_view line, std::vector<std::string_view>& fields) {
  while (true) {
    const std::size_t comma = line.find(',');
    fields.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return;
    line.remove_prefix(comma + 1);
  }
}

std::string what_to_do(const std::string& maker) {
  return fmt::format("take a copy that is whole, or make it again with '{}'", maker);
}

}  // namespace

ResultTable::ResultTable(std::filesystem::path file, std::string maker)
    : file_(std::move(file)), maker_(std::move(maker)), text_(read_text(file_)) {
  if (text_.empty())
    throw Error(fmt::format("{}: is empty; expected a line of names and rows; {}", file_.string(), what_to_do(maker_)));
  if (text_.back() != '\n') {
    const auto line = std::count(text_.begin(), text_.end(), '\n') + 1;
    throw Error(
        fmt::format("{}:{}: ends within this line; expected whole rows; {}", file_.string(), line, what_to_do(maker_)));
  }
  std::string_view rest = text_;
  std::vector<std::string_view> names;
  split(next_line(rest), names);
  header_.assign(names.begin(), names.end());
  for (std::int64_t line = 2; !rest.empty(); ++line) {
    const std::size_t before = fields_.size();
    split(next_line(rest), fields_);
    if (fields_.size() - before != header_.size())
      throw Error(fmt::format("{}:{}: has {} fields, expected {} as in the first line; {}", file_.string(), line,
                              fields_.size() - before, header_.size(), what_to_do(maker_)));
  }
}

bool ResultTable::has(std::string_view name) const noexcept {
  return std::find(header_.begin(), header_.end(), name) != header_.end();
}

std::size_t ResultTable::column(std::string_view name) const {
  const auto found = std::find(header_.begin(), header_.end(), name);
  if (found == header_.end())
    throw Error(fmt::format("{}:1: there is no column '{}'; expected the columns of docs/results.md; {}",
                            file_.string(), name, what_to_do(maker_)));
  return static_cast<std::size_t>(found - header_.begin());
}

std::string_view ResultTable::text(std::int64_t row, std::size_t column) const {
  return fields_[static_cast<std::size_t>(row) * header_.size() + column];
}

double ResultTable::number(std::int64_t row, std::size_t column) const {
  const std::string_view field = text(row, column);
  if (field.empty()) return std::numeric_limits<double>::quiet_NaN();
  double value = 0.0;
  const auto [end, failure] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (failure != std::errc() || end != field.data() + field.size())
    throw Error(fmt::format("{}:{}: {}: found '{}', expected a number; {}", file_.string(), line_of(row),
                            header_[column], field.substr(0, 40), what_to_do(maker_)));
  return value;
}

std::vector<double> ResultTable::numbers(std::string_view name) const {
  const std::size_t index = column(name);
  std::vector<double> values(static_cast<std::size_t>(rows()));
  for (std::int64_t row = 0; row < rows(); ++row) values[static_cast<std::size_t>(row)] = number(row, index);
  return values;
}

void ResultTable::require_rows(std::int64_t expected, const std::string& who_says_so) const {
  if (rows() == expected) return;
  throw Error(fmt::format("{}:{}: ends after {} rows, expected {} as {} says; {}", file_.string(), line_of(rows()) - 1,
                          rows(), expected, who_says_so, what_to_do(maker_)));
}

Json read_json(const std::filesystem::path& file, const std::string& maker) {
  const std::string text = read_text(file);
  if (text.find_first_not_of(" \t\r\n") == std::string::npos)
    throw Error(fmt::format("{}: is empty; expected JSON; {}", file.string(), what_to_do(maker)));
  try {
    return Json::parse(text);
  } catch (const JsonParseError& error) {
    const auto until = text.begin() + static_cast<std::ptrdiff_t>(std::min(error.byte, text.size()));
    const auto line = std::count(text.begin(), until, '\n') + 1;
    throw Error(
        fmt::format("{}:{}: is no JSON from here on, or is cut off; {}", file.string(), line, what_to_do(maker)));
  }
}

Json parse_json_line(std::string_view line, const std::filesystem::path& file, std::int64_t number,
                     const std::string& maker) {
  std::optional<Json> json = Json::parse_if_valid(line);
  if (!json || !json->is_object())
    throw Error(fmt::format("{}:{}: is no whole line of JSON; {}", file.string(), number, what_to_do(maker)));
  return std::move(*json);
}

const Json& member(const Json& json, const char* key, const std::filesystem::path& file, const std::string& maker) {
  const Json* found = json.is_object() ? json.find(key) : nullptr;
  if (!found)
    throw Error(fmt::format("{}: {}: there is no such key; expected the form of docs/results.md; {}", file.string(),
                            key, what_to_do(maker)));
  return *found;
}

Json seen(double value, int digits) {
  if (!std::isfinite(value)) return nullptr;
  std::array<char, 40> text;
  const auto end = std::to_chars(text.begin(), text.end(), value, std::chars_format::general, digits).ptr;
  double rounded = 0.0;
  std::from_chars(text.begin(), end, rounded);
  return rounded;
}

RequiredMembers::RequiredMembers(std::filesystem::path file, std::string expected)
    : file_(std::move(file)), expected_(std::move(expected)) {}

void RequiredMembers::refuse(const std::string& what) const {
  throw Error(fmt::format("{}: {}; expected {}", file_.string(), what, expected_));
}

const Json& RequiredMembers::get(const Json& json, const std::string& key, Json::Kind kind,
                                 const std::string& place) const {
  const std::string path = place.empty() ? key : place + "." + key;
  if (!json.is_object()) refuse(fmt::format("{} is no map", place.empty() ? "the whole" : place));
  const Json* found = json.find(key);
  if (!found) refuse(fmt::format("there is no {}", path));
  const bool is_number = kind == Json::Kind::number && found->kind() == Json::Kind::integer;
  if (found->kind() != kind && !is_number) refuse(fmt::format("{} is {}", path, found->kind_name()));
  return *found;
}

Json seen(double value) {
  constexpr int digits = 7, decimals = 4;
  const double size = std::abs(value);
  return seen(value, size < 1e3 ? digits : decimals + static_cast<int>(std::floor(std::log10(size))) + 1);
}

std::string counted(std::int64_t count) {
  std::string text = std::to_string(count);
  for (std::ptrdiff_t place = std::ssize(text) - 3; place > (count < 0 ? 1 : 0); place -= 3)
    text.insert(static_cast<std::size_t>(place), ",");
  return text;
}

void add_note(Json& notes, const char* about, const std::string& text) {
  notes.push_back({{"about", about}, {"text", text}});
}

Thinned thin(const std::vector<const std::vector<double>*>& columns, std::size_t count, std::size_t most) {
  Thinned thinned;
  if (count <= most || columns.empty()) {
    for (std::size_t row = 0; row < count; ++row) thinned.rows.push_back(row);
    return thinned;
  }
  // Two rows per column and stretch, plus the two ends.
  const std::size_t stretches = std::max<std::size_t>(1, (most - 2) / (2 * columns.size()));
  thinned.stretch = (count + stretches - 1) / stretches;
  std::vector<std::size_t> rows = {0, count - 1};
  for (std::size_t first = 0; first < count; first += thinned.stretch) {
    const std::size_t end = std::min(count, first + thinned.stretch);
    for (const std::vector<double>* column : columns) {
      std::size_t least = count, largest = count;
      for (std::size_t row = first; row < end; ++row) {
        const double value = (*column)[row];
        if (std::isnan(value)) continue;
        if (least == count || value < (*column)[least]) least = row;
        if (largest == count || value > (*column)[largest]) largest = row;
      }
      if (least == count) continue;
      rows.push_back(least);
      rows.push_back(largest);
    }
  }
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  thinned.rows = std::move(rows);
  return thinned;
}

Json column_of(const std::vector<double>& values, const std::vector<std::size_t>& rows) {
  Json column = Json::array();
  column.reserve(rows.size());
  for (const std::size_t row : rows) column.push_back(seen(values[row]));
  return column;
}

Json times_histogram(const std::vector<double>& times) {
  double least = std::numeric_limits<double>::infinity(), largest = 0.0;
  std::int64_t count = 0;
  for (const double time : times) {
    if (!(time > 0.0)) continue;
    least = std::min(least, time);
    largest = std::max(largest, time);
    ++count;
  }
  if (count == 0) return nullptr;
  const int first = static_cast<int>(std::floor(std::log10(least) * bins_per_decade)),
            last = std::max(first, static_cast<int>(std::floor(std::log10(largest) * bins_per_decade)));
  std::vector<std::int64_t> counts(static_cast<std::size_t>(last - first + 1));
  for (const double time : times) {
    if (!(time > 0.0)) continue;
    const int bin = static_cast<int>(std::floor(std::log10(time) * bins_per_decade));
    ++counts[static_cast<std::size_t>(std::clamp(bin, first, last) - first)];
  }
  Json edges = Json::array();
  for (int bin = first; bin <= last + 1; ++bin) edges.push_back(seen(std::pow(10.0, bin / bins_per_decade), 6));
  return {{"count", count}, {"edges", std::move(edges)}, {"counts", counts}};
}

}  // namespace rhec::sim
