// Unstable vehicles over long horizons: what the guess' inputs lead to by simulation is larger than anything that
// limits ask for by many orders of magnitude.
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "conformance/found.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "rhec/sim/problems/problem_file.hpp"

namespace rhec {
namespace priced_steps_unstable_test {

/// x' = growth x + u + 0.5 x u follows a sine, with |x + u / 2| <= side and x^2 - u <= 2 + side, which cost 10 each.
std::string line(double growth, double side) {
  constexpr int intervals = 60;
  std::vector<double> x, u;
  std::vector<std::string> nothing(intervals + 1, "[]");
  for (int i = 0; i <= intervals; ++i) {
    x.push_back(std::sin(0.3 * i));
    if (i < intervals) u.push_back(0.3 * std::sin(i) + 0.5);
  }
  const std::vector<std::string> lower(intervals + 1, fmt::format("[{}, null]", -side)),
      upper(intervals + 1, fmt::format("[{}, {}]", side, 2.0 + side));
  return fmt::format(
      R"({{"version": 5, "id": "unstable/0", "problem": "rhc",
"model": {{"name": "equations", "equations": {{"states": {{"x": {{}}}}, "inputs": {{"u": {{}}}}, "parameters": {{}},
"outputs": {{"x": {{}}}}, "equations": "x' = {} * x + u + 0.5 * x * u\n"}}}},
"horizon": {{"intervals": {}, "dt": 0.2, "integrator": "rk4", "substeps": 1}}, "initial_state": [0.1], "parameters": [],
"reference": {{"x": {}, "u": {}}}, "weights": {{"stage": {{"x": 1, "u": 0.1}}, "terminal": {{"x": 1}}}}, "bounds": {{}},
"terms": [{{"name": "equations", "options": {{"equations": {{"name": "t", "states": ["x"], "inputs": ["u"],
"limits": {{"a": {{"lower": 0, "term": "x + 0.5*u"}}, "b": {{"lower": 0, "term": "x^2 - u"}}}}}},
"soft": {{"linear": 10, "quadratic": 0}}}}, "data": [{}], "lower": [{}], "upper": [{}]}}]}})",
      growth, intervals, x, u, fmt::join(nothing, ", "), fmt::join(lower, ", "), fmt::join(upper, ", "));
}

TEST(PricedStepsUnstable, BeginAtARegulatorsTrajectory) {
  struct Case {
    double growth, side;
  };
  for (const Case& of : {Case{3.0, 0.5}, Case{3.0, 1.0}, Case{4.0, 1.0}}) {
    std::string text = line(of.growth, of.side);
    for (char& each : text)
      if (each == '\n') each = ' ';
    std::vector<sim::ProblemRecord> records = sim::read_problems(text, "the test");
    const Host& host = conformance::host();
    sim::make_terms(records, host);
    const sim::ProblemRecord& record = records.front();
    const auto problem = sim::build(record, host.make_model(record.model, record.model_options), record.intervals);
    Iterate point(problem->capacity());
    sim::start(record, *problem, point);
    const auto solver = conformance::make_solver("gn_rti");
    solver->setup(*problem);
    EXPECT_EQ(solver->solve(point).status, Status::solved) << of.growth << ", " << of.side;
    std::vector<double> scratch(problem->scratch_size());
    StageQp qp(problem->capacity());
    EXPECT_LE(kkt_residual(*problem, point, qp, scratch).largest(), 1e-8);
    // What follows the reference costs some 20, and the guess 1e25 times as much.
    EXPECT_LT(problem->evaluate(point, nullptr, scratch), 25.0);
  }
}

}  // namespace priced_steps_unstable_test
}  // namespace rhec
