#include "rhec/sim/files/json.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::sim {
namespace json_test {

JsonParseError mistake_in(const std::string& text, Json::RepeatedKeys repeated = Json::RepeatedKeys::last_counts) {
  try {
    Json::parse(text, repeated);
  } catch (const JsonParseError& mistake) {
    return mistake;
  }
  throw std::runtime_error("was accepted: " + text);
}

TEST(Json, IsWrittenInTheOrderInWhichItWasMade) {
  Json json;
  json["z"] = 1;
  json["a"] = {{"text", "x"}, {"flag", true}, {"nothing", nullptr}};
  json["list"] = {1, 2.0, "three"};
  json["numbers"] = std::vector<double>{0.1, -0.0, 1e300};
  json["counts"] = std::map<std::string, std::int64_t>{{"b", 2}, {"a", 1}};
  json["empty"] = Json::array();
  EXPECT_EQ(json.dump(),
            R"({"z":1,"a":{"text":"x","flag":true,"nothing":null},"list":[1,2.0,"three"],"numbers":[0.1,-0.0,1e+300],)"
            R"("counts":{"a":1,"b":2},"empty":[]})");
  EXPECT_EQ(Json({{"a", Json::object()}}).dump(2), "{\n  \"a\": {}\n}");
}

TEST(Json, ReadsWhatItWrote) {
  const std::string text = R"({"b":[1,-2,0.1,1e-320,9007199254740993,{"x":null}],"a":"\u00e4\n\"","c":{},"d":false})";
  const Json json = Json::parse(text);
  EXPECT_EQ(json, Json::parse(json.dump()));
  EXPECT_EQ(json.at("b").at(3).as_number(), 1e-320);
  EXPECT_EQ(json.at("b").at(4).as_integer(), 9007199254740993);
  EXPECT_EQ(json.at("a").as_text(), "\xC3\xA4\n\"");
  EXPECT_EQ(json.items().front().first, "b");
  EXPECT_EQ(json.at("d"), Json(false));
  EXPECT_NE(json, Json());
}

TEST(Json, KeepsAllBitsOfNumbers) {
  for (double value = 1e-300; value < 1e300; value *= -7.3e7)
    EXPECT_EQ(Json::parse(Json(value).dump()).as_number(), value);
  EXPECT_EQ(Json(std::numeric_limits<std::int64_t>::min()).dump(), "-9223372036854775808");
  EXPECT_EQ(Json(std::numeric_limits<std::uint64_t>::max()).dump(), "1.8446744073709552e+19");
  EXPECT_EQ(Json(std::nan("")).dump(), "null");
  EXPECT_EQ(Json({HUGE_VAL}).dump(), "[null]");
}

TEST(Json, WritesASignForWhatIsNoText) {
  std::string text = "x";
  append_quoted("a \"b\"\n\xff", text);
  EXPECT_EQ(text, "x\"a \\\"b\\\"\\n\xEF\xBF\xBD\"");
  EXPECT_EQ(Json("\xff").dump(), "\"\xEF\xBF\xBD\"");
}

TEST(Json, TellsWhatIsWrongWithAText) {
  EXPECT_EQ(mistake_in("{\"a\": 1,").cause, JsonParseError::Cause::syntax);
  EXPECT_EQ(mistake_in("[1, x]").byte, 5U);
  EXPECT_EQ(mistake_in("").cause, JsonParseError::Cause::syntax);
  EXPECT_EQ(mistake_in("[1] 2").cause, JsonParseError::Cause::syntax);
  EXPECT_EQ(mistake_in("[1e999]").cause, JsonParseError::Cause::large_number);
  const JsonParseError twice = mistake_in(R"({"a":{"b":1,"c":2,"b":3}})", Json::RepeatedKeys::refused);
  EXPECT_EQ(twice.cause, JsonParseError::Cause::repeated_key);
  EXPECT_EQ(twice.key, "b");
  EXPECT_EQ(Json::parse(R"({"b":1,"c":2,"b":3})").dump(), R"({"b":3,"c":2})");
  const auto nested = [](std::size_t levels) { return std::string(levels, '[') + std::string(levels, ']'); };
  EXPECT_TRUE(Json::parse_if_valid(nested(JsonParseError::most_levels)).has_value());
  EXPECT_EQ(mistake_in(nested(JsonParseError::most_levels + 1)).cause, JsonParseError::Cause::nesting);
  EXPECT_FALSE(Json::parse_if_valid(std::string(100000, '[')).has_value());
  EXPECT_FALSE(Json::parse_if_valid("{").has_value());
  EXPECT_TRUE(Json::parse_if_valid("null").has_value());
}

TEST(Json, RefusesToBeTakenForAnotherKind) {
  const Json json = {{"text", "x"}, {"list", {1, 2, 3}}};
  EXPECT_THROW(json.at("text").as_number(), JsonError);
  EXPECT_THROW(json.at("list").as_text(), JsonError);
  EXPECT_THROW(json.at("none"), JsonError);
  EXPECT_THROW(json.at("list").at(3), JsonError);
  EXPECT_THROW(json.at("text").at("x"), JsonError);
  EXPECT_THROW(json.at("text").size(), JsonError);
  EXPECT_EQ(json.at("list").get<std::vector<double>>(), (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(json.value("none", 7), 7);
  EXPECT_EQ(json.value("text", "y"), "x");
}

TEST(Json, IsChangedInPlace) {
  Json json = {{"a", 1}, {"b", {1, 2}}};
  const Json before = json;
  json["b"].push_back({{"c", 3}});
  json.update({{"a", "new"}, {"d", nullptr}});
  json.erase("none");
  EXPECT_EQ(json.dump(), R"({"a":"new","b":[1,2,{"c":3}],"d":null})");
  EXPECT_EQ(before.dump(), R"({"a":1,"b":[1,2]})") << "a copy is a copy";
  const Json moved = std::move(json);
  EXPECT_EQ(moved.size(), 3U);
  for (Json& value : (json = Json({1, 2}))) value = value.as_integer() + 1;
  EXPECT_EQ(json, Json({2, 3}));
}

TEST(Json, TakesSettings) {
  const Settings options = parse_yaml("{a: 1.50, b: true, c: text, d: '007', e: [1, .inf], f: {g: null}}", "options");
  EXPECT_EQ(json_text(options), R"({"a":1.5,"b":true,"c":"text","d":"007","e":[1,".inf"],"f":{"g":null}})");
}

}  // namespace json_test
}  // namespace rhec::sim
