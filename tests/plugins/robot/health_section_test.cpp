#include "rhec/plugins/robot/health_section.hpp"

#include <gmock/gmock.h>

#include "plugins/robot/robots.hpp"
#include "rhec/plugins/robot/estimator_section.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace health_section_test {

using testing::ElementsAre;
using testing::HasSubstr;

/// The judge of an estimator of this configuration, and of its blocks if there are any.
const SensorWatch* watch_of(std::unique_ptr<Estimator>& estimator, const std::string& text,
                            const std::string& blocking = {}) {
  const auto context = context_with("");
  estimator = EstimatorSection(context, BlockingSection(context, settings(blocking)), settings(text)).make();
  return estimator->watch();
}

TEST(HealthSection, EveryEstimatorHasAJudgeWhoseSetUpIsTheConfigurations) {
  std::unique_ptr<Estimator> estimator;
  for (const char* name : {"rhe", "ekf", "bank"}) {
    const SensorWatch* watch = watch_of(estimator, std::string("{name: ") + name +
                                                       ", process_noise: {kappa: 0.02, mu: 0.01}, health: {gate: 4, "
                                                       "proof: 7, lost_position: 1.5, lost_heading: 0.2}}");
    ASSERT_NE(watch, nullptr) << name;
    EXPECT_EQ(watch->setup().gate, 4.0);
    EXPECT_EQ(watch->setup().proof, 7);
    EXPECT_EQ(watch->setup().lost_position, 1.5);
    EXPECT_EQ(watch->setup().lost_heading, 0.2);
    EXPECT_THAT(watch->setup().walk, ElementsAre(0.02, 0.01));
  }
}

TEST(HealthSection, CanBeTurnedOff) {
  std::unique_ptr<Estimator> estimator;
  EXPECT_EQ(watch_of(estimator, "{health: {watch: false}}"), nullptr);
}

TEST(HealthSection, ACovarianceThatClaimsTooMuchIsNoMeasureUnlessAskedFor) {
  const std::string blocks = "{kappa: full_horizon, mu: full_horizon}";
  std::unique_ptr<Estimator> estimator;
  EXPECT_NE(watch_of(estimator, "", blocks), nullptr);
  EXPECT_EQ(watch_of(estimator, "{covariance: blocks}", blocks), nullptr);
  EXPECT_NE(watch_of(estimator, "{covariance: blocks, health: {watch: true}}", blocks), nullptr);
}

TEST(HealthSection, MistakesNameTheKey) {
  for (const char* key : {"gate: 0", "proof: 1", "lost_position: -1", "lost_heading: x", "gaet: 3"}) {
    std::unique_ptr<Estimator> estimator;
    EXPECT_THAT(error_of([&] { watch_of(estimator, std::string("{health: {") + key + "}}"); }),
                HasSubstr(std::string(key).substr(0, std::string(key).find(':'))));
  }
}

}  // namespace health_section_test
}  // namespace rhec
