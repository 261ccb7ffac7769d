// Parts of a configuration that name a plugin: as a map, as a word, or not at all.
#include "rhec/plugins/robot/plugin_option.hpp"

#include <gmock/gmock.h>

#include "plugins/robot/robots.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/term/term.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace plugin_option_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

constexpr PluginOption<Blocking> option{.otherwise = "full_horizon"};

TEST(PluginOption, MakesTheDefaultWhereNoneIsNamed) {
  EXPECT_TRUE(option.make(host(), {})->is_one_block());
  EXPECT_TRUE(option.make(host(), settings("{}"))->is_one_block());
  EXPECT_EQ(option.choice({}).name, "full_horizon");
}

TEST(PluginOption, TakesAMapOrAWord) {
  EXPECT_FALSE(option.make(host(), settings("unblocked"))->is_one_block());
  EXPECT_FALSE(option.make(host(), settings("{name: structured, size: 3}"))->is_one_block());
  const PluginChoice choice = option.choice(settings("{name: structured, size: 3}"));
  EXPECT_EQ(choice.name, "structured");
  ASSERT_EQ(choice.options.members().size(), 1U);
  EXPECT_EQ(choice.options.find("size")->as_integer(), 3);
  EXPECT_EQ(option.choice(settings("unblocked")).name, "unblocked");
}

TEST(PluginOption, ErrorsNameThePlace) {
  EXPECT_THAT(error_of([] { option.make(host(), settings("[unblocked]")); }), HasSubstr("the name of a plugin"));
  EXPECT_THAT(error_of([] { option.make(host(), settings("name: structured\nsize: 0")); }),
              StartsWith("robot.yaml:2: size"));
  // The plugin itself does not know where its options stand, nor the host where the name does.
  EXPECT_THAT(error_of([] { option.make(host(), settings("name: pattern")); }),
              AllOf(StartsWith("robot.yaml:1: "), HasSubstr("lengths")));
  EXPECT_THAT(error_of([] { option.make(host(), settings("structurd")); }),
              AllOf(StartsWith("robot.yaml:1: "), HasSubstr("structurd")));
}

TEST(PluginOption, TermsMayBeEquations) {
  constexpr PluginOption<Term> term{.otherwise = ""};
  const Settings section = settings("equations: {costs: {c: heading}, options: {a: 1}}\na: 2");
  EXPECT_NE(term.make(host(), section), nullptr);
  const PluginChoice choice = term.choice(section);
  EXPECT_EQ(choice.name, "equations");
  ASSERT_EQ(choice.options.members().size(), 2U);  // what makes it again
  EXPECT_NE(host().make_term(choice.name, choice.options), nullptr);
  EXPECT_THAT(error_of([&] { term.make(host(), settings("name: corridor\nequations: {costs: {c: heading}}")); }),
              HasSubstr("expected one of the keys"));
  EXPECT_THAT(error_of([&] { term.make(host(), settings("equations: term.yaml")); }),
              AllOf(StartsWith("robot.yaml:1: equations"), HasSubstr("expected a map of limits and costs")));
  EXPECT_THAT(error_of([&] { term.make(host(), settings("equations:\n  costs:\n    c: haeding")); }),
              AllOf(StartsWith("robot.yaml:3: equations.costs.c: "), HasSubstr("did you mean 'heading'?")));
}

TEST(PluginOption, DocumentsItsDefault) {
  const OptionRow row = option.row();
  EXPECT_EQ(row.name, "name");
  EXPECT_EQ(row.default_value, "full_horizon");
  EXPECT_EQ(row.constraint, "a blocking plugin");
}

}  // namespace plugin_option_test
}  // namespace rhec
