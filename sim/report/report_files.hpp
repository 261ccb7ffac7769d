#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/sim/files/json.hpp"

namespace rhec::sim {

/// A comma-separated results file with a header line, as rhec writes it. Errors name the file, the line and what to do.
class ResultTable {
 public:
  /// Throws Error for a file that is missing, empty, ends within a row, or has rows of unequal length. `maker` is the
  /// command that makes such files.
  ResultTable(std::filesystem::path file, std::string maker);

  const std::filesystem::path& file() const noexcept { return file_; }
  const std::vector<std::string>& header() const noexcept { return header_; }
  std::int64_t rows() const noexcept { return std::ssize(fields_) / std::ssize(header_); }
  /// Line number of a row in the file, from 1.
  std::int64_t line_of(std::int64_t row) const noexcept { return row + 2; }
  bool has(std::string_view name) const noexcept;
  /// Index of a column; throws Error if there is none of this name.
  std::size_t column(std::string_view name) const;
  std::string_view text(std::int64_t row, std::size_t column) const;
  /// NaN for an empty field; throws Error if it is not a number.
  double number(std::int64_t row, std::size_t column) const;
  /// The numbers of all rows.
  std::vector<double> numbers(std::string_view name) const;
  /// Throws Error unless the row count is the one that another file states.
  void require_rows(std::int64_t expected, const std::string& who_says_so) const;

 private:
  std::filesystem::path file_;
  std::string maker_, text_;
  std::vector<std::string> header_;
  std::vector<std::string_view> fields_;
};

/// Reads a whole JSON file; throws Error with the line if it is invalid or truncated.
Json read_json(const std::filesystem::path& file, const std::string& maker);
/// Parses one line of a JSON Lines file.
Json parse_json_line(std::string_view line, const std::filesystem::path& file, std::int64_t number,
                     const std::string& maker);
/// A required member; throws Error, naming file and key, if it is missing.
const Json& member(const Json& json, const char* key, const std::filesystem::path& file, const std::string& maker);

/// Members of a JSON document of which nobody knows who wrote it. Errors name the file, the place in it, and what was
/// expected.
class RequiredMembers {
 public:
  /// `expected`: what the file should be, and what makes it.
  RequiredMembers(std::filesystem::path file, std::string expected);
  /// The member `key` of what is at `place` (empty: the whole); throws Error unless it is there and of this kind. An
  /// integer is a number, too.
  const Json& get(const Json& json, const std::string& key, Json::Kind kind, const std::string& place = {}) const;
  /// Throws Error.
  [[noreturn]] void refuse(const std::string& what) const;

 private:
  std::filesystem::path file_;
  std::string expected_;
};

/// A number for display only: seven digits, at least four decimals. NaN becomes null.
Json seen(double value);
/// With `digits` significant digits.
Json seen(double value, int digits);

/// 12,345
std::string counted(std::int64_t count);

/// Adds a note for the report's reader.
void add_note(Json& notes, const char* about, const std::string& text);

/// A selection of rows from columns of equal length that keeps all extremes: from each stretch, the rows where a column
/// is smallest or largest, plus the first and last row. All rows if there are at most `most`. Columns may have NaNs.
struct Thinned {
  std::vector<std::size_t> rows;
  std::size_t stretch = 1;  ///< rows of a stretch; 1: nothing was left out
};
Thinned thin(const std::vector<const std::vector<double>*>& columns, std::size_t count, std::size_t most);

/// The selected rows of a column, formatted for display.
Json column_of(const std::vector<double>& values, const std::vector<std::size_t>& rows);

/// Histogram of solve times [us] with logarithmic bins, over all positive times.
Json times_histogram(const std::vector<double>& times);

}  // namespace rhec::sim
