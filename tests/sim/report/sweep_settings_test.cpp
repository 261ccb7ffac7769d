#include "sim/report/sweep_settings.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "sim/support/run_groups.hpp"

namespace rhec::sim {
namespace sweep_settings_test {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(SweepValues, AreTextsOfJson) {
  const RunGroup group = group_of({{"speed", "4"}, {"solver", "\"gn_rti\""}});
  EXPECT_EQ(value_of(group, "speed"), "4");
  EXPECT_EQ(value_of(group, "horizon"), no_value);
  EXPECT_EQ(number_in("4.5"), 4.5);
  EXPECT_EQ(number_in("-1e-3"), -1e-3);
  EXPECT_EQ(number_in("\"4.5\""), std::nullopt);
  EXPECT_EQ(number_in("4.5 m"), std::nullopt);
  EXPECT_EQ(plain_text("\"gn_rti\""), "gn_rti");
  EXPECT_EQ(plain_text("[1,2]"), "[1,2]");
}

TEST(SweepValues, ComeInTheOrderInWhichOneReadsThem) {
  EXPECT_TRUE(comes_before("9", "10"));
  EXPECT_FALSE(comes_before("10", "9"));
  EXPECT_TRUE(comes_before("10", "\"a\""));
  EXPECT_TRUE(comes_before("\"a\"", "\"b\""));
  EXPECT_TRUE(comes_before(no_value, "-5"));
  EXPECT_FALSE(comes_before("4", "4"));
}

TEST(SweepSettings, KeysThatVaryTogetherAreOne) {
  const std::vector<RunGroup> groups = {
      group_of({{"model.mass", "1"}, {"model.name", "\"a\""}, {"speed", "4"}, {"step", "0.2"}}),
      group_of({{"model.mass", "2"}, {"model.name", "\"b\""}, {"speed", "4"}, {"step", "0.2"}}),
      group_of({{"model.mass", "2"}, {"model.name", "\"b\""}, {"speed", "8"}, {"step", "0.2"}})};
  const SweepSettings settings(groups);
  EXPECT_THAT(settings.varies(), ElementsAre("model.mass", "model.name", "speed"));
  ASSERT_EQ(settings.varied().size(), 2U);
  const VariedKey &model = settings.varied()[0], &speed = settings.varied()[1];
  EXPECT_EQ(model.key, "model.name") << "a name says more than the number that goes with it";
  EXPECT_THAT(model.all, ElementsAre("model.mass", "model.name"));
  EXPECT_THAT(model.values, ElementsAre("\"b\"", "\"a\"")) << "first what has most runs";
  EXPECT_FALSE(model.is_numeric());
  EXPECT_EQ(speed.key, "speed");
  EXPECT_TRUE(speed.is_numeric());
  EXPECT_FALSE(settings.is_of_blocking());
}

TEST(SweepSettings, AKeyThatIsNotEverywhereVaries) {
  const std::vector<RunGroup> groups = {group_of({{"speed", "10"}}), group_of({{"speed", "9"}}), group_of({})};
  const SweepSettings settings(groups);
  ASSERT_EQ(settings.varied().size(), 1U);
  EXPECT_THAT(settings.varied()[0].values, ElementsAre(no_value, "9", "10"));
  EXPECT_FALSE(settings.varied()[0].is_numeric());
}

TEST(SweepSettings, OfGroupsThatAreAlikeNothingVaries) {
  const std::vector<RunGroup> groups = {group_of({{"speed", "4"}}, 5)};
  EXPECT_THAT(SweepSettings(groups).varies(), IsEmpty());
  EXPECT_THAT(SweepSettings(groups).varied(), IsEmpty());
  EXPECT_THAT(SweepSettings(groups).sorted_values("speed"), ElementsAre("4"));
}

/// Both parameters in blocks of these lengths and overlaps; "" has none.
RunGroup blocked(const std::string& kappa, const std::string& kappa_overlap, const std::string& mu,
                 const std::string& mu_overlap) {
  RunGroup group = group_of({{"speed", "4"}});
  const auto add = [&](const std::string& parameter, const std::string& size, const std::string& overlap) {
    group.keys["blocking." + parameter + ".name"] = size.empty() ? "\"full_horizon\"" : "\"structured\"";
    if (!size.empty()) group.keys["blocking." + parameter + ".size"] = size;
    if (!overlap.empty()) group.keys["blocking." + parameter + ".overlap"] = overlap;
  };
  add("kappa", kappa, kappa_overlap);
  add("mu", mu, mu_overlap);
  return group;
}

TEST(SweepSettings, TellsTheBlocksOfAGroup) {
  const std::vector<RunGroup> groups = {blocked("2", "", "", ""), blocked("2", "4", "2", "4"),
                                        blocked("2", "4", "3", "4"), blocked("", "", "", "")};
  const SweepSettings settings(groups);
  const auto one = settings.blocks_of(groups[0]), both = settings.blocks_of(groups[1]);
  ASSERT_TRUE(one && both);
  EXPECT_THAT(one->parameters, ElementsAre("kappa"));
  EXPECT_EQ(one->size, "2");
  EXPECT_EQ(one->overlap, "0") << "the one that is not there";
  EXPECT_THAT(both->parameters, ElementsAre("kappa", "mu"));
  EXPECT_EQ(both->overlap, "4");
  EXPECT_FALSE(settings.blocks_of(groups[2])) << "two lengths have no place on a map";
  EXPECT_FALSE(settings.blocks_of(groups[3]));
  EXPECT_TRUE(settings.is_of_blocking()) << "their overlaps vary";
  EXPECT_THAT(settings.varied(), IsEmpty()) << "but for the blocking nothing does";
}

TEST(SweepSettings, SaysWhatIsBlockedAndWhatElseVaries) {
  std::vector<RunGroup> groups = {blocked("2", "", "", ""), blocked("3", "", "", "")};
  groups[0].keys["blocking.kappa.neighbour_sigma"] = "0.04";
  groups[1].keys["blocking.mu.name"] = "\"unblocked\"";
  groups[1].keys["speed"] = "8";
  const SweepSettings settings(groups);
  EXPECT_EQ(settings.blocked_words(groups[0], {"kappa"}), "kappa, neighbour_sigma 0.04");
  EXPECT_EQ(settings.blocked_words(groups[1], {"kappa"}), "kappa, mu unblocked");
  EXPECT_EQ(settings.rest_of(groups[1], {"kappa"}), "blocking.mu.name=\"unblocked\"\nspeed=8\n");
  EXPECT_EQ(settings.rest_of(groups[1], {"kappa", "mu"}), "speed=8\n");
  EXPECT_THAT(settings.blocked_words(groups[0], {"kappa", "mu"}), testing::StartsWith("kappa and mu"));
}

}  // namespace sweep_settings_test
}  // namespace rhec::sim
