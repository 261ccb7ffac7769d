#pragma once

#include "detour_way.hpp"
#include "dubins_path.hpp"
#include "rhec/core/control/path.hpp"

namespace rhec {

/// How a vehicle turns.
struct TurningCircle {
  double radius = 0.0;    ///< [m], of arcs that it can drive
  double speed = 0.0;     ///< [m/s], at which it does
  double steering = 0.0;  ///< for how long it steers until it does [s]
};

/// How far a place is beyond the room that the path has beside it [m]; 0: it is not.
double beyond_room(const Path& path, const PathProjection& place) noexcept;

/// The way back to a path for a vehicle that looks away from it. It is a DubinsPath with arcs that the vehicle can
/// drive, to that place further on where this way and the part of the path that is left out are shortest together. It
/// is driven at one speed, in the direction of the path there: in reverse where the path is.
///
/// Its places are counted as if it were the end of the path: the arc length at its end is that of the path there, and
/// from there on it is the path.
class Approach final : public DetourWay {
 public:
  /// Begins where the vehicle is, with its heading, to the path at an arc length or further on in that section. Where
  /// the path has room beside it, the way keeps to it as far as the vehicle does now. False: there is no such way.
  bool begin(const Path& path, int section, double arc_length, const Pose& vehicle, const TurningCircle& turn) noexcept;
  void end() noexcept override { is_under_way_ = false; }
  bool is_under_way() const noexcept override { return is_under_way_; }

  /// A vehicle that is not on its way any more looks away from that, too, or is elsewhere, as where an estimate has
  /// jumped.
  bool advance(const Path& path, const Pose& vehicle, double time) noexcept override;
  bool has_arrived() const noexcept override { return done_ >= way_.length(); }
  /// Where the vehicle is, and where the approach ends [m].
  double arc_length() const noexcept override { return target_ - way_.length() + done_; }
  double target() const noexcept { return target_; }
  double arc_length_after(double arc_length, double time) const noexcept override;
  PathPoint point_at(const Path& path, double arc_length) const noexcept override;
  double path_beside(const Path& path, double arc_length) const noexcept override;
  std::optional<double> goes_on_at(const Path& path, double x, double y) const noexcept override;
  /// The place of the path that is closest to one of this way.
  PathProjection beside(const Path& path, double x, double y) const noexcept;

 private:
  bool has_room(const Path& path) const noexcept;

  DubinsPath way_;
  TurningCircle turn_;
  double target_ = 0.0, done_ = 0.0;  ///< [m]
  double first_ = 0.0, last_ = 0.0;   ///< where the section begins and ends [m]
  bool in_reverse_ = false;
  bool is_under_way_ = false;
};

}  // namespace rhec
