#include "rhec/core/config/settings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "support/error_of.hpp"

namespace rhec {
namespace settings_test {

using testing::ElementsAre;
using testing::HasSubstr;

Settings written(const std::string& text, int line = 1) { return Settings::scalar(text, {"field.yaml", line}); }

TEST(Settings, ANewNodeIsNull) {
  const Settings node;
  EXPECT_TRUE(node.is_null());
  EXPECT_EQ(node.found(), "nothing");
  EXPECT_EQ(node.find("a"), nullptr);
  EXPECT_EQ(node.find_path("a.b"), nullptr);
}

TEST(Settings, SetMakesMapsOnTheWay) {
  Settings root;
  root.set("estimator.horizon.length", written("25", 12));
  root.set("estimator.name", written("rhe", 13));
  const Settings* length = root.find_path("estimator.horizon.length");
  ASSERT_NE(length, nullptr);
  EXPECT_EQ(length->as_integer(), 25);
  EXPECT_EQ(length->path(), "estimator.horizon.length");
  EXPECT_EQ(length->where(), "field.yaml:12");
  EXPECT_EQ(root.find_path("estimator.horizon")->path(), "estimator.horizon");
  EXPECT_EQ(root.find_path("estimator.horizon.width"), nullptr);
  EXPECT_EQ(root.find_path("estimator.name.first"), nullptr);
}

TEST(Settings, SetReplacesWhatWasThereAndKeepsTheOrder) {
  Settings root;
  root.set("b", written("1"));
  root.set("a", written("2"));
  root.set("b", written("3", 9));
  ASSERT_EQ(root.members().size(), 2u);
  EXPECT_EQ(root.members()[0].first, "b");
  EXPECT_EQ(root.members()[0].second.as_integer(), 3);
  EXPECT_EQ(root.members()[0].second.where(), "field.yaml:9");
}

TEST(Settings, SetRefusesAWayThroughAScalar) {
  Settings root;
  root.set("a", written("1", 4));
  const std::string text = error_of([&] { root.set("a.b", Settings::scalar("2", {"--set a.b=2", 0})); });
  EXPECT_THAT(text, HasSubstr("--set a.b=2"));
  EXPECT_THAT(text, HasSubstr("'a' is '1', written at field.yaml:4"));
}

TEST(Settings, SetRefusesMalformedPathsAndChangesNothing) {
  for (const char* path : {"", ".", "a.", ".a", "a..b", "a.b."}) {
    Settings root;
    EXPECT_THAT(error_of([&] { root.set(path, written("1")); }), HasSubstr("empty")) << path;
    EXPECT_EQ(root.find("a"), nullptr) << path;
  }
}

TEST(Settings, AddTakesKeysWithDotsAndRefusesASecondOne) {
  Settings root = Settings::map({"field.yaml", 1});
  root.add("linear.solver", written("ma57", 2));
  EXPECT_EQ(root.find("linear.solver")->text(), "ma57");
  const std::string text = error_of([&] { root.add("linear.solver", written("mumps", 7)); });
  EXPECT_THAT(text, HasSubstr("field.yaml:7: linear.solver: the key is written twice, first at field.yaml:2"));
}

TEST(Settings, PathsFollowASubtreeThatIsAttachedLater) {
  Settings list = Settings::list({"field.yaml", 3});
  list.append(written("1", 3));
  list.append(written("2", 4));
  Settings inner = Settings::map();
  inner.add("noise", list);
  Settings root;
  root.set("estimator", inner);
  const Settings copy = *root.find_path("estimator.noise");
  EXPECT_EQ(copy.items()[1].path(), "estimator.noise[1]");
  EXPECT_THAT(copy.as_numbers(), ElementsAre(1.0, 2.0));
  EXPECT_EQ(list.items()[1].path(), "[1]") << "the original is untouched";
}

TEST(Settings, AppendRefusesWhatIsNoList) {
  Settings scalar = written("1");
  EXPECT_THROW(scalar.append(written("2")), Error);
  EXPECT_THROW(scalar.add("a", written("2")), Error);
}

TEST(Settings, ReadsNumbersWholeOrNotAtAll) {
  EXPECT_EQ(written("2.5e-3").as_number(), 2.5e-3);
  EXPECT_EQ(written("+4").as_number(), 4);
  EXPECT_EQ(written("-4").as_number(), -4);
  EXPECT_EQ(written(".inf").as_number(), INFINITY);
  EXPECT_EQ(written("-.inf").as_number(), -INFINITY);
  EXPECT_EQ(written("inf").as_number(), INFINITY);
  for (const char* bad :
       {"", " ", "+", "+-4", "1,5", "1.5m", " 1", "nan", ".nan", "infinity", "0x10", "1e999", "five"}) {
    EXPECT_FALSE(written(bad).number()) << bad;
  }
}

TEST(Settings, ReadsIntegersWholeOrNotAtAll) {
  EXPECT_EQ(written("25").as_integer(), 25);
  EXPECT_EQ(written("-1").as_integer(), -1);
  for (const char* bad : {"", "5.0", "1e3", "99999999999", "0x1", "a"}) EXPECT_FALSE(written(bad).integer()) << bad;
}

TEST(Settings, ReadsFlags) {
  EXPECT_TRUE(written("true").as_flag());
  EXPECT_FALSE(written("false").as_flag());
  EXPECT_EQ(error_of([] { written("yes", 5).as_flag(); }), "field.yaml:5: found 'yes', expected true or false");
}

TEST(Settings, ErrorsSayWhereAndWhat) {
  Settings root;
  root.set("horizon.length", written("five", 12));
  EXPECT_EQ(error_of([&] { root.find_path("horizon.length")->as_integer(); }),
            "field.yaml:12: horizon.length: found 'five', expected an integer");
  EXPECT_THAT(error_of([&] { root.find("horizon")->as_number(); }),
              HasSubstr("horizon: found a map, expected a number"));
  EXPECT_THAT(error_of([&] { root.find_path("horizon.length")->as_numbers(); }),
              HasSubstr("expected a list of numbers"));
}

TEST(Settings, ErrorsShowTheBeginningOfALongText) {
  const std::string found = written(std::string(59, 'a') + "\u00e4" + std::string(1'000'000, 'b')).found();
  EXPECT_EQ(found, "'" + std::string(59, 'a') + "...'");  // and no half of a letter
  EXPECT_EQ(written(std::string(200, 'a')).found(), "'" + std::string(200, 'a') + "'");
}

TEST(Settings, ListErrorsNameTheItem) {
  Settings root;
  root.set("sigma", Settings::list());
  Settings list = *root.find("sigma");
  list.append(written("1", 2));
  list.append(written("x", 3));
  EXPECT_EQ(error_of([&] { list.as_numbers(); }), "field.yaml:3: sigma[1]: found 'x', expected a number");
}

}  // namespace settings_test
}  // namespace rhec
