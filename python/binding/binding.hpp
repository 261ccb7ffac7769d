#pragma once

#include <pybind11/pybind11.h>

#include <string>

#include "rhec/core/base/error.hpp"

namespace rhec::python {

/// An argument that a function does not take; rhec.ArgumentError in Python.
class ArgumentError : public Error {
 public:
  using Error::Error;
};

/// A dict that says what it has where a name is unknown.
inline pybind11::object named(const pybind11::dict& values) {
  return pybind11::module_::import("rhec._errors").attr("Names")(values);
}

/// The method by which copy and pickle would take an object apart, of a class whose objects stay where they are;
/// `instead` says what to do.
inline auto not_copied(const char* instead) {
  return [instead](const pybind11::object& self, int) -> pybind11::object {
    const auto name = pybind11::str(pybind11::type::of(self).attr("__name__")).cast<std::string>();
    throw pybind11::type_error("cannot pickle or copy an object of the class " + name + "; " + instead);
  };
}

// Each adds to the module what one source of this folder is about.
void bind_settings(pybind11::module_& module);
void bind_hosts(pybind11::module_& module);
void bind_models(pybind11::module_& module);
void bind_robots(pybind11::module_& module);
void bind_estimators(pybind11::module_& module);
void bind_controllers(pybind11::module_& module);
void bind_problems(pybind11::module_& module);
void bind_studies(pybind11::module_& module);
void bind_drives(pybind11::module_& module);
void bind_log_files(pybind11::module_& module);
void bind_logs(pybind11::module_& module);
void bind_runs(pybind11::module_& module);

}  // namespace rhec::python
