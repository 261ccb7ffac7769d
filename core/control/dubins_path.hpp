#pragma once

#include <array>
#include <cmath>

namespace rhec {

/// A place [m] and the direction of motion there [rad].
struct Pose {
  double x = 0.0, y = 0.0, direction = 0.0;
};
inline bool is_finite(const Pose& it) noexcept {
  return std::isfinite(it.x) && std::isfinite(it.y) && std::isfinite(it.direction);
}

/// Where a vehicle is after a length [m] of an arc to the left (turn 1) or right (-1), or straight on (0).
Pose pose_after(const Pose& from, int turn, double length, double radius) noexcept;

/// The place of a way, whose poses a function says, that is closest to (x, y), of those between two arc lengths, and
/// its distance [m].
struct NearestPose {
  double along = 0.0, distance = HUGE_VAL;
};
template <class PoseAt>
NearestPose nearest_pose(const PoseAt& pose_at, double from, double to, double x, double y) noexcept {
  constexpr int steps = 32;
  NearestPose nearest{.along = from};
  for (int i = 0; i <= steps; ++i) {
    const double along = from + i * (to - from) / steps;
    const Pose there = pose_at(along);
    const double distance = std::hypot(x - there.x, y - there.y);
    if (distance < nearest.distance) nearest = {along, distance};
  }
  return nearest;
}

/// A path of three pieces between two poses, each an arc of one radius or a straight line; the shortest path whose
/// curvature nowhere exceeds that of the arcs is one of six of these kinds (L. E. Dubins, American Journal of
/// Mathematics 79(3), 1957). Neither allocates nor throws.
class DubinsPath {
 public:
  /// What the pieces are: 1 an arc to the left, -1 to the right, 0 straight on.
  using Kind = std::array<int, 3>;
  static constexpr std::array<Kind, 6> kinds{{{1, 0, 1}, {-1, 0, -1}, {1, 0, -1}, {-1, 0, 1}, {1, -1, 1}, {-1, 1, -1}}};

  /// An empty path at the origin.
  DubinsPath() = default;
  /// With a radius > 0 [m]. Whether there is one of this kind is said by `exists`.
  DubinsPath(const Kind& kind, const Pose& from, const Pose& to, double radius) noexcept;

  bool exists() const noexcept { return exists_; }
  double length() const noexcept;  ///< [m]
  /// At an arc length [m]; before the path and behind it straight on.
  Pose pose_at(double arc_length) const noexcept;
  /// To the left positive [1/m].
  double curvature_at(double arc_length) const noexcept;

 private:
  void join_by_line(const Pose& from, const Pose& to) noexcept;
  void join_by_arc(const Pose& from, const Pose& to) noexcept;

  Kind kind_{};
  Pose from_;
  double radius_ = 1.0;
  std::array<double, 3> lengths_{};  ///< [m]
  bool exists_ = false;
};

}  // namespace rhec
