#include "rhec/sim/comparison/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <gmock/gmock.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/sim/files/json.hpp"
#include "sim/support/comparisons.hpp"

namespace rhec::sim {
namespace comparison_test {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::Le;

std::vector<double> numbers(const BackendAnswers& backend, double Answer::*number) {
  std::vector<double> values;
  for (const Answer& answer : backend.answers) values.push_back(answer.*number);
  return values;
}

TEST(Comparison, SolversAgreeOnTheSameProblemsAndOneIterationIsLess) {
  ComparisonOptions options = comparing(all_backends());
  options.closed_loop = true;
  const Comparison result = compare(host(), short_scenario(), options);
  ASSERT_EQ(result.problems.size(), 2U);
  EXPECT_TRUE(result.all_usable());
  for (const SameProblems& same : result.problems) {
    EXPECT_GT(same.problems.size(), 40U);
    EXPECT_EQ(same.without_best, 0);
    for (std::size_t b = 0; b < result.backends.size(); ++b) {
      SCOPED_TRACE(result.backends[b].label);
      const BackendAnswers& mine = same.backends[b];
      ASSERT_EQ(mine.answers.size(), same.problems.size());
      EXPECT_THAT(numbers(mine, &Answer::gap), Each(Ge(-1e-12)));
      EXPECT_THAT(numbers(mine, &Answer::time_us), Each(::testing::Gt(0.0)));
      const Spread gap = spread_of(mine.answers, &Answer::gap), kkt = spread_of(mine.answers, &Answer::kkt);
      if (b == 0) {
        EXPECT_GT(gap.median, 1e-6);
        EXPECT_GT(kkt.median, 1e-6);
        EXPECT_GT(spread_of(mine.answers, &Answer::distance).median, 1e-5);
      } else {
        EXPECT_EQ(mine.statuses.at("solved"), std::ssize(same.problems));
        EXPECT_LE(kkt.max, 1e-8);
        EXPECT_LE(gap.median, 1e-9);  // a problem with several optima may be among them
        EXPECT_LE(spread_of(mine.answers, &Answer::distance).median, 1e-4);
      }
    }
  }
  ASSERT_EQ(result.loops.size(), result.backends.size());
  for (const BackendRuns& loop : result.loops) {
    ASSERT_EQ(loop.runs.size(), 1U);
    EXPECT_TRUE(loop.runs.front().completed);
    EXPECT_NEAR(loop.runs.front().mae.position, result.reference_runs.front().mae.position, 0.02);
  }
  // The reference is one of them: alone in the closed loop it drives as it did for the problems.
  EXPECT_EQ(result.loops[1].runs.front().mae.parameters, result.reference_runs.front().mae.parameters);
}

TEST(Comparison, AWorsePointIsSeenAsWorse) {
  // Without rates, whose inputs are states: the toy keeps bounds of inputs alone, and what is out of bounds is charged.
  Settings scenario = short_scenario();
  for (const char* assignment : {"controller.weights.stage.u2=0.8", "controller.weights.rates.u2=0"})
    apply_assignment(scenario, assignment);
  const Comparison result = compare(host(), scenario, comparing({converged(), backend("toy", "toy_solver")}));
  for (const SameProblems& same : result.problems) {
    const BackendAnswers &good = same.backends[0], &toy = same.backends[1];
    EXPECT_THAT(numbers(toy, &Answer::gap), Each(Ge(1e-7)));
    EXPECT_THAT(numbers(good, &Answer::gap), Each(Le(1e-12)));
    EXPECT_THAT(numbers(toy, &Answer::defect), Each(Le(1e-9)));
    EXPECT_THAT(numbers(toy, &Answer::distance), Each(Ge(1e-4)));
    // It says "solved": the core's residual does not.
    EXPECT_EQ(toy.statuses.at("solved"), std::ssize(same.problems));
    EXPECT_THAT(numbers(toy, &Answer::kkt), Each(Ge(1e-6)));
    for (std::size_t p = 0; p < same.problems.size(); ++p)
      EXPECT_NEAR(toy.answers[p].gap,
                  (toy.answers[p].objective - good.answers[p].objective) / std::max(1.0, good.answers[p].objective),
                  1e-6);
  }
}

TEST(Comparison, ADefectCannotFlatter) {
  const Comparison result =
      compare(host(), short_scenario(), comparing({converged(), backend("toy", "toy_solver", {"kind=defect"})}));
  for (const SameProblems& same : result.problems) {
    const BackendAnswers &good = same.backends[0], &toy = same.backends[1];
    std::size_t below = 0, with_defect = 0;
    for (std::size_t p = 0; p < same.problems.size(); ++p) {
      below += toy.answers[p].objective < good.answers[p].objective;
      with_defect += toy.answers[p].defect > 1e-3;
      EXPECT_GE(toy.answers[p].gap, -1e-12) << same.problems[p].step;
      EXPECT_LE(good.answers[p].gap, 1e-12) << same.problems[p].step;
    }
    EXPECT_GT(with_defect, same.problems.size() / 2);
    // An estimate's objective as it was returned lies below the optimum; a plan is assessed by what its inputs do.
    if (same.kind == "rhe") {
      EXPECT_GT(below, same.problems.size() / 2);
    } else {
      EXPECT_EQ(below, 0U);
    }
    EXPECT_GT(spread_of(toy.answers, &Answer::gap).median, 1e-3);
  }
}

TEST(Comparison, ARefusalIsToldAndTheOthersGoOn) {
  ComparisonOptions options = comparing({backend("toy", "toy_solver", {"kind=refuse_rhe"}), converged()});
  options.closed_loop = true;
  const Comparison result = compare(host(), short_scenario(), options);
  EXPECT_FALSE(result.all_usable());
  const SameProblems &rhe = result.problems[0], &rhc = result.problems[1];
  EXPECT_EQ(rhe.backends[0].refusal, "a toy cannot look back");
  EXPECT_EQ(rhe.backends[0].refused, std::ssize(rhe.problems));
  EXPECT_TRUE(rhe.backends[0].answers.empty());
  EXPECT_EQ(rhc.backends[0].refused, 0);
  EXPECT_EQ(rhc.backends[0].answers.size(), rhc.problems.size());
  EXPECT_EQ(rhe.backends[1].answers.size(), rhe.problems.size());
  EXPECT_THAT(result.loops[0].refusal, HasSubstr("estimation problems: a toy cannot look back"));
  EXPECT_TRUE(result.loops[0].runs.empty());
  EXPECT_TRUE(result.loops[1].runs.front().completed);
  const auto json = Json::parse(comparison_json(result));
  EXPECT_EQ(json["same_problems"]["rhe"]["solvers"][0]["refusal"], "a toy cannot look back");
  EXPECT_TRUE(json["closed_loop"][1]["errors"]["kappa"]["difference"].is_null());
  EXPECT_THAT(comparison_svg(result), HasSubstr("refused"));
}

TEST(Comparison, AnAnswerThatIsNotUsableHasNoGap) {
  const Comparison result =
      compare(host(), short_scenario(), comparing({backend("toy", "toy_solver", {"kind=lost"}), converged()}));
  EXPECT_FALSE(result.all_usable());
  for (const SameProblems& same : result.problems) {
    EXPECT_EQ(same.backends[0].statuses.at("infeasible"), std::ssize(same.problems));
    EXPECT_TRUE(std::isnan(spread_of(same.backends[0].answers, &Answer::gap).max));
    EXPECT_LE(spread_of(same.backends[1].answers, &Answer::gap).max, 1e-12);
  }
}

/// What was measured less what was true, by step.
std::map<std::int64_t, std::vector<double>> noise_of(Settings settings, const std::string& solver) {
  apply_assignment(settings, "estimator.solver=" + solver);
  apply_assignment(settings, "controller.solver=" + solver);
  const Scenario scenario(host(), settings);
  std::map<std::int64_t, std::vector<double>> noise;
  LoopHooks hooks;
  hooks.solved = [&](std::int64_t step, const HorizonProblem& problem, const Iterate&, const Iterate&, const Report&) {
    const auto* rhe = dynamic_cast<const RheProblem*>(&problem);
    if (!rhe) return;
    const double* newest = rhe->output(rhe->intervals());
    noise[step].assign(newest, newest + rhe->model().output_count());
  };
  const RunLog log = run_closed_loop(scenario, hooks);
  const Model& model = *scenario.robot().model();
  std::vector<double> outputs(model.output_count());
  for (const Sample& sample : log.samples) {
    model.observe({.count = 1, .states = sample.true_state.data(), .outputs = outputs.data()});
    for (std::size_t j = 0; j < outputs.size(); ++j) noise.at(sample.step)[j] -= outputs[j];
  }
  return noise;
}

TEST(Comparison, TheNoiseIsTheSameWhoeverDrives) {
  const auto one = noise_of(short_scenario(), "{name: gn_rti}");
  const auto other = noise_of(short_scenario(), "{name: gn_rti, mode: converge}");
  const auto shared = std::min(one.size(), other.size());
  ASSERT_GT(shared, 40U);
  double largest = 0.0;
  for (std::int64_t step = 0; step < static_cast<std::int64_t>(shared); ++step) {
    for (std::size_t j = 0; j < one.at(step).size(); ++j) {
      EXPECT_NEAR(one.at(step)[j], other.at(step)[j], 1e-12);
      largest = std::max(largest, std::abs(one.at(step)[j]));
    }
  }
  EXPECT_GT(largest, 0.01);
}

TEST(Comparison, SeedsFollowTheScenariosAndProblemsAreThinned) {
  Settings settings = short_scenario();
  apply_assignment(settings, "seed=5");
  ComparisonOptions options = comparing({converged()});
  options.seeds = 3;
  const Comparison all = compare(host(), settings, options);
  EXPECT_THAT(all.seeds, ::testing::ElementsAre(5, 6, 7));
  std::set<std::int64_t> seeds;
  for (const SameProblems::Place& place : all.problems[0].problems) seeds.insert(place.seed);
  EXPECT_EQ(seeds, (std::set<std::int64_t>{5, 6, 7}));
  EXPECT_NE(all.reference_runs[0].mae.position, all.reference_runs[1].mae.position);

  options.every = 7;
  const Comparison thin = compare(host(), settings, options);
  EXPECT_EQ(thin.every, 7);
  for (const SameProblems& same : thin.problems)
    for (const SameProblems::Place& place : same.problems) EXPECT_EQ(place.step % 7, 0);
  EXPECT_NEAR(static_cast<double>(thin.problems[0].problems.size()),
              static_cast<double>(all.problems[0].problems.size()) / 7.0, 3.0);

  options.every = 0;
  options.seeds = 12;
  const Comparison chosen = compare(host(), settings, options);
  EXPECT_GT(chosen.every, 1);
  for (const SameProblems& same : chosen.problems) EXPECT_THAT(same.problems.size(), AllOf(Ge(200U), Le(480U)));
}

TEST(Comparison, WithoutEstimationProblemsThereAreThoseOfControl) {
  Settings settings = short_scenario();
  apply_assignment(settings, "estimator.name=ekf");
  ComparisonOptions options = comparing({converged()});
  options.closed_loop = true;
  const Comparison result = compare(host(), settings, options);
  ASSERT_EQ(result.problems.size(), 1U);
  EXPECT_EQ(result.problems[0].kind, "rhc");
  EXPECT_TRUE(result.all_usable());
}

TEST(Comparison, MistakesAreToldBeforeAnythingRuns) {
  ComparisonOptions options = comparing({backend("a", "gn_rtj")});
  bool ran = false;
  options.progress = [&](double) { ran = true; };
  EXPECT_THROW(compare(host(), short_scenario(), options), Error);
  options.backends = {backend("a", "gn_rti", {"mod=rti"})};
  EXPECT_THROW(compare(host(), short_scenario(), options), Error);
  options.backends = {};
  EXPECT_THROW(compare(host(), short_scenario(), options), Error);
  EXPECT_FALSE(ran);
}

TEST(Comparison, ProgressGoesFromNothingToAll) {
  ComparisonOptions options = comparing({backend("rti", "gn_rti"), converged()});
  options.closed_loop = true;
  options.accuracy = 1e-4;
  std::vector<double> shares;
  options.progress = [&](double share) { shares.push_back(share); };
  compare(host(), short_scenario(), options);
  ASSERT_GT(shares.size(), 100U);
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_LT(shares.front(), 0.1);
  EXPECT_EQ(shares.back(), 1.0);
}

TEST(Comparison, MeansOfPairs) {
  std::vector<RunSummary> runs(3), others(3);
  const double one[] = {1.0, 2.0, 6.0}, other[] = {1.0, 1.0, 2.0};
  for (int r = 0; r < 3; ++r) {
    runs[r].mae.position = one[r];
    others[r].mae.position = other[r];
  }
  const auto position = [](const RunSummary& run) { return run.mae.position; };
  const Mean mean = paired_mean(runs, others, position);
  EXPECT_DOUBLE_EQ(mean.mean, 3.0);
  EXPECT_DOUBLE_EQ(mean.difference, 5.0 / 3.0);
  EXPECT_NEAR(mean.standard_error, std::sqrt(13.0 / 9.0), 1e-12);  // differences 0, 1, 4: variance 13/3
  EXPECT_TRUE(std::isnan(paired_mean(runs, {}, position).difference));
}

}  // namespace comparison_test
}  // namespace rhec::sim
