#include "rhec/sim/logs/variants.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace variants_test {

using testing::HasSubstr;

TEST(Variants, KeysOfAVariantArePutOverThoseOfTheScenario) {
  const Settings scenario = parse_yaml("step: 1\na: {b: 1, c: 2}\nvariants: {x: {a: {c: 3}}, y: }\n", "s.yaml");
  const auto found = variant_settings("s", scenario, {}, {});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].second.find_path("a.c")->as_number(), 3.0);
  EXPECT_EQ(found[0].second.find_path("a.b")->as_number(), 1.0);
  EXPECT_EQ(found[1].second.find_path("a.c")->as_number(), 2.0);
  EXPECT_EQ(variant_settings("s", scenario, {"y"}, {}).front().first, "y");
  EXPECT_EQ(variant_settings("s", parse_yaml("step: 1", "s.yaml"), {}, {}).front().first, "s");
}

TEST(Variants, MistakesNameTheirPlace) {
  const auto message = [](const char* text, const std::vector<std::string>& chosen = {}) {
    return error_of([&] { variant_settings("s", parse_yaml(text, "s.yaml"), chosen, {"name"}); });
  };
  EXPECT_THAT(message("variants: {x: {name: z}}"), HasSubstr("s.yaml:1: variants.x.name: is shared"));
  EXPECT_THAT(message("variants: {x: }", {"z"}), HasSubstr("no variant 'z'; expected one of x"));
  EXPECT_THAT(message("variants: 3"), HasSubstr("expected a map"));
  EXPECT_THAT(message("step: 1", {"z"}), HasSubstr("has no variants"));
}

}  // namespace variants_test
}  // namespace rhec::sim
