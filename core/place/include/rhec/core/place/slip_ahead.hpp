#pragma once

#include "rhec/core/base/export.hpp"

namespace rhec {

/// What slip to expect at places that the vehicle is about to reach, for a controller.
class RHEC_EXPORT SlipAhead {
 public:
  virtual ~SlipAhead() = default;
  /// The change of every parameter from the vehicle's place `here` to a place `there` (x, y [m]), `distance` metres
  /// further on its way; 0 where nothing is known. Given are the parameters at `here` (n_p), written the changes (n_p).
  virtual void change(const double* here, const double* there, double distance, const double* parameters,
                      double* change) const noexcept = 0;
};

}  // namespace rhec
