#pragma once

#include <pybind11/numpy.h>

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/model/model.hpp"

namespace rhec::python {

namespace py = pybind11;

/// What a call is given: anything that numpy makes an array of doubles of. One that is such an array is taken as it is.
struct Numbers : py::array_t<double, py::array::c_style | py::array::forcecast> {
  using array_t::array_t;
};
using Shape = std::vector<py::ssize_t>;

/// An array of doubles, row after row, of what numpy makes an array of; none of what is no real numbers: texts, dates,
/// complex ones. What a mask hides is NaN.
py::object doubles_of(py::handle given);
/// A read-only view, row after row, of numbers that belong to `owner`, which it keeps alive.
py::array view(const double* numbers, const Shape& shape, py::handle owner);
/// A new array with these numbers, row after row.
py::array copy(const double* numbers, const Shape& shape);
inline py::array copy(const std::vector<double>& numbers) {
  return copy(numbers.data(), {static_cast<py::ssize_t>(numbers.size())});
}

/// Whether none of them is NaN or infinite.
bool all_finite(const Numbers& given);
/// The numbers of a vector with one entry for each of these variables. Throws Error that names `what` and the variables
/// otherwise.
const double* vector_of(const Numbers& given, const std::vector<Variable>& variables, std::string_view what);
/// The same for rows of such vectors, or one of them; and how many rows there are.
py::ssize_t rows_of(const Numbers& given, const std::vector<Variable>& variables, std::string_view what);
/// "an array of 2 x 3", or "one number".
std::string shape_of(const Numbers& given);

}  // namespace rhec::python

template <>
struct pybind11::detail::type_caster<rhec::python::Numbers> {
  PYBIND11_TYPE_CASTER(rhec::python::Numbers, const_name("numpy.ndarray[numpy.float64]"));

  /// pybind11's own way asks numpy in any case, which takes as long as the rest of a call.
  static bool is_plain(handle source) {
    if (Py_TYPE(source.ptr()) != npy_api::get().PyArray_Type_) return false;
    const auto* array = array_proxy(source.ptr());
    constexpr int wanted = npy_api::NPY_ARRAY_C_CONTIGUOUS_ | npy_api::NPY_ARRAY_ALIGNED_;
    const auto* type = array_descriptor_proxy(array->descr);
    return (array->flags & wanted) == wanted && type->type_num == npy_api::NPY_DOUBLE_ && type->byteorder == '=';
  }
  bool load(handle source, bool convert) {
    if (is_plain(source)) {
      value = reinterpret_borrow<rhec::python::Numbers>(source);
      return true;
    }
    if (!convert) return false;
    object made = rhec::python::doubles_of(source);
    if (!made) return false;
    value = reinterpret_steal<rhec::python::Numbers>(made.release());
    return true;
  }
};
