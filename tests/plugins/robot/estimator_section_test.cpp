#include "rhec/plugins/robot/estimator_section.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace estimator_section_test {

using testing::AllOf;
using testing::DoubleEq;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

EstimatorSection estimator(const std::string& text, const std::string& bounds = {}) {
  const auto context = context_with(bounds);
  return {context, BlockingSection(context, {}), settings(text)};
}

std::vector<double> mean_of(const EstimatorParts& parts) {
  return {parts.initial_mean.data(), parts.initial_mean.data() + parts.initial_mean.size()};
}

std::vector<double> sigma_of(const EstimatorParts& parts) {
  const Eigen::VectorXd sigma = parts.initial_covariance.diagonal().cwiseSqrt();
  return {sigma.data(), sigma.data() + sigma.size()};
}

TEST(EstimatorSection, HasTheDocumentedDefaults) {
  const EstimatorSection section = estimator("");
  const EstimatorParts parts = section.parts();
  EXPECT_EQ(section.options().name, "rhe");
  EXPECT_EQ(parts.arrival, ArrivalKind::ekf);
  EXPECT_TRUE(parts.robust.empty());
  // States of 10, 10, 1 and 0.3, parameters of 0.5 as typical magnitudes.
  EXPECT_THAT(mean_of(parts), ElementsAre(0.0, 0.0, 0.0, 0.0, 0.5, 0.5));
  const double any_angle = std::numbers::pi / std::sqrt(3.0);
  EXPECT_THAT(sigma_of(parts), ElementsAre(DoubleEq(1.0), DoubleEq(1.0), DoubleNear(any_angle, 1e-12), DoubleEq(0.03),
                                           DoubleEq(0.5), DoubleEq(0.5)));
  EXPECT_THAT(sigma_of(section.parts(Eigen::VectorXd::Zero(4))),
              ElementsAre(DoubleEq(1.0), DoubleEq(1.0), DoubleEq(0.1), DoubleEq(0.03), DoubleEq(0.5), DoubleEq(0.5)));
  ASSERT_EQ(parts.walks.size(), 2U);

  const OptionSection documentation = EstimatorSection::documentation();
  const auto shown = [&](const char* key) { return documented_default(documentation, key); };
  EXPECT_EQ(shown("name"), "rhe");
  EXPECT_EQ(shown("horizon"), std::to_string(parts.horizon));
  EXPECT_EQ(shown("substeps"), "auto");
  EXPECT_EQ(parts.substeps, 1);
  EXPECT_EQ(shown("heading_starts"), std::to_string(section.parts(Eigen::VectorXd::Zero(4)).heading_starts));
  EXPECT_GT(parts.heading_starts, 1) << "nothing tells where it heads";
  EXPECT_EQ(shown("arrival.name"), "ekf");
  EXPECT_EQ(shown("process_noise.PARAMETER"), NumberValue{}.print(parts.walks[1].process_noise));
  EXPECT_EQ(shown("restart_sigma.PARAMETER"), NumberValue{}.print(parts.walks[1].restart_sigma));
  EXPECT_EQ(shown("block_sigma.PARAMETER"), NumberValue{}.print(parts.walks[1].block_sigma));
  EXPECT_EQ(shown("initial.sigma.STATE"),
            "0.1 x its typical magnitude; of a heading that nothing tells: any is as probable");
  EXPECT_EQ(shown("initial.sigma.PARAMETER"), "1 x its typical magnitude");
  EXPECT_EQ(shown("solver.name"), section.solver_choice().name);
}

