#pragma once

#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// A point on the path, and the speed there.
struct Waypoint {
  double x = 0.0;      ///< [m]
  double y = 0.0;      ///< [m]
  double speed = 0.0;  ///< reference speed over ground [m/s]
};

/// A point of the path with its direction and reference speed.
struct PathPoint {
  double x = 0.0;        ///< [m]
  double y = 0.0;        ///< [m]
  double heading = 0.0;  ///< of the segment [rad], in (-pi, pi]; at a waypoint that of the next segment
  double speed = 0.0;    ///< reference speed over ground [m/s]
};

/// The point of a path that is closest to a given position.
struct PathProjection {
  double arc_length = 0.0;  ///< of the closest point [m]
  double lateral = 0.0;     ///< distance to it [m]; positive if the position is left of the path
};

/// Straight segments through waypoints, parametrised by arc length, with a reference speed that varies linearly along
/// each. The first and last segments extend beyond their ends without limit (at the speed of that waypoint), so that a
/// horizon can look past the end. Const calls are thread-safe and neither allocate nor throw.
class RHEC_EXPORT Path {
 public:
  /// Drops a waypoint that coincides with the one before it. Throws Error, naming the waypoint (counted from 1), for
  /// values that are not finite, and for fewer than two distinct points.
  explicit Path(const std::vector<Waypoint>& waypoints);

  /// Number of distinct waypoints, at least 2.
  int size() const noexcept { return static_cast<int>(x_.size()); }
  /// Arc length from the first waypoint to the last [m].
  double length() const noexcept { return arc_lengths_.back(); }
  /// The largest reference speed of a waypoint [m/s].
  double top_speed() const noexcept;

  /// The point at an arc length [m], by a binary search.
  PathPoint point_at(double arc_length) const noexcept;
  /// The same for a sequence of nearby points: found without a search if the point lies on or near the segment of the
  /// last one, whose number is kept in `segment` (initially arbitrary).
  PathPoint point_at(double arc_length, int& segment) const noexcept;

  /// The closest point to (x, y) among those with an arc length in [from, to] [m], with from <= to: an exact projection
  /// on segments, at a cost that grows only with the number of waypoints in that range. The first of equally close
  /// points.
  PathProjection closest(double x, double y, double from, double to) const noexcept;

 private:
  int segment_at(double arc_length) const noexcept;
  int segment_near(int known, double arc_length) const noexcept;
  PathPoint point_on(int segment, double arc_length) const noexcept;

  std::vector<double> x_, y_, speeds_, arc_lengths_;  // one per waypoint
  std::vector<double> direction_x_, direction_y_;     // unit vectors, one per segment
  std::vector<double> headings_;                      // one per segment
};

/// Follows a path along with a vehicle: each search for the closest point is limited to a window near the last one, so
/// that a path that crosses or approaches itself is never cut short (docs/method.md, section 3).
class RHEC_EXPORT PathFollower {
 public:
  struct Window {
    double ahead = 8.0;   ///< [m] must exceed what the vehicle travels between two calls
    double behind = 1.0;  ///< [m] allows for noise in the position
  };

  /// `path` must outlive the follower. Throws Error if `ahead` is not positive or `behind` is negative.
  explicit PathFollower(const Path& path) : PathFollower(path, Window{}) {}
  PathFollower(const Path& path, Window window);

  /// Moves to the closest point of the window and returns its arc length [m]: at least 0, and more than the path's
  /// length once the end is passed. Stays at its place if the position is not finite.
  double advance(double x, double y) noexcept;
  /// Moves to an arc length [m], by default to the start.
  void reset(double arc_length = 0.0) noexcept { last_ = {.arc_length = arc_length}; }

  double arc_length() const noexcept { return last_.arc_length; }
  /// Signed distance of the last position from the path [m], positive to the left: the tracking error.
  double lateral() const noexcept { return last_.lateral; }
  /// True if the last position was at or beyond the path's end.
  bool finished() const noexcept { return last_.arc_length >= path_->length(); }
  const Path& path() const noexcept { return *path_; }

 private:
  const Path* path_;
  Window window_;
  PathProjection last_;
};

}  // namespace rhec
