#include "blocking/view.hpp"

namespace rhec {
namespace structured_test {

using namespace testing;

TEST(Structured, ThePictureOfThePaper) {
  const auto blocking = structured(5, 4);
  // k = 38: the start 35 leaves 3 intervals, fewer than 4. The window's first interval 23 is in the block of 20.
  EXPECT_EQ(view(*blocking, 38, 15), (View{20, {25, 30}}));
  // k = 39: it leaves 4.
  EXPECT_EQ(view(*blocking, 39, 15), (View{20, {25, 30, 35}}));
  EXPECT_EQ(view(*blocking, 40, 15), (View{25, {30, 35}}));
}

TEST(Structured, WithoutOverlapEveryMultipleStartsABlock) {
  EXPECT_EQ(view(*structured(5, 0), 38, 15), (View{20, {25, 30, 35}}));
  EXPECT_EQ(view(*structured(5, 0), 36, 15), (View{20, {25, 30, 35}}));
  EXPECT_EQ(view(*structured(5, 0), 35, 15), (View{20, {25, 30}})) << "the interval 35 is not in the window yet";
}

TEST(Structured, SeveralStartsCanBeSuppressed) {
  const auto blocking = structured(2, 4);
  // Of 6, 8, ..., 18: 18 leaves 2 intervals, 16 leaves 4.
  EXPECT_EQ(view(*blocking, 20, 15), (View{4, {6, 8, 10, 12, 14, 16}}));
  EXPECT_EQ(view(*blocking, 21, 15), (View{6, {8, 10, 12, 14, 16}}));
  EXPECT_EQ(view(*structured(1, 4), 20, 6), (View{14, {15, 16}}));
}

TEST(Structured, OverlapsOfNoneAndOneAreTheSame) {
  for (int size = 1; size <= 30; ++size) {
    const auto none = structured(size, 0), one = structured(size, 1);
    for (int k = 0; k <= 60; ++k)
      for (int intervals = 1; intervals <= std::min(k, 30); ++intervals)
        ASSERT_EQ(view(*none, k, intervals), view(*one, k, intervals)) << size << ", " << k << ", " << intervals;
  }
}

TEST(Structured, OfSizeOneIsUnblocked) {
  const auto unblocked = make("unblocked");
  for (const int overlap : {0, 1}) {
    const auto blocking = structured(1, overlap);
    for (int k = 1; k <= 60; ++k)
      for (int intervals = 1; intervals <= std::min(k, 30); ++intervals)
        ASSERT_EQ(view(*blocking, k, intervals), view(*unblocked, k, intervals));
  }
}

TEST(Structured, WithNoBorderInViewHasTheStructureOfFullHorizon) {
  const auto full = make("full_horizon");
  EXPECT_EQ(view(*structured(15, 0), 45, 15).borders, view(*full, 45, 15).borders);
  EXPECT_EQ(view(*structured(15, 15), 50, 15).borders, view(*full, 50, 15).borders);
  for (int overlap = 0; overlap <= 15; ++overlap)
    EXPECT_EQ(view(*structured(30, overlap), 17, 15).borders, view(*full, 17, 15).borders);
}

TEST(Structured, TheRuleOfTheMethodForAllSmallNumbers) {
  for (int size = 1; size <= 7; ++size) {
    for (int overlap = 0; overlap <= 9; ++overlap) {
      const auto blocking = structured(size, overlap);
      for (int k = 1; k <= 40; ++k) {
        for (int intervals = std::max(1, overlap); intervals <= std::min(k, 20); ++intervals) {
          const std::int64_t first = k - intervals;
          View expected{first, {}};
          while (expected.first_start % size != 0) --expected.first_start;
          for (std::int64_t s = first + 1; s < k; ++s)
            if (s % size == 0 && k - s >= overlap) expected.borders.push_back(s);
          ASSERT_EQ(view(*blocking, k, intervals), expected) << size << ", " << overlap << ", " << k;
        }
      }
    }
  }
}

TEST(Structured, ABorderThatExistsStaysWhereItIs) {
  for (const auto& [size, overlap] : {std::pair{5, 4}, {2, 4}, {3, 0}, {7, 10}}) {
    const auto blocking = structured(size, overlap);
    for (int k = 16; k <= 80; ++k) {
      const View before = view(*blocking, k - 1, 15), now = view(*blocking, k, 15);
      for (const std::int64_t border : before.borders) {
        const bool in_view = border > k - 15;
        if (in_view) {
          EXPECT_THAT(now.borders, ::testing::Contains(border));
        } else {
          EXPECT_EQ(now.first_start, border) << "the block that slid to the edge is the first one";
        }
      }
      EXPECT_GE(now.first_start, before.first_start);
      EXPECT_LE(now.borders.size(), before.borders.size() + 1) << "at most one block is born at a step";
    }
  }
}

TEST(Structured, AWindowThatGrowsFromTheStartOfTheRun) {
  const auto blocking = structured(2, 4);
  EXPECT_EQ(view(*blocking, 1, 1), (View{0, {}}));
  EXPECT_EQ(view(*blocking, 3, 3), (View{0, {}})) << "shorter than the overlap: one block";
  EXPECT_EQ(view(*blocking, 5, 5), (View{0, {}}));
  EXPECT_EQ(view(*blocking, 6, 6), (View{0, {2}}));
  for (int k = 2; k <= 15; ++k) {
    const auto before = view(*blocking, k - 1, k - 1).borders;
    EXPECT_THAT(view(*blocking, k, k).borders, ::testing::IsSupersetOf(before));
  }
}

TEST(Structured, AnchoredAtTheHorizonItMovesWithIt) {
  const auto blocking = structured(4, 0, ", anchor: horizon");
  EXPECT_EQ(view(*blocking, 10, 10), (View{0, {4, 8}}));
  EXPECT_EQ(view(*blocking, 23, 10), (View{13, {17, 21}}));
  const auto overlapping = structured(4, 3, ", anchor: horizon");
  EXPECT_EQ(view(*overlapping, 23, 10), (View{13, {17}})) << "the last block of 2 belongs to the one before";
  EXPECT_EQ(view(*overlapping, 24, 11), (View{13, {17, 21}}));
}

TEST(Structured, RefusesAnOverlapLongerThanTheHorizon) {
  const auto blocking = structured(2, 4);
  EXPECT_EQ(blocking->why_not(4), "");
  EXPECT_EQ(blocking->why_not(15), "");
  EXPECT_THAT(blocking->why_not(3),
              HasSubstr("an overlap of 4 needs a horizon of at least 4 intervals, and this one has "
                        "3; make the overlap smaller or the horizon longer"));
  EXPECT_THAT(blocking->why_not(0), HasSubstr("at least one interval"));
}

TEST(Structured, LinksItsBlocksAsTold) {
  EXPECT_EQ(structured(5, 4)->transition(), Transition::step);
  EXPECT_EQ(structured(5, 4)->neighbour_sigma(), std::nullopt);
  const auto linked = structured(5, 4, ", transition: ramp, neighbour_sigma: 0.04");
  EXPECT_EQ(linked->transition(), Transition::ramp);
  EXPECT_EQ(linked->neighbour_sigma(), 0.04);
}

TEST(Structured, TellsMistakesWithPlaceAndRemedy) {
  EXPECT_THAT(mistake("structured", "size: 0"), HasSubstr("test:1: size: found '0', expected an integer, at least 1"));
  EXPECT_THAT(mistake("structured", "overlap: -1"), HasSubstr("overlap: found '-1', expected an integer, at least 0"));
  EXPECT_THAT(mistake("structured", "overlp: 3"), HasSubstr("did you mean 'overlap'?"));
  EXPECT_THAT(mistake("structured", "anchor: tiem"), HasSubstr("time"));
  EXPECT_THAT(mistake("structured", "neighbour_sigma: 0"), HasSubstr("greater than 0"));
}

}  // namespace structured_test
}  // namespace rhec
