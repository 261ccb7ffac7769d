// What is found out on drives: parameters that nothing sees, and scales that are far off.
#include <gmock/gmock.h>

#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace model_check_drives_test {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(ModelCheck, FindsAParameterThatNothingSees) {
  const ModelCheck found = check(Fault::unseen_parameter);
  EXPECT_THAT(faults(found), ElementsAre("fail observability: parameter mu"));
  EXPECT_THAT(finding_of(found, "observability").found, HasSubstr("can never learn it"));
  EXPECT_THAT(drive_of(found, "slalom").undetermined, ElementsAre("mu"));
}

TEST(ModelCheck, NamesACombinationThatIsNotDetermined) {
  const ModelCheck found = check(Fault::product_of_parameters);
  EXPECT_THAT(faults(found),
              testing::IsSupersetOf({"fail observability: parameter kappa", "fail observability: parameter mu"}));
  // At kappa = mu and the same scales, what is gained by one is lost by the other.
  EXPECT_THAT(drive_of(found, "slalom").undetermined, ElementsAre("0.71 kappa - 0.71 mu"));
}

TEST(ModelCheck, NamesErrorsOfSensorsThatTheDataCannotSeparate) {
  ModelCheckOptions options;
  options.biased = {0};
  const ModelCheck shifted = check({}, options);
  EXPECT_THAT(faults(shifted), ElementsAre("warn observability: x_gps_bias"));
  for (const Finding& finding : shifted.findings) {
    if (finding.where != "x_gps_bias") continue;
    EXPECT_THAT(finding.found, HasSubstr("0.71 x - 0.71 x_gps_bias"));
  }
  // The drives' own unknowns do not have it.
  EXPECT_THAT(drive_of(shifted, "slalom").undetermined, ElementsAre());
  options.biased = {};
  options.scaled = {0};
  const ModelCheck scaled = check({}, options);
  // x alone is scaled: y still tells how fast and where to.
  EXPECT_THAT(faults(scaled), ElementsAre());
  options.scaled = {0, 1};
  const ModelCheck both = check({}, options);
  EXPECT_THAT(faults(both), Contains("warn observability: parameter kappa"));
  EXPECT_THAT(faults(both),
              testing::IsSupersetOf({"warn observability: x_gps_scale", "warn observability: y_gps_scale"}));
  options.scaled = {2};
  EXPECT_THROW(check({}, options), Error);
}

TEST(ModelCheck, FindsAScaleThatIsFarOff) {
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.states[1].scale *= 1e4; })),
              Contains("warn scaling: state y"));
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.outputs[1].scale *= 1e4; })),
              Contains("warn scaling: output y_gps"));
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.outputs[1].scale *= 1e-4; })),
              ElementsAre("warn scaling: output y_gps"));
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.parameters[1].scale *= 1e-4; })),
              Contains("warn description: parameter mu"));
}

}  // namespace model_check_drives_test
}  // namespace rhec::sim
