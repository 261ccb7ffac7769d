#include "blocking/view.hpp"

namespace rhec {
namespace unblocked_test {

using namespace testing;

TEST(Unblocked, HasAValueForEveryInterval) {
  EXPECT_EQ(view(*make("unblocked"), 12, 5), (View{7, {8, 9, 10, 11}}));
  EXPECT_EQ(make("unblocked", "neighbour_sigma: 0.04")->neighbour_sigma(), 0.04);
}

TEST(Unblocked, JumpsOrGoesByRamps) {
  EXPECT_EQ(make("unblocked")->transition(), Transition::step);
  EXPECT_EQ(make("unblocked", "transition: ramp")->transition(), Transition::ramp);
  EXPECT_FALSE(make("unblocked")->neighbour_sigma());
  EXPECT_THAT(mistake("unblocked", "transition: jump"), HasSubstr("one of step, ramp"));
}

}  // namespace unblocked_test
}  // namespace rhec
