#pragma once

#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/base/infinity.hpp"

namespace rhec {

/// A point on the path, and how it is passed.
struct Waypoint {
  double x = 0.0;      ///< [m]
  double y = 0.0;      ///< [m]
  double speed = 0.0;  ///< reference speed over ground [m/s]: negative: in reverse; 0: a stop
  // Room beside the path, as seen along it [m].
  double left = infinity;
  double right = infinity;
};

/// A point of the path with the vehicle's reference there.
struct PathPoint {
  double x = 0.0;           ///< [m]
  double y = 0.0;           ///< [m]
  double heading = 0.0;     ///< of the vehicle [rad], in (-pi, pi]: along the segment, or against it in reverse; at a
                            ///< waypoint that of the next segment
  double speed = 0.0;       ///< reference speed over ground [m/s]; negative in reverse
  double curvature = 0.0;   ///< change of the heading per metre of the path [1/m]
  bool in_reverse = false;  ///< the path leads against the heading
  // Room beside the path, as seen along it [m].
  double left = infinity;
  double right = infinity;
};

/// The point of a path that is closest to a given position.
struct PathProjection {
  double arc_length = 0.0;  ///< of the closest point [m]
  double lateral = 0.0;     ///< distance to it [m]; positive if the position is left of the path
};

/// Straight segments through waypoints, parametrised by arc length, each driven with constant acceleration from the
/// speed of its first waypoint to that of its second: v^2 varies linearly. The first and last segments extend beyond
/// their ends without limit (at the speed of that waypoint), so that a horizon can look past the end.
///
/// A waypoint of speed 0 between others is a stop. There a vehicle may change its direction, from forwards to reverse
/// or back (a cusp). Stops divide the path into sections. Const calls are thread-safe and neither allocate nor throw.
class RHEC_EXPORT Path {
 public:
  /// What lowers the speeds of waypoints [m/s^2].
  struct Limits {
    double acceleration = infinity;          ///< along the path: brakes in time for what comes
    double lateral_acceleration = infinity;  ///< in bends: speed^2 times curvature
  };

  /// Drops a waypoint that coincides with the one before it. Throws Error, naming the waypoint (counted from 1), for
  /// values that are not finite, for room that is negative, and for fewer than two distinct points.
  explicit Path(const std::vector<Waypoint>& waypoints) : Path(waypoints, Limits{}) {}
  Path(const std::vector<Waypoint>& waypoints, const Limits& limits);

  /// Why no vehicle can follow this path, and what to do; empty if one can. It cannot where the speed is 0 along a
  /// whole segment, changes its sign without a stop, or does not change it where the path turns back.
  const std::string& why_not_drivable() const noexcept { return why_not_drivable_; }
  /// The waypoint where it cannot, counted from 1 as given; 0 if it can.
  int obstacle_waypoint() const noexcept { return obstacle_waypoint_; }

  /// Number of distinct waypoints, at least 2.
  int size() const noexcept { return static_cast<int>(x_.size()); }
  /// Arc length from the first waypoint to the last [m].
  double length() const noexcept { return arc_lengths_.back(); }
  /// Time from the first waypoint to the last at the reference speeds, without rest at stops [s].
  double duration() const noexcept { return times_.back(); }
  /// The largest reference speed of a waypoint, in either direction [m/s].
  double top_speed() const noexcept;

  /// The point at an arc length [m], by a binary search.
  PathPoint point_at(double arc_length) const noexcept;
  /// The same for a sequence of nearby points: found without a search if the point lies on or near the segment of the
  /// last one, whose number is kept in `segment` (initially arbitrary).
  PathPoint point_at(double arc_length, int& segment) const noexcept;

  /// Where a vehicle is that has driven on from an arc length [m] for a while [s] at the reference speeds, through
  /// stops without a rest. Beyond an end whose speed is 0 it stays. `segment` as above: of where it starts, then of
  /// where it gets to.
  double arc_length_after(double arc_length, double time, int& segment) const noexcept;
  /// How long it takes to the end of a section at the reference speeds [s].
  double time_to_section_end(double arc_length, int section) const noexcept;

  int section_count() const noexcept { return static_cast<int>(section_ends_.size()); }
  /// Where a section begins and ends [m]. The first one begins at 0, the last one ends at `length()`.
  double section_start(int section) const noexcept { return section > 0 ? section_ends_[section - 1] : 0.0; }
  double section_end(int section) const noexcept { return section_ends_[section]; }
  /// Whether a vehicle comes to rest at the end of a section: always, but perhaps at the end of the path.
  bool stops_after(int section) const noexcept { return section + 1 < section_count() || speeds_.back() == 0.0; }

  /// The closest point to (x, y) among those with an arc length in [from, to] [m], with from <= to: an exact projection
  /// on segments, at a cost that grows only with the number of waypoints in that range. The first of equally close
  /// points.
  PathProjection closest(double x, double y, double from, double to) const noexcept;

  struct Place {
    double arc_length = 0.0;
    int section = 0;
  };
  /// What counts in a search over the whole path.
  struct Search {
    double turn_length = 2.0;  ///< a heading that is a radian off is as bad as this distance [m]
    double margin = 1.0;       ///< of places that are worse than the best one by no more than this, the first one [m]
  };
  /// Where on the whole path a vehicle is, with its heading [rad], or NaN if that is not known. At a cost that grows
  /// with the number of waypoints.
  Place locate(double x, double y, double heading, const Search& search) const noexcept;
  Place locate(double x, double y, double heading) const noexcept { return locate(x, y, heading, Search{}); }

 private:
  static int segment_of(const std::vector<double>& of, double value) noexcept;
  int segment_near(int known, const std::vector<double>& of, double value) const noexcept;
  PathPoint point_on(int segment, double arc_length) const noexcept;
  double speed_on(int segment, double along) const noexcept;
  double time_on(int segment, double along) const noexcept;
  void lower_speeds(const Limits& limits);
  void find_curvatures();
  void find_sections();
  void find_times();
  std::string find_obstacle();

  // One per waypoint. Speeds are absolute values.
  std::vector<double> x_, y_, speeds_, arc_lengths_, left_, right_, times_, curvatures_;
  std::vector<int> numbers_;  ///< as given, counted from 1
  // One per segment. `directions_` are 1 forwards and -1 in reverse; `headings_` the vehicle's.
  std::vector<double> direction_x_, direction_y_, directions_, headings_;
  std::vector<double> section_ends_;
  std::vector<double> given_speeds_;  ///< with their signs
  std::string why_not_drivable_;
  int obstacle_waypoint_ = 0;
};

}  // namespace rhec
