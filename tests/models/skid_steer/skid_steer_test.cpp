#include "models/drive.hpp"

namespace rhec {
namespace skid_steer_test {

using namespace testing;

constexpr double radius = 0.2, width = 0.8;

std::shared_ptr<Model> robot() {
  return vehicle("skid_steer",
                 "{wheel_radius: 0.2, track_width: 0.8, antenna_x: 0.1, antenna_y: 0.2, outputs: [x_gps, y_gps]}");
}

TEST(SkidSteer, GoesStraightWhereBothSidesGainAlike) {
  // The left side turns faster, and slips by as much more.
  const Numbers end = drive(*robot(), {0.0, 0.0, 0.4}, {10.0, 8.0}, {0.4, 0.25, 0.1}, 3.0);
  expect_near(end, {3.6 * std::cos(0.4), 3.6 * std::sin(0.4), 0.4});
}

TEST(SkidSteer, TurnsOnTheSpotAboutItsCentreOfRotation) {
  const double s = 0.15, psi = 0.3, yaw_rate = radius * 10.0 / width;  // from -5 to 5 rad/s
  const Numbers end = drive(*robot(), {0.0, 0.0, psi}, {-5.0, 5.0}, {0.0, 0.0, s}, 1.0);
  EXPECT_NEAR(end[2], psi + yaw_rate, 1e-10);
  // The point that is s before its centre stays where it is.
  EXPECT_NEAR(end[0] + s * std::cos(end[2]), s * std::cos(psi), 1e-10);
  EXPECT_NEAR(end[1] + s * std::sin(end[2]), s * std::sin(psi), 1e-10);
}

TEST(SkidSteer, ItsCentreOfRotationNeverSlidesSideways) {
  const double s = -0.12, psi = 1.2;
  const Numbers rate = rates(*robot(), {0.0, 0.0, psi}, {4.0, 9.0}, {0.2, 0.1, s});
  const double left = radius * 4.0 * 0.8, right = radius * 9.0 * 0.9;
  EXPECT_NEAR(rate[2], (right - left) / width, 1e-12);
  const double vx = rate[0] - s * rate[2] * std::sin(psi), vy = rate[1] + s * rate[2] * std::cos(psi);
  EXPECT_NEAR(-vx * std::sin(psi) + vy * std::cos(psi), 0.0, 1e-12);
  EXPECT_NEAR(vx * std::cos(psi) + vy * std::sin(psi), 0.5 * (left + right), 1e-12);
}

TEST(SkidSteer, DrivesAlongACircle) {
  const double speed = 0.5 * radius * (6.0 + 8.0), yaw_rate = radius * 2.0 / width;
  expect_near(drive(*robot(), {1.0, 2.0, -0.7}, {6.0, 8.0}, {0.0, 0.0, 0.0}, 5.0),
              along_circle(1.0, 2.0, -0.7, speed, yaw_rate, 5.0));
}

TEST(SkidSteer, TurnsTheWheelsOfEachSideAsFastAsTheySlip) {
  const Numbers slip{0.5, 0.2, 0.1};
  const auto [state, inputs] = straight(*robot(), 1.0, slip);
  expect_near(inputs, {1.0 / radius / 0.5, 1.0 / radius / 0.8}, 1e-12);
  expect_near(drive(*robot(), state, inputs, slip, 2.0), {2.0, 0.0, 0.0});
}

TEST(SkidSteer, HasItsAntennaAtItsPlace) {
  const double c = std::cos(2.1), s = std::sin(2.1);
  expect_near(seen(*robot(), {3.0, 4.0, 2.1}), {3.0 + 0.1 * c - 0.2 * s, 4.0 + 0.1 * s + 0.2 * c}, 1e-14);
}

}  // namespace skid_steer_test
}  // namespace rhec