TEST(EstimatorSection, ReadsNumbersByName) {
  const EstimatorParts parts = estimator(R"(
process_noise: {mu: 0.5}
restart_sigma: {kappa: 2}
block_sigma: {kappa: .inf}
initial: {state: {beta: 1}, parameters: {mu: 0.25}, sigma: {delta: 4, kappa: 8}}
arrival: {name: smoothing}
robust: {outputs: [y_gps]}
horizon: 7)")
                                   .parts();
  EXPECT_EQ(parts.walks[0].process_noise, ParameterWalk{}.process_noise);
  EXPECT_EQ(parts.walks[1].process_noise, 0.5);
  EXPECT_EQ(parts.walks[0].restart_sigma, 2.0);
  EXPECT_EQ(parts.walks[1].restart_sigma, ParameterWalk{}.restart_sigma);
  EXPECT_EQ(parts.walks[0].block_sigma, std::numeric_limits<double>::infinity());
  EXPECT_EQ(parts.walks[1].block_sigma, ParameterWalk{}.block_sigma);
  EXPECT_THAT(mean_of(parts), ElementsAre(0.0, 0.0, 1.0, 0.0, 0.5, 0.25));
  EXPECT_THAT(sigma_of(parts), ElementsAre(DoubleEq(1.0), DoubleEq(1.0), DoubleEq(0.1), 4.0, 8.0, DoubleEq(0.5)));
  EXPECT_EQ(parts.arrival, ArrivalKind::smoothing);
  ASSERT_EQ(parts.robust.size(), 1U);
  EXPECT_THAT(parts.robust[0].outputs, ElementsAre(1));
  EXPECT_EQ(parts.problem().max_intervals, 7);
}

TEST(EstimatorSection, ParametersStartInTheMiddleOfTheConfigurationsBounds) {
  EXPECT_THAT(mean_of(estimator("", "kappa: [0.5, 1]").parts()), ElementsAre(0.0, 0.0, 0.0, 0.0, 0.75, 0.5));
  // Without a middle, where nothing slips.
  EXPECT_THAT(mean_of(estimator("", "mu: [0, null]").parts()), ElementsAre(0.0, 0.0, 0.0, 0.0, 0.5, 1.0));
}

TEST(EstimatorSection, TakesAnInitialStateWhereItHasNone) {
  const Eigen::VectorXd start = Eigen::VectorXd::LinSpaced(4, 1.0, 4.0);
  EXPECT_THAT(mean_of(estimator("").parts(start)), ElementsAre(1.0, 2.0, 3.0, 4.0, 0.5, 0.5));
  EXPECT_THAT(mean_of(estimator("initial: {parameters: {mu: 0.25}}").parts(start)),
              ElementsAre(1.0, 2.0, 3.0, 4.0, 0.5, 0.25));
  EXPECT_THAT(mean_of(estimator("initial: {state: {y_pos: 9}}").parts(start)),
              ElementsAre(1.0, 9.0, 3.0, 4.0, 0.5, 0.5));
  Eigen::VectorXd partial = start;
  partial[1] = partial[2] = nan;
  EXPECT_THAT(mean_of(estimator("initial: {state: {y_pos: 9}}").parts(partial)),
              ElementsAre(1.0, 9.0, 0.0, 4.0, 0.5, 0.5));
}

/// What nobody has said of a heading is not known: neither the section, nor who makes the estimator.
TEST(EstimatorSection, KnowsOfAHeadingWhatIsSaidOfIt) {
  const double any_angle = std::numbers::pi / std::sqrt(3.0);
  const auto sigma = [](const std::string& text, const std::optional<Eigen::VectorXd>& start = {}) {
    return sigma_of(estimator(text).parts(start))[2];
  };
  Eigen::VectorXd start = Eigen::VectorXd::Zero(4);
  EXPECT_DOUBLE_EQ(sigma("", start), 0.1);
  EXPECT_DOUBLE_EQ(sigma("initial: {state: {beta: 1}}"), 0.1);
  EXPECT_DOUBLE_EQ(sigma("initial: {sigma: {beta: 0.3}}"), 0.3);
  EXPECT_NEAR(sigma("initial: {state: {x_pos: 1}}"), any_angle, 1e-12);
  EXPECT_NEAR(sigma("heading_starts: 8", start), any_angle, 1e-12) << "it is to be searched";
  EXPECT_DOUBLE_EQ(sigma("{heading_starts: 8, initial: {sigma: {beta: 3}}}"), 3.0);
  start[2] = nan;
  EXPECT_NEAR(sigma("", start), any_angle, 1e-12);
  EXPECT_DOUBLE_EQ(sigma("initial: {state: {beta: 1}}", start), 0.1);
}

