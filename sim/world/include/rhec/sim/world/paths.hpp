#pragma once

#include <filesystem>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/control/path.hpp"

namespace rhec::sim {

/// Two tangent circles, driven in turn: from (0, 0) facing +x round the left one (centre (0, radius), anticlockwise),
/// then round the right one (centre (0, -radius), clockwise), and so on. The default is the paper's 275 m per lap.
struct FigureEight {
  double speed = 2.0;    ///< reference ground speed [m/s]
  int laps = 2;          ///< a lap is both circles
  double radius = 21.9;  ///< [m]
  double spacing = 0.1;  ///< largest distance between waypoints [m]
};
RHEC_EXPORT std::vector<Waypoint> figure_eight(const FigureEight& options = {});

/// Straight legs alternating along +x and -x, joined by half circles, as in field work between headlands: from (0, -20)
/// facing +x, each leg offset by 2 * radius along +y from the previous one. The first half circle turns left.
///
///     length = legs * leg_length + (legs - 1) * pi * radius          (549.4 m by default; about 550 m in the paper)
///
/// A half circle of 9 m requires a steering angle of 8.8 deg from a bicycle with a wheelbase of 1.4 m (17.6 deg at a
/// side slip of 0.5).
struct ZigZag {
  double speed = 2.0;        ///< reference ground speed [m/s]
  int legs = 6;              ///< number of straight legs
  double leg_length = 68.0;  ///< [m]
  double radius = 9.0;       ///< of the half circles [m]
  double spacing = 0.1;      ///< largest distance between waypoints [m]
};
RHEC_EXPORT std::vector<Waypoint> zig_zag(const ZigZag& options = {});

/// Rows of a field, driven there and back: from (0, 0) facing +x, each offset by `row_spacing` along +y from the last
/// one. Where rows are nearer than two radii the vehicle turns as a fishtail, with a stop at each change of direction:
/// a quarter of a circle forwards, 2 radius - row_spacing back in reverse, and another quarter forwards. Other rows are
/// joined by quarters with a straight between them. It comes to rest at the end of the last row.
struct Headland {
  double speed = 2.0;          ///< reference ground speed, in reverse too [m/s]
  int rows = 4;                ///< number of rows
  double row_length = 40.0;    ///< [m]
  double row_spacing = 3.0;    ///< [m]
  double turn_radius = 5.0;    ///< [m]
  double point_spacing = 0.1;  ///< largest distance between waypoints [m]
};
RHEC_EXPORT std::vector<Waypoint> headland(const Headland& options = {});

/// Waypoints from a CSV file. With a header its columns are, in any order, x, y [m] and, as far as they are given,
/// speed [m/s] (negative: in reverse; 0: a stop), left and right: the room beside the path [m]; a missing number there
/// is no limit. Without a header the columns are x, y or x, y, speed. Without a column of speeds the speed is `speed`.
///
/// Throws Error, naming file and line, for rows that are ragged or not numeric, for coordinates and speeds that are
/// missing, for columns that are not known, for fewer than two rows, and for a path that no vehicle can follow
/// (Path::why_not_drivable).
struct WaypointFile {
  double speed = 2.0;  ///< if the file has none [m/s]
};
RHEC_EXPORT std::vector<Waypoint> load_waypoints(const std::filesystem::path& file, const WaypointFile& options = {});

}  // namespace rhec::sim
