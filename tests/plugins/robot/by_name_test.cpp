// Options by the names of variables: read, checked and documented from one table.
#include "rhec/plugins/robot/by_name.hpp"
#include "rhec/core/base/infinity.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace by_name_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;
using testing::StartsWith;

ModelDescription about() {
  ModelDescription about;
  about.states = {{.name = "x", .unit = "m", .meaning = "x", .scale = 10.0},
                  {.name = "heading", .unit = "rad", .meaning = "heading", .scale = 2.0}};
  about.parameters = {{.name = "kappa", .unit = "1", .meaning = "slip", .scale = 0.5}};
  return about;
}

NumbersByName sigmas() {
  return {"sigmas of a test",
          {greater_than(0.0)},
          {{"STATE", &ModelDescription::states, scaled_default(0.5), "of a state"},
           {"PARAMETER", &ModelDescription::parameters, constant_default(3.0), "of a parameter"}}};
}

TEST(NumbersByName, HasTheDefaultOfWhatIsNotNamed) {
  EXPECT_THAT(sigmas().read({}, about()), ElementsAre(5.0, 1.0, 3.0));
  EXPECT_THAT(sigmas().read(settings("{}"), about()), ElementsAre(5.0, 1.0, 3.0));
  EXPECT_THAT(sigmas().read(settings("{kappa: 7, x: 0.25}"), about()), ElementsAre(0.25, 1.0, 7.0));
}

TEST(NumbersByName, SuggestsTheNearestOfAllItsNames) {
  EXPECT_THAT(error_of([] { sigmas().read(settings("x: 1\nkapa: 2"), about()); }),
              AllOf(StartsWith("robot.yaml:2: kapa: sigmas of a test has no option 'kapa'"),
                    HasSubstr("did you mean 'kappa'?"), HasSubstr("x, heading, kappa")));
}

TEST(NumbersByName, RefusesNumbersOutOfRangeWithTheUnit) {
  EXPECT_THAT(error_of([] { sigmas().read(settings("x: 0"), about()); }),
              AllOf(StartsWith("robot.yaml:1: x: found '0', expected a number, greater than 0"),
                    HasSubstr("sigmas of a test: m")));
  EXPECT_THAT(error_of([] { sigmas().read(settings("x: wide"), about()); }), HasSubstr("found 'wide'"));
  EXPECT_THAT(error_of([] { sigmas().read(settings("x: .inf"), about()); }), HasSubstr("expected a finite number"));
  EXPECT_THAT(error_of([] { sigmas().read(settings("[1, 2, 3]"), about()); }), HasSubstr("expected a map"));
}

TEST(NumbersByName, MayBeInfiniteWhereTheValueSaysSo) {
  const ByName<NumberValue> map(
      "m", {or_infinite(greater_than(0.0))},
      {{"PARAMETER", &ModelDescription::parameters, constant_default(3.0), "of a parameter"}});
  EXPECT_THAT(map.read(settings("kappa: .inf"), about()), ElementsAre(std::numeric_limits<double>::infinity()));
}

TEST(NumbersByName, DocumentsEachKind) {
  const std::vector<OptionRow> rows = sigmas().rows();
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].name, "STATE");
  EXPECT_EQ(rows[0].type, "number");
  EXPECT_EQ(rows[0].default_value, "0.5 x its typical magnitude");
  EXPECT_EQ(rows[0].constraint, "greater than 0");
  EXPECT_EQ(rows[0].meaning, "of a state");
  EXPECT_EQ(rows[1].name, "PARAMETER");
  EXPECT_EQ(rows[1].default_value, "3");
}

TEST(BoundsValue, ReadsPairsOfWhichNullIsNone) {
  EXPECT_THAT(BoundsValue{}.read(settings("[-1, 2]"), {}), Pair(-1.0, 2.0));
  EXPECT_THAT(BoundsValue{}.read(settings("[null, 2]"), {}), Pair(-infinity, 2.0));
  EXPECT_THAT(BoundsValue{}.read(settings("[1, null]"), {}), Pair(1.0, infinity));
  for (const char* wrong : {"3", "[1]", "[1, 2, 3]", "{lower: 1}"})
    EXPECT_THAT(error_of([&] { BoundsValue{}.read(settings(wrong), {}); }), HasSubstr("a list [lower, upper]"))
        << wrong;
  EXPECT_THAT(error_of([] { BoundsValue{}.read(settings("[2, 1]"), {}); }),
              HasSubstr("found [2, 1], expected lower <= upper"));
}

TEST(BoundsValue, RefusesWhatNoVehicleReaches) {
  for (const char* wrong : {"[.inf, null]", "[null, -.inf]", "[1e300, null]", "[null, 1e12]", "[5e-324, 1]"})
    EXPECT_THAT(error_of([&] { BoundsValue{}.read(settings(wrong), {}); }),
                HasSubstr("expected bounds of a magnitude of at most 1e+09, or null for none"))
        << wrong;
  EXPECT_THAT(BoundsValue{}.read(settings("[-.inf, .inf]"), {}), Pair(-infinity, infinity));
  EXPECT_THAT(BoundsValue{}.read(settings("[0, 1e9]"), {}), Pair(0.0, 1e9));
}

TEST(SigmaValue, LiesWhereDoublesTellItFromNothingAndFromEverything) {
  const SigmaValue sigma{greater_than(0.0)}, drift{at_least(0.0)};
  EXPECT_EQ(sigma.read(settings("1e-9"), {}), 1e-9);
  EXPECT_EQ(drift.read(settings("0"), {}), 0.0);
  for (const char* wrong : {"1e-12", "5e-324", "1e12"}) {
    EXPECT_THAT(error_of([&] { sigma.read(settings(wrong), {}); }),
                HasSubstr("expected a standard deviation between 1e-09 and 1e+09, in the variable's unit;"))
        << wrong;
    EXPECT_THAT(error_of([&] { drift.read(settings(wrong), {}); }), HasSubstr(", or 0;")) << wrong;
  }
  EXPECT_THAT(error_of([&] { sigma.read(settings("0"), {}); }), HasSubstr("greater than 0"));
  EXPECT_THAT(error_of([&] { sigma.read(settings(".inf"), {}); }), HasSubstr("a finite number"));
}

}  // namespace by_name_test
}  // namespace rhec
