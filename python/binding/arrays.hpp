#pragma once

#include <pybind11/numpy.h>

#include <cstddef>
#include <string_view>
#include <vector>

#include "rhec/core/model/model.hpp"

namespace rhec::python {

namespace py = pybind11;

/// What a call is given: anything that numpy makes an array of doubles of.
using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Shape = std::vector<py::ssize_t>;

/// A read-only view, row after row, of numbers that belong to `owner`, which it keeps alive.
py::array view(const double* numbers, const Shape& shape, py::handle owner);
/// A new array with these numbers, row after row.
py::array copy(const double* numbers, const Shape& shape);
inline py::array copy(const std::vector<double>& numbers) {
  return copy(numbers.data(), {static_cast<py::ssize_t>(numbers.size())});
}

/// The numbers of a vector with one entry for each of these variables. Throws Error that names `what` and the variables
/// otherwise.
const double* vector_of(const Numbers& given, const std::vector<Variable>& variables, std::string_view what);
/// The same for rows of such vectors, or one of them; and how many rows there are.
py::ssize_t rows_of(const Numbers& given, std::size_t width, std::string_view what);

}  // namespace rhec::python
