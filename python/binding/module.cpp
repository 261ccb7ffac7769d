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

/// That of a function, a method, a static method or an accessor of a property which pybind11 has made; null of all
/// else.
PyCFunctionObject* function_of(PyObject* value) {
  if (PyInstanceMethod_Check(value)) value = PyInstanceMethod_GET_FUNCTION(value);
  if (!PyCFunction_Check(value)) return nullptr;
  auto* const function = reinterpret_cast<PyCFunctionObject*>(value);
  return function->m_ml->ml_flags == (METH_VARARGS | METH_KEYWORDS) ? function : nullptr;
}

/// What pybind11 calls for every function.
PyCFunctionWithKeywords dispatcher() {
  static const auto found = [] {
    const py::cpp_function any([] {});
    const PyCFunctionObject* function = function_of(any.ptr());
    return function ? reinterpret_cast<PyCFunctionWithKeywords>(reinterpret_cast<void*>(function->m_ml->ml_meth))
                    : nullptr;
  }();
  return found;
}

/// Calls what pybind11 would call, and says in the package's words what a function expects that refuses its arguments.
/// A call that is not refused takes no longer.
PyObject* call_in_words(PyObject* self, PyObject* arguments, PyObject* by_name) {
  PyObject* const made = dispatcher()(self, arguments, by_name);
  if (made || !PyErr_ExceptionMatches(PyExc_TypeError)) return made;
  py::error_already_set refused;
  if (refused.trace()) {  // raised in Python, by what the function has called
    refused.restore();
    return nullptr;
  }
  try {
    const py::object words = py::module_::import("rhec._arguments")
                                 .attr("in_words")(py::str(refused.value()), py::handle(arguments),
                                                   by_name ? py::handle(by_name) : py::none());
    if (words.is_none())
      refused.restore();
    else
      raise(words);
  } catch (py::error_already_set&) {
    refused.restore();
  }
  return nullptr;
}

void speak_of_arguments(const py::handle& holder) {
  for (const auto& [name, value] : holder.attr("__dict__").attr("copy")().cast<py::dict>()) {
    py::object callable = py::reinterpret_borrow<py::object>(value);
    if (Py_TYPE(value.ptr()) == &PyStaticMethod_Type) callable = value.attr("__func__");
    if (PyCFunctionObject* const function = function_of(callable.ptr());
        function && reinterpret_cast<void*>(function->m_ml->ml_meth) == reinterpret_cast<void*>(dispatcher()))
      function->m_ml->ml_meth = reinterpret_cast<PyCFunction>(reinterpret_cast<void*>(&call_in_words));
    if (PyType_Check(value.ptr())) speak_of_arguments(value);
  }
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
  rhec::python::bind_log_files(module);
  rhec::python::bind_logs(module);
  rhec::python::bind_drives(module);
  rhec::python::bind_runs(module);
  refuse_what_was_not_made(module);
  refuse_constructors(module);
  speak_of_arguments(module);
}
