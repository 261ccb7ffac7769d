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
