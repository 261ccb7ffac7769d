#include "arrays.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "rhec/core/base/error.hpp"

namespace rhec::python {
namespace {

/// Of a dense array, row after row. numpy is always told them: what pybind11 assumes of a type's size does not hold for
/// every version of numpy.
Shape strides_of(const Shape& shape) {
  Shape strides(shape.size());
  py::ssize_t step = sizeof(double);
  for (std::size_t i = shape.size(); i-- > 0;) {
    strides[i] = step;
    step *= std::max<py::ssize_t>(shape[i], 1);
  }
  return strides;
}

/// "x [m], beta [rad], mu"
std::string with_units(const std::vector<Variable>& variables) {
  std::vector<std::string> texts;
  texts.reserve(variables.size());
  for (const Variable& each : variables)
    texts.push_back(each.unit == "1" ? each.name : fmt::format("{} [{}]", each.name, each.unit));
  return fmt::format("{}", fmt::join(texts, ", "));
}

}  // namespace

std::string shape_of(const Numbers& given) {
  std::string shape;
  for (py::ssize_t i = 0; i < given.ndim(); ++i) shape += fmt::format("{}{}", i > 0 ? " x " : "", given.shape(i));
  return shape.empty() ? "one number" : "an array of " + shape;
}

py::object doubles_of(py::handle given) {
  if (given.is_none()) return {};  // numpy has a number for it
  py::object plain = py::reinterpret_borrow<py::object>(given);
  if (py::hasattr(plain, "mask") && py::hasattr(plain, "filled"))
    plain = plain.attr("astype")("float64").attr("filled")(NAN);
  const py::array any = py::array::ensure(plain);
  // Objects become numbers one by one, where they can: None is NaN.
  if (!any || std::string_view("biufO").find(any.dtype().kind()) == std::string_view::npos) return {};
  return py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(any);
}

py::array view(const double* numbers, const Shape& shape, py::handle owner) {
  py::array_t<double> made(shape, strides_of(shape), numbers, owner);
  py::detail::array_proxy(made.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return made;
}

py::array copy(const double* numbers, const Shape& shape) {
  py::array_t<double> made(shape, strides_of(shape));
  std::copy_n(numbers, made.size(), made.mutable_data());
  return made;
}

bool all_finite(const Numbers& given) {
  return std::all_of(given.data(), given.data() + given.size(), [](double number) { return std::isfinite(number); });
}

const double* vector_of(const Numbers& given, const std::vector<Variable>& variables, std::string_view what) {
  if (given.ndim() == 1 && given.size() == static_cast<py::ssize_t>(variables.size())) return given.data();
  throw Error(fmt::format("{}: found {}, expected {} numbers in one dimension: {}", what, shape_of(given),
                          variables.size(), with_units(variables)));
}

py::ssize_t rows_of(const Numbers& given, const std::vector<Variable>& variables, std::string_view what) {
  const auto wanted = static_cast<py::ssize_t>(variables.size());
  if (given.ndim() == 1 && given.shape(0) == wanted) return 1;
  if (given.ndim() == 2 && given.shape(1) == wanted) return given.shape(0);
  throw Error(fmt::format("{0}: found {1}, expected {2} numbers in one dimension, or rows of so many (n x {2}): {3}",
                          what, shape_of(given), wanted, with_units(variables)));
}

}  // namespace rhec::python
