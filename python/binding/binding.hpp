#pragma once

#include <pybind11/pybind11.h>

namespace rhec::python {

// Each adds to the module what one source of this folder is about.
void bind_settings(pybind11::module_& module);
void bind_hosts(pybind11::module_& module);
void bind_models(pybind11::module_& module);
void bind_robots(pybind11::module_& module);
void bind_estimators(pybind11::module_& module);
void bind_controllers(pybind11::module_& module);
void bind_problems(pybind11::module_& module);
void bind_studies(pybind11::module_& module);
void bind_logs(pybind11::module_& module);
void bind_runs(pybind11::module_& module);

}  // namespace rhec::python
