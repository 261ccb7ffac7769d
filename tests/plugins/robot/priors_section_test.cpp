#include "rhec/plugins/robot/priors_section.hpp"

#include <gmock/gmock.h>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace priors_section_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

PriorsSection priors(const std::string& text) { return {context_with(), settings(text)}; }

TEST(PriorsSection, LeavesOpenWhatIsNotGiven) {
  EXPECT_EQ(priors("").combinations().size(), 24U) << "eight laws of the one parameter, three of the other";
  EXPECT_EQ(priors("{kappa: auto, mu: auto}").combinations().size(), 24U);
  EXPECT_EQ(PriorsSection::rows().front().default_value, "auto");
}

TEST(PriorsSection, TakesAPriorOrAListOfThem) {
  const auto one = priors("{kappa: {name: walk, sigma: 0.02}, mu: constant}").combinations();
  ASSERT_EQ(one.size(), 1U);
  ASSERT_EQ(one[0].size(), 2U);
  const auto more = priors("{kappa: [walk, {name: matern, length: 20}], mu: {name: walk}}").combinations();
  EXPECT_EQ(more.size(), 2U);
  EXPECT_EQ(priors("{kappa: [walk, {name: matern, length: 20}]}").combinations().size(), 6U) << "two, and three of mu";
}

TEST(PriorsSection, RefusesMistakesAtOnce) {
  EXPECT_THAT(error_of([] { priors("kappa: auto\nmuu: walk"); }),
              AllOf(StartsWith("robot.yaml:2: muu: "), HasSubstr("did you mean 'mu'?")));
  EXPECT_THAT(error_of([] { priors("mu:\n  - name: walk\n    sigma: -1"); }), StartsWith("robot.yaml:3: mu[0].sigma"));
  EXPECT_THAT(error_of([] { priors("mu: []"); }), HasSubstr("at least one prior"));
  EXPECT_THAT(error_of([] { priors("mu: wlak"); }), HasSubstr("did you mean 'walk'?"));
  EXPECT_THAT(error_of([] { priors("{mu: [walk, walk, walk, walk, walk], kappa: [walk, walk, walk, walk, walk]}"); }),
              AllOf(StartsWith("robot.yaml:1"), HasSubstr("25 combinations")));
}

}  // namespace priors_section_test
}  // namespace rhec
