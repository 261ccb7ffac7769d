#pragma once

#include <span>

#include "rhec/core/base/export.hpp"
#include "rhec/core/base/infinity.hpp"

namespace rhec {

class TermWriter;

/// An ellipse on the ground that moves with a constant velocity.
struct Obstacle {
  double x = 0.0, y = 0.0;                    ///< centre [m]
  double semi_axis_along = 0.0;               ///< in the direction of `heading` [m]
  double semi_axis_across = 0.0;              ///< [m]
  double heading = 0.0;                       ///< [rad]
  double velocity_x = 0.0, velocity_y = 0.0;  ///< [m/s]
};

/// Where and when a node of the horizon is expected: what the data of terms are made of.
struct TermPlace {
  double time = 0.0;        ///< of the node, on the clock of the estimates [s]
  double x = 0.0, y = 0.0;  ///< reference position [m]
  double heading = 0.0;     ///< direction of the path there, in reverse too [rad]
  double speed = 0.0;       ///< reference speed over ground [m/s]
  double arc_length = 0.0;  ///< along the path [m]
  double left = infinity;   ///< room beside the path, as its waypoints have it [m]
  double right = infinity;
  std::span<const Obstacle> obstacles{};  ///< that were seen at run time, as they were then
  double seen = 0.0;                      ///< when, on the same clock [s]
};

/// Formulas of the state, inputs, parameters and data of a node (TermWriter) that are part of a control problem, at
/// every node at which something can still be decided: limits, which are rows g with lower <= g <= upper, hard or soft;
/// and residuals, whose losses are part of the cost. A term names the vehicle's variables by role, so that it applies
/// to every vehicle that has them. Const and thread-safe.
class RHEC_EXPORT Term {
 public:
  virtual ~Term() = default;
  /// Writes the formulas down, once, in set-up. Throws Error if the vehicle lacks what they need.
  virtual void write(TermWriter& writer) const = 0;
  /// The data of a node, and the bounds of its limits, each in the order in which `write` has asked for them. Bounds
  /// may be infinite.
  virtual void write_data(const TermPlace& place, double* data, double* lower, double* upper) const noexcept = 0;
  /// How many obstacles of a place it regards.
  virtual int most_obstacles() const noexcept { return 0; }
};

}  // namespace rhec
