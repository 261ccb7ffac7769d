#include "rhec/plugins/robot/model_section.hpp"

#include <gmock/gmock.h>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace model_section_test {

using testing::HasSubstr;
using testing::StartsWith;

TEST(ModelSection, MakesTheDocumentedDefault) {
  const ModelSection section(host(), {});
  EXPECT_EQ(section.model()->description().name, section.choice().name);
  EXPECT_EQ(section.choice().name, documented_default(ModelSection::documentation(), "name"));
}

TEST(ModelSection, ChoosesOutputs) {
  const ModelSection section(host(), settings("{name: bicycle_slip, outputs: [x_gps, y_gps]}"));
  EXPECT_EQ(section.model()->output_count(), 2);
  EXPECT_NE(section.choice().options.find("outputs"), nullptr);
}

TEST(ModelSection, ErrorsNameThePlace) {
  EXPECT_THAT(error_of([] { ModelSection(host(), settings("name: bicycle_slip\nwheelbse: 1")); }),
              AllOf(StartsWith("robot.yaml:2: wheelbse"), HasSubstr("did you mean 'wheelbase'?")));
  EXPECT_THAT(error_of([] { ModelSection(host(), settings("name: bicycle_slip\nwheelbase: 0")); }),
              AllOf(StartsWith("robot.yaml:2: wheelbase"), HasSubstr("between 0.001 and 1000")));
}

}  // namespace model_section_test
}  // namespace rhec
