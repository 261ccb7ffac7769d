#include "view.hpp"

namespace rhec {
namespace effort_test {

using namespace testing;

TEST(Effort, IsAResidualForEachInputThatHasAWeight) {
  const At at(bicycle(), make("effort", "{weights: {u2: 0.5}, delta: 3}"), {}, {0.0, 0.0, 0.0, 0.0}, {2.0, 0.3});
  EXPECT_TRUE(at.values.empty());
  EXPECT_THAT(at.residuals, ::testing::ElementsAre(0.3));
  EXPECT_EQ(at.functions.losses()[0].weight, 0.5);
  EXPECT_EQ(at.functions.losses()[0].delta, 3.0);
  const At square(bicycle(), make("effort", "{weights: {u1: 1}}"), {}, {0.0, 0.0, 0.0, 0.0});
  EXPECT_EQ(square.functions.losses()[0].delta, HUGE_VAL);
}

TEST(Effort, RefusesWhatIsNoWeightOfAnInput) {
  EXPECT_THAT(error_of([] { make("effort", "{weights: [1]}"); }), HasSubstr("a map from inputs"));
  EXPECT_THAT(error_of([] { make("effort", "{weights: {u1: -1}}"); }), HasSubstr("a weight of at least 0"));
  EXPECT_THAT(error_of([] {
                TermFunctions(*bicycle(), {{"effort", make("effort", "{weights: {u3: 1}}")}});
              }),
              HasSubstr("term 'effort': the model 'bicycle_slip' has no input 'u3'"));
}

}  // namespace effort_test
}  // namespace rhec
