#pragma once

#include "detour_way.hpp"
#include "rhec/core/control/path.hpp"

namespace rhec {

/// The way out for a vehicle that its limits keep from going on along a path, as at the edge of a corridor, looking
/// out of it: against the path's direction, beside it as it is driven anyway, until the vehicle is aligned with the
/// path. What keeps the vehicle off its limits meanwhile is the controller's problem, as on the path.
///
/// Its places are those of the path [m], which become less.
class Retreat final : public DetourWay {
 public:
  /// The vehicle looks away from the path by less than this when it is over, by less than `most_off` when it begins,
  /// and never by more than `lost` [rad].
  static constexpr double aligned = 0.05, most_off = 1.9, lost = 2.4;

  /// Begins at an arc length of a section, at a speed >= 0 [m/s], for a vehicle whose heading is off the path's by an
  /// angle [rad]. False: it is aligned, or looks away too far, or the section has no room behind the vehicle.
  bool begin(const Path& path, int section, double arc_length, double speed, double heading_error) noexcept;
  void end() noexcept override { is_under_way_ = false; }
  bool is_under_way() const noexcept override { return is_under_way_; }

  /// It has ended where the vehicle is aligned, looks away too far, or the section begins, or it has been driven for as
  /// long as it may be.
  bool advance(const Path& path, const Pose& vehicle, double time) noexcept override;
  bool has_arrived() const noexcept override { return is_aligned_; }
  double arc_length() const noexcept override { return place_; }
  double arc_length_after(double arc_length, double time) const noexcept override;
  PathPoint point_at(const Path& path, double arc_length) const noexcept override;
  double path_beside(const Path& path, double arc_length) const noexcept override;
  std::optional<double> goes_on_at(const Path& path, double x, double y) const noexcept override;

 private:
  double place_ = 0.0, last_ = 0.0;  ///< [m], and where it ends at the latest
  double speed_ = 0.0;               ///< [m/s]
  bool is_under_way_ = false, is_aligned_ = false;
};

}  // namespace rhec
