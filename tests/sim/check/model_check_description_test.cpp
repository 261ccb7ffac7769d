// Models that are described wrongly, or move as they are not described.
#include <gmock/gmock.h>

#include <cmath>
#include <string>

#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace model_check_description_test {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(ModelCheck, FindsWhatADescriptionGetsWrong) {
  using About = ModelDescription;
  const std::vector<std::pair<std::function<void(About&)>, std::string>> cases = {
      {[](About& a) { a.name.clear(); }, "fail description: model"},
      {[](About& a) { a.source.clear(); }, "warn description: model"},
      {[](About& a) { a.inputs[1].name = "kappa"; }, "fail description: parameter kappa"},
      {[](About& a) { a.outputs[1].name = "x_gps"; }, "fail description: output x_gps"},
      {[](About& a) { a.states[3].name = "yaw rate"; }, "fail description: state yaw rate"},
      {[](About& a) { a.parameters[1].name = ""; }, "fail description: parameter 1"},
      {[](About& a) { a.parameters[1].unit = ""; }, "fail description: parameter mu"},
      {[](About& a) { a.outputs[0].meaning = ""; }, "warn description: output x_gps"},
      {[](About& a) { a.parameters[1].nominal = 2.0; }, "fail description: parameter mu"},
      {[](About& a) { a.states[0].unit = "cm"; }, "fail description: roles.position_x"},
      {[](About& a) { a.states[2].is_angle = false; }, "fail description: roles.heading"},
      {[](About& a) { a.states[0].scale = 0.0; }, "fail description: state x"},
      {[](About& a) { a.states[0].scale = HUGE_VAL; }, "fail description: state x"},
      {[](About& a) { a.inputs[1].lower = 2.0; }, "fail description: input w"},
      {[](About& a) { a.roles.speed = 2; }, "fail description: roles.speed"},
      {[](About& a) { a.roles.heading = -2; }, "fail description: roles.heading"},
      {[](About& a) { a.roles.other_headings = {-1}; }, "fail description: roles.other_headings"},
  };
  for (const auto& [spoil, expected] : cases) EXPECT_THAT(faults(check(spoil)), ElementsAre(expected));
  // The name of an output may be that of what it measures.
  EXPECT_THAT(faults(check([](About& a) { a.outputs[0].name = "x"; })), ElementsAre());
}

TEST(ModelCheck, TellsMissingMeaningsOnce) {
  const ModelCheck found = check([](ModelDescription& about) {
    for (Variable& state : about.states) state.meaning.clear();
  });
  EXPECT_THAT(faults(found), ElementsAre("warn description: 4 variables"));
  EXPECT_THAT(finding_of(found, "description").found, HasSubstr("no meaning: state x, state y, "));
}

TEST(ModelCheck, FindsARoleThatPointsAtAnotherVariable) {
  const ModelCheck found = check([](ModelDescription& about) { about.roles.speed = 1; });
  EXPECT_THAT(faults(found), Contains("fail description: roles.speed"));
  EXPECT_THAT(faults(found), Contains("fail straight_motion: at nominal parameters"));
}

TEST(ModelCheck, FindsDynamicsThatKnowWhereTheyAre) {
  const ModelCheck heading = check(Fault::knows_its_heading);
  EXPECT_THAT(faults(heading), ElementsAre("fail symmetry: d rate / dt"));
  EXPECT_THAT(finding_of(heading, "symmetry").found, HasSubstr("turned"));
  const ModelCheck place = check(Fault::knows_its_place);
  EXPECT_THAT(faults(place), ElementsAre("fail symmetry: d rate / dt"));
  EXPECT_THAT(finding_of(place, "symmetry").found, HasSubstr("shifted"));
}

TEST(ModelCheck, FindsThatStraightIsNotStraight) {
  EXPECT_THAT(faults(check(Fault::pulls_aside)), ElementsAre("fail straight_motion: d psi / dt"));
  // The speed factor is not said: at other parameters the vehicle is slower than it should be.
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.roles.speed_factor = -1; })),
              ElementsAre("warn straight_motion: at other parameters"));
}

}  // namespace model_check_description_test
}  // namespace rhec::sim
