#pragma once

#include <array>
#include <memory>

#include "rhec/core/base/export.hpp"

namespace rhec::logs {

/// A place on the WGS84 ellipsoid.
struct GeodeticPoint {
  double latitude = 0.0, longitude = 0.0;  ///< [deg]
  double height = 0.0;                     ///< above the ellipsoid [m]
};
/// Whether it can be one: finite, and within +-90 and +-540 degrees.
RHEC_EXPORT bool is_valid(const GeodeticPoint& point) noexcept;

/// The plane that touches the ellipsoid at its origin: x to the east, y to the north, z up (ENU, REP 103).
class RHEC_EXPORT LocalPlane {
 public:
  explicit LocalPlane(const GeodeticPoint& origin);
  ~LocalPlane();
  LocalPlane(LocalPlane&&) noexcept;
  LocalPlane& operator=(LocalPlane&&) noexcept;

  const GeodeticPoint& origin() const noexcept { return origin_; }
  std::array<double, 3> forward(const GeodeticPoint& point) const;
  GeodeticPoint reverse(const std::array<double, 3>& place) const;

 private:
  struct Projection;
  GeodeticPoint origin_;
  std::unique_ptr<const Projection> projection_;
};

}  // namespace rhec::logs
