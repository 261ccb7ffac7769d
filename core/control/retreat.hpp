#pragma once

#include "rhec/core/control/path.hpp"

namespace rhec {

/// The way out for a vehicle that its limits keep from going on along a path, as at the edge of a corridor, looking
/// out of it: against the path's direction, beside it as it is driven anyway, until the vehicle is aligned with the
/// path. What keeps the vehicle off its limits meanwhile is the controller's problem, as on the path.
///
/// Its places are those of the path [m], which become less. Neither allocates nor throws.
class Retreat {
 public:
  /// The vehicle looks away from the path by less than this when it is over, by less than `most_off` when it begins,
  /// and never by more than `lost` [rad].
  static constexpr double aligned = 0.05, most_off = 1.9, lost = 2.4;

  /// Begins at an arc length of a section, at a speed >= 0 [m/s], for a vehicle whose heading is off the path's by an
  /// angle [rad]. False: it is aligned, or looks away too far, or the section has no room behind the vehicle.
  bool begin(const Path& path, int section, double arc_length, double speed, double heading_error) noexcept;
  void end() noexcept { is_under_way_ = false; }
  bool is_under_way() const noexcept { return is_under_way_; }

  /// Moves on with the vehicle, whose heading is off the path's by an angle [rad]. It has ended where the vehicle is
  /// aligned, looks away too far, or the section begins, or it has been driven for as long as it may be.
  void advance(const Path& path, double x, double y, double heading) noexcept;
  double arc_length() const noexcept { return place_; }  ///< where the vehicle is [m]
  double arc_length_after(double arc_length, double time) const noexcept;
  PathPoint point_at(const Path& path, double arc_length) const noexcept;

 private:
  double place_ = 0.0, last_ = 0.0;  ///< [m], and where it ends at the latest
  double speed_ = 0.0;               ///< [m/s]
  bool is_under_way_ = false;
};

}  // namespace rhec
