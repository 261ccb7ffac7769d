#include "rhec/sim/problems/problem_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "rhec/sim/files/json.hpp"
#include "sim/support/problem_lines.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace problem_file_test {

using ::testing::ElementsAre;
using ::testing::StartsWith;
constexpr double infinity = std::numeric_limits<double>::infinity();

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
  EXPECT_THAT(error_of([&] { read_problems(one + "\n{", "set.jsonl"); }), StartsWith("set.jsonl:2: column"));
}

TEST(ProblemFile, IdsWithoutAStepStandAlone) {
  const ProblemRecord record = read_problem(replaced(rhe_line, "run/rhe/sb/7", "mine"), "set.jsonl", 3);
  EXPECT_EQ(record.step, -1);
  EXPECT_EQ(record.prefix, "mine");
  EXPECT_EQ(read_problem(replaced(rhe_line, "run/rhe/sb/7", "run/x7"), "set.jsonl", 3).prefix, "run/x7");
}

TEST(ProblemFile, NamesThePlaceAndTheRemedy) {
  const Mistake mistakes[] = {
      {rhe_line, "\"rhe\"", "\"mhe\"", "problem", "found \"mhe\", expected \"rhe\" or \"rhc\""},
      {rhe_line, "\"outputs\": [[1.5]", "\"outptus\": [[1.5]", "outptus", "did you mean 'outputs'?"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": \"0.1\"", "horizon.dt", "found \"0.1\", expected a number"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": 0", "horizon.dt", "above 0"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": 1e400", "", "too large"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": 0.1, \"dt\": 0.2", "dt", "written twice"},
      {rhe_line, "\"dt\": 0.1, ", "", "horizon.dt", "missing"},
      {rhe_line, "\"intervals\": 3", "\"intervals\": 2.5", "horizon.intervals", "an integer, at least 1"},
      {rhe_line, "\"intervals\": 3", "\"intervals\": 300000000", "horizon.intervals", "at most 1000000 intervals"},
      {rhe_line, "rk4", "euler", "horizon.integrator", "\"rk4\""},
      {rhe_line, "rk4", "radau5", "horizon.integrator", "is for lines with \"version\": 4"},
      {rhe_line, "\"substeps\": 2", "\"substeps\": 0", "horizon.substeps", "at least 1"},
      {rhe_line, "\"substeps\": 2", "\"substeps\": 1000000000", "horizon.substeps", "at most 1000"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": NaN", "", "a number that is not finite"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": -Infinity", "", "a number that is not finite"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": oops", "", "no JSON"},
      {rhe_line, "[null, 3]", "[4, 3]", "bounds.speed", "lower <= upper"},
      {rhe_line, "[null, 3]", "[4]", "bounds.speed", "[lower, upper]"},
      {rhe_line, "{\"id\"", "{\"version\": 6, \"id\"", "version", "found 6, expected 1 .. 5"},
      {rhe_line, "{\"id\"", "{\"version\": \"2\", \"id\"", "version", "an integer"},
      {rhe_line, "{\"id\"", "{\"origin\": {}, \"id\"", "origin", "is a key of version 2; add \"version\": 2"},
      {rhe_line, "{\"id\"", "{\"version\": 1, \"robust\": [], \"id\"", "robust", "is a key of version 2"},
      {rhe_line, "\"dt\": 0.1", "\"dt\": [0.1, 0.1, 0.1]", "horizon.dt", "found a list of 3, expected a number"},
      {rhe_line_2, "[0.1, 0.2, 0.3]", "[0.1, 0.2]", "horizon.dt", "2 numbers, expected 3: one for each interval"},
      {rhe_line_2, "[0.1, 0.2, 0.3]", "[0.1, 0, 0.3]", "horizon.dt[1]", "above 0"},
      {rhe_line_2, "[4, 5, 6]", "[4, 5]", "guess.states[1]", "2 numbers, expected 3"},
      {rhe_line_2, "[6, 7, 8]]", "[6, 7]]", "guess.controls[2]", "2 numbers, expected 3: the free inputs"},
      {rhe_line_2, "[6, 7, 8]]", "[6, 7, null]]", "guess.controls[2][2]", "found null, expected a number"},
      {rhe_line_2, ", [6, 7, 8]]", "]", "guess.controls", "2 rows, expected 3"},
      {rhe_line_2, "\"costates\"", "\"costate\"", "guess.costate", "did you mean 'costates'?"},
      {rhe_line_2, "\"infeasible\"", "3", "origin.status", "expected a text"},
      {rhc_line_2, "\"intervals\": 2", "\"intervals\": 0", "horizon.intervals", "an integer, at least 1"},
  };
  expect_told(mistakes);
}

TEST(ProblemFile, RefusesWhatIsNoProblem) {
  for (const char* text : {"", "[]", "3", "null", "{\"id\": 1}", "{\"id\": \"x\"", "{} {}", "\xff"})
    EXPECT_THAT(error_of([&] { read_problem(text, "set.jsonl", 3); }), StartsWith("set.jsonl:3: ")) << text;
}

}  // namespace problem_file_test
}  // namespace rhec::sim
