// Estimation problems: how a line is read, and what problem is made of it.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/sim/files/json.hpp"
#include "sim/support/problem_lines.hpp"

namespace rhec::sim {
namespace rhe_format_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(RheFormat, BuildsAnEstimationProblem) {
  const ProblemRecord record = read_problem(rhe_line, "set.jsonl", 3);
  const auto problem = build(record, cart(), 5);
  const auto& rhe = dynamic_cast<const RheProblem&>(*problem);
  EXPECT_EQ(rhe.capacity().intervals, 5);
  EXPECT_EQ(rhe.intervals(), 3);
  EXPECT_EQ(rhe.arrival_information(2, 1), 0.5);
  EXPECT_EQ(rhe.arrival_mean[2], 0.75);
  EXPECT_EQ(rhe.duration(2), 0.1);
  EXPECT_EQ(rhe.control_count(1), 2);
  EXPECT_EQ(rhe.control_count(2), 3) << "a block starts there";
  EXPECT_EQ(rhe.state_upper(1)[1], infinity) << "the model's own bounds are not on the line";
  EXPECT_EQ(rhe.control_upper(0)[0], 3.0);
  EXPECT_EQ(rhe.state_upper(0)[2], 0.9);

  Iterate guess(rhe.capacity());
  cold_start(record, rhe, guess);
  EXPECT_EQ(guess.state(0)[0], 1.0);
  EXPECT_EQ(guess.control(1)[0], 0.0) << "not measured";
  EXPECT_EQ(guess.control(2)[0], 3.0) << "clipped";
  EXPECT_DOUBLE_EQ(guess.state(1)[0], 1.0 + 0.1 * 2.0 * 0.75);
  EXPECT_TRUE(guess.is_finite());
}

TEST(RheFormat, BuildsWhatVersion2Adds) {
  const ProblemRecord record = read_problem(rhe_line_2, "set.jsonl", 3);
  EXPECT_EQ(record.version, 2);
  EXPECT_EQ(record.origin.at("status"), "infeasible");
  const auto problem = build(record, cart());
  const auto& rhe = dynamic_cast<const RheProblem&>(*problem);
  EXPECT_EQ(rhe.duration(1), 0.2);
  ASSERT_EQ(rhe.setup().robust.size(), 1U);
  EXPECT_THAT(rhe.setup().robust[0].outputs, ElementsAre(0));
  EXPECT_EQ(rhe.setup().robust[0].delta, 3.0);
  EXPECT_TRUE(rhe.structure().is_ramp(0));
  EXPECT_TRUE(rhe.structure().starts_block(0, 0)) << "a ramp that starts at the window's edge";
  EXPECT_EQ(rhe.link_variance(0, 0), 0.5);
  EXPECT_EQ(rhe.link_variance(2, 0), infinity);
  Iterate point(rhe.capacity());
  start(record, rhe, point);
  EXPECT_EQ(point.state(2)[2], 9.0);
  EXPECT_TRUE(std::signbit(point.state(3)[0])) << "zeros keep their sign";
  EXPECT_EQ(point.control(2)[2], 8.0);
  EXPECT_EQ(point.costate(3)[1], 3.0);
  EXPECT_EQ(point.control_bound(0)[0], 0.0) << "multipliers that are not there are zero";

  std::string alone = rhe_line_2.substr(0, rhe_line_2.find(",\n \"guess\"")) + "}";
  alone = replaced(replaced(alone, "\"grip\": [0, 2]", "\"grip\": []"), "[0.5, null]", "[]");
  const auto never = build(read_problem(alone, "set.jsonl", 3), cart());
  EXPECT_FALSE(never->structure().starts_block(0, 0)) << "no ramp starts in the window";
}

TEST(RheFormat, KeepsMeasurementsBetweenNodes) {
  const std::string line = replaced(rhe_line_2, "\"version\": 2",
                                    "\"version\": 4, \"between\": [[], [[0.05, 1.25], [0.1, null]], [[0.25, 2.5]]]");
  const ProblemRecord record = read_problem(line, "set.jsonl", 3);
  const auto problem = build(record, cart());
  const auto& rhe = dynamic_cast<const RheProblem&>(*problem);
  EXPECT_EQ(rhe.between(0).count(), 0);
  ASSERT_EQ(rhe.between(1).count(), 2);
  EXPECT_EQ(rhe.between(1).time(1), 0.1);
  EXPECT_EQ(rhe.between(1).outputs(0)[0], 1.25);
  EXPECT_TRUE(std::isnan(rhe.between(1).outputs(1)[0]));
  EXPECT_EQ(rhe.between(2).outputs(0)[0], 2.5);
  // And back: the same problem again.
  const ProblemRecord again = read_problem(
      problem_line(record_of(rhe, nullptr, record.id, record.model, record.model_options)), "set.jsonl", 3);
  ASSERT_EQ(again.between.size(), 3U);
  EXPECT_THAT(again.between[2][0], ElementsAre(0.25, 2.5));
  EXPECT_TRUE(std::isnan(again.between[1][1][1]));
  const auto without =
      build(read_problem(replaced(rhe_line_2, "\"version\": 2", "\"version\": 4"), "set.jsonl", 3), cart());
  EXPECT_FALSE(refill(record, *without)) << "there is no room for them";
  for (const char* wrong : {"[[], [[0.3, 1]], []]", "[[], []]", "[[], [[0.1]], []]"})
    EXPECT_THROW(
        read_problem(replaced(rhe_line_2, "\"version\": 2", std::string("\"version\": 4, \"between\": ") + wrong),
                     "set.jsonl", 3),
        Error)
        << wrong;
}

TEST(RheFormat, KeepsHowMuchSingleMeasurementsCount) {
  const std::string between = "\"between\": [[], [[0.05, 1.25], [0.1, null]], [[0.25, 2.5]]]";
  const auto line_with = [&](const std::string& weights) {
    return replaced(rhe_line_2, "\"version\": 2", "\"version\": 5, " + between + ", \"relative_weights\": " + weights);
  };
  const std::string weights = R"({"outputs": [[1], [4], [0.25], [1]], "between": [[], [[2], [1]], [[0.5]]]})";
  const ProblemRecord record = read_problem(line_with(weights), "set.jsonl", 3);
  const auto problem = build(record, cart());
  const auto& rhe = dynamic_cast<const RheProblem&>(*problem);
  EXPECT_EQ(rhe.measured(1).weight(0), 4.0);
  EXPECT_EQ(rhe.between(1).measured(0).weight(0), 2.0);
  EXPECT_EQ(rhe.between(2).measured(0).weight(0), 0.5);
  const std::string again = problem_line(record_of(rhe, nullptr, record.id, record.model, record.model_options));
  EXPECT_THAT(again, HasSubstr("\"relative_weights\""));
  EXPECT_EQ(problem_line(read_problem(again, "set.jsonl", 3)), again);
  const auto copy = build(read_problem(again, "set.jsonl", 3), cart());
  EXPECT_EQ(dynamic_cast<const RheProblem&>(*copy).between(2).measured(0).weight(0), 0.5);
  for (const char* wrong :
       {R"({"outputs": [[1], [4], [0.25]]})", R"({"outputs": [[1], [0], [0.25], [1]]})",
        R"({"outputs": [[1, 1], [4, 1], [0.25, 1], [1, 1]]})", R"({"outputs": [[1], [4], [1], [1]], "between": [[]]})",
        R"({"outputs": [[1], [4], [1], [1]], "between": [[], [[2]], [[0.5]]]})", R"({"between": []})"})
    EXPECT_THROW(read_problem(line_with(wrong), "set.jsonl", 3), Error) << wrong;
  const std::string usual = line_with(R"({"outputs": [[1], [1], [1], [1]]})");
  const auto same = build(read_problem(usual, "set.jsonl", 3), cart());
  EXPECT_THAT(problem_line(record_of(dynamic_cast<const RheProblem&>(*same), nullptr, "a", record.model, {})),
              Not(HasSubstr("relative_weights")));
}

TEST(RheFormat, AnEstimatorsFirstWindowHasNoInterval) {
  const std::string line = R"({"version": 2, "id": "run/rhe/0", "problem": "rhe", "model": {"name": "cart"},
 "horizon": {"intervals": 0, "dt": [], "integrator": "rk4", "substeps": 1},
 "arrival": {"state": [1, 0.5], "parameters": [1.75], "information": [[4, 0, 0], [0, 3, 0], [0, 0, 2]]},
 "outputs": [[2]], "inputs": [], "weights": {"outputs": [100], "inputs": [10, 20]}, "bounds": {"grip": [0, 1]},
 "block_starts": {"grip": [0]}})";
  const ProblemRecord record = read_problem(line, "set.jsonl", 1);
  const auto problem = build(record, cart());
  EXPECT_EQ(problem->intervals(), 0);
  Iterate point(problem->capacity());
  start(record, *problem, point);
  EXPECT_EQ(point.state(0)[2], 1.0) << "the prior, clipped";
  std::vector<double> scratch(problem->scratch_size());
  EXPECT_DOUBLE_EQ(problem->evaluate(point, nullptr, scratch), 100.0 + 2.0 * 0.75 * 0.75);
  EXPECT_EQ(Json::parse(solution_line(record, *problem, point, {}))["states"].size(), 1u);
}

