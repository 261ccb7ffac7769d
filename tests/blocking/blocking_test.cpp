// The blocking strategies, through their plugins, against METHOD's rules.
#include "rhec/core/horizon/blocking.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::shared_ptr<Blocking> make(const std::string& name, const std::string& yaml = "") {
  static const Host host({TEMPLATE_PLUGINS});
  return host.make_blocking(name, parse_yaml(yaml, "test"));
}

std::shared_ptr<Blocking> structured(int size, int overlap, const std::string& more = "") {
  return make("structured", "{size: " + std::to_string(size) + ", overlap: " + std::to_string(overlap) + more + "}");
}

/// What a strategy says of the window of `intervals` that ends at step k.
struct View {
  std::int64_t first_start;
  std::vector<std::int64_t> borders;  ///< absolute starts of blocks behind the window's first interval

  bool operator==(const View&) const = default;
};

View view(const Blocking& blocking, std::int64_t k, int intervals) {
  const std::int64_t first = k - intervals;
  std::vector<std::uint8_t> begins(intervals + 1, 7);  // rubbish, and one behind the end
  View result{blocking.starts({.first = first, .intervals = intervals}, begins.data()), {}};
  EXPECT_EQ(begins[0], 1);
  EXPECT_EQ(begins[intervals], 7) << "written behind the end";
  EXPECT_LE(result.first_start, first);
  EXPECT_GE(result.first_start, 0);
  for (int i = 1; i < intervals; ++i) {
    EXPECT_LE(begins[i], 1);
    if (begins[i]) result.borders.push_back(first + i);
  }
  return result;
}

template <class Call>
std::string message(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

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
          EXPECT_THAT(now.borders, testing::Contains(border));
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
    EXPECT_THAT(view(*blocking, k, k).borders, testing::IsSupersetOf(before));
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

TEST(FullHorizon, IsOneBlockThatBeganWithTheRun) {
  const auto blocking = make("full_horizon");
  for (const int k : {1, 7, 15, 400}) EXPECT_EQ(view(*blocking, k, std::min(k, 15)), (View{0, {}}));
  EXPECT_EQ(blocking->why_not(1), "");
  EXPECT_THAT(blocking->why_not(0), HasSubstr("at least one interval"));
}

TEST(Unblocked, HasAValueForEveryInterval) {
  EXPECT_EQ(view(*make("unblocked"), 12, 5), (View{7, {8, 9, 10, 11}}));
  EXPECT_EQ(make("unblocked", "neighbour_sigma: 0.04")->neighbour_sigma(), 0.04);
}

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

// --- the template's
// ---------------------------------------------------------------------------------------------------

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
          EXPECT_TRUE(border == k - 1 || testing::Value(before.borders, testing::Contains(border)))
              << options << ": " << border << " appears at step " << k;
        // A block at the window's edge is the one that was there, or the next one, once that has come to the edge.
        if (now.first_start != before.first_start) {
          EXPECT_EQ(now.first_start, k - horizon) << options << " at step " << k;
          EXPECT_THAT(before.borders, testing::Contains(now.first_start));
        }
        before = now;
      }
    }
  }
}

TEST(Geometric, RefusesWhatItCannotDo) {
  EXPECT_THAT(message([] { make("geometric"); }), HasSubstr("now: expected 'end' for an estimator or 'start'"));
  EXPECT_EQ(make("geometric", "{now: end, first: 4}")->why_not(15), "");
  EXPECT_THAT(make("geometric", "{now: end, first: 15}")->why_not(15), HasSubstr("as long as the horizon"));
}

TEST(BlockingOptions, MistakesAreToldWithPlaceAndRemedy) {
  const auto mistake = [](const std::string& name, const std::string& yaml) {
    return message([&] { make(name, yaml); });
  };
  EXPECT_THAT(mistake("structured", "size: 0"), HasSubstr("test:1: size: found '0', expected an integer, at least 1"));
  EXPECT_THAT(mistake("structured", "overlap: -1"), HasSubstr("overlap: found '-1', expected an integer, at least 0"));
  EXPECT_THAT(mistake("structured", "overlp: 3"), HasSubstr("did you mean 'overlap'?"));
  EXPECT_THAT(mistake("structured", "anchor: tiem"), HasSubstr("time"));
  EXPECT_THAT(mistake("structured", "neighbour_sigma: 0"), HasSubstr("greater than 0"));
  EXPECT_THAT(mistake("unblocked", "transition: jump"), HasSubstr("one of step, ramp"));
  EXPECT_THAT(mistake("full_horizon", "size: 3"), HasSubstr("'full_horizon' has no options; remove 'size'"));
  EXPECT_THAT(mistake("pattern", ""), HasSubstr("lengths: expected at least one block length"));
  EXPECT_THAT(mistake("pattern", "lengths: [2, 0]"), HasSubstr("lengths[1]: found '0'"));
}

}  // namespace
}  // namespace rhec
