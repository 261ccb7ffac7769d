#include "models/drive.hpp"

namespace rhec {
namespace bicycle_sideslip_test {

using namespace testing;

constexpr double wheelbase = 2.2;

std::shared_ptr<Model> bicycle() {
  return vehicle("bicycle_sideslip", "{wheelbase: 2.2, antenna_x: 0.3, antenna_y: -0.4, outputs: [x_gps, y_gps]}");
}

TEST(BicycleSideslip, WithoutSlipIsTheOtherBicycle) {
  const auto other = vehicle("bicycle_slip", "{wheelbase: 2.2}");
  const Numbers start{1.0, 2.0, 0.7, -0.1}, inputs{2.5, 0.08};
  expect_near(drive(*bicycle(), start, inputs, {0.0, 0.0}, 3.0), drive(*other, start, inputs, {1.0, 1.0}, 3.0));
}

// Both axles move as their side slip says, and their distance stays: this is all that the equations express.
TEST(BicycleSideslip, ItsAxlesMoveAsTheirSideSlipSays) {
  for (const double front : {-0.1, 0.0, 0.15}) {
    for (const double rear : {-0.05, 0.12}) {
      const double psi = 0.9, delta = 0.25;
      const Numbers rate = rates(*bicycle(), {0.0, 0.0, psi, delta}, {3.0, 0.0}, {front, rear});
      EXPECT_NEAR(std::hypot(rate[0], rate[1]), 3.0, 1e-12);
      EXPECT_NEAR(std::atan2(rate[1], rate[0]), psi + rear, 1e-12);
      const double front_x = rate[0] - wheelbase * rate[2] * std::sin(psi),
                   front_y = rate[1] + wheelbase * rate[2] * std::cos(psi);
      EXPECT_NEAR(std::atan2(front_y, front_x), psi + delta + front, 1e-12);
    }
  }
}

TEST(BicycleSideslip, GoesLikeACrabWhereBothAxlesSlideAlike) {
  const double slide = 0.2;
  const Numbers end = drive(*bicycle(), {0.0, 0.0, 0.5, 0.0}, {2.0, 0.0}, {slide, slide}, 5.0);
  expect_near(end, {10.0 * std::cos(0.5 + slide), 10.0 * std::sin(0.5 + slide), 0.5, 0.0});
}

TEST(BicycleSideslip, DrivesAlongACircleThatItSlidesInto) {
  const double front = 0.05, rear = -0.1, delta = 0.2, speed = 2.0;
  const double yaw_rate = speed * std::cos(rear) * (std::tan(delta + front) - std::tan(rear)) / wheelbase;
  const Numbers circle = along_circle(0.0, 0.0, 0.3 + rear, speed, yaw_rate, 6.0);
  expect_near(drive(*bicycle(), {0.0, 0.0, 0.3, delta}, {speed, 0.0}, {front, rear}, 6.0),
              {circle[0], circle[1], circle[2] - rear, delta});
}

TEST(BicycleSideslip, HasItsAntennaAtItsPlace) {
  const double c = std::cos(1.1), s = std::sin(1.1);
  expect_near(seen(*bicycle(), {3.0, 4.0, 1.1, 0.0}), {3.0 + 0.3 * c + 0.4 * s, 4.0 + 0.3 * s - 0.4 * c}, 1e-14);
}

}  // namespace bicycle_sideslip_test
}  // namespace rhec
