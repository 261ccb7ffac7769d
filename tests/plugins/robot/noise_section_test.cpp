#include "rhec/plugins/robot/noise_section.hpp"

#include <gmock/gmock.h>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace noise_section_test {

using testing::DoubleEq;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

NoiseSection noise(const std::string& text) { return {settings(text), context_with()->about}; }

TEST(NoiseSection, IsAShareOfTypicalMagnitudesWhereNoneIsGiven) {
  const NoiseSection section = noise("");
  EXPECT_THAT(section.output_sigmas, ElementsAre(DoubleEq(0.1), DoubleEq(0.1), DoubleEq(0.003)));
  EXPECT_THAT(section.input_sigmas, ElementsAre(DoubleEq(0.05), DoubleEq(0.003)));
  EXPECT_EQ(default_sigmas(context_with()->about.outputs), section.output_sigmas);
  EXPECT_EQ(documented_default(NoiseSection::documentation(), "outputs.OUTPUT"), "0.01 x its typical magnitude");
  EXPECT_EQ(documented_default(NoiseSection::documentation(), "inputs.INPUT"), "0.01 x its typical magnitude");
}

TEST(NoiseSection, IsReadByName) {
  const NoiseSection section = noise("{outputs: {y_gps: 0.5}, inputs: {u2: 0.25}}");
  EXPECT_THAT(section.output_sigmas, ElementsAre(DoubleEq(0.1), 0.5, DoubleEq(0.003)));
  EXPECT_THAT(section.input_sigmas, ElementsAre(DoubleEq(0.05), 0.25));
}

TEST(NoiseSection, RefusesUnknownNamesAndWrongNumbers) {
  EXPECT_THAT(error_of([] { noise("outputs: {}\noutput: {}"); }),
              AllOf(StartsWith("robot.yaml:2: output: noise has no option"), HasSubstr("did you mean 'outputs'?")));
  EXPECT_THAT(error_of([] { noise("outputs: {x_gsp: 1}"); }),
              AllOf(StartsWith("robot.yaml:1: outputs.x_gsp"), HasSubstr("did you mean 'x_gps'?")));
  EXPECT_THAT(error_of([] { noise("inputs: {u1: 0}"); }), HasSubstr("greater than 0"));
  EXPECT_THAT(error_of([] { noise("inputs: {u1: .inf}"); }), HasSubstr("a finite number"));
}

TEST(NoiseSection, WhatIsSaidOfASensorThatIsLeftOutIsPassedOverAndNoted) {
  const auto about = context_with()->about;
  const NoiseSection section(settings("outputs: {x_gps: 0.5, yaw_rate: 0.1}\nbiases: {yaw_rate: {sigma: 0.1}}"), about,
                             {"yaw_rate", "heading"});
  EXPECT_EQ(section.output_sigmas.size(), about.outputs.size());
  EXPECT_EQ(section.output_sigmas[0], 0.5);
  EXPECT_THAT(section.notes, ElementsAre(AllOf(StartsWith("robot.yaml:1: outputs.yaw_rate"), HasSubstr("passed over")),
                                         StartsWith("robot.yaml:2: biases.yaw_rate")));
  EXPECT_THAT(error_of([&] { NoiseSection(settings("outputs: {yaw_rte: 1}"), about, {"yaw_rate"}); }),
              HasSubstr("did you mean 'yaw_rate'?"));
  EXPECT_THAT(noise("outputs: {x_gps: 0.5}").notes, testing::IsEmpty());
}

}  // namespace noise_section_test
}  // namespace rhec
