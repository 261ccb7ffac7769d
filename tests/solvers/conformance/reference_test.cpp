// Every solver that is found, on a sample of the reference problems that another program solved.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <ostream>

#include "assessment.hpp"
#include "found.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "verdicts.hpp"

namespace rhec::conformance {
namespace reference_test {

// Of each set, every so-many-th problem: an odd number, so that all block structures have their turn.
constexpr std::size_t stride = 71;
constexpr double objective_tolerance = 1e-7;

struct Case {
  std::string solver, set;
};

std::ostream& operator<<(std::ostream& out, const Case& of) { return out << of.solver << " on " << of.set; }

/// The environment says where reference problems are; otherwise what was configured.
std::filesystem::path folder() {
  const char* given = std::getenv("RHEC_REFERENCE_DATA");
  return given ? given : RHEC_REFERENCE_FOLDER;
}

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  for (const char* set : {"gentle-rhe", "tight-rhe", "tight-rhc", "lag-rhc"})
    for (const std::string& solver : host().names(PluginKind::solver)) cases.push_back({solver, set});
  return cases;
}

std::vector<std::string> lines_of(const std::filesystem::path& file) {
  std::vector<std::string> lines;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

class Reference : public ::testing::TestWithParam<Case> {};

TEST_P(Reference, IsMetOrBettered) {
  const std::string& set = GetParam().set;
  const std::filesystem::path problems = folder() / (set + ".jsonl"), solutions = folder() / (set + ".solutions.jsonl");
  if (!std::filesystem::exists(problems) || !std::filesystem::exists(solutions))
    GTEST_SKIP() << "no reference problems in " << folder() << "; RHEC_REFERENCE_DATA says where they are";
  const std::vector<std::string> lines = lines_of(problems), answers = lines_of(solutions);
  ASSERT_EQ(lines.size(), answers.size());
  const double tolerance = tolerance_of(GetParam().solver);
  std::vector<Verdict> verdicts;
  for (std::size_t k = 0; k < lines.size(); k += stride) {
    const sim::ProblemRecord record = sim::read_problem(lines[k], problems.string(), static_cast<int>(k) + 1);
    SCOPED_TRACE(record.id);
    const Settings answer = parse_yaml(answers[k], solutions.string());
    const auto problem = sim::build(record, host().make_model(record.model, record.model_options));
    Iterate guess(problem->capacity());
    sim::cold_start(record, *problem, guess);
    const auto solver = make_solver(GetParam().solver);
    Verdict verdict;
    verdict.solver = GetParam().solver;
    verdict.model = record.model;
    verdict.family = "reference " + set;
    verdict.seed = static_cast<unsigned>(k) + 1;
    const Settings* several = answer.find("several_optima");
    verdict.several_optima = several && several->as_flag();
    verdict.reference = answer.find("objective")->as_number();
    verdict.reason = solver->why_not(*problem);
    EXPECT_EQ(verdict.reason, "") << "refused";
    if (!verdict.reason.empty()) {
      verdict.outcome = "refused";
      verdicts.push_back(std::move(verdict));
      continue;
    }
    solver->setup(*problem);
    const Assessment assessed = solve_and_assess(*solver, *problem, guess, tolerance);
    verdict.status = name_of(assessed.report.status);
    verdict.iterations = assessed.report.iterations;
    verdict.residual = assessed.kkt.largest();
    verdict.objective = assessed.objective;
    verdict.corrected = assessed.corrected_objective;
    verdict.milliseconds = assessed.milliseconds;
    if (assessed.report.status != Status::solved) verdict.reason = "it says " + verdict.status;
    for (const std::string& complaint : assessed.complaints)
      verdict.reason += (verdict.reason.empty() ? "" : ", ") + complaint;
    const double gap = (assessed.objective - verdict.reference) / std::abs(verdict.reference);
    if (!verdict.several_optima && gap > objective_tolerance)
      verdict.reason +=
          fmt::format("{}its objective is {:.1e} above the reference", verdict.reason.empty() ? "" : ", ", gap);
    verdict.outcome = verdict.reason.empty() ? "solved" : "failed";
    EXPECT_EQ(verdict.reason, "");
    verdict.solution = scaled_primal(*problem, assessed.point);
    verdicts.push_back(std::move(verdict));
  }
  keep_verdicts(verdicts);
}

INSTANTIATE_TEST_SUITE_P(Problems, Reference, ::testing::ValuesIn(all_cases()), [](const auto& of) {
  std::string name = of.param.solver + "_" + of.param.set;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

}  // namespace reference_test
}  // namespace rhec::conformance
