#pragma once

#include "rhec/core/base/export.hpp"
#include "rhec/core/control/path.hpp"

namespace rhec {

/// Follows a path along with a vehicle: each search for the closest point is limited to the section of the path that is
/// being driven, and in it to a window near the last point, so that a path that crosses or approaches itself, or turns
/// back at a cusp, is never cut short (docs/method.md, section 3). A section is left when its stop is reached.
class RHEC_EXPORT PathFollower {
 public:
  struct Window {
    double ahead = 8.0;   ///< [m] must exceed what the vehicle travels between two calls
    double behind = 1.0;  ///< [m] allows for noise in the position
    // A stop is reached where it is this near, in distance [m] or in time at the reference speed [s].
    double stop_distance = 0.1;
    double stop_time = 0.2;
    Path::Search place = {};  ///< of `locate`
  };

  /// `path` must outlive the follower. Throws Error if `ahead` is not positive, or another value is negative.
  explicit PathFollower(const Path& path) : PathFollower(path, Window{}) {}
  PathFollower(const Path& path, Window window);

  /// Moves to the closest point of the window and returns its arc length [m]: at least 0, and more than the path's
  /// length once the end is passed. Stays at its place if the position is not finite.
  double advance(double x, double y) noexcept;
  /// The same, but leaves a section only when `other`, of the same path, has left it; finished is what has passed the
  /// path's end itself, for where it stops is for `other` to say.
  double advance_with(const PathFollower& other, double x, double y) noexcept;
  /// Moves to where on the whole path the vehicle is (Path::locate). Stays if the position is not finite.
  void locate(double x, double y, double heading) noexcept;
  /// Moves to an arc length [m], by default to the start; beyond the path's ends to these.
  void reset(double arc_length = 0.0) noexcept;

  double arc_length() const noexcept { return last_.arc_length; }
  /// Signed distance of the last position from the path [m], positive to the left: the tracking error.
  double lateral() const noexcept { return last_.lateral; }
  /// The section that is being driven.
  int section() const noexcept { return section_; }
  /// True if the last position was at or beyond the path's end, or near enough to a stop there.
  bool finished() const noexcept { return is_finished_; }
  const Path& path() const noexcept { return *path_; }

 private:
  void project(double x, double y) noexcept;
  bool has_reached_stop() const noexcept;

  const Path* path_;
  Window window_;
  PathProjection last_;
  int section_ = 0;
  bool is_finished_ = false;
};

}  // namespace rhec
