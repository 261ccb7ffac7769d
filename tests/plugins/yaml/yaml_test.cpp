#include "rhec/plugins/yaml/yaml.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec {
namespace yaml_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

Settings yaml(const std::string& text) { return parse_yaml(text, "field.yaml"); }

std::string mistake(const std::string& text) {
  return error_of([&] { yaml(text); });
}

TEST(Yaml, NodesKnowTheirLines) {
  const Settings root = yaml("# a comment\nestimator:\n  horizon: 25\n  sigma:\n    - 0.1\n    - 0.2\n");
  EXPECT_EQ(root.find("estimator")->where(), "field.yaml:2");
  EXPECT_EQ(root.find_path("estimator.horizon")->where(), "field.yaml:3");
  EXPECT_EQ(root.find_path("estimator.horizon")->path(), "estimator.horizon");
  EXPECT_EQ(root.find_path("estimator.sigma")->where(), "field.yaml:4");
  EXPECT_EQ(root.find_path("estimator.sigma")->items()[1].where(), "field.yaml:6");
  EXPECT_EQ(root.find_path("estimator.sigma")->items()[1].path(), "estimator.sigma[1]");
}

TEST(Yaml, ScalarsStayText) {
  const Settings root = yaml("a: 1e-3\nb: '5'\nc: true\nd: \"null\"\ne: hello world\nf: .inf\n");
  EXPECT_EQ(root.find("a")->as_number(), 1e-3);
  EXPECT_EQ(root.find("b")->text(), "5");
  EXPECT_TRUE(root.find("c")->as_flag());
  EXPECT_EQ(root.find("d")->text(), "null");
  EXPECT_EQ(root.find("e")->text(), "hello world");
  EXPECT_GT(root.find("f")->as_number(), 1e300);
}

TEST(Yaml, NothingIsNull) {
  EXPECT_TRUE(yaml("").is_null());
  EXPECT_TRUE(yaml("# only words\n").is_null());
  const Settings root = yaml("a:\nb: ~\nc: null\n");
  for (const char* key : {"a", "b", "c"}) EXPECT_TRUE(root.find(key)->is_null()) << key;
}

TEST(Yaml, KeysKeepTheirOrderAndTheirDots) {
  const Settings root = yaml("z: 1\na.b: 2\nm: 3\n");
  ASSERT_EQ(root.members().size(), 3u);
  EXPECT_EQ(root.members()[0].first, "z");
  EXPECT_EQ(root.members()[1].first, "a.b");
  EXPECT_EQ(root.members()[2].first, "m");
}

TEST(Yaml, AnchorsAndMergeKeysWork) {
  const Settings root =
      yaml("base: &base {x: 1, y: 2}\nmore: &more {y: 5, z: 6}\nuse:\n  y: 3\n  <<: [*base, *more]\nsame: *base\n");
  EXPECT_EQ(root.find_path("use.x")->as_integer(), 1);
  EXPECT_EQ(root.find_path("use.y")->as_integer(), 3) << "what is written here wins";
  EXPECT_EQ(root.find_path("use.z")->as_integer(), 6);
  EXPECT_EQ(root.find_path("same.y")->as_integer(), 2);
  EXPECT_EQ(root.find("same")->where(), "field.yaml:6") << "where it is used, not where the anchor is";
  EXPECT_EQ(root.find_path("same.y")->path(), "same.y");
  EXPECT_THAT(mistake("a: 1\n<<: 3\n"), HasSubstr("field.yaml:2: '<<' merges maps"));
}

TEST(Yaml, AKeyWrittenTwiceIsAnError) {
  EXPECT_THAT(mistake("a:\n  b: 1\n  c: 2\n  b: 3\n"),
              HasSubstr("field.yaml:4: b: the key is written twice, first at field.yaml:2"));
  EXPECT_THAT(mistake("{a: 1, a: 2}"), HasSubstr("field.yaml:1: a: the key is written twice"));
}

TEST(Yaml, WrongSyntaxNamesTheLine) {
  for (const char* text : {"a: 1\nb: [1, 2\nc: 3\n", "a: 1\n  b: 2\n", "a: 1\n\tb: 2\n", "a: *unknown\n", "a: 1\n- 2\n",
                           "{", "]", "a: b: c"}) {
    EXPECT_THAT(mistake(text), AllOf(StartsWith("field.yaml:"), HasSubstr("not valid YAML"))) << text;
  }
}

