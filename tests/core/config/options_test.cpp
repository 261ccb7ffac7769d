#include "rhec/core/config/options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "support/error_of.hpp"

namespace rhec {
namespace options_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

enum class Order { first, second };

struct Search {
  int steps = 4;
  double shrink = 0.5;
  static const OptionTable<Search>& table() {
    static const auto options = OptionTable<Search>()
                                    .integer("steps", &Search::steps, "trials at most", at_least(0))
                                    .number("shrink", &Search::shrink, "factor of a step", between(0.1, 0.9));
    return options;
  }
};

struct Options {
  double tolerance = 1e-6;
  int size = 5;
  bool verbose = false;
  std::string label = "plain";
  Order order = Order::second;
  std::optional<double> sigma;
  std::optional<int> limit = 3;
  std::optional<int> parts;
  std::vector<double> weights = {1, 0.5};
  std::vector<int> starts;
  std::vector<std::string> outputs = {"x", "y"};
  Settings native;
  Search search{.steps = 7};

  static const OptionTable<Options>& table() {
    static const auto options =
        OptionTable<Options>()
            .number("tolerance", &Options::tolerance, "KKT residual [1]", greater_than(0))
            .integer("size", &Options::size, "block length [intervals]", at_least(1))
            .flag("verbose", &Options::verbose, "tell more")
            .text("label", &Options::label, "a label")
            .choice("order", &Options::order, {{"first", Order::first}, {"second", Order::second}}, "of the hold")
            .optional_number("sigma", &Options::sigma, "spread [m]", greater_than(0))
            .optional_integer("limit", &Options::limit, "iterations at most", at_least(1))
            .automatic_integer("parts", &Options::parts, "of an interval", between(1, 9))
            .numbers("weights", &Options::weights, "of the outputs", at_least(0))
            .integers("starts", &Options::starts, "of the blocks")
            .names("outputs", &Options::outputs, "measured")
            .subtree("native", &Options::native, "of the backend")
            .group("search", &Options::search, Search::table())
            .renamed("precision", "tolerance");
    return options;
  }
};

Settings line(int number, const std::string& text) { return Settings::scalar(text, {"field.yaml", number}); }

Options parse(const Settings& from) { return Options::table().parse(from, "solver 'toy'", {"name"}); }

std::string message(const Settings& from) {
  return error_of([&] { parse(from); });
}

std::string message(const std::string& key, const std::string& text) {
  Settings root;
  root.set(key, line(3, text));
  return message(root);
}

TEST(Options, AnOldNameIsRefusedWithTheNewOne) {
  EXPECT_EQ(message("precision", "1e-3"),
            "field.yaml:3: precision: 'precision' of solver 'toy' is called 'tolerance' now; rename the key");
}

TEST(Options, NothingWrittenGivesTheDefaults) {
  const Options options = parse(Settings());
  EXPECT_EQ(options.size, 5);
  EXPECT_EQ(options.order, Order::second);
  EXPECT_EQ(options.search.steps, 7) << "the member's own default, not the group's";
}

TEST(Options, EveryKindIsRead) {
  Settings root;
  root.set("name", line(1, "toy"));
  root.set("tolerance", line(2, "1e-3"));
  root.set("size", line(3, "8"));
  root.set("verbose", line(4, "true"));
  root.set("label", line(5, "a b"));
  root.set("order", line(6, "first"));
  root.set("sigma", line(7, "0.2"));
  root.set("limit", line(8, "none"));
  Settings list;
  list.append(line(9, "2"));
  list.append(line(9, "3"));
  root.set("weights", list);
  root.set("starts", list);
  root.set("outputs", list);
  root.set("native.mu_strategy", line(10, "adaptive"));
  root.set("search.shrink", line(11, "0.8"));
  const Options options = parse(root);
  EXPECT_EQ(options.tolerance, 1e-3);
  EXPECT_EQ(options.size, 8);
  EXPECT_TRUE(options.verbose);
  EXPECT_EQ(options.label, "a b");
  EXPECT_EQ(options.order, Order::first);
  EXPECT_EQ(options.sigma, 0.2);
  EXPECT_EQ(options.limit, std::nullopt);
  EXPECT_THAT(options.weights, ElementsAre(2.0, 3.0));
  EXPECT_THAT(options.starts, ElementsAre(2, 3));
  EXPECT_THAT(options.outputs, ElementsAre("2", "3"));
  EXPECT_EQ(options.native.find("mu_strategy")->path(), "native.mu_strategy");
  EXPECT_EQ(options.search.shrink, 0.8);
  EXPECT_EQ(options.search.steps, 7);
}

TEST(Options, AWrongValueNamesPlaceKeyFindingAndExpectation) {
  EXPECT_EQ(message("size", "0"),
            "field.yaml:3: size: found '0', expected an integer, at least 1 (solver 'toy': block length [intervals])");
  EXPECT_THAT(message("tolerance", "0"), HasSubstr("expected a number, greater than 0"));
  EXPECT_THAT(message("tolerance", "fast"), HasSubstr("found 'fast', expected a number"));
  EXPECT_THAT(message("search.shrink", "1"),
              HasSubstr("search.shrink: found '1', expected a number, between 0.1 and 0.9"));
  EXPECT_THAT(message("verbose", "yes"), HasSubstr("expected a flag, true or false"));
  EXPECT_THAT(message("sigma", "-1"), HasSubstr("expected a number, greater than 0"));
  EXPECT_THAT(message("weights", "1"), HasSubstr("found '1', expected a list of numbers, each at least 0"));
  EXPECT_THAT(message("label.a", "1"), HasSubstr("label: found a map, expected a text"));
}

TEST(Options, ANumberIsFiniteAndHasASquare) {
  const OptionContext context{"a test", "a length [m]"};
  const auto said = [&](const NumberValue& value, const char* text) {
    return error_of([&] { value.read(Settings::scalar(text), context); });
  };
  const NumberValue length{greater_than(0.0)}, place{any()}, deadline{or_infinite(greater_than(0.0))};
  EXPECT_THAT(said(length, ".inf"),
              HasSubstr("found '.inf', expected a finite number, greater than 0 (a test: a length"));
  EXPECT_THAT(said(place, "-.inf"), HasSubstr("expected a finite number"));
  for (const char* text : {"5e-324", "1e-300", "1e300"})
    EXPECT_THAT(said(length, text),
                HasSubstr("expected a number of a magnitude between 1e-100 and 1e+100, greater than 0"));
  EXPECT_THAT(said(place, "-1e300"), HasSubstr("expected a number, 0 or of a magnitude between 1e-100 and 1e+100"));
  EXPECT_EQ(place.read(Settings::scalar("0"), context), 0.0);
  EXPECT_EQ(length.read(Settings::scalar("1e-100"), context), 1e-100);
  EXPECT_EQ(deadline.read(Settings::scalar(".inf"), context), std::numeric_limits<double>::infinity());
  EXPECT_THAT(said(deadline, "-.inf"), HasSubstr("expected a number, greater than 0"));
}

TEST(Options, AnEmptyValueIsNoValue) {
  Settings root;
  root.set("size", Settings::null({"field.yaml", 4}));
  EXPECT_THAT(message(root), HasSubstr("field.yaml:4: size: found nothing, expected an integer"));
  Settings optional;
  optional.set("limit", Settings::null());
  EXPECT_EQ(parse(optional).limit, std::nullopt);
}

TEST(Options, AutoLeavesTheChoiceToTheProgram) {
  EXPECT_EQ(parse({}).parts, std::nullopt);
  Settings root;
  root.set("parts", line(3, "4"));
  EXPECT_EQ(parse(root).parts, 4);
  root.set("parts", line(3, "auto"));
  EXPECT_EQ(parse(root).parts, std::nullopt);
  EXPECT_THAT(message("parts", "automatic"),
              HasSubstr("parts: found 'automatic', expected an integer or auto, between 1 and 9"));
  EXPECT_THAT(message("parts", "10"), HasSubstr("found '10', expected an integer or auto, between 1 and 9"));
}

TEST(Options, AWrongChoiceNamesTheChoices) {
  EXPECT_EQ(
      message("order", "frist"),
      "field.yaml:3: order: found 'frist', expected one of first, second (solver 'toy': of the hold); did you mean "
      "'first'?");
}

TEST(Options, AnItemOutOfRangeIsNamed) {
  Settings list;
  list.append(line(5, "1"));
  list.append(line(6, "-1"));
  Settings root;
  root.set("weights", list);
  EXPECT_THAT(message(root), HasSubstr("field.yaml:6: weights[1]: found '-1', expected a number, at least 0"));
}

TEST(Options, AnUnknownKeySuggestsTheNearest) {
  EXPECT_THAT(message("sise", "5"), AllOf(HasSubstr("field.yaml:3: sise: solver 'toy' has no option 'sise'"),
                                          HasSubstr("did you mean 'size'?"), HasSubstr("tolerance, size, verbose")));
  EXPECT_THAT(message("search.step", "5"),
              HasSubstr("search.step: solver 'toy' has no option 'step'; did you mean 'steps'?"));
  EXPECT_THAT(message("zzzzzz", "5"), HasSubstr("has no option 'zzzzzz'. Its options are: tolerance"));
}

TEST(Options, OnlyTheKeysToldAreSkipped) {
  Settings root;
  root.set("name", line(1, "toy"));
  EXPECT_NO_THROW(parse(root));
  EXPECT_THROW(Options::table().parse(root, "solver 'toy'"), Error);
}

TEST(Options, WhatIsNoMapIsRefused) {
  EXPECT_THAT(message(line(2, "fast")),
              HasSubstr("field.yaml:2: found 'fast', expected a map with the options of solver"));
}

TEST(Options, ATableRefusesANameTwice) {
  OptionTable<Search> table;
  table.integer("steps", &Search::steps, "");
  EXPECT_THROW(table.integer("steps", &Search::steps, ""), Error);
}

TEST(Options, TheSchemaShowsDefaultsAndConstraints) {
  std::vector<std::string> lines;
  for (const OptionRow& row : Options::table().schema()) {
    lines.push_back(row.name + " | " + row.type + " | " + row.default_value + " | " + row.constraint);
  }
  EXPECT_THAT(
      lines,
      ElementsAre("tolerance | number | 1e-06 | greater than 0", "size | integer | 5 | at least 1",
                  "verbose | flag | false | true or false", "label | text | plain | ",
                  "order | choice | second | one of first, second", "sigma | number or none | none | greater than 0",
                  "limit | integer or none | 3 | at least 1", "parts | integer or auto | auto | between 1 and 9",
                  "weights | list of numbers | [1, 0.5] | each at least 0", "starts | list of integers | [] | ",
                  "outputs | list of texts | [x, y] | ", "native | map | {} | passed through as it is",
                  "search.steps | integer | 7 | at least 0", "search.shrink | number | 0.5 | between 0.1 and 0.9"));
  EXPECT_EQ(Options::table().schema()[1].meaning, "block length [intervals]");
}

struct Weights {
  Settings by_name, list;
  static const OptionTable<Weights>& table() {
    static const auto options =
        OptionTable<Weights>()
            .map("by_name", &Weights::by_name,
                 {{"STATE", "number", "1", "at least 0", "of a state"}, {"INPUT", "number", "5", "", "of an input"}})
            .map("list", &Weights::list, {{"", "list of texts", "[]", "", "which count"}});
    return options;
  }
};

TEST(Options, AMapIsPassedThroughAndDocumentedByItsRows) {
  Settings from;
  from.set("by_name.x", line(3, "2"));
  EXPECT_EQ(Weights::table().parse(from, "weights").by_name.find("x")->as_number(), 2.0);
  EXPECT_TRUE(Weights::table().parse({}, "weights").list.is_null());
  const std::vector<OptionRow> rows = Weights::table().schema();
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows[0].name, "by_name.STATE");
  EXPECT_EQ(rows[0].constraint, "at least 0");
  EXPECT_EQ(rows[1].name, "by_name.INPUT");
  EXPECT_EQ(rows[1].default_value, "5");
  EXPECT_EQ(rows[2].name, "list");
}

TEST(Nearest, FindsSlipsOfTheHand) {
  const std::vector<std::string> words = {"overlap", "size", "transition"};
  EXPECT_EQ(nearest("ovrelap", words), "overlap");
  EXPECT_EQ(nearest("sizes", words), "size");
  EXPECT_EQ(nearest("transitoin", words), "transition");
  EXPECT_EQ(nearest("horizon", words), "");
  EXPECT_EQ(nearest("size", {}), "");
}

TEST(Nearest, FindsNamesByAPartOfThem) {
  const std::vector<std::string> words = {"bicycle_sideslip", "bicycle_slip", "unicycle_traction"};
  EXPECT_EQ(nearest("bicycle", words), "bicycle_slip");
  EXPECT_EQ(nearest("traction", words), "unicycle_traction");
  EXPECT_EQ(nearest("tricycle", words), "");
  EXPECT_EQ(nearest("cy", words), "");
}

}  // namespace options_test
}  // namespace rhec
