#include "retreat.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/base/angle.hpp"

namespace rhec {
namespace {

// How far the vehicle goes back at most, and how far behind its place it is looked for from one call to the next, in
// seconds of the speed at which it does.
constexpr double longest = 20.0, search = 3.0;
// Less than this behind the vehicle is no way to drive [m], and what is nearer to the end of the way is its end.
constexpr double least_way = 0.1;

}  // namespace

bool Retreat::begin(const Path& path, int section, double arc_length, double speed, double heading_error) noexcept {
  is_under_way_ = is_aligned_ = false;
  if (!(speed > 0.0) || !(std::abs(heading_error) > aligned) || !(std::abs(heading_error) < most_off)) return false;
  place_ = std::min(std::max(arc_length, path.section_start(section)), path.section_end(section));
  last_ = std::max(path.section_start(section), place_ - longest * speed);
  speed_ = speed;
  return is_under_way_ = place_ - last_ > least_way;
}

bool Retreat::advance(const Path& path, const Pose& vehicle, double /*time*/) noexcept {
  if (!is_under_way_ || !is_finite(vehicle)) return false;
  place_ = path.closest(vehicle.x, vehicle.y, std::max(last_, place_ - search * speed_), place_).arc_length;
  const double off = std::abs(angle_difference(vehicle.direction, path.point_at(place_).heading));
  is_aligned_ = off < aligned;
  is_under_way_ = !is_aligned_ && off < lost && place_ - last_ > least_way;
  return false;
}

double Retreat::path_beside(const Path& /*path*/, double arc_length) const noexcept { return arc_length; }

std::optional<double> Retreat::goes_on_at(const Path& /*path*/, double /*x*/, double /*y*/) const noexcept {
  return place_;
}

double Retreat::arc_length_after(double arc_length, double time) const noexcept {
  return std::max(arc_length - time * speed_, std::min(arc_length, last_));
}

PathPoint Retreat::point_at(const Path& path, double arc_length) const noexcept {
  PathPoint point = path.point_at(arc_length);
  point.speed = point.in_reverse ? speed_ : -speed_;
  point.in_reverse = !point.in_reverse;
  return point;
}

}  // namespace rhec
