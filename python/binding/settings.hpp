#pragma once

#include <pybind11/pybind11.h>

#include <string>

#include "rhec/core/config/settings.hpp"

namespace rhec::python {

/// A configuration of Python's own objects: None, bool, int, float, str, and lists, tuples and dicts of them; what has
/// an `item` method (a number of numpy) or a `tolist` method (an array) counts as what that returns. Throws Error, with
/// the key, for anything else.
Settings settings_of(pybind11::handle object, const std::string& origin);
/// The opposite: scalars become what they read as.
pybind11::object object_of(const Settings& settings);

}  // namespace rhec::python
