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
}

}  // namespace signal_value_test
}  // namespace rhec::logs
