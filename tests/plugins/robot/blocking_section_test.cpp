#include "rhec/plugins/robot/blocking_section.hpp"

#include <gmock/gmock.h>

#include <memory>
#include <string>
#include <utility>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace blocking_section_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

BlockingSection blocking(const std::string& text) { return {context_with(), settings(text)}; }

TEST(BlockingSection, HasOneValueAHorizonWhereNoneIsGiven) {
  const auto made = blocking("").make();
  ASSERT_EQ(made.size(), 2U);
  for (const auto& each : made) EXPECT_TRUE(each->is_one_block());
  EXPECT_EQ(blocking("").choice(1).name, documented_default(BlockingSection::documentation(), "PARAMETER.name"));
}

TEST(BlockingSection, IsReadByParameter) {
  const BlockingSection section = blocking("{mu: {name: structured, size: 3}}");
  const auto made = section.make();
  EXPECT_TRUE(made[0]->is_one_block());
  EXPECT_FALSE(made[1]->is_one_block());
  EXPECT_EQ(section.choice(0).name, "full_horizon");
  EXPECT_EQ(section.choice(1).name, "structured");
  EXPECT_EQ(section.choice(1).options.find("size")->as_integer(), 3);
}

TEST(BlockingSection, RefusesUnknownNamesAndWrongOptionsAtOnce) {
  EXPECT_THAT(error_of([] { blocking("kappa: unblocked\nmuu: unblocked"); }),
              AllOf(StartsWith("robot.yaml:2: muu: blocking has no option"), HasSubstr("did you mean 'mu'?")));
  EXPECT_THAT(error_of([] { blocking("mu:\n  name: structured\n  size: 0"); }), StartsWith("robot.yaml:3: mu.size"));
}

TEST(BlockingSection, SaysWhichHorizonDoesNotFit) {
  const BlockingSection section = blocking("kappa: {name: structured, size: 3, overlap: 16}");
  EXPECT_EQ(section.make_for(20, "estimator.horizon").size(), 2U);
  EXPECT_THAT(error_of([&] { section.make_for(15, "estimator.horizon"); }),
              AllOf(StartsWith("robot.yaml:1: kappa: "), HasSubstr("change it or estimator.horizon")));
}

BlockingSection of_noisy(const std::string& text) {
  const auto plain = context_with();
  RobotContext noisy = *plain;
  noisy.noise.state_sigmas[1] = 0.2;
  return {std::make_shared<const RobotContext>(std::move(noisy)), settings(text)};
}

TEST(BlockingSection, BlocksProcessNoise) {
  const BlockingSection section = of_noisy("{y_pos_noise: {name: structured, size: 3, overlap: 16}}");
  EXPECT_TRUE(section.blocks_noise());
  EXPECT_EQ(section.make().size(), 2U) << "noise is no parameter";
  const auto noises = section.make_noises_for(20, "estimator.horizon");
  ASSERT_EQ(noises.size(), 1U);
  EXPECT_EQ(noises[0].state, 1);
  EXPECT_FALSE(of_noisy("mu: structured").blocks_noise());
  EXPECT_THAT(error_of([&] { section.make_noises_for(15, "estimator.horizon"); }),
              AllOf(StartsWith("robot.yaml:1: y_pos_noise: "), HasSubstr("change it or estimator.horizon")));
  EXPECT_THAT(error_of([] { of_noisy("x_pos_noise: structured"); }),
              AllOf(StartsWith("robot.yaml:1: x_pos_noise: "), HasSubstr("set noise.states.x_pos")));
  EXPECT_THAT(error_of([] { of_noisy("y_pos_noise:\n  name: structured\n  size: 0"); }),
              StartsWith("robot.yaml:3: y_pos_noise.size"));
  for (const char* linked : {"transition: ramp", "neighbour_sigma: 0.1", "anchor: horizon"})
    EXPECT_THAT(
        error_of([&] {
          of_noisy("y_pos_noise: {name: structured, size: 2, " + std::string(linked) + "}").make_noises_for(9, "k");
        }),
        AllOf(StartsWith("robot.yaml:1: y_pos_noise: "), HasSubstr("blocks of process noise")));
}

}  // namespace blocking_section_test
}  // namespace rhec
