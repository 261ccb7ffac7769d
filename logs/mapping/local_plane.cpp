#include "rhec/logs/mapping/local_plane.hpp"

#include <GeographicLib/LocalCartesian.hpp>
#include <cmath>

namespace rhec::logs {

struct LocalPlane::Projection {
  GeographicLib::LocalCartesian cartesian;
};

bool is_valid(const GeodeticPoint& point) noexcept {
  return std::abs(point.latitude) <= 90.0 && std::abs(point.longitude) <= 540.0 && std::isfinite(point.height);
}

LocalPlane::LocalPlane(const GeodeticPoint& origin)
    : origin_(origin),
      projection_(new Projection{GeographicLib::LocalCartesian(origin.latitude, origin.longitude, origin.height)}) {}
LocalPlane::~LocalPlane() = default;
LocalPlane::LocalPlane(LocalPlane&&) noexcept = default;
LocalPlane& LocalPlane::operator=(LocalPlane&&) noexcept = default;

std::array<double, 3> LocalPlane::forward(const GeodeticPoint& point) const {
  std::array<double, 3> place{};
  projection_->cartesian.Forward(point.latitude, point.longitude, point.height, place[0], place[1], place[2]);
  return place;
}

GeodeticPoint LocalPlane::reverse(const std::array<double, 3>& place) const {
  GeodeticPoint point;
  projection_->cartesian.Reverse(place[0], place[1], place[2], point.latitude, point.longitude, point.height);
  return point;
}

}  // namespace rhec::logs
