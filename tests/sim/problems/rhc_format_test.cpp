// Control problems: how a line is read, and what problem is made of it.
#include <gmock/gmock.h>

#include <limits>
#include <vector>

#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "sim/support/problem_lines.hpp"

namespace rhec::sim {
namespace rhc_format_test {

using ::testing::ElementsAre;
constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(RhcFormat, BuildsAControlProblem) {
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

TEST(RhcFormat, BuildsBoundsThatDifferFromIntervalToInterval) {
  const auto control = build(read_problem(rhc_line_2, "set.jsonl", 3), cart());
  EXPECT_EQ(control->control_lower(0)[0], 0.0);
  EXPECT_EQ(control->control_lower(1)[0], -infinity);
  EXPECT_EQ(control->control_upper(1)[0], 4.5);
  EXPECT_EQ(control->control_upper(1)[1], 1.0);
}

TEST(RhcFormat, BuildsTheRatesOfInputs) {
  const ProblemRecord record = read_problem(rhc_line_3, "set.jsonl", 3);
  const auto problem = build(record, cart());
  auto& rhc = dynamic_cast<RhcProblem&>(*problem);
  EXPECT_THAT(rhc.setup().rates, ElementsAre(RhcProblem::Rate{1, 2}));
  EXPECT_THAT(rhc.setup().input_weights, ElementsAre(5.0, 0.5));
  EXPECT_EQ(rhc.initial_state()[2], 0.25) << "the input before the first interval";
  EXPECT_EQ(rhc.state_upper(1)[2], 1.0);
  EXPECT_EQ(rhc.control_upper(0)[1], 3.0);
  EXPECT_TRUE(refill(record, rhc));
  EXPECT_FALSE(refill(read_problem(rhc_line, "set.jsonl", 3), rhc));
  EXPECT_FALSE(refill(record, *build(read_problem(rhc_line_2, "set.jsonl", 3), cart())));
  // And back to the same line.
  const ProblemRecord kept = record_of(rhc, nullptr, record.id, record.model, record.model_options);
  EXPECT_THAT(kept.rates, ElementsAre("push"));
  EXPECT_EQ(problem_line(read_problem(problem_line(kept), "set.jsonl", 3)), problem_line(kept));
}

/// A bicycle in a corridor with an obstacle, and multipliers at its limits.
TEST(RhcFormat, StoresTermsWithTheirOptionsAndData) {
  const Host host;
  const std::shared_ptr<const Model> model = host.make_model("bicycle_slip");
  RhcProblem::Setup setup;
  setup.max_intervals = 4;
  setup.state_weights = setup.terminal_weights = {1.0, 1.0, 0.0, 0.0};
  setup.input_weights = {5.0, 0.8};
  for (const auto& [name, options] : {std::pair("lateral_acceleration", "{most: 3, hard: true}"),
                                      std::pair("obstacles", "{most: 2, obstacles: [{x: 3, radius: 0.5}]}"),
                                      std::pair("effort", "{weights: {u2: 0.25}}")}) {
    const Settings made = parse_yaml(options, "test");
    setup.terms.push_back({name, host.make_term(name, made), made});
  }
  RhcProblem problem(model, setup);
  problem.set_intervals(4);
  for (int i = 0; i < 4; ++i) problem.set_duration(i, 0.2);
  for (int i = 0; i <= 4; ++i) problem.terms().place(i, {.time = 0.2 * i, .x = 0.4 * i});
  problem.terms().set_price(40.5);
  problem.given_parameters()[0] = problem.given_parameters()[1] = 0.9;
  std::vector<double> scratch(problem.scratch_size());
  problem.finish(scratch);
  Iterate point(problem.capacity());
  for (int i = 0; i <= 4; ++i) {
    point.state(i)[0] = 0.4 * i;
    if (i < 4) point.control(i)[0] = 2.0 + 0.1 * i;
    for (int r = 0; r < problem.limit_count(i); ++r) point.limit_bound(i)[r] = 0.1 * (r - i);
  }
  const ProblemRecord kept = record_of(problem, &point, "run/rhc/3", "bicycle_slip", Settings::map());
  const std::string line = problem_line(kept);
  std::vector<ProblemRecord> read{read_problem(line, "set.jsonl", 3), read_problem(line, "set.jsonl", 4)};
  EXPECT_THAT(error_of([&] { build(read[0], model); }), ::testing::HasSubstr("make_terms"));
  make_terms(read, host);
  EXPECT_EQ(problem_line(read[0]), line);
  const auto built = build(read[0], model);
  EXPECT_TRUE(refill(read[1], *built)) << "the same terms";
  Iterate guess(built->capacity());
  start(read[0], *built, guess);
  StageQp expected(problem.capacity()), found(problem.capacity());
  EXPECT_EQ(problem.linearise(all_stages(problem), point, Hessian::exact, expected, scratch),
            built->linearise(all_stages(*built), guess, Hessian::exact, found, scratch));
  for (int i = 0; i <= 4; ++i) {
    ASSERT_EQ(found.limits(i), expected.limits(i));
    const auto same = [](const double* a, const double* b, int count) { return std::equal(a, a + count, b); };
    const int row = expected.stride();
    EXPECT_TRUE(same(found.G(i), expected.G(i), found.limits(i) * row));
    EXPECT_TRUE(same(found.limit_lower(i), expected.limit_lower(i), found.limits(i)));
    EXPECT_TRUE(same(found.limit_upper(i), expected.limit_upper(i), found.limits(i)));
    EXPECT_TRUE(same(found.limit_linear(i), expected.limit_linear(i), found.limits(i)));
    EXPECT_TRUE(same(found.H(i), expected.H(i), problem.state_count(i) * row));
  }
  const auto wrong = [&](const std::string& from, const std::string& to) {
    std::vector<ProblemRecord> bad;
    return error_of([&] {
      bad.push_back(read_problem(replaced(line, from, to), "set.jsonl", 3));
      make_terms(bad, host);
      build(bad[0], model);
    });
  };
  EXPECT_THAT(wrong("\"version\":5", "\"version\":3"), ::testing::HasSubstr("is a key of version 4"));
  EXPECT_THAT(wrong("\"name\":\"effort\"", "\"name\":\"efort\""), ::testing::HasSubstr("set.jsonl:3: terms[2]: "));
  EXPECT_THAT(wrong("\"most\":2", "\"most\":3"),
              ::testing::HasSubstr("terms[1].data[0]: 14 numbers, expected 21 for the term 'obstacles'"));
  EXPECT_THAT(wrong("\"limit_price\":40.5", "\"limit_price\":-1"),
              ::testing::HasSubstr("limit_price: found -1, expected a number above 0"));
  EXPECT_THAT(wrong("\"hard\":true", "\"hard\":false"),
              ::testing::HasSubstr("set.jsonl:3: limit_price: there is no hard limit"));
  EXPECT_EQ(wrong("\"lower\":[[-", "\"lower\":[[1"), "") << "a hard one; the solver says that it is infeasible";
  const std::string without_price = replaced(line, ",\"limit_price\":40.5", "");
  const auto soft = [&](const char* lower) {
    std::vector<ProblemRecord> record{read_problem(
        replaced(replaced(without_price, "\"hard\":true", "\"hard\":false"), "\"lower\":[[-", lower), "set.jsonl", 3)};
    make_terms(record, host);
    build(record[0], model);
  };
  EXPECT_EQ(error_of([&] { soft("\"lower\":[[-"); }), "");
  EXPECT_THAT(error_of([&] { soft("\"lower\":[[1"); }),
              ::testing::HasSubstr("set.jsonl:3: terms[0].lower[0][0]: found 13, expected at most the upper bound 3"));
}

TEST(RhcFormat, RefillsInPlaceWhatFits) {
  const auto control = build(read_problem(rhc_line, "set.jsonl", 3), cart());
  ASSERT_TRUE(refill(read_problem(replaced(rhc_line, "[0, 4.5]", "[0, 4.25]"), "set.jsonl", 4), *control));
  EXPECT_EQ(control->control_upper(1)[0], 4.25) << "bounds of inputs move with the reference speed";
  EXPECT_FALSE(refill(read_problem(replaced(rhc_line, "{\"push\": [0]}", "{}"), "set.jsonl", 4), *control));
}

TEST(RhcFormat, NamesThePlaceAndTheRemedy) {
  const Mistake mistakes[] = {
      {rhc_line, "\"initial_state\": [1, 0.5]", "\"initial_state\": [1]", "initial_state", "expected 2, for pos, lean"},
      {rhc_line, "[1, 2, 3]", "[1, 2]", "reference.pos", "2 numbers, expected 3, one for each node"},
      {rhc_line, "[4, 5]", "[4, 5, 6]", "reference.speed", "3 numbers, expected 2, one for each interval"},
      {rhc_line, ", \"speed\": [4, 5]", "", "reference.speed", "missing, but the variable has a weight"},
      {rhc_line, "\"terminal\": {\"pos\"", "\"terminal\": {\"speed\"", "weights.terminal.speed", "no such variable"},
      {rhc_line, "\"stage\": {\"pos\": 1", "\"stage\": {\"pos\": null", "weights.stage.pos", "expected a number"},
      {rhc_line, "\"speed\": [0, 4.5]", "\"grip\": [0, 1]", "bounds.grip", "no such variable here"},
      {rhc_line, "\"parameters\": [0.5],", "", "parameters", "missing"},
      {rhc_line_2, "[[0, null], 4.5]", "[[0], 4.5]", "bounds.speed[0]", "1 numbers, expected 2: one for each interval"},
      {rhc_line_2, "[[0, null], 4.5]", "[[0, 5], 4.5]", "bounds.speed", "on interval 1, expected lower <= upper"},
      {rhc_line_2, "\"push\": [-1, 1]", "\"lean\": [[-1, 1], 2]", "bounds.lean", "lists of bounds are for inputs"},
      {rhc_line, "\"speed\": [0, 4.5]", "\"speed\": [[0, 0], 4.5]", "bounds.speed[0]", "expected a number"},
      {rhc_line_3, "[\"push\"]", "[\"pusch\"]", "rates", "no input 'pusch'; did you mean 'push'?"},
      {rhc_line_3, "[\"push\"]", "[\"push\", \"push\"]", "rates", "each input once, in the model's order"},
      {rhc_line_3, "[1, 0.5, 0.25]", "[1, 0.5]", "initial_state", "expected 3, for pos, lean, push"},
      {rhc_line_3, "\"version\": 3", "\"version\": 2", "rates", "is a key of version 3; add \"version\": 3"},
  };
  expect_told(mistakes);
}

}  // namespace rhc_format_test
}  // namespace rhec::sim
