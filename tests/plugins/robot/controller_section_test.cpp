#include "rhec/plugins/robot/controller_section.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace controller_section_test {

using testing::AllOf;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

std::unique_ptr<Controller> controller(const std::string& text, const std::string& bounds = {}) {
  return ControllerSection(context_with(bounds), settings(text)).make(Path({{0.0, 0.0, 2.0}, {50.0, 0.0, 2.0}}));
}

const RhcProblem::Setup& problem_of(const Controller& controller) { return controller.problem().setup(); }

TEST(ControllerSection, HasTheDocumentedDefaults) {
  const auto made = controller("");
  const RhcProblem::Setup& problem = problem_of(*made);
  EXPECT_THAT(problem.state_weights, ElementsAre(1.0, 1.0, 0.0, 0.0));
  const double steering_rate = host().make_model("bicycle_slip")->description().inputs[1].scale;
  EXPECT_THAT(problem.input_weights, ElementsAre(5.0, DoubleNear(0.02 / (steering_rate * steering_rate), 1e-12)));
  EXPECT_THAT(problem.terminal_weights, ElementsAre(10.0, 10.0, 0.0, 0.0));
  EXPECT_TRUE(problem.blocked_inputs.empty());

  const ControllerOptions options;
  const OptionSection documentation = ControllerSection::documentation();
  const auto shown = [&](const char* key) { return documented_default(documentation, key); };
  EXPECT_EQ(shown("horizon"), std::to_string(problem.max_intervals));
  EXPECT_EQ(shown("substeps"), "auto");
  EXPECT_EQ(problem.substeps, 1);
  EXPECT_EQ(shown("reference_speed"), "ground");
  EXPECT_EQ(shown("least_speed_factor"), NumberValue{}.print(options.least_speed_factor));
  EXPECT_EQ(shown("speed_bound_factor"), NumberValue{}.print(options.speed_bound_factor));
  EXPECT_EQ(shown("speed_bound_offset"), NumberValue{}.print(options.speed_bound_offset));
  EXPECT_EQ(shown("weights.stage.STATE"), "1 for the position, 5 for a speed, else 0");
  EXPECT_EQ(shown("weights.stage.INPUT"), "5 for a speed, else 0.02 / typical^2");
  EXPECT_EQ(shown("weights.terminal.STATE"), "10 for the position, else 0");
  EXPECT_EQ(shown("solver.name"), ControllerSection(context_with(), {}).solver_choice().name);
}

TEST(ControllerSection, ReadsWeightsAndBlockingByName) {
  const auto made = controller(
      "{horizon: 8, weights: {stage: {beta: 3, u2: 0.5}, terminal: {y_pos: 7}}, blocking: {u2: {name: structured, "
      "size: "
      "2, anchor: horizon}}}");
  const RhcProblem::Setup& problem = problem_of(*made);
  EXPECT_EQ(problem.max_intervals, 8);
  EXPECT_THAT(problem.state_weights, ElementsAre(1.0, 1.0, 3.0, 0.0));
  EXPECT_THAT(problem.input_weights, ElementsAre(5.0, 0.5));
  EXPECT_THAT(problem.terminal_weights, ElementsAre(10.0, 7.0, 0.0, 0.0));
  EXPECT_THAT(problem.blocked_inputs, ElementsAre(1));
}

TEST(ControllerSection, ReadsWeightsAndBoundsOfRates) {
  const auto made = controller("{weights: {stage: {u2: 0.5}, rates: {u2: 0.25}}, rate_bounds: {u1: [-2, null]}}",
                               "{u2: [-0.125, 1]}");
  const RhcProblem::Setup& problem = problem_of(*made);
  // Both inputs are states now, one because its rate has a weight, one because it has a bound.
  EXPECT_THAT(problem.rates, ElementsAre(RhcProblem::Rate{0, 4}, RhcProblem::Rate{1, 5}));
  EXPECT_THAT(problem.state_weights, ElementsAre(1.0, 1.0, 0.0, 0.0, 5.0, 0.5));
  EXPECT_THAT(problem.terminal_weights, ElementsAre(10.0, 10.0, 0.0, 0.0, 5.0, 0.5));
  EXPECT_THAT(problem.input_weights, ElementsAre(0.0, 0.25));
  EXPECT_THAT(problem.input_lower, ElementsAre(-2.0, -HUGE_VAL));
  EXPECT_EQ(problem.input_upper[0], HUGE_VAL);
  EXPECT_EQ(problem.state_lower[5], -0.125);
  EXPECT_EQ(problem.state_upper[5], 1.0);
  EXPECT_TRUE(problem_of(*controller("weights: {rates: {u2: 0}}")).rates.empty()) << "which costs nothing";
}

TEST(ControllerSection, HasTheBoundsOfTheConfiguration) {
  const auto made = controller("", "{delta: [-0.25, 0.5], u2: [-0.125, 1]}");
  EXPECT_EQ(problem_of(*made).state_lower[3], -0.25);
  EXPECT_EQ(problem_of(*made).state_upper[3], 0.5);
  EXPECT_EQ(problem_of(*made).input_lower[1], -0.125);
  EXPECT_EQ(problem_of(*made).input_upper[1], 1.0);
}

TEST(ControllerSection, RefusesUnknownNamesAndWrongNumbers) {
  const std::vector<std::pair<const char*, const char*>> wrong = {
      {"horzion: 3", "horzion: controller has no option 'horzion'; did you mean 'horizon'?"},
      {"horizon: 0", "between 1 and 100000"},
      {"reference_speed: lit", "one of ground, literal"},
      {"least_speed_factor: 0", "greater than 0"},
      {"speed_bound_factor: -1", "at least 0"},
      {"weights: {stag: {}}", "weights.stag: controller: weights has no option 'stag'; did you mean 'stage'?"},
      {"weights: {stage: {bata: 1}}", "did you mean 'beta'?"},
      {"weights: {stage: {u1: -1}}", "at least 0"},
      {"weights: {terminal: {u1: 1}}", "weights: terminal has no option 'u1'"},
      {"weights: {rates: {u3: 1}}", "weights: rates has no option 'u3'; did you mean 'u1'?"},
      {"weights: {rates: {u2: -1}}", "at least 0"},
      {"weights: {rate: {u2: 1}}", "did you mean 'rates'?"},
      {"rate_bounds: {delta: [-1, 1]}", "rate_bounds has no option 'delta'"},
      {"rate_bounds: {u2: [1, -1]}", "lower <= upper"},
      {"rate_bounds: {u2: [0.1, 1]}", "found [0.1, 1], expected 0 between them"},
      {"blocking: {u3: unblocked}", "controller: blocking has no option 'u3'"},
      {"blocking: {u1: {name: structured, overlap: 30}}", "change it or controller.horizon"},
      {"blocking: {u1: {name: unblocked, transition: ramp}}", "drop transition and neighbour_sigma"},
  };
  for (const auto& [text, expected] : wrong)
    EXPECT_THAT(error_of([text = text] { controller(text); }), AllOf(StartsWith("robot.yaml:1: "), HasSubstr(expected)))
        << text;
}

TEST(ControllerSection, LooksAtWeightsOnlyOnceThereIsAController) {
  const ControllerSection section(context_with(), settings("weights: {stage: {nobody: 1}}"));
  EXPECT_EQ(section.options().horizon, ControllerOptions{}.horizon);
  EXPECT_THAT(error_of([&] { section.make(Path({{0.0, 0.0, 2.0}, {50.0, 0.0, 2.0}})); }), HasSubstr("nobody"));
}

}  // namespace controller_section_test
}  // namespace rhec
