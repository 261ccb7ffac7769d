#include "approach.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rhec/core/base/angle.hpp"

namespace rhec {
namespace {

// How far along the path the approach may end, and in what steps this is tried, in radii.
constexpr double most_ahead = 8.0, ahead_step = 0.5;
// Room beside the path is looked at in steps of this many radii. Rounding is no lack of it [m].
constexpr double room_step = 0.25, room_rounding = 1e-6;
// The vehicle's place is looked for this far ahead: never on another arc that passes it [radii].
constexpr double search_window = 1.0;
// A vehicle that looks away from its way by more than this [rad], or is farther from it than this [radii], has left it.
constexpr double most_off = 0.5 * std::numbers::pi, most_beside = 2.0;

}  // namespace

double beyond_room(const Path& path, const PathProjection& place) noexcept {
  const PathPoint point = path.point_at(place.arc_length);
  return std::max({0.0, place.lateral - point.left, -place.lateral - point.right});
}

bool Approach::begin(const Path& path, int section, double arc_length, const Pose& vehicle,
                     const TurningCircle& turn) noexcept {
  is_under_way_ = false;
  if (!(turn.radius > 0.0) || !(turn.speed > 0.0) || !std::isfinite(turn.radius)) return false;
  if (!is_finite(vehicle)) return false;
  turn_ = turn;
  first_ = path.section_start(section);
  last_ = path.section_end(section);
  const double start = std::min(std::max(arc_length, first_), last_);
  DubinsPath best;
  double least = HUGE_VAL, target = 0.0;
  for (double ahead = 0.0; ahead <= most_ahead; ahead += ahead_step) {
    target_ = start + ahead * turn.radius;
    if (target_ > last_) break;
    const PathPoint there = path.point_at(target_);
    const double turned = there.in_reverse ? std::numbers::pi : 0.0;
    for (const DubinsPath::Kind& kind : DubinsPath::kinds) {
      way_ = DubinsPath(kind, {vehicle.x, vehicle.y, vehicle.direction + turned},
                        {there.x, there.y, there.heading + turned}, turn.radius);
      const double cost = way_.length() + target_ - start;
      if (!way_.exists() || !(cost < least)) continue;
      if (!has_room(path)) continue;
      least = cost;
      best = way_;
      target = target_;
      in_reverse_ = there.in_reverse;
    }
  }
  if (!best.exists()) return false;
  way_ = best;
  target_ = target;
  done_ = 0.0;
  is_under_way_ = true;
  return true;
}

PathProjection Approach::beside(const Path& path, double x, double y) const noexcept {
  const double reach = way_.length() + turn_.radius, from = std::max(first_, target_ - reach);
  return path.closest(x, y, from, std::max(from, std::min(last_, target_ + reach)));
}

/// Whether the way is nowhere further beyond the path's room than at its start.
bool Approach::has_room(const Path& path) const noexcept {
  double allowed = room_rounding;
  for (double along = 0.0; along <= way_.length(); along += room_step * turn_.radius) {
    const Pose place = way_.pose_at(along);
    const double beyond = beyond_room(path, beside(path, place.x, place.y));
    if (along == 0.0) allowed = beyond + room_rounding;
    if (beyond > allowed) return false;
  }
  return true;
}

bool Approach::advance(const Path& /*path*/, const Pose& vehicle, double /*time*/) noexcept {
  if (!is_under_way_ || !is_finite(vehicle)) return false;
  const NearestPose nearest = nearest_pose([&](double along) { return way_.pose_at(along); }, done_,
                                           done_ + search_window * turn_.radius, vehicle.x, vehicle.y);
  done_ = nearest.along;
  const double direction = vehicle.direction + (in_reverse_ ? std::numbers::pi : 0.0);
  const double off = std::abs(angle_difference(direction, way_.pose_at(done_).direction));
  is_under_way_ = !has_arrived() && off < most_off && nearest.distance < most_beside * turn_.radius;
  return false;
}

double Approach::path_beside(const Path& path, double arc_length) const noexcept {
  const PathPoint there = point_at(path, arc_length);
  return beside(path, there.x, there.y).arc_length;
}

std::optional<double> Approach::goes_on_at(const Path& /*path*/, double /*x*/, double /*y*/) const noexcept {
  return has_arrived() ? std::optional(target_) : std::nullopt;
}

double Approach::arc_length_after(double arc_length, double time) const noexcept {
  return std::min(arc_length + time * turn_.speed, std::max(arc_length, last_));
}

PathPoint Approach::point_at(const Path& path, double arc_length) const noexcept {
  const double along = arc_length - target_ + way_.length();
  PathPoint point = path.point_at(std::max(arc_length, target_));
  point.speed = in_reverse_ ? -turn_.speed : turn_.speed;
  if (arc_length >= target_) return point;
  const Pose pose = way_.pose_at(along);
  point.x = pose.x;
  point.y = pose.y;
  point.heading = std::remainder(pose.direction - (in_reverse_ ? std::numbers::pi : 0.0), 2.0 * std::numbers::pi);
  point.curvature = way_.curvature_at(along);
  point.in_reverse = in_reverse_;
  // Room is beside the path, not beside this way.
  point.left = point.right = infinity;
  return point;
}

}  // namespace rhec
