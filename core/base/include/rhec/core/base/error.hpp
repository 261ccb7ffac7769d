#pragma once

#include <stdexcept>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// An error that the user can correct: the text names the file and line or the key, what was expected, and what to do.
/// Thrown by set-up code only; nothing that runs inside a control loop throws.
class RHEC_EXPORT Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace rhec
