#include "rhec/plugins/robot/bounds_section.hpp"
#include "rhec/core/base/infinity.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace bounds_section_test {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

ModelDescription own() { return ModelSection(host(), {}).model()->description(); }

TEST(BoundsSection, AreTheModelsOwnWhereNoneAreGiven) {
  const ModelDescription bounded = BoundsSection({}, own()).bounded();
  for (const auto kind : {&ModelDescription::states, &ModelDescription::inputs, &ModelDescription::parameters}) {
    EXPECT_EQ(lower_bounds_of(bounded.*kind), lower_bounds_of(own().*kind));
    EXPECT_EQ(upper_bounds_of(bounded.*kind), upper_bounds_of(own().*kind));
  }
  EXPECT_THAT(upper_bounds_of(bounded.parameters), ElementsAre(1.0, 1.0));
}

TEST(BoundsSection, AreReadByNameOfAnyKind) {
  const ModelDescription bounded =
      BoundsSection(settings("{y_pos: [-3, null], u1: [0, 4], mu: [0.25, 0.75]}"), own()).bounded();
  EXPECT_THAT(lower_bounds_of(bounded.states), ElementsAre(-infinity, -3.0, -infinity, own().states[3].lower));
  EXPECT_THAT(upper_bounds_of(bounded.inputs), ElementsAre(4.0, own().inputs[1].upper));
  EXPECT_THAT(lower_bounds_of(bounded.parameters), ElementsAre(0.0, 0.25));
  EXPECT_THAT(upper_bounds_of(bounded.parameters), ElementsAre(1.0, 0.75));
}

TEST(BoundsSection, RefusesUnknownNamesAndWrongPairs) {
  EXPECT_THAT(error_of([] { BoundsSection(settings("mu: [0, 1]\nkapa: [0, 1]"), own()); }),
              AllOf(StartsWith("robot.yaml:2: kapa: bounds has no option"), HasSubstr("did you mean 'kappa'?")));
  // An output is measured, and has no bounds.
  EXPECT_THAT(error_of([] { BoundsSection(settings("x_gps: [0, 1]"), own()); }), HasSubstr("no option 'x_gps'"));
  EXPECT_THAT(error_of([] { BoundsSection(settings("kappa: [1, 0]"), own()); }),
              StartsWith("robot.yaml:1: kappa: found [1, 0], expected lower <= upper"));
}

TEST(BoundsSection, HoldNoStateAtAPoint) {
  EXPECT_THAT(error_of([] { BoundsSection(settings("u1: [0, 4]\ny_pos: [2, 2]"), own()); }),
              StartsWith("robot.yaml:2: y_pos: found [2, 2], expected lower < upper"));
  // Slip that is known, and an input that is.
  const ModelDescription bounded = BoundsSection(settings("{kappa: [1, 1], u1: [3, 3]}"), own()).bounded();
  EXPECT_EQ(bounded.parameters[0].lower, bounded.parameters[0].upper);
  EXPECT_EQ(bounded.inputs[0].lower, bounded.inputs[0].upper);
}

TEST(BoundsSection, DocumentsOneRowForAllKinds) {
  const OptionSection section = BoundsSection::documentation();
  ASSERT_EQ(section.rows.size(), 1U);
  EXPECT_EQ(section.rows[0].name, "STATE, INPUT or PARAMETER");
  EXPECT_EQ(section.rows[0].default_value, "the model's own");
}

}  // namespace bounds_section_test
}  // namespace rhec
