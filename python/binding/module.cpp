// The module rhec._rhec: what the package rhec is made of.
#include <pybind11/pybind11.h>

#include <cstddef>
#include <exception>
#include <string>

#include "binding.hpp"
#include "rhec/core/base/error.hpp"

namespace {

namespace py = pybind11;

/// The package's own class: it finds file, line and key in the text.
void raise(const char* name, const rhec::Error& error) {
  const py::object type = py::module_::import("rhec._errors").attr(name);
  PyErr_SetObject(type.ptr(), py::str(error.what()).ptr());
}

void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const rhec::python::ArgumentError& error) {
    raise("ArgumentError", error);
  } catch (const rhec::Error& error) {
    raise("Error", error);
  }
}

/// What is raised is an exception of Python's.
void raise(const py::object& exception) {
  PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(exception.ptr())), exception.ptr());
}

/// What pybind11 calls all functions by; set once, when the module is made.
PyCFunctionWithKeywords dispatch = nullptr;

/// Where arguments do not fit, pybind11 lists the signatures that do; the package says which argument does not.
PyObject* dispatch_in_words(PyObject* self, PyObject* given, PyObject* named) {
  PyObject* made = dispatch(self, given, named);
  if (made != nullptr || PyErr_Occurred() != PyExc_TypeError) return made;
  py::error_already_set mistake;
  try {
    const auto text = py::str(mistake.value()).cast<std::string>();
    const std::size_t name_end = text.find("(): incompatible ");
    if (name_end == std::string::npos || name_end != text.find('(')) {
      mistake.restore();
      return nullptr;
    }
    const py::object words = named == nullptr ? py::none() : py::reinterpret_borrow<py::object>(named);
    raise(
        py::module_::import("rhec._arguments").attr("refusal")(text, py::reinterpret_borrow<py::object>(given), words));
  } catch (py::error_already_set& other) {
    other.restore();
  }
  return nullptr;
}

/// Only functions of pybind11 that are called this way: other ones stay as they are.
void tell_in_words(py::handle function) {
  PyObject* plain = function.ptr();
  if (PyInstanceMethod_Check(plain)) plain = PyInstanceMethod_GET_FUNCTION(plain);
  if (Py_IS_TYPE(plain, &PyStaticMethod_Type)) {
    tell_in_words(function.attr("__func__"));
    return;
  }
  if (!PyCFunction_Check(plain)) return;
  PyMethodDef& about = *reinterpret_cast<PyCFunctionObject*>(plain)->m_ml;
  if (about.ml_flags != (METH_VARARGS | METH_KEYWORDS)) return;
  const auto called = reinterpret_cast<PyCFunctionWithKeywords>(reinterpret_cast<void (*)()>(about.ml_meth));
  if (called == &dispatch_in_words) return;
  dispatch = called;
  about.ml_meth = reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(&dispatch_in_words));
}

void tell_in_words(const py::module_& module) {
  for (const auto& [name, value] : module.attr("__dict__").cast<py::dict>()) {
    tell_in_words(value);
    if (!PyType_Check(value.ptr())) continue;
    for (const auto& [member_name, member] : py::dict(value.attr("__dict__"))) tell_in_words(member);
  }
}

/// Of a class whose objects only C++ makes.
void refuse_constructors(const py::module_& module) {
  for (const auto& [name, value] : module.attr("__dict__").cast<py::dict>()) {
    if (!PyType_Check(value.ptr())) continue;
    // pybind11's own one is a slot of the type.
    if (!Py_IS_TYPE(value.attr("__init__").ptr(), &PyWrapperDescr_Type)) continue;
    const auto of = name.cast<std::string>();
    py::setattr(value, "__init__", py::cpp_function([of](const py::args&, const py::kwargs&) {
                  raise(py::module_::import("rhec._arguments").attr("without_constructor")(of));
                  throw py::error_already_set();
                }));
  }
}

/// pybind11 would give memory to an object that __new__ has made and __init__ has not, and take what is in it for an
/// object.
void* refuse_memory(std::size_t) {
  throw rhec::python::ArgumentError("an object that was not made; call its class, not __new__");
}

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
  refuse_constructors(module);
  tell_in_words(module);
}
