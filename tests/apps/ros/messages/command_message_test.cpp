#include "apps/ros/messages/command_message.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "rhec/core/base/error.hpp"
#include "rhec/logs/cdr/message_reader.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::apps::ros::command_message_test {
namespace {

constexpr double interval = 0.1;

std::shared_ptr<const Model> model(const std::string& text) {
  const Host host;
  return Robot(host, RobotOptions::table().parse(parse_yaml("model: " + text, "test"), "test")).model();
}
std::shared_ptr<const Model> skid_steer() { return model("{name: skid_steer, wheel_radius: 0.1, track_width: 0.5}"); }
std::shared_ptr<const Model> bicycle() { return model("{name: bicycle_slip, wheelbase: 2}"); }

std::vector<double> numbers(const CommandMessage& command, std::span<const std::byte> message,
                            const std::vector<std::string>& fields) {
  logs::MessageReader reader(
      std::make_shared<const logs::MessageType>(logs::link_message(command.type(), logs::builtin_definitions())),
      {.fields = fields});
  std::vector<double> values(fields.size());
  reader.read({.bytes = message}, values.data());
  return values;
}

TEST(CommandMessage, ATwistIsTheMotionWithoutSlip) {
  CommandMessage command(skid_steer(), {}, interval);
  const std::array state{3.0, 4.0, 2.5};
  const std::array inputs{10.0, 20.0};  // rad/s of wheels of 0.1 m: 1 and 2 m/s
  const auto found = numbers(command, command.write(0, "base_link", state.data(), inputs.data()),
                             {"twist.linear.x", "twist.angular.z", "twist.linear.y"});
  EXPECT_NEAR(found[0], 1.5, 1e-12);
  EXPECT_NEAR(found[1], 2.0, 1e-12);  // (2 - 1) m/s / 0.5 m
  EXPECT_EQ(found[2], 0.0);
}

TEST(CommandMessage, ABaseMakesOfItWhatWasMeant) {
  for (const CommandForm form : {CommandForm::twist_stamped, CommandForm::twist, CommandForm::inputs}) {
    CommandMessage command(skid_steer(), {.form = form, .steering = ""}, interval);
    const std::array state{0.0, 0.0, -1.0};
    const std::array inputs{-7.0, 12.5};
    std::array<double, 2> given{};
    command.read(command.write(0, "base_link", state.data(), inputs.data()), state.data(), given.data());
    EXPECT_NEAR(given[0], inputs[0], 1e-6);
    EXPECT_NEAR(given[1], inputs[1], 1e-6);
  }
}

TEST(CommandMessage, ASteeredVehicleSteersByTwistAndByAngle) {
  for (const CommandForm form : {CommandForm::twist_stamped, CommandForm::ackermann}) {
    CommandMessage command(bicycle(), {.form = form, .steering = "delta"}, interval);
    const std::array state{0.0, 0.0, 0.7, 0.2};
    const std::array inputs{1.5, -0.3};
    std::array<double, 2> given{};
    command.read(command.write(0, "base_link", state.data(), inputs.data()), state.data(), given.data());
    EXPECT_NEAR(given[0], inputs[0], 1e-6);
    EXPECT_NEAR(given[1], inputs[1], 1e-5);  // an angle is sent as a float
  }
}

TEST(CommandMessage, AnAngleIsThatAtTheEndOfTheInterval) {
  CommandMessage command(bicycle(), {.form = CommandForm::ackermann, .steering = "delta"}, interval);
  const std::array state{0.0, 0.0, 0.0, 0.2};
  const std::array inputs{1.5, -0.3};
  const auto found = numbers(command, command.write(0, "", state.data(), inputs.data()),
                             {"drive.steering_angle", "drive.steering_angle_velocity", "drive.speed"});
  EXPECT_NEAR(found[0], 0.2 - 0.3 * interval, 1e-6);
  EXPECT_NEAR(found[1], -0.3, 1e-6);
  EXPECT_NEAR(found[2], 1.5, 1e-6);
}

TEST(CommandMessage, AStopIsRest) {
  CommandMessage command(skid_steer(), {}, interval);
  const std::array state{0.0, 0.0, 0.0};
  std::array given{1.0, 1.0};
  command.read(command.stop(0, "base_link"), state.data(), given.data());
  EXPECT_EQ(given, (std::array{0.0, 0.0}));
}

TEST(CommandMessage, RefusesWhatIsBrokenOrNotFinite) {
  CommandMessage command(skid_steer(), {.form = CommandForm::twist, .steering = ""}, interval);
  const std::array state{0.0, 0.0, 0.0};
  std::array given{1.0, 2.0};
  logs::CdrWriter message;
  message.numbers(std::array{1.0, 0.0, 0.0, 0.0, 0.0, std::numeric_limits<double>::infinity()});
  EXPECT_THROW(command.read(message.bytes(), state.data(), given.data()), logs::RecordError);
  EXPECT_THROW(command.read(message.bytes().first(20), state.data(), given.data()), logs::RecordError);
  message.clear();
  message.numbers(std::array{1e308, 0.0, 0.0, 0.0, 0.0, -1e308});  // finite, and nobody's motion
  EXPECT_THROW(command.read(message.bytes(), state.data(), given.data()), logs::RecordError);
  EXPECT_EQ(given, (std::array{1.0, 2.0}));
}

TEST(CommandMessage, SaysWhichModelsItIsNotFor) {
  EXPECT_THROW(CommandMessage(bicycle(), {.form = CommandForm::ackermann, .steering = "nothing"}, interval), Error);
  EXPECT_THROW(CommandMessage(skid_steer(), {.form = CommandForm::ackermann, .steering = "psi"}, interval), Error);
}

}  // namespace
}  // namespace rhec::apps::ros::command_message_test
