#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {

/// A file of results with commas between its fields and the columns' names in its first line, as rhec writes them.
/// Errors name the file, the line and what to do.
class ResultTable {
 public:
  /// Throws Error for a file that is not there, is empty, ends within a row, or has rows that are longer or shorter
  /// than the first. `maker` is the command that makes such files.
  ResultTable(std::filesystem::path file, std::string maker);

  const std::filesystem::path& file() const noexcept { return file_; }
  const std::vector<std::string>& header() const noexcept { return header_; }
  std::int64_t rows() const noexcept { return std::ssize(fields_) / std::ssize(header_); }
  /// The line of the file, counted from 1, that a row stands on.
  std::int64_t line_of(std::int64_t row) const noexcept { return row + 2; }
  bool has(std::string_view name) const noexcept;
  /// Index of a column; throws Error where there is none of this name.
  std::size_t column(std::string_view name) const;
  std::string_view text(std::int64_t row, std::size_t column) const;
  /// NaN where the field is empty; throws Error where it is no number.
  double number(std::int64_t row, std::size_t column) const;
  /// Of all rows.
  std::vector<double> numbers(std::string_view name) const;
  /// Throws Error unless there are so many rows, as another file says.
  void require_rows(std::int64_t expected, const std::string& who_says_so) const;

 private:
  std::filesystem::path file_;
  std::string maker_, text_;
  std::vector<std::string> header_;
  std::vector<std::string_view> fields_;
};

/// A whole file of JSON; throws Error with the line where it is none, or is cut off.
Json read_json(const std::filesystem::path& file, const std::string& maker);
/// One line of a file of JSON lines.
Json parse_json_line(std::string_view line, const std::filesystem::path& file, std::int64_t number,
                     const std::string& maker);
/// A member that has to be there; throws Error naming file and key.
const Json& member(const Json& json, const char* key, const std::filesystem::path& file, const std::string& maker);

/// A number that is seen, not computed with: seven digits, and four decimals at least. NaN becomes null.
Json seen(double value);
/// With so many significant digits.
Json seen(double value, int digits);

/// 12,345
std::string counted(std::int64_t count);

/// Adds to the list of what a reader has to know.
void add_note(Json& notes, const char* about, const std::string& text);

/// Rows of a set of columns of equal length that show all of their extremes: of each stretch of rows those where a
/// column is least or largest, with the first and the last row. All of them where they are at most `most`. Columns may
/// have NaNs.
struct Thinned {
  std::vector<std::size_t> rows;
  std::size_t stretch = 1;  ///< rows of a stretch; 1: nothing was left out
};
Thinned thin(const std::vector<const std::vector<double>*>& columns, std::size_t count, std::size_t most);

/// The chosen rows of a column, as they are seen.
Json column_of(const std::vector<double>& values, const std::vector<std::size_t>& rows);

/// How often solves took how long [us], in bins of equal ratio, from every one of them that took any time.
Json times_histogram(const std::vector<double>& times);

}  // namespace rhec::sim
