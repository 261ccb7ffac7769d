// The module rhec._rhec: what the package rhec is made of.
#include <pybind11/pybind11.h>

#include <cstddef>
#include <exception>

#include "binding.hpp"
#include "rhec/core/base/error.hpp"

namespace {

namespace py = pybind11;

/// The package's own class: it finds file, line and key in the text.
void raise(const rhec::Error& error) {
  const py::object type = py::module_::import("rhec._errors").attr("Error");
  PyErr_SetObject(type.ptr(), py::str(error.what()).ptr());
}

void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const rhec::Error& error) {
    raise(error);
  }
}

/// pybind11 would give memory to an object that __new__ has made and __init__ has not, and take what is in it for an
/// object.
void* refuse_memory(std::size_t) { throw py::type_error("an object that was not made; call its class, not __new__"); }

void refuse_what_was_not_made(const py::module_& module) {
  for (const auto& [name, value] : module.attr("__dict__").cast<py::dict>())
    if (PyType_Check(value.ptr()))
      if (auto* type = py::detail::get_type_info(reinterpret_cast<PyTypeObject*>(value.ptr())))
        type->operator_new = &refuse_memory;
}

}  // namespace

PYBIND11_MODULE(_rhec, module) {
  module.doc() = "What the package rhec is made of. Use the package: its names are those that stay.";
  module.attr("version") = RHEC_VERSION;
  py::register_exception_translator(&translate);
  rhec::python::bind_settings(module);
  rhec::python::bind_hosts(module);
  rhec::python::bind_models(module);
  rhec::python::bind_robots(module);
  rhec::python::bind_estimators(module);
  rhec::python::bind_controllers(module);
  rhec::python::bind_problems(module);
  rhec::python::bind_studies(module);
  rhec::python::bind_logs(module);
  rhec::python::bind_runs(module);
  refuse_what_was_not_made(module);
}
