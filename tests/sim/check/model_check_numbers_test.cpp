// Models whose numbers are not finite somewhere: the check tells where.
#include <gmock/gmock.h>

#include <cmath>

#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace model_check_numbers_test {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(ModelCheck, FindsWhereNumbersAreNotFinite) {
  const ModelCheck found = check(Fault::root_of_a_state);
  ASSERT_THAT(faults(found), testing::SizeIs(1));
  const Finding& numbers = finding_of(found, "numbers");
  EXPECT_EQ(numbers.verdict, Verdict::fail);
  EXPECT_THAT(numbers.where, testing::MatchesRegex("rate in \\[-0\\.8, -0\\.(4[6-9]|50?).*\\]")) << numbers.where;
  EXPECT_THAT(numbers.where, testing::Not(HasSubstr(";"))) << "no other variable has to do with it";
  EXPECT_THAT(numbers.found, HasSubstr("next states"));
}

TEST(ModelCheck, FindsWhereOutputsAreNotFiniteWithoutBounds) {
  const ModelCheck found = check(Fault::log_of_an_output, [](ModelDescription& about) {
    about.states[3].lower = -HUGE_VAL;
    about.states[3].upper = HUGE_VAL;
  });
  ASSERT_THAT(faults(found), testing::SizeIs(1));
  const Finding& numbers = finding_of(found, "numbers");
  EXPECT_THAT(numbers.where, testing::StartsWith("rate in [0.9")) << numbers.where;
  EXPECT_THAT(numbers.found, HasSubstr("outputs"));
  // Within bounds that keep away from it, there is nothing to find.
  EXPECT_THAT(faults(check(Fault::log_of_an_output)), ElementsAre());
}

TEST(ModelCheck, FindsAPoleThatIsFiniteEverywhere) {
  const ModelCheck found = check(Fault::pole_of_a_state, [](ModelDescription& about) {
    about.states[3].unit = "rad";
    about.states[3].lower = -HUGE_VAL;
    about.states[3].upper = HUGE_VAL;
  });
  ASSERT_THAT(faults(found), testing::SizeIs(1)) << testing::PrintToString(faults(found));
  const Finding& numbers = finding_of(found, "numbers");
  EXPECT_EQ(numbers.verdict, Verdict::warn);
  EXPECT_THAT(numbers.where, HasSubstr("rate in [")) << numbers.where;
  EXPECT_THAT(faults(check(Fault::pole_of_a_state)), ElementsAre());
}

}  // namespace model_check_numbers_test
}  // namespace rhec::sim