TEST(EstimatorSection, RefusesUnknownNamesWithTheNearest) {
  const std::vector<std::pair<const char*, const char*>> wrong = {
      {"horzion: 3", "horzion: estimator has no option 'horzion'; did you mean 'horizon'?"},
      {"name: ekv", "name: found 'ekv', expected one of rhe, ekf, bank"},
      {"arrival: {name: ekv}", "did you mean 'ekf'?"},
      {"process_noise: {kapa: 1}", "process_noise.kapa: process_noise has no option 'kapa'; did you mean 'kappa'?"},
      {"forgetting: {kappa: 1}", "'forgetting' of estimator is called 'process_noise' now; rename the key"},
      {"restart_sigma: {kapa: 1}", "did you mean 'kappa'?"},
      {"block_sigma: {kapa: 1}", "did you mean 'kappa'?"},
      {"initial: {stat: {}}", "initial.stat: estimator: initial has no option 'stat'; did you mean 'state'?"},
      {"initial: {state: {beat: 1}}", "did you mean 'beta'?"},
      {"initial: {parameters: {muu: 1}}", "did you mean 'mu'?"},
      {"initial: {sigma: {kapa: 1}}", "did you mean 'kappa'?"},
      {"robust: {outputs: [speed]}", "one of x_gps, y_gps, delta"},
  };
  for (const auto& [text, expected] : wrong)
    EXPECT_THAT(error_of([text = text] { estimator(text); }), AllOf(StartsWith("robot.yaml:1: "), HasSubstr(expected)))
        << text;
}

TEST(EstimatorSection, RefusesWrongNumbersWhateverTheEstimator) {
  const std::vector<std::pair<const char*, const char*>> wrong = {
      {"horizon: 0", "between 1 and 100000"},
      {"substeps: 0", "between 1 and 1000"},
      {"heading_starts: 65", "between 1 and 64"},
      {"process_noise: {kappa: -1}", "at least 0"},
      {"restart_sigma: {kappa: .inf}", "a finite number"},
      {"block_sigma: {kappa: 0}", "greater than 0"},
      {"initial: {sigma: {beta: 0}}", "greater than 0"},
      {"initial: {state: {beta: .inf}}", "between -1000000000 and 1000000000"},
  };
  for (const auto& [text, expected] : wrong)
    EXPECT_THAT(error_of([text = text] { estimator(std::string("name: ekf\n") + text); }),
                AllOf(StartsWith("robot.yaml:2: "), HasSubstr(expected)))
        << text;
}

TEST(EstimatorSection, MakesTheEstimatorOfItsNameOnItsTimeline) {
  for (const char* name : {"rhe", "ekf"}) {
    const auto made = estimator(std::string("{name: ") + name + ", substeps: 3}").make();
    EXPECT_EQ(made->method().substeps(), 3);
    EXPECT_EQ(dynamic_cast<const WindowedEstimation*>(&made->method()) != nullptr, name == std::string("rhe"));
    const double outputs[3] = {};
    made->push_measurement(0.0, outputs);
    made->push_measurement(1.0, outputs);
    made->estimate(1.0);
    EXPECT_EQ(made->counts().nodes, 6) << "a second in steps of 0.2 s";
  }
}

TEST(EstimatorSection, KnowsDelaysOfOutputs) {
  const auto made = estimator("{name: ekf, delays: {x_gps: 0.1, y_gps: 0.1}, initial: {sigma: {beta: 0.1}}}").make();
  const double outputs[] = {1.0, 2.0, 0.0};
  for (int k = 0; k <= 4; ++k) made->push_measurement(0.2 * k, outputs);
  EXPECT_DOUBLE_EQ(made->estimate(0.8).time, 0.8);
  // From the first fix at -0.1 s on, in steps of 0.2 s, and the newest angle.
  EXPECT_EQ(made->counts().nodes, 6);
  EXPECT_THAT(error_of([] { estimator("{delays: {x_gps: -1}}"); }), HasSubstr("x_gps"));
}

}  // namespace estimator_section_test
}  // namespace rhec
