#include "sim/problems/line_value.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "support/error_of.hpp"

namespace rhec::sim {
namespace line_value_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A line of a file, and its values.
struct Line {
  explicit Line(const char* text) : json(Json::parse(text)) {}
  LineValue operator[](const std::string& key) const { return whole()[key]; }
  LineValue whole() const { return {json, "", where}; }

  Json json;
  std::string where = "set.jsonl:7";
};

TEST(LineValue, GivesWhatIsWritten) {
  const Line line(R"({"number": 2.5, "whole": 3, "none": null, "text": "rk4", "list": [1, 2.5],
                      "rows": [[1, 2], [3, null]], "ragged": [[], [1, 2], [3]]})");
  EXPECT_EQ(line["number"].number(), 2.5);
  EXPECT_EQ(line["whole"].number(), 3.0);
  EXPECT_EQ(line["whole"].integer(3), 3);
  EXPECT_EQ(line["none"].number_or(-1.0), -1.0);
  EXPECT_EQ(line["number"].number_or(-1.0), 2.5);
  EXPECT_TRUE(std::isnan(line["none"].number_or_missing()));
  EXPECT_EQ(line["number"].number_or_missing(), 2.5);
  EXPECT_EQ(line["text"].text(), "rk4");
  EXPECT_THAT(line["list"].numbers(), ElementsAre(1.0, 2.5));
  EXPECT_THAT(line["ragged"].ragged(3, "any"), ElementsAre(IsEmpty(), ElementsAre(1.0, 2.0), ElementsAre(3.0)));
  const LineValue::Rows rows = line["rows"].rows(2, "any", true);
  EXPECT_THAT(rows[0], ElementsAre(1.0, 2.0));
  EXPECT_TRUE(std::isnan(rows[1][1]));
  EXPECT_TRUE(line["none"].is_null());
  EXPECT_TRUE(line["list"].is_list());
  EXPECT_FALSE(line["text"].is_list());
  EXPECT_TRUE(line.whole().has("text"));
  EXPECT_FALSE(line.whole().has("txt"));
}

TEST(LineValue, AnotherKindIsToldWithFileLineAndKey) {
  const Line line(R"({"text": "4", "decimals": 2.5, "list": [1, "x"], "map": {"a": 1}, "rows": [[1, 2], [3]],
                      "missing": [[1, null]], "large": 3000000000, "less": -1})");
  const auto said = [&](const std::function<void()>& ask) { return error_of(ask); };
  EXPECT_EQ(said([&] { line["text"].number(); }), "set.jsonl:7: text: found \"4\", expected a number");
  EXPECT_EQ(said([&] { line["map"].number(); }), "set.jsonl:7: map: found a map, expected a number");
  EXPECT_EQ(said([&] { line["list"].number(); }), "set.jsonl:7: list: found a list of 2, expected a number");
  EXPECT_EQ(said([&] { line["decimals"].text(); }), "set.jsonl:7: decimals: found 2.5, expected a text");
  for (const char* key : {"decimals", "large", "less", "text"})
    EXPECT_THAT(said([&] { line[key].integer(0); }), HasSubstr("expected an integer, at least 0")) << key;
  EXPECT_EQ(said([&] { line["list"].numbers(); }), "set.jsonl:7: list[1]: found \"x\", expected a number");
  EXPECT_EQ(said([&] { line["text"].items("a list of lists"); }),
            "set.jsonl:7: text: found \"4\", expected a list of lists");
  EXPECT_EQ(said([&] { line["text"].map(); }), "set.jsonl:7: text: found \"4\", expected a map");
  EXPECT_EQ(said([&] { line["rows"].rows(2, "any", false); }),
            "set.jsonl:7: rows[1]: 1 numbers, expected 2 as in the first row");
  EXPECT_EQ(said([&] { line["rows"].ragged(3, "one for each node"); }),
            "set.jsonl:7: rows: 2 rows, expected 3: one for each node");
  EXPECT_EQ(said([&] { line["missing"].rows(1, "any", false); }),
            "set.jsonl:7: missing[0][1]: found null, expected a number");
  EXPECT_EQ(said([&] { line["list"].rows(2, "any", true); }),
            "set.jsonl:7: list[0]: found 1, expected a row of numbers");
}

TEST(LineValue, KeysAreToldWithTheMapsThatTheyAreIn) {
  const Line line(R"({"horizon": {"dt": "x", "steps": 3, "guess": 1}})");
  const LineValue horizon = line["horizon"];
  EXPECT_EQ(error_of([&] { horizon["dt"].number(); }), "set.jsonl:7: horizon.dt: found \"x\", expected a number");
  EXPECT_THAT(error_of([&] { horizon["intervals"]; }), HasSubstr("set.jsonl:7: horizon.intervals: missing"));
  EXPECT_EQ(error_of([&] {
              horizon.allow({"dt", "step", "guess"});
            }),
            "set.jsonl:7: horizon.steps: unknown key; did you mean 'step'?");
  EXPECT_EQ(error_of([&] {
              horizon.allow({"dt", "steps"}, {{2, {"guess"}}}, 1);
            }),
            "set.jsonl:7: horizon.guess: is a key of version 2; add \"version\": 2 to the line");
  EXPECT_NO_THROW(horizon.allow({"dt", "steps"}, {{2, {"guess"}}}, 2));
  EXPECT_THAT(error_of([&] {
                horizon.allow({"dt"}, {{2, {"guess"}}, {3, {"steps"}}}, 2);
              }),
              HasSubstr("is a key of version 3; add \"version\": 3"));
  EXPECT_EQ(at_key("set.jsonl:7", "", "no map"), "set.jsonl:7: no map");
  std::vector<std::string> keys;
  horizon.for_each([&](const std::string& key, const LineValue&) { keys.push_back(key); });
  EXPECT_THAT(keys, ElementsAre("dt", "steps", "guess"));
}

TEST(LineValue, SettingsKnowTheLineThatTheyCameFrom) {
  const Line line(R"({"model": {"name": "cart", "mass": 2.5, "axles": [1, 2], "none": null}})");
  const Settings settings = line["model"].settings();
  ASSERT_EQ(settings.kind(), Settings::Kind::map);
  EXPECT_EQ(settings.find("name")->text(), "cart");
  EXPECT_EQ(settings.find("mass")->as_number(), 2.5);
  EXPECT_EQ(settings.find("mass")->where(), "set.jsonl:7");
  ASSERT_EQ(settings.find("axles")->items().size(), 2U);
  EXPECT_EQ(settings.find("axles")->items()[1].as_number(), 2.0);
  EXPECT_TRUE(settings.find("none")->is_null());
}

TEST(DidYouMean, NamesTheNearestWordOrAll) {
  EXPECT_EQ(did_you_mean("kapa", {"kappa", "mu"}), "did you mean 'kappa'?");
  EXPECT_EQ(did_you_mean("something else", {"kappa", "mu"}), "expected one of kappa, mu");
}

}  // namespace line_value_test
}  // namespace rhec::sim