TEST(RheFormat, RefillsInPlaceWhatFits) {
  const auto model = cart();
  const auto problem = build(read_problem(rhe_line, "set.jsonl", 3), model, 4);
  const ProblemRecord next = read_problem(
      replaced(replaced(rhe_line, "\"grip\": [0, 2]", "\"grip\": [0, 1]"), "[1, 0.5]", "[6, 0.5]"), "set.jsonl", 4);
  ASSERT_TRUE(refill(next, *problem));
  EXPECT_EQ(problem->control_count(1), 3);
  EXPECT_EQ(dynamic_cast<const RheProblem&>(*problem).arrival_mean[0], 6.0);
  EXPECT_FALSE(refill(read_problem(replaced(rhe_line, "[100]", "[50]"), "set.jsonl", 5), *problem));
  EXPECT_FALSE(refill(read_problem(rhc_line, "set.jsonl", 6), *problem));
  EXPECT_FALSE(refill(read_problem(replaced(replaced(rhe_line, "{\"id\"", "{\"version\": 2, \"id\""), "\"bounds\"",
                                            "\"robust\": [{\"outputs\": [\"gps\"], \"delta\": 3}], \"bounds\""),
                                   "set.jsonl", 7),
                      *problem));
  EXPECT_EQ(problem->control_count(1), 3) << "left as it was";
}

