// Every solver that is found, on every family of problems of every model.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>

#include "assessment.hpp"
#include "families.hpp"
#include "found.hpp"
#include "refusals.hpp"
#include "verdicts.hpp"

namespace rhec::conformance {
namespace families_test {

struct Case {
  std::string solver, model, family;
};
std::string name_of_case(const ::testing::TestParamInfo<Case>& of) {
  return of.param.solver + "_" + of.param.model + "_" + of.param.family;
}
std::ostream& operator<<(std::ostream& out, const Case& of) {
  return out << of.solver << " on " << of.family << " of " << of.model;
}

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  for (const std::string& model_name : model_names()) {
    const auto model = make_model(model_name);
    for (const Family& each : families()) {
      if (!applies(each, model_name, *model)) continue;
      for (const std::string& solver : host().names(PluginKind::solver))
        cases.push_back({solver, model_name, each.name});
    }
  }
  return cases;
}

class EverySolver : public ::testing::TestWithParam<Case> {};

/// Whether the documentation allows it. A plugin that it does not know may refuse what it likes.
void check_refusal(const Case& of, const std::string& reason) {
  const std::string problem = problem_name(of.family, of.model);
  bool listed = false;
  for (const AllowedRefusal& allowed : documentation().refusals) {
    if (covers(allowed, of.solver, problem) && allowed.options.members().empty())
      listed = listed || reason.find(allowed.words) != std::string::npos;
  }
  if (!reason.empty() && documentation().knows(of.solver)) {
    EXPECT_TRUE(listed) << of.solver << " refuses " << problem << " (" << reason
                        << "), and docs/solvers.md does not allow it";
  }
}

TEST_P(EverySolver, IsRight) {
  const Case& of = GetParam();
  const Family& from = family(of.family);
  const auto model = make_model(of.model);
  const double tolerance = tolerance_of(of.solver);
  std::vector<Verdict> verdicts;
  for (unsigned seed = 1; seed <= static_cast<unsigned>(problem_count(from)); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Problem problem = from.make(model, seed);
    const auto solver = make_solver(of.solver);
    Verdict verdict;
    verdict.solver = of.solver;
    verdict.model = of.model;
    verdict.family = of.family;
    verdict.several_optima = from.several_optima;
    verdict.seed = seed;
    const std::string reason = solver->why_not(problem.posed());
    if (problem.limited && reason.find("has limits") != std::string::npos) GTEST_SKIP() << of.solver << ": " << reason;
    check_refusal(of, reason);
    if (!reason.empty()) {
      verdict.outcome = "refused";
      verdict.reason = reason;
      EXPECT_THROW(solver->setup(problem.posed()), Error) << "it refuses the problem and takes it all the same";
      verdicts.push_back(std::move(verdict));
      continue;
    }
    solver->setup(problem.posed());
    const Assessment assessed = solve_and_assess(*solver, problem.posed(), problem.guess, tolerance);
    verdict.status = name_of(assessed.report.status);
    verdict.iterations = assessed.report.iterations;
    verdict.residual = assessed.kkt.largest();
    verdict.objective = assessed.objective;
    verdict.corrected = assessed.corrected_objective;
    verdict.milliseconds = assessed.milliseconds;
    const Status expected = from.answer == Family::Answer::solved ? Status::solved : Status::infeasible;
    if (assessed.report.status != expected) {
      verdict.reason = fmt::format(
          "it says {} (residual: stationarity {:.0e}, defect {:.0e}, bounds {:.0e}, "
          "complementarity {:.0e}) after {} iterations",
          verdict.status, assessed.kkt.stationarity, assessed.kkt.defect, assessed.kkt.bound_violation,
          assessed.kkt.complementarity, verdict.iterations);
    }
    for (const std::string& complaint : assessed.complaints)
      verdict.reason += (verdict.reason.empty() ? "" : ", ") + complaint;
    verdict.outcome = !verdict.reason.empty() ? "failed" : expected == Status::solved ? "solved" : "infeasible";
    EXPECT_EQ(verdict.reason, "");
    verdict.solution = scaled_primal(*problem.ocp, assessed.point);
    verdicts.push_back(std::move(verdict));
  }
  keep_verdicts(verdicts);
}

INSTANTIATE_TEST_SUITE_P(Families, EverySolver, ::testing::ValuesIn(all_cases()), name_of_case);

TEST(Discovery, FindsSolversAndModels) {
  EXPECT_FALSE(host().names(PluginKind::solver).empty());
  EXPECT_FALSE(host().names(PluginKind::model).empty());
}

TEST(Documentation, ListsOnlyRefusalsThatHappen) {
  const std::vector<std::string> found = host().names(PluginKind::solver);
  for (const AllowedRefusal& allowed : documentation().refusals) {
    const std::string where = "docs/solvers.md:" + std::to_string(allowed.line);
    EXPECT_TRUE(documentation().knows(allowed.solver)) << where << ": no section describes " << allowed.solver;
    if (std::find(found.begin(), found.end(), allowed.solver) == found.end()) continue;
    const auto solver = make_solver(allowed.solver, allowed.options);
    bool covers_one = false, happens = false;
    std::string said;
    for (const std::string& model_name : model_names()) {
      const auto model = make_model(model_name);
      for (const Family& each : families()) {
        if (happens || !applies(each, model_name, *model) ||
            !covers(allowed, allowed.solver, problem_name(each.name, model_name)))
          continue;
        covers_one = true;
        said = solver->why_not(each.make(model, 1).posed());
        happens = said.find(allowed.words) != std::string::npos;
      }
    }
    EXPECT_TRUE(covers_one) << where << ": no problem is called like " << allowed.problem;
    EXPECT_TRUE(happens) << where << ": none of its problems is refused with '" << allowed.words << "'; said was '"
                         << said << "'";
  }
}

}  // namespace families_test
}  // namespace rhec::conformance
