#include "blocking/view.hpp"

namespace rhec {
namespace pattern_test {

using namespace testing;

TEST(Pattern, IsAnchoredAtTheHorizon) {
  const auto blocking = make("pattern", "lengths: [1, 2, 4]");
  EXPECT_EQ(view(*blocking, 7, 7), (View{0, {1, 3}}));
  EXPECT_EQ(view(*blocking, 30, 20), (View{10, {11, 13}})) << "the last block goes on";
  EXPECT_EQ(view(*blocking, 30, 3), (View{27, {28}})) << "a list longer than the horizon";
  EXPECT_EQ(view(*make("pattern", "lengths: [3]"), 30, 20), (View{10, {}}));
}

TEST(Pattern, RepeatsInTime) {
  const auto blocking = make("pattern", "{lengths: [1, 2, 4], anchor: time}");  // starts 0, 1, 3; 7, 8, 10; 14, ...
  EXPECT_EQ(view(*blocking, 16, 16), (View{0, {1, 3, 7, 8, 10, 14, 15}}));
  EXPECT_EQ(view(*blocking, 16, 10), (View{3, {7, 8, 10, 14, 15}}));
  EXPECT_EQ(view(*blocking, 16, 9), (View{7, {8, 10, 14, 15}}));
  for (int size = 1; size <= 6; ++size) {
    const auto equal = make("pattern", "{lengths: [" + std::to_string(size) + "], anchor: time}");
    for (int k = 10; k <= 40; ++k) EXPECT_EQ(view(*equal, k, 10), view(*structured(size, 0), k, 10));
  }
}

TEST(Pattern, TellsMistakesWithPlaceAndRemedy) {
  EXPECT_THAT(mistake("pattern", ""), HasSubstr("lengths: expected at least one block length"));
  EXPECT_THAT(mistake("pattern", "lengths: [2, 0]"), HasSubstr("lengths[1]: found '0'"));
}

}  // namespace pattern_test
}  // namespace rhec
