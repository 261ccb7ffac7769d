#include "rhec/plugins/robot/scenario_file.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec {
namespace scenario_file_test {

using testing::AllOf;
using testing::HasSubstr;

class ScenarioFile : public FolderTest {};

TEST_F(ScenarioFile, HasTheKeysOfItsRobotWithItsOwnPutOverThem) {
  put("robots/one.yaml", "step: 0.1\nmodel: {name: bicycle_slip, wheelbase: 2}\nestimator: {horizon: 10, name: ekf}\n");
  const Settings scenario =
      load_scenario(put("field.yaml", "robot: robots/one.yaml\nspeed: 3\nestimator: {horizon: 20}\n"));
  EXPECT_EQ(scenario.find("robot"), nullptr);
  EXPECT_EQ(scenario.find("speed")->as_number(), 3.0);
  EXPECT_EQ(scenario.find("step")->as_number(), 0.1);
  EXPECT_EQ(scenario.find("estimator")->find("horizon")->as_number(), 20.0);
  EXPECT_EQ(scenario.find("estimator")->find("name")->as_text(), "ekf");
  EXPECT_THAT(scenario.find("model")->find("wheelbase")->where(), HasSubstr("robots/one.yaml:2"))
      << "a mistake is told where it is written";
  EXPECT_THAT(scenario.find("estimator")->find("horizon")->where(), HasSubstr("field.yaml:3"));
}

TEST_F(ScenarioFile, WithoutARobotIsWhatItIs) {
  const Settings plain = load_scenario(put("field.yaml", "speed: 3\n"));
  EXPECT_EQ(plain.members().size(), 1U);
  EXPECT_THAT(error_of([&] { load_scenario(put("empty.yaml", "")); }), HasSubstr("there is nothing in it"));
}

TEST_F(ScenarioFile, RefusesRobotsThatAreNone) {
  const auto error = [&](const std::string& text) {
    const auto file = put("field.yaml", text);
    return error_of([&] { load_scenario(file); });
  };
  EXPECT_THAT(error("robot: none.yaml"),
              AllOf(HasSubstr("field.yaml:1: robot: found 'none.yaml'"), HasSubstr("there is no")));
  EXPECT_THAT(error("robot: {name: one}"), HasSubstr("field.yaml:1: robot"));
  put("list.yaml", "- 1\n");
  EXPECT_THAT(error("robot: list.yaml"), HasSubstr("a robot, which is a map"));
  put("another.yaml", "robot: field.yaml\n");
  EXPECT_THAT(error("robot: another.yaml"), HasSubstr("another.yaml:1: robot"));
}

TEST_F(ScenarioFile, SaysWhatFilesOfOtherKindsAre) {
  const auto error = [&](const std::string& text) {
    const auto file = put("field.yaml", text);
    return error_of([&] { load_scenario(file); });
  };
  EXPECT_THAT(error("scenario: x.yaml\ngrid: {speed: [1, 2]}"),
              AllOf(HasSubstr("field.yaml:2: grid"), HasSubstr("this file is for 'rhec sweep'")));
  EXPECT_THAT(error("name: car\nequations: |\n  x' = v"), HasSubstr("'model: {equations: FILE}'"));
  refuse_what_is_no_scenario(settings("speed: 3"));
  refuse_what_is_no_scenario(Settings());
}

TEST(PutOver, MergesMapsAndReplacesAllElse) {
  Settings base = settings("a: {b: 1, c: [1, 2]}\nd: {e: 4}");
  put_over(base, settings("a: {c: [3]}\nd: 5\nf: 6"));
  EXPECT_EQ(base.find("a")->find("b")->as_number(), 1.0);
  EXPECT_EQ(base.find("a")->find("c")->items().size(), 1U);
  EXPECT_EQ(base.find("d")->as_number(), 5.0);
  EXPECT_EQ(base.find("f")->as_number(), 6.0);
}

}  // namespace scenario_file_test
}  // namespace rhec
