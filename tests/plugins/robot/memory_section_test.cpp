#include "rhec/plugins/robot/memory_section.hpp"

#include <gmock/gmock.h>

#include "rhec/core/estimation/bank_estimation.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace memory_section_test {

using testing::AllOf;
using testing::HasSubstr;

Robot robot_of(const std::string& estimator) {
  static const Host host;
  const std::string text = "{model: bicycle_slip, bounds: {kappa: [0, 2], mu: [0, 1]}, estimator: " + estimator + "}";
  return {host, RobotOptions::table().parse(parse_yaml(text, "robot.yaml"), "robot")};
}

TEST(MemorySection, IsOffByDefaultAndANameAloneTurnsItOn) {
  EXPECT_FALSE(robot_of("{name: bank}").memory().is_given());
  EXPECT_FALSE(robot_of("{name: bank, memory: none}").memory().is_given());
  const Robot robot = robot_of("{name: bank, memory: place}");
  EXPECT_TRUE(robot.memory().is_given());
  EXPECT_TRUE(robot.make_estimator()->slip_ahead());
  EXPECT_FALSE(robot_of("{name: bank}").make_estimator()->slip_ahead());
}

TEST(MemorySection, MapAndLeastFollowTheWidthOfTheBounds) {
  const Robot robot = robot_of("{memory: {name: place, spread: 0.1, least: 0.01, cell: 0.25, reach: 1, cells: 500}}");
  const auto map = robot.memory().make_map();
  EXPECT_EQ(map->setup().cell, 0.25);
  EXPECT_EQ(map->setup().capacity, 500U);
  EXPECT_THAT(map->setup().spread, testing::ElementsAre(testing::DoubleEq(0.2), testing::DoubleEq(0.1)));
  EXPECT_THAT(robot.memory().setup(map).least, testing::ElementsAre(testing::DoubleEq(0.02), testing::DoubleEq(0.01)));
}

TEST(MemorySection, SaysWhoseMapItIs) {
  const MapIdentity identity =
      robot_of("{memory: {name: place, vehicle: red one, frame: 'EPSG:25833', origin: [400000, 5.8e6]}}")
          .memory()
          .identity();
  EXPECT_EQ(identity.vehicle, "red one");
  EXPECT_EQ(identity.model, "bicycle_slip");
  EXPECT_EQ(identity.frame, "EPSG:25833");
  EXPECT_EQ(identity.origin_y, 5.8e6);
  EXPECT_THAT(identity.parameters, testing::ElementsAre("kappa", "mu"));
  EXPECT_EQ(robot_of("{memory: place}").memory().identity().vehicle, "bicycle_slip");
}

TEST(MemorySection, RefusesWhatCannotBe) {
  const auto error = [](const std::string& estimator) {
    return error_of([&] { robot_of(estimator).make_estimator(); });
  };
  EXPECT_THAT(error("{memory: plaec}"), HasSubstr("place"));
  EXPECT_THAT(error("{memory: {name: place, orign: [0, 0]}}"), HasSubstr("origin"));
  EXPECT_THAT(error("{memory: {name: place, origin: [0]}}"), HasSubstr("two finite numbers"));
  EXPECT_THAT(error("{memory: {name: place, cell: 0}}"), HasSubstr("greater than 0"));
  EXPECT_THAT(error("{memory: {name: place, cell: 0.01, reach: 50}}"), HasSubstr("100 cells"));
  EXPECT_THAT(error("{name: ekf, memory: place}"), AllOf(HasSubstr("robot.yaml"), HasSubstr("bank")));
}

}  // namespace memory_section_test
}  // namespace rhec
