#include "sim/report/sweep_maps.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include <fmt/format.h>

#include "sim/support/run_groups.hpp"

namespace rhec::sim {
namespace sweep_maps_test {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<std::string> subjects_of(const Json& notes) {
  std::vector<std::string> subjects;
  for (const Json& note : notes) subjects.push_back(note.at("about").as_text());
  return subjects;
}

/// Blocks of two lengths and two overlaps at two speeds, and without blocks, two seeds each.
std::vector<RunGroup> blockings() {
  std::vector<RunGroup> groups;
  for (const char* speed : {"4", "8"}) {
    for (const char* size : {"1", "2"})
      for (const char* overlap : {"0", "4"})
        groups.push_back(group_of({{"speed", speed},
                                   {"blocking.kappa.name", "\"structured\""},
                                   {"blocking.kappa.size", size},
                                   {"blocking.kappa.overlap", overlap}},
                                  2));
    groups.push_back(group_of({{"speed", speed}, {"blocking.kappa.name", "\"full_horizon\""}}, 2));
  }
  groups.push_back(group_of({{"speed", "4"}, {"blocking.kappa.name", "\"unblocked\""}}, 2));
  return groups;
}

TEST(BlockingMaps, ThereIsOneForEachOfTheOtherSettings) {
  const std::vector<RunGroup> groups = blockings();
  Json notes = Json::array();
  const SweepMaps maps = blocking_maps(groups, SweepSettings(groups), notes);
  ASSERT_EQ(maps.axes.size(), 2U);
  EXPECT_EQ(maps.axes[0].key, "size");
  EXPECT_EQ(maps.axes[1].key, "overlap");
  ASSERT_EQ(maps.choice_keys.size(), 2U);
  EXPECT_EQ(maps.choice_keys[0].key, "speed");
  EXPECT_EQ(maps.choice_keys[1].key, "blocked");
  EXPECT_THAT(maps.choice_keys[1].values, ElementsAre("\"kappa\""));
  ASSERT_EQ(maps.maps.size(), 2U);
  for (const SweepMap& map : maps.maps) {
    const std::string speed = map.setting.at(0);
    EXPECT_TRUE(map.is_blocking);
    EXPECT_EQ(map.setting.at(1), "\"kappa\"");
    EXPECT_EQ(map.cells.size(), 4U);
    EXPECT_EQ(map.runs(), 8);
    const Cell& cell = map.cells.at({"2", "4"});
    ASSERT_EQ(cell.size(), 1U);
    EXPECT_EQ(value_of(*cell.front(), "speed"), speed);
    EXPECT_EQ(value_of(*cell.front(), "blocking.kappa.size"), "2");
    ASSERT_NE(map.reference, nullptr);
    EXPECT_EQ(value_of(*map.reference, "speed"), speed);
    EXPECT_EQ(value_of(*map.reference, "blocking.kappa.name"), "\"full_horizon\"");
    EXPECT_EQ(map.unblocked != nullptr, speed == "4") << "at one speed alone there is one";
  }
  EXPECT_THAT(maps.others, IsEmpty());
  EXPECT_THAT(subjects_of(notes), IsEmpty());
}

TEST(BlockingMaps, WhatIsOnNoMapIsTold) {
  std::vector<RunGroup> groups = blockings();
  groups.push_back(
      group_of({{"speed", "4"}, {"blocking.kappa.name", "\"unblocked\""}, {"blocking.kappa.neighbour_sigma", "0.04"}}));
  Json notes = Json::array();
  const SweepMaps maps = blocking_maps(groups, SweepSettings(groups), notes);
  EXPECT_THAT(maps.others, ElementsAre(&groups.back())) << "the plain one is what maps are held against";
}

TEST(BlockingMaps, SettingsWithoutARunOnTheFullHorizonAreTold) {
  std::vector<RunGroup> groups = blockings();
  std::erase_if(groups, [](const RunGroup& group) {
    return value_of(group, "blocking.kappa.name") == "\"full_horizon\"" && value_of(group, "speed") == "8";
  });
  Json notes = Json::array();
  const SweepMaps maps = blocking_maps(groups, SweepSettings(groups), notes);
  for (const SweepMap& map : maps.maps) EXPECT_EQ(map.reference != nullptr, map.setting.at(0) == "4");
  EXPECT_THAT(subjects_of(notes), ElementsAre("pairs"));
}

TEST(GeneralMaps, NumbersMakeTheAxes) {
  std::vector<RunGroup> groups;
  for (const char* solver : {"\"gn_rti\"", "\"ipopt\""})
    for (const char* horizon : {"5", "10"})
      for (const char* speed : {"4", "8", "12"})
        groups.push_back(group_of({{"horizon", horizon}, {"solver.name", solver}, {"speed", speed}}));
  Json notes = Json::array();
  const SweepMaps maps = general_maps(groups, SweepSettings(groups), notes);
  ASSERT_EQ(maps.axes.size(), 2U);
  EXPECT_EQ(maps.axes[0].key, "speed") << "the one with most values comes first";
  EXPECT_THAT(maps.axes[0].values, ElementsAre("4", "8", "12"));
  EXPECT_EQ(maps.axes[1].key, "horizon");
  ASSERT_EQ(maps.choice_keys.size(), 1U);
  EXPECT_EQ(maps.choice_keys[0].key, "solver.name");
  ASSERT_EQ(maps.maps.size(), 2U);
  for (const SweepMap& map : maps.maps) {
    EXPECT_EQ(map.cells.size(), 6U);
    EXPECT_EQ(value_of(*map.cells.at({"12", "5"}).front(), "solver.name"), map.setting.at(0));
    EXPECT_EQ(map.reference, nullptr);
  }
  EXPECT_THAT(subjects_of(notes), ElementsAre("pairs"));
}

TEST(GeneralMaps, OfOneSettingThereIsOneCell) {
  const std::vector<RunGroup> groups = {group_of({{"name", "\"figure8\""}, {"speed", "4"}}, 3)};
  Json notes = Json::array();
  const SweepMaps maps = general_maps(groups, SweepSettings(groups), notes);
  ASSERT_EQ(maps.axes.size(), 1U);
  EXPECT_EQ(maps.axes[0].key, "name");
  ASSERT_EQ(maps.maps.size(), 1U);
  EXPECT_EQ(maps.maps[0].cells.size(), 1U);
  EXPECT_EQ(maps.maps[0].cells.count({"\"figure8\"", no_value}), 1U);
  EXPECT_EQ(maps.maps[0].runs(), 3);
  EXPECT_THAT(subjects_of(notes), Contains("runs"));
}

TEST(GeneralMaps, WhereThereAreTooManyChoicesMeansAreOverThem) {
  std::vector<RunGroup> groups;
  for (int i = 0; i < 61; ++i)
    groups.push_back(group_of({{"speed", fmt::format("{}", i % 2)},
                               {"horizon", fmt::format("{}", i / 2 % 2)},
                               {"path.file", fmt::format("\"{:02}.csv\"", i)}}));
  Json notes = Json::array();
  const SweepMaps maps = general_maps(groups, SweepSettings(groups), notes);
  EXPECT_THAT(maps.choice_keys, IsEmpty());
  ASSERT_EQ(maps.maps.size(), 1U);
  EXPECT_EQ(maps.maps[0].cells.size(), 4U);
  EXPECT_EQ(maps.maps[0].runs(), 61);
  EXPECT_THAT(subjects_of(notes), Contains("settings"));
  EXPECT_THAT(notes.dump(), HasSubstr("the 61 values of path.file"));
}

}  // namespace sweep_maps_test
}  // namespace rhec::sim
