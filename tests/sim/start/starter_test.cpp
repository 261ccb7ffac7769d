#include "rhec/sim/start/starter.hpp"

#include <gmock/gmock.h>

#include <string>

#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace starter_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

StarterWishes bicycle() {
  return {.name = "mine", .vehicle = "bicycle_slip", .sensors = {}, .options = {}, .folder = "mine"};
}

Robot robot_of(const StarterFiles& files) {
  const Host host;
  return {host, RobotOptions::table().parse(parse_yaml(files.robot, "robot.yaml"), "robot")};
}

TEST(StarterFiles, SayWhatTheModelKnows) {
  const StarterFiles files = starter_files(Host(), bicycle());
  const Robot robot = robot_of(files);
  EXPECT_THAT(names_of(robot.model()->description().outputs), ElementsAre("x_gps", "y_gps", "delta"));
  EXPECT_THAT(robot.output_sigmas(), ElementsAre(0.1, 0.1, 0.003));
  EXPECT_THAT(robot.notes(), testing::IsEmpty());
  const ModelDescription plain = starter_vehicle(Host(), bicycle());
  for (std::size_t j = 0; j < plain.parameters.size(); ++j)
    EXPECT_DOUBLE_EQ(robot.bounded_description().parameters[j].upper, plain.parameters[j].upper);
  EXPECT_THAT(files.scenario, AllOf(HasSubstr("robot: robot.yaml"), HasSubstr("rhec run mine/field.yaml")));
}

TEST(StarterFiles, AreOfTheSensorsAndOptionsThatAreWished) {
  StarterWishes wishes = bicycle();
  wishes.sensors = {"yaw_rate", "x_gps", "y_gps"};
  wishes.options = parse_yaml("wheelbase: 2.5", "wishes");
  const Robot robot = robot_of(starter_files(Host(), wishes));
  EXPECT_THAT(names_of(robot.model()->description().outputs), ElementsAre("x_gps", "y_gps", "yaw_rate"));
  EXPECT_EQ(robot.model_choice().options.find("wheelbase")->as_number(), 2.5);
}

TEST(StarterFiles, TakePartsOfNamesForAllSensorsOfThem) {
  StarterWishes named = bicycle(), meant = bicycle();
  named.sensors = {"x_gps", "y_gps", "delta"};
  meant.sensors = {"gps", "delta"};
  EXPECT_EQ(starter_files(Host(), meant).robot, starter_files(Host(), named).robot);
  meant.sensors = {"g"};
  EXPECT_THROW(starter_files(Host(), meant), Error);
}

TEST(StarterFiles, RefuseWhatThereIsNot) {
  StarterWishes wishes = bicycle();
  wishes.sensors = {"x_gsp"};
  EXPECT_THAT(error_of([&] { starter_files(Host(), wishes); }), HasSubstr("did you mean 'x_gps'?"));
  wishes.sensors = {"radar"};
  EXPECT_THAT(error_of([&] { starter_files(Host(), wishes); }), HasSubstr("it could have x_gps, y_gps"));
  wishes.vehicle = "bicycle";
  EXPECT_THAT(error_of([&] { starter_files(Host(), wishes); }), HasSubstr("bicycle_slip"));
}

}  // namespace starter_test
}  // namespace rhec::sim
