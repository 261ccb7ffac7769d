// What is found out on drives: parameters that nothing sees, and scales that are far off.
#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace model_check_drives_test {

using testing::AllOf;
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

/// "pass: ...", "warn x_gps_bias: ...": what is found of observability.
std::vector<std::string> of_observability(const ModelCheck& check) {
  std::vector<std::string> found;
  for (const Finding& finding : check.findings)
    if (finding.check == "observability") found.push_back(finding.where + ": " + finding.found);
  return found;
}

TEST(ModelCheck, ComparesErrorsOfSensorsWithWhatIsKnownOfThem) {
  ModelCheckOptions options;
  options.scaled = {0};
  options.scale_sigmas = {10.0};
  EXPECT_THAT(of_observability(check({}, options)), Contains(HasSubstr("x_gps_scale to ")));
  options.scale_sigmas = {1e-6};
  const ModelCheck known = check({}, options);
  EXPECT_THAT(faults(known), ElementsAre("warn observability: x_gps_scale"));
  EXPECT_THAT(of_observability(known),
              Contains(AllOf(HasSubstr("more than the 1e-06 that is known before"), HasSubstr("hardly separate"))));
  options.scale_sigmas = {1.0, 1.0};
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
