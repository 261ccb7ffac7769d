#include "rhec/sim/problems/problem_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;
constexpr double infinity = std::numeric_limits<double>::infinity();

/// A cart whose speed is the input times a grip.
struct Cart {
  static constexpr int state_count = 2, input_count = 2, parameter_count = 1, output_count = 1;
  template <class Scalar>
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = u[0] * p[0];
    dxdt[1] = u[1] - x[1];
  }
  template <class Scalar>
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
  }
};

std::shared_ptr<const Model> cart() {
  ModelDescription about;
  about.name = "cart";
  about.states = {{"pos", "m", ""}, {"lean", "rad", "", -1.0, 1.0}};
  about.inputs = {{"speed", "m/s", "", -1.0, 1.0}, {"push", "rad/s", ""}};
  about.parameters = {{"grip", "1", "", 0.0, 1.0}};
  about.outputs = {{"gps", "m", ""}};
  return std::make_shared<FormulaModel<Cart>>(Cart{}, about);
}

const std::string rhe_line = R"({"id": "run/rhe/sb/7", "problem": "rhe", "model": {"name": "cart", "mass": 2.5},
 "horizon": {"intervals": 3, "dt": 0.1, "integrator": "rk4", "substeps": 2},
 "arrival": {"state": [1, 0.5], "parameters": [0.75], "information": [[4, 0, 0], [0, 3, 0.5], [0, 0.5, 2]]},
 "outputs": [[1.5], [null], [1.75], [2]], "inputs": [[2, 0.25], [null, 0.5], [9, null]],
 "weights": {"outputs": [100], "inputs": [10, 20]},
 "bounds": {"speed": [null, 3], "grip": [0, 0.9]}, "block_starts": {"grip": [0, 2]}})";

const std::string rhc_line = R"({"id": "run/rhc/8", "problem": "rhc", "model": {"name": "cart"},
 "horizon": {"intervals": 2, "dt": 0.1, "integrator": "rk4", "substeps": 1},
 "initial_state": [1, 0.5], "parameters": [0.5],
 "reference": {"pos": [1, 2, 3], "speed": [4, 5]}, "weights": {"stage": {"pos": 1, "speed": 5}, "terminal": {"pos": 10}},
 "bounds": {"speed": [0, 4.5]}, "block_starts": {"push": [0]}})";

// All that version 2 adds.
const std::string rhe_line_2 = R"({"version": 2, "id": "run/rhe/7", "problem": "rhe", "model": {"name": "cart"},
 "horizon": {"intervals": 3, "dt": [0.1, 0.2, 0.3], "integrator": "rk4", "substeps": 2},
 "arrival": {"state": [1, 0.5], "parameters": [0.75], "information": [[4, 0, 0], [0, 3, 0.5], [0, 0.5, 2]]},
 "outputs": [[1.5], [null], [1.75], [2]], "inputs": [[2, 0.25], [null, 0.5], [9, null]],
 "weights": {"outputs": [100], "inputs": [10, 20]}, "robust": [{"outputs": ["gps"], "delta": 3}],
 "bounds": {"speed": [null, 3]}, "block_starts": {"grip": [0, 2]}, "transition": {"grip": "ramp"},
 "neighbour_variance": {"grip": [0.5, null]},
 "guess": {"states": [[1, 2, 3], [4, 5, 6], [7, 8, 9], [-0.0, 11, 12]], "controls": [[1, 2, 3], [4, 5], [6, 7, 8]],
  "costates": [[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3]]},
 "origin": {"run": "figure8", "status": "infeasible"}})";

const std::string rhc_line_2 = R"({"version": 2, "id": "run/rhc/8", "problem": "rhc", "model": {"name": "cart"},
 "horizon": {"intervals": 2, "dt": 0.1, "integrator": "rk4", "substeps": 1},
 "initial_state": [1, 0.5], "parameters": [0.5], "reference": {}, "weights": {"stage": {}, "terminal": {}},
 "bounds": {"speed": [[0, null], 4.5], "push": [-1, 1]}})";

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

std::string replaced(std::string text, const std::string& old, const std::string& with) {
  const std::size_t at = text.find(old);
  EXPECT_NE(at, std::string::npos) << old;
  return text.replace(at, old.size(), with);
}

/// What reading, and building, says of a line with one thing changed.
std::string mistake(const std::string& line, const std::string& old, const std::string& with) {
  return message_of([&] { build(read_problem(replaced(line, old, with), "set.jsonl", 3), cart()); });
}

