#pragma once

#include <memory>

#include "rhec/core/model/model.hpp"

namespace rhec::python {

/// A vehicle's model, as Python has it.
struct Vehicle {
  std::shared_ptr<const Model> model;
  ModelDescription about;  ///< with the bounds of its robot, where it has one
};

}  // namespace rhec::python
