#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/logs/signals/clock.hpp"

namespace rhec::logs {

struct CsvColumn {
  std::string name;         ///< without its unit
  std::string unit;         ///< as in brackets behind the name, or in a line of units
  std::string text;         ///< the whole cell of the header
  char decimal_mark = '.';  ///< of its numbers
};

/// How a table is written: what separates cells, the columns, and where the lines of data begin.
struct CsvLayout {
  std::string file;
  char separator = ',';
  std::vector<CsvColumn> columns;
  int header_lines = 1;  ///< lines before the first one of data
  int clock = -1;        ///< the column that says when a line was measured; -1: none is called so
  int received = -1;     ///< the column that says when it became known

  std::vector<std::string> names() const;
  /// By name, or by the whole cell of the header; -1: there is none.
  int find(std::string_view name) const;
  /// Throws Error that suggests the nearest name.
  int column(std::string_view name) const;
  /// Throws Error for one that no clock has.
  ClockUnit unit_of_clock(int column) const;
};

/// Of the first lines of a file. Throws Error if there is no header.
CsvLayout csv_layout(const std::string& file, const std::vector<std::string>& first_lines);

/// Without blanks and quotes around it.
std::string_view trimmed_cell(std::string_view text);
/// The end of the cell that a line begins with; a separator within quotes is text.
std::size_t csv_cell_end(std::string_view line, char separator);
/// A number, NaN where it is missing; false for anything else.
bool read_csv_number(std::string_view cell, char decimal_mark, double& value);

/// Calls `visit(cell, number)` for each cell, and returns how many there are.
template <class Visit>
std::size_t for_each_cell(std::string_view line, char separator, const Visit& visit) {
  for (std::size_t count = 0;; ++count) {
    const std::size_t end = csv_cell_end(line, separator);
    visit(trimmed_cell(line.substr(0, end)), count);
    if (end == std::string_view::npos) return count + 1;
    line.remove_prefix(end + 1);
  }
}

}  // namespace rhec::logs