TEST(ProblemFile, ReadsAnEstimationProblem) {
  const ProblemRecord record = read_problem(rhe_line, "set.jsonl", 3);
  EXPECT_EQ(record.id, "run/rhe/sb/7");
  EXPECT_EQ(record.prefix, "run/rhe/sb");
  EXPECT_EQ(record.step, 7);
  EXPECT_EQ(record.first_interval(), 4);
  EXPECT_EQ(record.model, "cart");
  ASSERT_NE(record.model_options.find("mass"), nullptr);
  EXPECT_EQ(record.model_options.find("mass")->as_number(), 2.5);
  EXPECT_EQ(record.model_options.find("mass")->where(), "set.jsonl:3");
  EXPECT_EQ(record.model_options.find("name"), nullptr);
  EXPECT_EQ(record.substeps, 2);
  EXPECT_THAT(record.bounds.at("speed"), ElementsAre(-infinity, 3.0));
  EXPECT_THAT(record.block_starts.at("grip"), ElementsAre(0, 2));
  EXPECT_TRUE(std::isnan(record.outputs[1][0]));
  EXPECT_TRUE(std::isnan(record.inputs[2][1]));
}

TEST(ProblemFile, BuildsAnEstimationProblem) {
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

TEST(ProblemFile, BuildsAControlProblem) {
  const ProblemRecord record = read_problem(rhc_line, "set.jsonl", 3);
  const auto problem = build(record, cart());
  const auto& rhc = dynamic_cast<const RhcProblem&>(*problem);
  EXPECT_EQ(record.first_interval(), 8);
  EXPECT_THAT(rhc.setup().blocked_inputs, ElementsAre(1));
  EXPECT_EQ(rhc.control_count(0), 2);
  EXPECT_EQ(rhc.control_count(1), 1);
  EXPECT_EQ(rhc.initial_state()[2], 0.5) << "the parameter";
  EXPECT_EQ(rhc.state_reference(2)[0], 3.0);
  Iterate guess(rhc.capacity());
  cold_start(record, rhc, guess);
  EXPECT_EQ(guess.control(0)[0], 4.0);
  EXPECT_EQ(guess.control(1)[0], 4.5) << "clipped";
  std::vector<double> scratch(rhc.scratch_size());
  // Node 0: 0; node 1: off by 0.8; the end: off by 1.575. Inputs: off by 0 and by 0.5.
  EXPECT_NEAR(rhc.evaluate(guess, nullptr, scratch), 0.8 * 0.8 + 10 * 1.575 * 1.575 + 5 * 0.5 * 0.5, 1e-12);
}

TEST(ProblemFile, BuildsWhatVersion2Adds) {
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

  const auto control = build(read_problem(rhc_line_2, "set.jsonl", 3), cart());
  EXPECT_EQ(control->control_lower(0)[0], 0.0);
  EXPECT_EQ(control->control_lower(1)[0], -infinity);
  EXPECT_EQ(control->control_upper(1)[0], 4.5);
  EXPECT_EQ(control->control_upper(1)[1], 1.0);
}

TEST(ProblemFile, AnEstimatorsFirstWindowHasNoInterval) {
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

TEST(ProblemFile, RefillsInPlaceWhatFits) {
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

  const auto control = build(read_problem(rhc_line, "set.jsonl", 3), model);
  ASSERT_TRUE(refill(read_problem(replaced(rhc_line, "[0, 4.5]", "[0, 4.25]"), "set.jsonl", 4), *control));
  EXPECT_EQ(control->control_upper(1)[0], 4.25) << "bounds of inputs move with the reference speed";
  EXPECT_FALSE(refill(read_problem(replaced(rhc_line, "{\"push\": [0]}", "{}"), "set.jsonl", 4), *control));
}

TEST(ProblemFile, SolutionLinesKeepEveryBit) {
  const ProblemRecord record = read_problem(rhe_line, "set.jsonl", 3);
  const auto problem = build(record, cart());
  Iterate point(problem->capacity());
  cold_start(record, *problem, point);
  point.state(1)[0] = 0.1 + 0.2;
  point.control(0)[0] = 1.0 / 3.0;
  const std::string line =
      solution_line(record, *problem, point, {"a \"solver\"", Status::iteration_limit, 7, 1e-300 / 3, 2.0 / 3e9, 12.5});
  EXPECT_EQ(line.find('\n'), std::string::npos);
  const auto read = Json::parse(line);
  EXPECT_EQ(read["id"], record.id);
  EXPECT_EQ(read["solver"], "a \"solver\"");
  EXPECT_EQ(read["status"], "iteration_limit");
  EXPECT_EQ(read["iterations"], 7);
  EXPECT_EQ(read["objective"].get<double>(), 1e-300 / 3);
  EXPECT_EQ(read["kkt_residual"].get<double>(), 2.0 / 3e9);
  EXPECT_EQ(read["solve_time_us"].get<double>(), 12.5);
  EXPECT_EQ(read["states"].size(), 4u);
  EXPECT_EQ(read["states"][0].size(), 2u);
  EXPECT_EQ(read["states"][1][0].get<double>(), 0.1 + 0.2);
  EXPECT_EQ(read["inputs"][0][0].get<double>(), 1.0 / 3.0);
  EXPECT_EQ(read["parameters"].size(), 3u);
  EXPECT_EQ(read["parameters"][2][0].get<double>(), 0.75);
  EXPECT_EQ(read["bounds_active"], true) << "the clipped speed";
}

TEST(ProblemFile, ReadsWholeFilesAndCountsTheirLines) {
  const std::string one = Json::parse(rhe_line).dump(), two = Json::parse(rhc_line).dump();
  const auto records = read_problems("\n" + one + "\r\n  \n" + two, "set.jsonl");
  ASSERT_EQ(records.size(), 2u);
  EXPECT_EQ(records[0].where, "set.jsonl:2");
  EXPECT_EQ(records[1].where, "set.jsonl:4");
  EXPECT_THAT(message_of([&] { read_problems(one + "\n{", "set.jsonl"); }), StartsWith("set.jsonl:2: column"));
}

TEST(ProblemFile, IdsWithoutAStepStandAlone) {
  const ProblemRecord record = read_problem(replaced(rhe_line, "run/rhe/sb/7", "mine"), "set.jsonl", 3);
  EXPECT_EQ(record.step, -1);
  EXPECT_EQ(record.prefix, "mine");
  EXPECT_EQ(read_problem(replaced(rhe_line, "run/rhe/sb/7", "run/x7"), "set.jsonl", 3).prefix, "run/x7");
}

TEST(ProblemFile, NamesThePlaceAndTheRemedy) {
  const struct {
    const std::string &line, old, with, key, what;
  } cases[] = {
      {rhe_line, "\"rhe\"", "\"mhe\"", "problem", "found \"mhe\", expected \"rhe\" or \"rhc\""},
      {rhe_line, "\"outputs\": [[1.5]", "\"outptus\": [[1.5]", "outptus", "did you mean 'outputs'?"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": \"0.1\"", "horizon.dt", "found \"0.1\", expected a number"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": 0", "horizon.dt", "above 0"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": 1e400", "", "too large"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": 0.1, \"dt\": 0.2", "dt", "written twice"},
      {rhe_line, "\"dt\": 0.1, ", "", "horizon.dt", "missing"},
      {rhe_line, "\"intervals\": 3", "\"intervals\": 2.5", "horizon.intervals", "an integer, at least 1"},
      {rhe_line, "\"intervals\": 3", "\"intervals\": 4", "outputs", "4 rows, expected 5"},
      {rhe_line, "rk4", "euler", "horizon.integrator", "\"rk4\""},
      {rhe_line, "\"substeps\": 2", "\"substeps\": 0", "horizon.substeps", "at least 1"},
      {rhe_line, "[1.75]", "[1.75, 3]", "outputs[2]", "2 numbers, expected 1 as in the first row"},
      {rhe_line, "[1.75]", "[\"x\"]", "outputs[2][0]", "a number, or null"},
      {rhe_line, "[null, 0.5]", "null", "inputs[1]", "a row of numbers"},
      {rhe_line, "[4, 0, 0]", "[4, 0, null]", "arrival.information[0][2]", "found null, expected a number"},
      {rhe_line, "[[4, 0, 0], ", "[", "arrival.information", "2 rows, expected 3"},
      {rhe_line, "\"state\": [1, 0.5]", "\"state\": [1]", "arrival.information", "expected 2"},
      {rhe_line, "[100]", "[-100]", "weights.outputs[0]", "at least 0"},
      {rhe_line, "[100]", "[100, 100]", "weights.outputs", "expected 1, for gps of model 'cart'"},
      {rhe_line, "[null, 3]", "[4, 3]", "bounds.speed", "lower <= upper"},
      {rhe_line, "[null, 3]", "[4]", "bounds.speed", "[lower, upper]"},
      {rhe_line, "\"speed\": [null", "\"sped\": [null", "bounds.sped", "did you mean 'speed'?"},
      {rhe_line, "\"grip\": [0, 2]", "\"grip\": [1, 2]", "block_starts.grip", "0 first"},
      {rhe_line, "\"grip\": [0, 2]", "\"grip\": [0, 3]", "block_starts.grip[1]", "0 .. 2"},
      {rhe_line, "\"grip\": [0, 2]", "\"grip\": [0, 2, 2]", "block_starts.grip[2]", "increase"},
      {rhe_line, "\"grip\": [0, 2]", "", "block_starts.grip", "missing"},
      {rhe_line, "\"grip\": [0, 2]", "\"grip\": [0], \"speed\": [0]", "block_starts.speed", "no such variable here"},
      {rhc_line, "\"initial_state\": [1, 0.5]", "\"initial_state\": [1]", "initial_state", "expected 2, for pos, lean"},
      {rhc_line, "[1, 2, 3]", "[1, 2]", "reference.pos", "2 numbers, expected 3, one for each node"},
      {rhc_line, "[4, 5]", "[4, 5, 6]", "reference.speed", "3 numbers, expected 2, one for each interval"},
      {rhc_line, ", \"speed\": [4, 5]", "", "reference.speed", "missing, but the variable has a weight"},
      {rhc_line, "\"terminal\": {\"pos\"", "\"terminal\": {\"speed\"", "weights.terminal.speed", "no such variable"},
      {rhc_line, "\"stage\": {\"pos\": 1", "\"stage\": {\"pos\": null", "weights.stage.pos", "expected a number"},
      {rhc_line, "\"speed\": [0, 4.5]", "\"grip\": [0, 1]", "bounds.grip", "no such variable here"},
      {rhc_line, "\"parameters\": [0.5],", "", "parameters", "missing"},
      {rhe_line, "[4, 0, 0]", "[4, 0.1, 0]", "arrival.information", "[0][1] is 0.1, [1][0] is 0; expected a symmetric"},
      {rhe_line, "[[4,", "[[-4,", "arrival.information", "[0][0] is -4; expected a positive semidefinite"},
      {rhe_line, "[0, 3, 0.5], [0, 0.5, 2]", "[0, 3, 5], [0, 5, 2]", "arrival.information", "it is at most 2.44949"},
      {rhe_line, "[[4, 0, 0], [0, 3, 0.5], [0, 0.5, 2]]", "[[1, 0.9, 0], [0.9, 1, 0.9], [0, 0.9, 1]]",
       "arrival.information", "negative eigenvalue"},
      {rhe_line, "{\"id\"", "{\"version\": 3, \"id\"", "version", "found 3, expected 1 .. 2"},
      {rhe_line, "{\"id\"", "{\"version\": \"2\", \"id\"", "version", "an integer"},
      {rhe_line, "{\"id\"", "{\"origin\": {}, \"id\"", "origin", "is a key of version 2; add \"version\": 2"},
      {rhe_line, "{\"id\"", "{\"version\": 1, \"robust\": [], \"id\"", "robust", "is a key of version 2"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": [0.1, 0.1, 0.1]", "horizon.dt", "found a list of 3, expected a number"},
      {rhe_line_2, "[0.1, 0.2, 0.3]", "[0.1, 0.2]", "horizon.dt", "2 numbers, expected 3: one for each interval"},
      {rhe_line_2, "[0.1, 0.2, 0.3]", "[0.1, 0, 0.3]", "horizon.dt[1]", "above 0"},
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
      {rhe_line_2, "[4, 5, 6]", "[4, 5]", "guess.states[1]", "2 numbers, expected 3"},
      {rhe_line_2, "[6, 7, 8]]", "[6, 7]]", "guess.controls[2]", "2 numbers, expected 3: the free inputs"},
      {rhe_line_2, "[6, 7, 8]]", "[6, 7, null]]", "guess.controls[2][2]", "found null, expected a number"},
      {rhe_line_2, ", [6, 7, 8]]", "]", "guess.controls", "2 rows, expected 3"},
      {rhe_line_2, "\"costates\"", "\"costate\"", "guess.costate", "did you mean 'costates'?"},
      {rhe_line_2, "\"infeasible\"", "3", "origin.status", "expected a text"},
      {rhc_line_2, "[[0, null], 4.5]", "[[0], 4.5]", "bounds.speed[0]", "1 numbers, expected 2: one for each interval"},
      {rhc_line_2, "[[0, null], 4.5]", "[[0, 5], 4.5]", "bounds.speed", "on interval 1, expected lower <= upper"},
      {rhc_line_2, "\"push\": [-1, 1]", "\"lean\": [[-1, 1], 2]", "bounds.lean", "lists of bounds are for inputs"},
      {rhc_line_2, "\"intervals\": 2", "\"intervals\": 0", "horizon.intervals", "an integer, at least 1"},
      {rhc_line, "\"speed\": [0, 4.5]", "\"speed\": [[0, 0], 4.5]", "bounds.speed[0]", "expected a number"},
  };
  for (const auto& each : cases) {
    const std::string place = each.key.empty() ? "set.jsonl:3: " : "set.jsonl:3: " + each.key + ": ";
    EXPECT_THAT(mistake(each.line, each.old, each.with), AllOf(StartsWith(place), HasSubstr(each.what))) << each.with;
  }
}

TEST(ProblemFile, RefusesWhatIsNoProblem) {
  for (const char* text : {"", "[]", "3", "null", "{\"id\": 1}", "{\"id\": \"x\"", "{} {}", "\xff"})
    EXPECT_THAT(message_of([&] { read_problem(text, "set.jsonl", 3); }), StartsWith("set.jsonl:3: ")) << text;
}

}  // namespace
}  // namespace rhec::sim
