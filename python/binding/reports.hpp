#pragma once

#include <pybind11/pybind11.h>

#include <optional>

#include "rhec/core/base/clock.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec::python {

/// When a call has to stop that may take so many seconds.
Clock::time_point deadline_in(std::optional<double> seconds);
/// Largest components of a KKT residual, and the largest of these.
pybind11::dict dict_of(const KktResidual& residual);

}  // namespace rhec::python