TEST(RheFormat, NamesThePlaceAndTheRemedy) {
  const Mistake mistakes[] = {
      {rhe_line, "\"intervals\": 3", "\"intervals\": 4", "outputs", "4 rows, expected 5"},
      {rhe_line, "[1.75]", "[1.75, 3]", "outputs[2]", "2 numbers, expected 1 as in the first row"},
      {rhe_line, "[1.75]", "[\"x\"]", "outputs[2][0]", "a number, or null"},
      {rhe_line, "[null, 0.5]", "null", "inputs[1]", "a row of numbers"},
      {rhe_line, "[4, 0, 0]", "[4, 0, null]", "arrival.information[0][2]", "found null, expected a number"},
      {rhe_line, "[[4, 0, 0], ", "[", "arrival.information", "2 rows, expected 3"},
      {rhe_line, "\"state\": [1, 0.5]", "\"state\": [1]", "arrival.information", "expected 2"},
      {rhe_line, "[100]", "[-100]", "weights.outputs[0]", "at least 0"},
      {rhe_line, "[100]", "[100, 100]", "weights.outputs", "expected 1, for gps of model 'cart'"},
      {rhe_line, "\"speed\": [null", "\"sped\": [null", "bounds.sped", "did you mean 'speed'?"},
      {rhe_line, "\"grip\": [0, 2]", "\"grip\": [1, 2]", "block_starts.grip", "0 first"},
      {rhe_line, "\"grip\": [0, 2]", "\"grip\": [0, 3]", "block_starts.grip[1]", "0 .. 2"},
      {rhe_line, "\"grip\": [0, 2]", "\"grip\": [0, 2, 2]", "block_starts.grip[2]", "increase"},
      {rhe_line, "\"grip\": [0, 2]", "", "block_starts.grip", "missing"},
      {rhe_line, "\"grip\": [0, 2]", "\"grip\": [0], \"speed\": [0]", "block_starts.speed", "no such variable here"},
      {rhe_line, "[4, 0, 0]", "[4, 0.1, 0]", "arrival.information", "[0][1] is 0.1, [1][0] is 0; expected a symmetric"},
      {rhe_line, "[[4,", "[[-4,", "arrival.information", "[0][0] is -4; expected a positive semidefinite"},
      {rhe_line, "[0, 3, 0.5], [0, 0.5, 2]", "[0, 3, 5], [0, 5, 2]", "arrival.information", "it is at most 2.44949"},
      {rhe_line, "[[4, 0, 0], [0, 3, 0.5], [0, 0.5, 2]]", "[[1, 0.9, 0], [0.9, 1, 0.9], [0, 0.9, 1]]",
       "arrival.information", "negative eigenvalue"},
      {rhe_line_2, "[\"gps\"], \"delta\": 3", "[\"gp\"], \"delta\": 3", "robust[0].outputs", "no output 'gp'"},
      {rhe_line_2, "[\"gps\"], \"delta\": 3", "[\"gps\", \"gps\"], \"delta\": 3", "robust[0].outputs",
       "name each output once"},
      {rhe_line_2, "[\"gps\"], \"delta\": 3", "[], \"delta\": 3", "robust[0].outputs", "at least one output"},
      {rhe_line_2, "\"delta\": 3", "\"delta\": 0", "robust[0].delta", "above 0"},
      {rhe_line_2, "\"delta\": 3", "\"detla\": 3", "robust[0].detla", "did you mean 'delta'?"},
      {rhe_line_2, "\"ramp\"", "\"slope\"", "transition.grip", "\"step\" or \"ramp\""},
      {rhe_line_2, "{\"grip\": \"ramp\"}", "{\"grip\": \"ramp\", \"pos\": \"step\"}", "transition.pos",
       "no such variable"},
      {rhe_line_2, "\"grip\": \"ramp\"", "\"grip\": \"step\"", "neighbour_variance.grip[0]",
       "no block before the first"},
      {rhe_line_2, "[0.5, null]", "[0.5]", "neighbour_variance.grip",
       "1 variances, expected 2: one for each of block_starts.grip"},
      {rhe_line_2, "[0.5, null]", "[0.5, 0]", "neighbour_variance.grip[1]", "above 0, or null"},
      {rhe_line_2, "{\"grip\": [0.5, null]}", "{\"grp\": [0.5, null]}", "neighbour_variance.grp",
       "no block_starts.grp"},
  };
  expect_told(mistakes);
}

}  // namespace rhe_format_test
}  // namespace rhec::sim
