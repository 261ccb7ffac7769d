#include "blocking/view.hpp"

namespace rhec {
namespace full_horizon_test {

using namespace testing;

TEST(FullHorizon, IsOneBlockThatBeganWithTheRun) {
  const auto blocking = make("full_horizon");
  for (const int k : {1, 7, 15, 400}) EXPECT_EQ(view(*blocking, k, std::min(k, 15)), (View{0, {}}));
  EXPECT_EQ(blocking->why_not(1), "");
  EXPECT_THAT(blocking->why_not(0), HasSubstr("at least one interval"));
}

TEST(FullHorizon, IsKnownToMakeOneBlockOnly) {
  EXPECT_TRUE(make("full_horizon")->is_one_block());
  EXPECT_FALSE(make("unblocked")->is_one_block());
  EXPECT_FALSE(structured(15, 0)->is_one_block()) << "a border may pass through";
}

TEST(FullHorizon, HasNoOptions) {
  EXPECT_THAT(mistake("full_horizon", "size: 3"), HasSubstr("'full_horizon' has no options; remove 'size'"));
}

}  // namespace full_horizon_test
}  // namespace rhec
