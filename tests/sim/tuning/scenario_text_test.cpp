#include "sim/tuning/scenario_text.hpp"

#include <gtest/gtest.h>

#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {
namespace scenario_text_test {

TEST(ScenarioText, IsReadBackAsTheSame) {
  for (const char* file : {SCENARIOS "/figure8.yaml", SCENARIOS "/paper/figure8.yaml", SCENARIOS "/victoria_park.yaml",
                           SCENARIOS "/tractor_trailer.yaml"}) {
    const Settings settings = load_yaml(file);
    EXPECT_EQ(json_text(parse_yaml(scenario_text(settings), "text")), json_text(settings)) << file;
  }
}

TEST(ScenarioText, QuotesWhatYamlWouldTakeForSomethingElse) {
  Settings settings = Settings::map();
  for (const char* text : {"", "null", "~", "- a", "a: b", "# no", "[x", "yes and no", "1/2", "-x", "\"", "*a", "&a"})
    settings.add(std::string("key ") + text, Settings::scalar(text));
  const Settings read = parse_yaml(scenario_text(settings), "text");
  for (const auto& [key, value] : settings.members()) {
    ASSERT_NE(read.find(key), nullptr) << key;
    EXPECT_EQ(read.find(key)->text(), value.text()) << key;
    EXPECT_FALSE(read.find(key)->is_null()) << key;
  }
}

TEST(ScenarioText, LeavesOutWhatIsNotGiven) {
  Settings settings = parse_yaml("a: {b: 1}\nc: 2\n", "text");
  settings.set("a.b", Settings::null());
  EXPECT_EQ(scenario_text(settings).find("b"), std::string::npos);
  EXPECT_NE(scenario_text(settings).find("c: 2"), std::string::npos);
}

}  // namespace scenario_text_test
}  // namespace rhec::sim