TEST(Yaml, WhatIsNoPlainTreeIsRefused) {
  EXPECT_THAT(mistake("a: 1\n[1, 2]: 3\n"), HasSubstr("field.yaml:2: a key must be a plain text"));
  EXPECT_THAT(mistake("~: 3\n"), HasSubstr("a key must be a plain text"));
  EXPECT_THAT(mistake("a: 1\nb: !include other.yaml\n"),
              HasSubstr("field.yaml:2: the tag '!include' means nothing here"));
  EXPECT_THAT(mistake("a: 1\n---\nb: 2\n"), HasSubstr("found 2 documents, expected one"));
  EXPECT_THAT(mistake("a: 1\n...\nb: 2\n"), HasSubstr("found 2 documents, expected one"));
  // Of these yaml-cpp makes documents until there is no memory left.
  for (const char* text : {"\n,", "\n,{}- ", "\n, a", "--- \n,"})
    EXPECT_THAT(mistake(text), HasSubstr("field.yaml:2: not valid YAML in column 1: what stands here")) << text;
  EXPECT_EQ(yaml("a: !!float 5\n").find("a")->as_number(), 5);
}

TEST(Yaml, AliasesCannotMakeATreeWithoutEnd) {
  EXPECT_THAT(mistake("a: &a [*a, *a]\n"), HasSubstr("does an alias"));
  std::string bomb = "l0: &l0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int level = 1; level < 9; ++level) {
    const std::string below = "*l" + std::to_string(level - 1);
    bomb += "l" + std::to_string(level) + ": &l" + std::to_string(level) + " [" + below;
    for (int i = 0; i < 9; ++i) bomb += ", " + below;
    bomb += "]\n";
  }
  EXPECT_THAT(mistake(bomb), HasSubstr("does an alias"));
}

TEST(Yaml, AMapThatIsNoConfigurationIsRefusedAtOnce) {
  std::string text = "speed: 4\n";
  for (int i = 0; i < 10000; ++i) text += "k" + std::to_string(i) + ": 1\n";
  EXPECT_THAT(mistake(text), HasSubstr("a map of 10001 keys, expected at most 10000"));
}

TEST(Yaml, FilesAreNamedInErrors) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.put("run.yaml", "a: 1\nb: x\n");
  const Settings root = load_yaml(file);
  EXPECT_THAT(error_of([&] { root.find("b")->as_number(); }), StartsWith(file.string() + ":2: b: found 'x'"));
  EXPECT_THAT(error_of([&] { load_yaml(folder / "gone.yaml"); }),
              AllOf(HasSubstr("gone.yaml"), HasSubstr("no such file")));
  EXPECT_THAT(error_of([&] { load_yaml(folder.path()); }), HasSubstr("is a directory"));
  for (const char* nothing : {"", "\n\n", "# speed: 4\n", "---\n"}) {
    folder.put("run.yaml", nothing);
    EXPECT_THAT(error_of([&] { load_yaml(file); }), StartsWith(file.string() + ": there is nothing in it")) << nothing;
  }
}

TEST(Yaml, DevicesHaveAnEnd) {
  EXPECT_THAT(error_of([] { load_yaml("/dev/zero"); }),
              StartsWith("/dev/zero: more than 50 MB; expected a configuration"));
  EXPECT_THAT(error_of([] { load_yaml(""); }), StartsWith("'': no such file"));
}

TEST(Assignment, PutsValuesInTheirPlace) {
  Settings root = yaml("horizon:\n  length: 20\n  rate: 5\n");
  apply_assignment(root, "horizon.length=25");
  apply_assignment(root, "solver.weights=[1, 2.5]");
  apply_assignment(root, "title=a = b");
  apply_assignment(root, "empty=");
  apply_assignment(root, "solver.native={mu: 1}");
  EXPECT_EQ(root.find_path("horizon.length")->as_integer(), 25);
  EXPECT_EQ(root.find_path("horizon.rate")->as_integer(), 5);
  EXPECT_THAT(root.find_path("solver.weights")->as_numbers(), ElementsAre(1, 2.5));
  EXPECT_EQ(root.find("title")->text(), "a = b");
  EXPECT_TRUE(root.find("empty")->is_null());
  EXPECT_EQ(root.find_path("solver.native.mu")->path(), "solver.native.mu");
  EXPECT_EQ(root.find_path("horizon.length")->where(), "--set horizon.length=25");
}

TEST(Assignment, WrongOnesAreNamed) {
  Settings root = yaml("a: 1\n");
  const auto wrong = [&](const char* text) { return error_of([&] { apply_assignment(root, text); }); };
  EXPECT_EQ(wrong("horizon.length"), "--set horizon.length: expected key.path=value, e.g. horizon.length=25");
  EXPECT_THAT(wrong("=5"), HasSubstr("expected key.path=value"));
  EXPECT_THAT(wrong("b=[1"), HasSubstr("--set b=[1: not valid YAML"));
  EXPECT_THAT(wrong("a.b=1"), HasSubstr("'a' is '1', written at field.yaml:1"));
  EXPECT_THAT(wrong("b..c=1"), HasSubstr("joined by single dots"));
  EXPECT_EQ(root.members().size(), 1u) << "nothing was changed";
}

}  // namespace yaml_test
}  // namespace rhec
