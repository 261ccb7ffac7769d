#include "rhec/plugins/robot/robust_losses.hpp"

#include <gmock/gmock.h>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace robust_losses_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

std::vector<RobustLoss> losses(const std::string& text) {
  return robust_losses(settings(text), context_with()->about, "estimator");
}

TEST(RobustLosses, AreNoneWhereNoneIsGiven) { EXPECT_TRUE(losses("").empty()); }

TEST(RobustLosses, ShareOneLossWithTheDocumentedDelta) {
  const auto found = losses("outputs: [delta, x_gps]");
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].outputs, ElementsAre(2, 0));
  EXPECT_EQ(found[0].delta, RobustLoss{}.delta);
  const OptionSection section{"", "", robust_rows("none at all")};
  EXPECT_EQ(documented_default(section, "delta"), NumberValue{}.print(found[0].delta));
  EXPECT_EQ(documented_default(section, "outputs"), "none at all");
  EXPECT_EQ(losses("{outputs: [x_gps], delta: 1.5}")[0].delta, 1.5);
}

TEST(RobustLosses, RefuseWhatIsNoOutputOrNoDelta) {
  EXPECT_THAT(
      error_of([] { losses("outputs: [x_gps]\ndetla: 2"); }),
      AllOf(StartsWith("robot.yaml:2: detla: estimator: robust has no option"), HasSubstr("did you mean 'delta'?")));
  EXPECT_THAT(error_of([] { losses("outputs: [speed]"); }),
              AllOf(StartsWith("robot.yaml:1: outputs[0]: found 'speed'"), HasSubstr("one of x_gps, y_gps, delta")));
  EXPECT_THAT(error_of([] { losses("outputs: []"); }), HasSubstr("at least one output"));
  EXPECT_THAT(error_of([] { losses("outputs: x_gps"); }), HasSubstr("a list of at least one output"));
  EXPECT_THAT(error_of([] { losses("delta: 1"); }), HasSubstr("expected the key 'outputs'"));
  EXPECT_THAT(error_of([] { losses("{outputs: [x_gps], delta: 0}"); }), HasSubstr("greater than 0"));
}

}  // namespace robust_losses_test
}  // namespace rhec
