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

/// Waypoints from a CSV file: columns x, y [m] and, optionally, the reference speed [m/s]; a header row is allowed.
/// Without that column the speed is `speed`. Throws Error, naming file and row, for rows that are ragged or not
/// numeric, for missing values, for speeds that are not positive, and for fewer than two rows.
struct WaypointFile {
  double speed = 2.0;  ///< if the file has none [m/s]
};
RHEC_EXPORT std::vector<Waypoint> load_waypoints(const std::filesystem::path& file, const WaypointFile& options = {});

}  // namespace rhec::sim
