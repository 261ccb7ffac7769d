// Solvers at equal accuracy: their options are tightened until the residual is the one that was asked for.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <map>
#include <string>
#include <vector>

#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "sim/support/comparisons.hpp"

namespace rhec::sim {
namespace accuracy_test {

using ::testing::HasSubstr;

/// Problems of the reference's run, kept by other means than the comparison's.
struct Kept {
  std::vector<RheProblem> rhe;
  std::vector<RhcProblem> rhc;
  std::map<std::string, std::vector<Iterate>> guesses;
};

/// The problems of every n-th step.
Kept keep_problems(Settings settings, int every) {
  apply_assignment(settings, "estimator.solver={name: gn_rti, mode: converge}");
  apply_assignment(settings, "controller.solver={name: gn_rti, mode: converge}");
  const Scenario scenario(host(), settings);
  Kept kept;
  LoopHooks hooks;
  hooks.solved = [&](std::int64_t step, const HorizonProblem& problem, const Iterate& guess, const Iterate&,
                     const Report&) {
    if (step % every != 0) return;
    if (problem.kind() == "rhe") kept.rhe.push_back(dynamic_cast<const RheProblem&>(problem));
    if (problem.kind() == "rhc") kept.rhc.push_back(dynamic_cast<const RhcProblem&>(problem));
    kept.guesses[std::string(problem.kind())].push_back(guess);
  };
  run_closed_loop(scenario, hooks);
  return kept;
}

template <class Problem>
std::vector<double> residuals(const Backend& backend, Settings options, double tolerance,
                              const std::vector<Problem>& problems, const std::vector<Iterate>& guesses) {
  if (backend.solver == "gn_rti") options.set("mode", Settings::scalar("converge"));
  options.set("tolerance", Settings::scalar(fmt::format("{}", tolerance)));
  const auto solver = host().make_solver(backend.solver, options);
  Problem live = problems.front();
  solver->setup(live);
  std::vector<double> result;
  for (std::size_t p = 0; p < problems.size(); ++p) {
    live.take_data(problems[p]);
    Iterate point = guesses[p];
    solver->prepare(point);
    solver->solve(point);
    StageQp qp(problems[p].capacity());
    std::vector<double> scratch(problems[p].scratch_size());
    result.push_back(kkt_residual(problems[p], point, qp, scratch).largest());
  }
  return result;
}

TEST(Accuracy, EqualAccuracyEndsWithTheResidualAskedFor) {
  constexpr double wanted = 1e-6;
  ComparisonOptions options = comparing(all_backends());
  options.accuracy = wanted;
  options.every = 4;
  const Comparison result = compare(host(), short_scenario(), options);
  const Kept kept = keep_problems(short_scenario(), options.every);
  for (const SameProblems& same : result.problems) {
    for (std::size_t b = 0; b < result.backends.size(); ++b) {
      const Backend& mine = result.backends[b];
      SCOPED_TRACE(mine.label);
      const BackendAnswers& answers = same.backends[b];
      ASSERT_TRUE(answers.accuracy_reached) << answers.tuning;
      ASSERT_TRUE(answers.tolerance.has_value());
      const double tolerance = *answers.tolerance;
      const std::vector<Iterate>& guesses = kept.guesses.at(same.kind);
      const auto p99 = [&](double at) {
        return spread_of(same.kind == "rhe" ? residuals(mine, mine.options, at, kept.rhe, guesses)
                                            : residuals(mine, mine.options, at, kept.rhc, guesses))
            .p99;
      };
      EXPECT_LE(p99(tolerance), wanted);
      EXPECT_EQ(p99(tolerance), spread_of(answers.answers, &Answer::kkt).p99);
      // No tighter than need be.
      if (tolerance < 1e-2) {
        EXPECT_GT(p99(10.0 * tolerance), wanted);
      }
    }
  }
}

TEST(Accuracy, AnAccuracyThatIsNotReachedIsTold) {
  ComparisonOptions options = comparing({backend("toy", "toy_solver"), converged()});
  options.accuracy = 1e-30;
  options.every = 10;
  const Comparison result = compare(host(), short_scenario(), options);
  for (const SameProblems& same : result.problems) {
    EXPECT_FALSE(same.backends[0].accuracy_reached);
    EXPECT_FALSE(same.backends[0].tolerance.has_value());
    EXPECT_THAT(same.backends[0].tuning, HasSubstr("has no option 'tolerance'"));
    EXPECT_FALSE(same.backends[1].accuracy_reached);
    EXPECT_THAT(same.backends[1].tuning, HasSubstr("never reached"));
    EXPECT_LE(spread_of(same.backends[1].answers, &Answer::kkt).p99, 1e-9);  // its best all the same
  }
}

}  // namespace accuracy_test
}  // namespace rhec::sim
