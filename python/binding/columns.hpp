#pragma once

#include <pybind11/numpy.h>

#include <cstdint>
#include <string>
#include <vector>

#include "arrays.hpp"

namespace rhec::python {

/// A table of named columns, each filled by a function of a row.
template <class Row>
class Columns {
 public:
  explicit Columns(const std::vector<Row>& rows) : rows_(rows) {}

  template <class Function>
  void numbers(const std::string& name, const Function& value_of) {
    std::vector<double> values;
    values.reserve(rows_.size());
    for (const Row& row : rows_) values.push_back(value_of(row));
    made_[py::str(name)] = copy(values);
  }
  /// One column for each of these variables, NaN where a row has no such entry.
  template <class Function>
  void variables(const std::string& prefix, const std::vector<Variable>& variables, const Function& vector_of_row,
                 std::size_t first = 0) {
    for (std::size_t j = 0; j < variables.size(); ++j)
      numbers(prefix + variables[j].name, [&](const Row& row) {
        const auto& values = vector_of_row(row);
        const auto at = static_cast<decltype(values.size())>(first + j);
        return at < values.size() ? values[at] : NAN;
      });
  }
  /// Of objects that numpy finds the type of: texts, flags, integers.
  template <class Function>
  void objects(const std::string& name, const Function& value_of) {
    py::list values;
    for (const Row& row : rows_) values.append(value_of(row));
    made_[py::str(name)] = py::module_::import("numpy").attr("array")(values);
  }
  py::dict take() { return std::move(made_); }

 private:
  const std::vector<Row>& rows_;
  py::dict made_;
};

}  // namespace rhec::python
