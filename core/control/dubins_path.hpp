#pragma once

#include <array>

namespace rhec {

/// A place [m] and the direction of motion there [rad].
struct Pose {
  double x = 0.0, y = 0.0, direction = 0.0;
};

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
