#include "logs/mapping/signal_value.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace rhec::logs {
namespace signal_value_test {

MappedSignal signal(SignalForm form, std::vector<SignalName> from = {{"", "a"}}) {
  MappedSignal made;
  made.options.form = form;
  made.from = std::move(from);
  return made;
}

TEST(SignalValue, AQuaternionHasAHeadingWhateverItsRollAndPitch) {
  std::optional<LocalPlane> plane;
  const double yaw = 2.5, pitch = 0.3, roll = -0.2;
  const double cy = std::cos(yaw / 2), sy = std::sin(yaw / 2), cp = std::cos(pitch / 2), sp = std::sin(pitch / 2),
               cr = std::cos(roll / 2), sr = std::sin(roll / 2);
  const std::array q{sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy,
                     cr * cp * cy + sr * sp * sy};
  EXPECT_NEAR(value_of(signal(SignalForm::heading), q, plane), yaw, 1e-12);
  EXPECT_TRUE(std::isnan(value_of(signal(SignalForm::heading), std::array{0.0, 0.0, 0.0, 0.0}, plane)));
}

/// The vehicle turns on level ground; what the sensor sees of that depends on how it is mounted.
TEST(SignalValue, ASensorMayBeMountedInAnyWay) {
  std::optional<LocalPlane> plane;
  const double heading = 0.7, r = M_PI, p = 0.4, y = -1.1;
  // Quaternions w, x, y, z; the sensor's attitude is the vehicle's, and then the mounting.
  using Q = std::array<double, 4>;
  const auto times = [](const Q& a, const Q& b) {
    return Q{
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
  };
  const auto about = [](int axis, double angle) {
    Q q{std::cos(angle / 2), 0, 0, 0};
    q[static_cast<std::size_t>(axis)] = std::sin(angle / 2);
    return q;
  };
  const Q mounting = times(times(about(3, y), about(2, p)), about(1, r));
  const Q seen = times(about(3, heading), mounting);
  MappedSignal signal_of = signal(SignalForm::heading);
  signal_of.options.rpy = {r, p, y};
  EXPECT_NEAR(value_of(signal_of, std::array{seen[1], seen[2], seen[3], seen[0]}, plane), heading, 1e-12);
  // The angular velocity (0, 0, 0.5) of the vehicle in the sensor's axes.
  const Q inverse{mounting[0], -mounting[1], -mounting[2], -mounting[3]};
  const Q rate = times(times(inverse, Q{0, 0, 0, 0.5}), mounting);
  signal_of.options.form = SignalForm::yaw_rate;
  EXPECT_NEAR(value_of(signal_of, std::array{rate[1], rate[2], rate[3]}, plane), 0.5, 1e-12);
  EXPECT_EQ(value_of(signal(SignalForm::yaw_rate), std::array{1.0, 2.0, 3.0}, plane), 3.0);
}

TEST(SignalValue, TwoFixesHaveADirection) {
  std::optional<LocalPlane> plane;
  const MappedSignal direction = signal(SignalForm::direction);
  EXPECT_NEAR(value_of(direction, std::array{-2.0, 2.0}, plane), 0.75 * M_PI, 1e-12);
  EXPECT_TRUE(std::isnan(value_of(direction, std::array{0.0, 0.0}, plane)));
  EXPECT_FALSE(plane);
  EXPECT_NEAR(value_of(direction, std::array{48.0, 11.0, 48.00001, 11.0}, plane), M_PI / 2, 1e-6);
  EXPECT_NEAR(value_of(direction, std::array{48.0, 11.0, 5.0, 0.0, 48.0, 10.9999, 5.0, 0.0}, plane), M_PI, 1e-5);
  EXPECT_TRUE(std::isnan(value_of(direction, std::array{48.0, 11.0, 5.0, -1.0, 48.0, 10.9, 5.0, 0.0}, plane)))
      << "no fix";
}

TEST(SignalValue, TheFirstGoodFixIsTheOrigin) {
  std::optional<LocalPlane> plane;
  const MappedSignal east = signal(SignalForm::east), north = signal(SignalForm::north);
  EXPECT_TRUE(std::isnan(value_of(east, std::array{48.0, 11.0, 500.0, -1.0}, plane)));  // no fix
  EXPECT_FALSE(plane);
  EXPECT_EQ(value_of(east, std::array{48.0, 11.0, 500.0, 0.0}, plane), 0.0);
  EXPECT_NEAR(value_of(north, std::array{48.001, 11.0, 500.0, 2.0}, plane), 111.2, 0.3);
  EXPECT_NEAR(value_of(east, std::array{48.0, 11.001, std::nan("")}, plane), 74.6, 0.3);
}

TEST(SignalValue, MeansAndTurnsAreOfAll) {
  std::optional<LocalPlane> plane;
  EXPECT_EQ(value_of(signal(SignalForm::mean), std::array{1.0, 2.0, 6.0}, plane), 3.0);
  MappedSignal turn = signal(SignalForm::turn);
  turn.factor = 1.0 / 0.5;
  EXPECT_EQ(value_of(turn, std::array{1.0, 2.0}, plane), 2.0);
}

TEST(SignalValue, ATopicAsAWholeStandsForItsFields) {
  EXPECT_EQ(fields_of(signal(SignalForm::east, {{"/fix", ""}}), "sensor_msgs/msg/NavSatFix").size(), 4u);
  EXPECT_EQ(
      fields_of(signal(SignalForm::north, {{"/pose", "position"}}), "geographic_msgs/msg/GeoPoseStamped")[1].field,
      "position.longitude");
  EXPECT_EQ(fields_of(signal(SignalForm::heading, {{"/imu", "orientation"}}), "")[3].field, "orientation.w");
  EXPECT_EQ(fields_of(signal(SignalForm::yaw_rate, {{"/imu", "angular_velocity"}}), "")[2].field, "angular_velocity.z");
  const auto two = fields_of(signal(SignalForm::direction, {{"/a", ""}, {"/b", ""}}), "sensor_msgs/msg/NavSatFix");
  ASSERT_EQ(two.size(), 8u);
  EXPECT_EQ(two[4].topic, "/b");
  EXPECT_EQ(two[7].field, "status.status");
}

}  // namespace signal_value_test
}  // namespace rhec::logs
