#include "rhec/logs/mapping/local_plane.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace rhec::logs {
namespace local_plane_test {

TEST(LocalPlane, EastNorthAndUpAreMetres) {
  const GeodeticPoint origin{48.0, 11.0, 500.0};
  const LocalPlane plane(origin);
  EXPECT_NEAR(plane.forward(origin)[0], 0.0, 1e-9);
  // Radii of curvature of WGS84.
  const double a = 6378137.0, f = 1.0 / 298.257223563, e2 = f * (2.0 - f), sine = std::sin(48.0 * M_PI / 180.0);
  const double across = a / std::sqrt(1.0 - e2 * sine * sine), along = across * (1.0 - e2) / (1.0 - e2 * sine * sine);
  const double step = 1e-5 * M_PI / 180.0;
  const auto place = plane.forward({48.0 + 1e-5, 11.0 - 1e-5, 502.0});
  EXPECT_NEAR(place[0], -(across + 500.0) * std::cos(48.0 * M_PI / 180.0) * step, 1e-5);
  EXPECT_NEAR(place[1], (along + 500.0) * step, 1e-5);
  EXPECT_NEAR(place[2], 2.0, 1e-5);
}

TEST(LocalPlane, GoesThereAndBack) {
  const LocalPlane plane({48.0, 11.0, 500.0});
  const GeodeticPoint point{48.01, 10.98, 510.0};
  const GeodeticPoint found = plane.reverse(plane.forward(point));
  EXPECT_NEAR(found.latitude, point.latitude, 1e-12);
  EXPECT_NEAR(found.longitude, point.longitude, 1e-12);
  EXPECT_NEAR(found.height, point.height, 1e-6);
}

TEST(LocalPlane, PlacesThatCannotBeAreTold) {
  EXPECT_TRUE(is_valid({90.0, -180.0, -400.0}));
  EXPECT_FALSE(is_valid({91.0, 0.0, 0.0}));
  EXPECT_FALSE(is_valid({0.0, std::numeric_limits<double>::quiet_NaN(), 0.0}));
}

}  // namespace local_plane_test
}  // namespace rhec::logs
