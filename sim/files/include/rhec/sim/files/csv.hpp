#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

enum class CsvHeader {
  none,      ///< every line is data
  required,  ///< the first line names the columns
  optional   ///< the first line names the columns if no field of it is a number
};

struct CsvOptions {
  CsvHeader header = CsvHeader::none;
  int columns = 0;              ///< required number of columns; 0: that of the first line
  std::int64_t first_line = 1;  ///< line of the file at which the text given to `parse_csv` starts
};

/// Numbers in rows and columns. A missing value is a NaN.
struct CsvTable {
  std::string name;                   ///< of the file, for messages
  std::vector<std::string> header;    ///< names of the columns; empty without a header
  std::vector<double> values;         ///< row after row
  std::vector<std::int64_t> missing;  ///< number of missing values, one count per column
  std::int64_t first_row_line = 1;    ///< line number of row 0 in the file, from 1

  int columns() const noexcept { return static_cast<int>(missing.size()); }
  std::int64_t rows() const noexcept { return missing.empty() ? 0 : std::ssize(values) / std::ssize(missing); }
  /// Row and column are counted from 0.
  double at(std::int64_t row, int column) const { return values[static_cast<std::size_t>(row * columns() + column)]; }
  std::int64_t line_of(std::int64_t row) const noexcept { return first_row_line + row; }
};

/// Reads numbers separated by commas. An empty field or the word nan means 'missing'; blanks around a field, a sign
/// '+', Windows line ends and a byte-order mark are accepted; anything else is an error: a line with more or fewer
/// fields than the first one, a blank line within the data, a field that is not a finite number. Throws Error naming
/// file, line and what was found there.
RHEC_EXPORT CsvTable read_csv(const std::filesystem::path& file, const CsvOptions& options = {});
/// Parses text in memory; messages use `name` as the file name.
RHEC_EXPORT CsvTable parse_csv(std::string_view text, const std::string& name, const CsvOptions& options = {});

/// A whole file as text. Throws Error naming the file and the reason.
RHEC_EXPORT std::string read_text(const std::filesystem::path& file);

/// Throws Error, naming the line, if the times in a column run backwards or one is missing. Equal times are allowed: a
/// logger may write several rows at once.
RHEC_EXPORT void check_time_order(const CsvTable& table, int column = 0);

}  // namespace rhec::sim
