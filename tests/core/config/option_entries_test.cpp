#include "rhec/core/config/option_entries.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rhec/core/config/options.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace option_entries_test {

using testing::ElementsAre;

struct Inner {
  int count = 3;
};

enum class Side : unsigned char { left = 200, right = 7 };

struct Outer {
  double length = 1.5;
  Side side = Side::left;
  Settings native;
  Inner inner;
};

Settings scalar(const std::string& text) { return Settings::scalar(text, {"field.yaml", 4}); }

OptionEntries entries() {
  OptionEntries inner;
  inner.add(
      "count", "how many", [](void* object) -> void* { return &static_cast<Inner*>(object)->count; },
      usual_kind(IntegerValue{at_least(1)}));
  OptionEntries outer;
  outer.add(
      "length", "of it [m]", [](void* object) -> void* { return &static_cast<Outer*>(object)->length; },
      usual_kind(NumberValue{}));
  outer.add(
      "side", "where", [](void* object) -> void* { return &static_cast<Outer*>(object)->side; },
      choice_kind(
          {{"left", 200}, {"right", 7}},
          [](const void* of) { return static_cast<long long>(*static_cast<const Side*>(of)); },
          [](void* of, long long number) { *static_cast<Side*>(of) = static_cast<Side>(number); }));
  outer.add(
      "native", "", [](void* object) -> void* { return &static_cast<Outer*>(object)->native; },
      map_kind({{"", "map", "{}", "", "passed on"}, {"depth", "integer", "2", "", "levels"}}));
  outer.add(
      "inner", "", [](void* object) -> void* { return &static_cast<Outer*>(object)->inner; },
      group_kind(std::move(inner)));
  outer.add_renamed("size", "length");
  return outer;
}

TEST(OptionEntries, ReadAStructByItsAddress) {
  Settings root;
  root.set("length", scalar("2.5"));
  root.set("side", scalar("right"));
  root.set("native.any", scalar("thing"));
  root.set("inner.count", scalar("9"));
  Outer outer;
  entries().read(&outer, root, "toy");
  EXPECT_EQ(outer.length, 2.5);
  EXPECT_EQ(outer.side, Side::right);
  ASSERT_NE(outer.native.find("any"), nullptr);
  EXPECT_EQ(outer.inner.count, 9);
}

TEST(OptionEntries, WhatIsNotGivenStays) {
  Outer outer{.length = 4.0, .side = Side::right, .native = {}, .inner = {.count = 8}};
  entries().read(&outer, Settings(), "toy");
  EXPECT_EQ(outer.length, 4.0);
  EXPECT_EQ(outer.side, Side::right);
  EXPECT_EQ(outer.inner.count, 8);
}

TEST(OptionEntries, DescribeTheValuesOfAnObjectInTheOrderOfTheTable) {
  const Outer outer{.length = 4.0, .side = Side::right, .native = {}, .inner = {.count = 8}};
  std::vector<OptionRow> rows;
  entries().describe(&outer, "a.", rows);
  std::vector<std::string> names, defaults;
  for (const OptionRow& row : rows) {
    names.push_back(row.name);
    defaults.push_back(row.default_value);
  }
  EXPECT_THAT(names, ElementsAre("a.length", "a.side", "a.native", "a.native.depth", "a.inner.count"));
  EXPECT_THAT(defaults, ElementsAre("4", "right", "{}", "2", "8"));
  EXPECT_EQ(rows[1].constraint, "one of left, right");
  EXPECT_EQ(rows[4].meaning, "how many");
}

TEST(OptionEntries, RefuseWhatIsUnknownOldOrTwice) {
  const auto message = [](const std::string& key, const std::string& text) {
    Settings root;
    root.set(key, scalar(text));
    return error_of([&] {
      Outer outer;
      entries().read(&outer, root, "toy");
    });
  };
  EXPECT_CONTAINS(message("lenght", "1"), "did you mean 'length'?");
  EXPECT_CONTAINS(message("size", "1"), "is called 'length' now");
  EXPECT_CONTAINS(message("inner.count", "0"), "expected an integer, at least 1 (toy: how many)");
  EXPECT_CONTAINS(error_of([] {
                    OptionEntries twice = entries();
                    twice.add(
                        "side", "", [](void* object) { return object; }, usual_kind(FlagValue{}));
                  }),
                  "has the name 'side' twice");
}

TEST(OptionEntries, ACopyIsATableOfItsOwn) {
  OptionEntries one = entries(), more = one;
  more.add(
      "extra", "", [](void* object) -> void* { return &static_cast<Outer*>(object)->length; },
      usual_kind(NumberValue{}));
  Settings root;
  root.set("extra", scalar("6"));
  Outer outer;
  more.read(&outer, root, "toy");
  EXPECT_EQ(outer.length, 6.0);
  EXPECT_CONTAINS(error_of([&] { one.read(&outer, root, "toy"); }), "extra");
}

/// Variables that a kind of value fits, but is not of: the table converts.
struct Converted {
  float length = 0.5f;
  long count = 4;
  std::string shape = "round";
  static const OptionTable<Converted>& table() {
    static const auto options =
        OptionTable<Converted>()
            .number("length", &Converted::length, "of it [m]", at_least(0))
            .integer("count", &Converted::count, "how many")
            .choice("shape", &Converted::shape, {{"circle", "round"}, {"box", "square"}}, "of it");
    return options;
  }
};

TEST(OptionTable, TakesVariablesOfOtherTypes) {
  Settings root;
  root.set("length", scalar("0.25"));
  root.set("count", scalar("-5"));
  root.set("shape", scalar("box"));
  const Converted read = Converted::table().parse(root, "toy");
  EXPECT_EQ(read.length, 0.25f);
  EXPECT_EQ(read.count, -5);
  EXPECT_EQ(read.shape, "square");
  EXPECT_EQ(Converted::table().schema()[2].default_value, "circle");
  EXPECT_EQ(Converted::table().schema()[0].default_value, "0.5");
}

}  // namespace option_entries_test
}  // namespace rhec
