// The strategy of plugins/template.
#include "blocking/view.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace geometric_test {

using namespace testing;

TEST(Geometric, GrowsFromTheStartOfAControllersHorizon) {
  const auto blocking = make("geometric", "{now: start, first: 1, factor: 2}");
  EXPECT_EQ(view(*blocking, 15, 15), (View{0, {1, 3, 7}}));
  EXPECT_EQ(view(*blocking, 115, 15), (View{100, {101, 103, 107}}));
  EXPECT_EQ(view(*make("geometric", "{now: start, first: 2, factor: 3}"), 20, 20), (View{0, {2, 8}}));
}

TEST(Geometric, GrowsWithAgeInAnEstimatorsWindow) {
  const auto blocking = make("geometric", "{now: end, first: 1, factor: 2}");
  // Ages 1; 2 and 3; 4 to 7; 8 to 15: lengths 1, 2, 4, 8.
  EXPECT_EQ(view(*blocking, 16, 16), (View{0, {8, 12, 14, 15}}));
  EXPECT_EQ(view(*blocking, 100, 12), (View{88, {96, 98, 99}}));
  EXPECT_EQ(view(*blocking, 101, 12).first_start, 88);
}

TEST(Geometric, BordersOfAnEstimatorStayWhereTheyAreOrVanishForGood) {
  for (const char* options : {"{now: end}", "{now: end, first: 3}", "{now: end, first: 2, factor: 3}"}) {
    const auto blocking = make("geometric", options);
    for (const int horizon : {4, 15, 31}) {
      View before = view(*blocking, horizon, horizon);
      for (std::int64_t k = horizon + 1; k < 300; ++k) {
        const View now = view(*blocking, k, horizon);
        for (const std::int64_t border : now.borders)
          EXPECT_TRUE(border == k - 1 || ::testing::Value(before.borders, ::testing::Contains(border)))
              << options << ": " << border << " appears at step " << k;
        // A block at the window's edge is the one that was there, or the next one, once that has come to the edge.
        if (now.first_start != before.first_start) {
          EXPECT_EQ(now.first_start, k - horizon) << options << " at step " << k;
          EXPECT_THAT(before.borders, ::testing::Contains(now.first_start));
        }
        before = now;
      }
    }
  }
}

TEST(Geometric, RefusesWhatItCannotDo) {
  EXPECT_THAT(error_of([] { make("geometric"); }), HasSubstr("now: expected 'end' for an estimator or 'start'"));
  EXPECT_EQ(make("geometric", "{now: end, first: 4}")->why_not(15), "");
  EXPECT_THAT(make("geometric", "{now: end, first: 15}")->why_not(15), HasSubstr("as long as the horizon"));
}

}  // namespace geometric_test
}  // namespace rhec
