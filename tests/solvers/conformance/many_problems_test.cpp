// Verdicts on many problems with limits, of seeds that nothing was tuned on. RHEC_MANY_PROBLEMS says how many of each
// family and model; the nightly tests have more of them.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "assessment.hpp"
#include "families.hpp"
#include "found.hpp"

namespace rhec::conformance {
namespace {

constexpr unsigned first_seed = 1001;
// A method that looks around a point may take the least violation there for the least of all. Ipopt does so, too.
constexpr double most_wrong = 1e-3;

unsigned problems_of_each() {
  const char* wanted = std::getenv("RHEC_MANY_PROBLEMS");
  return wanted ? static_cast<unsigned>(std::atoi(wanted)) : 2U;
}

std::string verdict_of(const std::string& solver, const Problem& problem) {
  const auto other = make_solver(solver);
  other->setup(problem.posed());
  return name_of(solve_and_assess(*other, problem.posed(), problem.guess, tolerance_of(solver)).report.status);
}

TEST(ManyProblems, GnRtiIsRightAboutLimits) {
  int problems = 0, wrong = 0;
  for (const std::string& model_name : model_names()) {
    const auto model = make_model(model_name);
    for (const Family& from : limited_families()) {
      if (!applies(from, model_name, *model)) continue;
      const Status expected = from.answer == Family::Answer::solved ? Status::solved : Status::infeasible;
      for (unsigned seed = first_seed; seed < first_seed + problems_of_each(); ++seed, ++problems) {
        const Problem problem = from.make(model, seed);
        const auto solver = make_solver("gn_rti");
        solver->setup(problem.posed());
        const Assessment assessed = solve_and_assess(*solver, problem.posed(), problem.guess, tolerance_of("gn_rti"));
        const std::string name = fmt::format("{} of {}, seed {}", from.name, model_name, seed);
        // Whatever it says of a point is what the core finds there.
        for (const std::string& complaint : assessed.complaints) ADD_FAILURE() << name << ": " << complaint;
        if (assessed.report.status == expected) continue;
        ++wrong;
        fmt::print("{}: gn_rti says {}, sparse_sqp {}, ipopt {}\n", name, name_of(assessed.report.status),
                   verdict_of("sparse_sqp", problem), verdict_of("ipopt", problem));
      }
    }
  }
  fmt::print("{} problems, {} wrong verdicts\n", problems, wrong);
  EXPECT_GT(problems, 100);
  EXPECT_LE(wrong, most_wrong * problems);
}

}  // namespace
}  // namespace rhec::conformance
