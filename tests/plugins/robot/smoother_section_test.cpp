#include "rhec/plugins/robot/smoother_section.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "plugins/robot/robots.hpp"
#include "rhec/plugins/robot/estimator_section.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace smoother_section_test {

using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using testing::StartsWith;

/// Ten intervals straight ahead, the latter half of them on slippery ground.
NodeLog drive() {
  NodeLog log;
  double x = 0.0;
  for (int k = 0; k <= 10; ++k) {
    log.states.insert(log.states.end(), {x, 0.0, 0.0, 0.0});
    log.parameters.insert(log.parameters.end(), {0.75, 0.5});
    log.outputs.insert(log.outputs.end(), {x, 0.0, 0.0});
    if (k == 10) break;
    log.durations.push_back(0.2);
    log.inputs.insert(log.inputs.end(), {5.0, 0.0});
    x += 0.2 * 5.0 * (k < 5 ? 0.9 : 0.5);
  }
  return log;
}

SmoothedRun smoothed(const std::string& smoother, const std::string& blocking) {
  const auto context = context_with();
  const EstimatorSection estimator(context, BlockingSection(context, settings(blocking)), {});
  return SmootherSection(context, settings(smoother)).make(estimator.parts())->estimate(drive());
}

/// How much kappa differs between the first and the last interval.
double change(const SmoothedRun& run) { return run.parameters.front() - run.parameters[run.parameters.size() - 2]; }

TEST(SmootherSection, HasTheEstimatorsBlockingUnlessItNamesOne) {
  EXPECT_NEAR(change(smoothed("", "kappa: full_horizon")), 0.0, 1e-9);
  EXPECT_GT(change(smoothed("", "kappa: unblocked")), 0.1);
  EXPECT_GT(change(smoothed("blocking: {kappa: unblocked}", "")), 0.1);
  EXPECT_NEAR(change(smoothed("blocking: {mu: unblocked}", "kappa: unblocked")), 0.0, 1e-9);
}

TEST(SmootherSection, FollowsPriorsWhereThereAreNoBlocksOrWhereItIsGivenSome) {
  EXPECT_TRUE(smoothed("", "kappa: full_horizon").laws.empty());
  EXPECT_TRUE(smoothed("blocking: {kappa: unblocked}", "").laws.empty());
  const SmoothedRun open = smoothed("laws: 2", "");
  EXPECT_THAT(open.laws, SizeIs(2));
  EXPECT_GT(change(open), 0.1);
  const SmoothedRun given = smoothed("priors: {kappa: {name: walk, sigma: 0.1}, mu: constant}", "kappa: full_horizon");
  ASSERT_THAT(given.laws, SizeIs(1));
  EXPECT_THAT(given.laws[0].texts, Each("the prior given"));
  EXPECT_GT(change(given), 0.1);
  EXPECT_THAT(smoothed("priors: {kappa: auto}", "kappa: full_horizon").laws, Not(IsEmpty()));
}

TEST(SmootherSection, HasTheDocumentedDefaults) {
  const OptionSection documentation = SmootherSection::documentation();
  EXPECT_EQ(documented_default(documentation, "deadline"), NumberValue{}.print(SmootherOptions{}.deadline));
  EXPECT_EQ(documented_default(documentation, "blocking.PARAMETER.name"), "as in `blocking`");
  EXPECT_EQ(documented_default(documentation, "priors.PARAMETER"), "as in `estimator.priors`");
  EXPECT_EQ(documented_default(documentation, "laws"), IntegerValue{}.print(SmootherOptions{}.laws));
  EXPECT_EQ(documented_default(documentation, "robust.outputs"), "as in `estimator`");
  EXPECT_EQ(documented_default(documentation, "solver.name"), "sparse_sqp");
  const SmootherSection section(context_with(), settings("deadline: .inf"));
  EXPECT_EQ(section.options().deadline, std::numeric_limits<double>::infinity());
}

TEST(SmootherSection, RefusesUnknownNamesAndWrongNumbers) {
  const auto error = [](const std::string& text) {
    return error_of([&] { SmootherSection(context_with(), settings(text)); });
  };
  EXPECT_THAT(error("deadine: 3"), AllOf(StartsWith("robot.yaml:1: deadine: smoother has no option 'deadine'"),
                                         HasSubstr("did you mean 'deadline'?")));
  EXPECT_THAT(error("deadline: 0"), HasSubstr("greater than 0"));
  EXPECT_THAT(error("laws: 0"), HasSubstr("between 1 and 24"));
  EXPECT_THAT(error("priors: {kapa: walk}"), HasSubstr("did you mean 'kappa'?"));
  EXPECT_THAT(error("{blocking: {kappa: unblocked}, priors: {kappa: auto}}"),
              AllOf(StartsWith("robot.yaml:1: "), HasSubstr("either blocks or priors")));
  EXPECT_THAT(error("robust: {outputs: [speed]}"), HasSubstr("one of x_gps, y_gps, delta"));
  EXPECT_THAT(error_of([] { smoothed("blocking: {kapa: unblocked}", ""); }), HasSubstr("did you mean 'kappa'?"));
}

}  // namespace smoother_section_test
}  // namespace rhec
