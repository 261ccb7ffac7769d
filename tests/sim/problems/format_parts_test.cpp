#include "sim/problems/format_parts.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <string>

#include "sim/support/problem_lines.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace format_parts_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

/// What block starts come to on three intervals, or what is said of them. `ramp` has ramps.
ProblemRecord starts_of(const char* text, int intervals = 3) {
  ProblemRecord record;
  record.where = "set.jsonl:3";
  record.intervals = intervals;
  record.transition["ramp"] = Transition::ramp;
  record.transition["step"] = Transition::step;
  const Json json = Json::parse(text);
  read_block_starts({json, "block_starts", record.where}, record);
  return record;
}

TEST(BlockStarts, AreTheIntervalsOnWhichABlockBegins) {
  const ProblemRecord record = starts_of(R"({"grip": [0, 2], "ramp": [1], "step": [0]})");
  EXPECT_THAT(record.block_starts.at("grip"), ElementsAre(0, 2));
  EXPECT_THAT(begins_of(record, "grip"), ElementsAre(1, 0, 1));
  EXPECT_THAT(begins_of(record, "ramp"), ElementsAre(0, 1, 0));
  EXPECT_TRUE(is_ramp(record, "ramp"));
  EXPECT_FALSE(is_ramp(record, "step"));
  EXPECT_FALSE(is_ramp(record, "grip")) << "what is not said is a step";
}

TEST(BlockStarts, OfAHorizonWithoutIntervals) {
  const ProblemRecord record = starts_of(R"({"grip": [0], "ramp": []})", 0);
  EXPECT_THAT(begins_of(record, "grip"), ElementsAre());
  EXPECT_THAT(error_of([] { starts_of(R"({"ramp": [0]})", 0); }),
              HasSubstr("block_starts.ramp[0]: found 0, expected none: the horizon has no interval"));
}

TEST(BlockStarts, AreRefusedWhereTheyAreNotInOrderOrBeyondTheHorizon) {
  EXPECT_THAT(error_of([] { starts_of(R"({"grip": [0, 3]})"); }),
              HasSubstr("set.jsonl:3: block_starts.grip[1]: found 3, expected an interval of 0 .. 2"));
  EXPECT_THAT(error_of([] { starts_of(R"({"grip": [0, 2, 1]})"); }), HasSubstr("expected starts that increase"));
  EXPECT_THAT(error_of([] { starts_of(R"({"grip": [1]})"); }), HasSubstr("0 first"));
  EXPECT_THAT(error_of([] { starts_of(R"({"step": []})"); }), HasSubstr("0 first"));
  EXPECT_EQ(error_of([] { starts_of(R"({"ramp": []})"); }), "") << "no ramp need start in a window";
}

TEST(OneBlock, IsAParameterThatKeepsItsValueOverTheHorizon) {
  const auto model = cart();
  ProblemRecord record = starts_of(R"({"grip": [0]})");
  EXPECT_TRUE(is_one_block(record, *model, 0));
  record.block_starts["grip"] = {0, 2};
  EXPECT_FALSE(is_one_block(record, *model, 0));
}

TEST(ToALine, WhatIsNotFiniteIsNull) {
  EXPECT_EQ(number_or_null(0.1).dump(), "0.1");
  EXPECT_TRUE(number_or_null(unbounded).is_null());
  EXPECT_TRUE(number_or_null(std::numeric_limits<double>::quiet_NaN()).is_null());
  EXPECT_EQ(list_of({1.5, unbounded}).dump(), "[1.5,null]");
  EXPECT_EQ(rows_of({{1.5}, {}, {2.5, 3.5}}).dump(), "[[1.5],[],[2.5,3.5]]");
  EXPECT_EQ(map_of(std::map<std::string, double>{{"a", 0.5}, {"b", unbounded}}, number_or_null).dump(),
            R"({"a":0.5,"b":null})");
}

TEST(ToARecord, KeepsTheBoundsThatThereAre) {
  ProblemRecord record;
  const std::vector<Variable> variables = {{"a", "m", ""}, {"b", "m", ""}, {"c", "m", ""}};
  keep_bounds(record, variables, {-1.0, -unbounded, -unbounded}, {1.0, unbounded, 2.0});
  EXPECT_THAT(record.bounds, ElementsAre(Pair("a", ElementsAre(-1.0, 1.0)), Pair("c", ElementsAre(-unbounded, 2.0))));
  const double values[] = {1.0, 2.0, 3.0};
  EXPECT_THAT(copied(values, 2), ElementsAre(1.0, 2.0));
}

TEST(ModelNames, BringWhatHasANameIntoTheModelsOrder) {
  const auto model = cart();
  const ModelDescription& about = model->description();
  ProblemRecord record;
  record.where = "set.jsonl:3";
  record.bounds["push"] = {-2.0, 2.0};
  const ModelNames names(record, *model);
  EXPECT_EQ(ModelNames::index_of(about.inputs, "push"), 1);
  EXPECT_EQ(ModelNames::index_of(about.inputs, "pos"), -1);
  EXPECT_THAT(ModelNames::in_order({{"push", 3.0}}, about.inputs), ElementsAre(0.0, 3.0));
  std::vector<double> lower, upper;
  names.fill_bounds(about.inputs, lower, upper);
  EXPECT_THAT(lower, ElementsAre(-unbounded, -2.0));
  EXPECT_THAT(upper, ElementsAre(unbounded, 2.0));
}

TEST(ModelNames, TellWhatTheModelDoesNotHave) {
  const auto model = cart();
  const ModelDescription& about = model->description();
  ProblemRecord record;
  record.where = "set.jsonl:3";
  const ModelNames names(record, *model);
  const std::map<std::string, double> good = {{"speed", 1.0}, {"pos", 1.0}}, bad = {{"psh", 1.0}};
  EXPECT_EQ(error_of([&] { names.check("weights", good, {&about.states, &about.inputs}); }), "");
  EXPECT_EQ(error_of([&] {
              names.check("weights", bad, {&about.states, &about.inputs});
            }),
            "set.jsonl:3: weights.psh: model 'cart' has no such variable here; did you mean 'push'?");
  EXPECT_EQ(error_of([&] { names.check_count("inputs[0]", 3, about.inputs); }),
            "set.jsonl:3: inputs[0]: 3 numbers, expected 2, for speed, push of model 'cart'");
  EXPECT_EQ(error_of([&] { names.check_count("inputs[0]", 2, about.inputs); }), "");
}

}  // namespace format_parts_test
}  // namespace rhec::sim
