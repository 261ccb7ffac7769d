// From problems to lines and back, to the bit; what a loop solved is solved again with the same bits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/control/input_rate_model.hpp"
#include "rhec/core/model/implicit_model.hpp"
#include "rhec/core/model/state_noise_model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "sim/support/same_point.hpp"
#include "support/random_problem.hpp"

namespace rhec::sim {
namespace problem_record_test {

using rhec::testing::RandomProblem;
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double missing = std::numeric_limits<double>::quiet_NaN();

const Host& host() {
  static const Host one;
  return one;
}

/// Objective, defects, and both linearisations at a point: `read` may have less room than `live`.
void expect_same_problem(const HorizonProblem& live, const Iterate& at_live, const HorizonProblem& read,
                         const Iterate& at_read) {
  ASSERT_EQ(live.intervals(), read.intervals());
  const int N = live.intervals(), ns = live.capacity().states, nw = live.capacity().controls;
  ASSERT_EQ(ns, read.capacity().states);
  ASSERT_EQ(nw, read.capacity().controls);
  std::vector<double> scratch(live.scratch_size()), other_scratch(read.scratch_size());
  std::vector<double> defects(static_cast<std::size_t>(N) * ns + 1), other_defects(defects);
  const double objective = live.evaluate(at_live, defects.data(), scratch);
  const double other = read.evaluate(at_read, other_defects.data(), other_scratch);
  ASSERT_TRUE(std::isfinite(objective));
  ASSERT_TRUE(same_bits("objective", 0, &objective, &other, 1));
  ASSERT_TRUE(same_bits("defects", 0, defects.data(), other_defects.data(), N * ns));
  StageQp a(live.capacity()), b(read.capacity());
  for (const Hessian hessian : {Hessian::gauss_newton, Hessian::exact}) {
    live.linearise(all_stages(live), at_live, hessian, a, scratch);
    read.linearise(all_stages(read), at_read, hessian, b, other_scratch);
    ASSERT_EQ(a.initial_state_is_given, b.initial_state_is_given);
    if (a.initial_state_is_given) {
      ASSERT_TRUE(same_bits("initial step", 0, a.initial_step(), b.initial_step(), ns));
    }
    for (int i = 0; i <= N; ++i) {
      ASSERT_TRUE(same_bits("H", i, a.H(i), b.H(i), (ns + nw) * a.stride()));
      ASSERT_TRUE(same_bits("h", i, a.h(i), b.h(i), ns + nw));
      ASSERT_TRUE(same_bits("state lower", i, a.state_lower(i), b.state_lower(i), ns));
      ASSERT_TRUE(same_bits("state upper", i, a.state_upper(i), b.state_upper(i), ns));
      if (i == N) break;
      const int m = a.controls(i);
      ASSERT_EQ(m, b.controls(i));
      ASSERT_TRUE(same_bits("F", i, a.AB(i), b.AB(i), ns * a.stride()));
      ASSERT_TRUE(same_bits("b", i, a.b(i), b.b(i), ns));
      ASSERT_TRUE(same_bits("control lower", i, a.control_lower(i), b.control_lower(i), m));
      ASSERT_TRUE(same_bits("control upper", i, a.control_upper(i), b.control_upper(i), m));
    }
  }
}

Iterate perturbed(const Ocp& ocp, Iterate point, RandomProblem& random) {
  for (int i = 0; i <= ocp.intervals(); ++i) {
    for (int j = 0; j < ocp.state_count(i); ++j) {
      point.state(i)[j] += 0.01 * random.normal();
      point.costate(i)[j] = random.normal();
      point.state_bound(i)[j] = j == 0 ? -0.0 : random.normal();
    }
    if (i == ocp.intervals()) break;
    for (int j = 0; j < ocp.control_count(i); ++j) {
      point.control(i)[j] += 0.01 * random.normal();
      point.control_bound(i)[j] = random.normal();
    }
  }
  return point;
}

/// Writes, reads, builds and compares; returns the record that was read.
ProblemRecord round_trip(const HorizonProblem& problem, const Iterate& guess,
                         std::shared_ptr<const Model> model = nullptr) {
  const std::string line = problem_line(record_of(problem, &guess, "run/7", "any", Settings::map()));
  EXPECT_EQ(line.find('\n'), std::string::npos);
  ProblemRecord record = read_problem(line, "dump.jsonl", 1);
  EXPECT_EQ(problem_line(record), line) << "a record that was read is written as it was";
  const auto built = build(record, model ? model : problem.shared_model());
  Iterate started(built->capacity());
  start(record, *built, started);
  expect_same_point(problem, guess, started);
  expect_same_problem(problem, guess, *built, started);
  EXPECT_TRUE(refill(record, *built));
  expect_same_problem(problem, guess, *built, started);
  return record;
}

/// A dense one, of variances that differ by orders of magnitude.
void correlate(RheProblem& problem, RandomProblem& random) {
  const Eigen::Index n = problem.arrival_mean.size();
  Eigen::MatrixXd root(n, n);
  for (Eigen::Index r = 0; r < n; ++r)
    for (Eigen::Index c = 0; c < n; ++c)
      root(r, c) = random.normal() * std::pow(10.0, static_cast<double>(c % 4) - 1.0);
  const Eigen::MatrixXd product = root.transpose() * root;
  problem.arrival_information = 0.5 * (product + product.transpose());
}

class EveryModel : public ::testing::TestWithParam<std::string> {
 protected:
  std::shared_ptr<const Model> model = host().make_model(GetParam());
};
INSTANTIATE_TEST_SUITE_P(ProblemRecord, EveryModel, ::testing::ValuesIn(host().names(PluginKind::model)),
                         [](const auto& test) { return test.param; });

TEST_P(EveryModel, EstimationKeepsEveryBit) {
  unsigned seed = 1;
  for (const Transition transition : {Transition::step, Transition::ramp})
    for (const bool linked : {false, true})
      for (const bool robust : {false, true})
        for (const double share : {0.0, 0.3})
          for (const int block : {0, 1, 4}) {
            SCOPED_TRACE(fmt::format("seed {}", seed));
            RandomProblem random(model, seed++);
            RandomProblem::RheSpec spec;
            spec.intervals = 9;
            spec.transition = transition;
            spec.linked = linked;
            spec.robust = robust;
            spec.missing = share;
            spec.block = block;
            const auto problem = random.rhe(spec);
            correlate(*problem, random);
            for (int i = 0; i < spec.intervals; ++i) problem->set_duration(i, 0.1 + 0.3 * random.uniform(0.0, 1.0));
            if (share > 0.0) problem->measured_input(3)[0] = missing;
            if (HasFatalFailure()) return;
            const Iterate guess = perturbed(*problem, RandomProblem::cold_start(*problem), random);
            const ProblemRecord record = round_trip(*problem, guess);
            EXPECT_EQ(record.transition.empty(), transition == Transition::step);
            EXPECT_EQ(record.robust.size(), robust ? 1U : 0U);
            const bool jumps = block > 0 || transition == Transition::ramp;
            EXPECT_EQ(record.neighbour_variance.empty(), !linked || !jumps || model->parameter_count() == 0);
            ASSERT_FALSE(HasFailure());
          }
}

TEST_P(EveryModel, AWindowThatIsShorterThanItsRoom) {
  for (const int intervals : {0, 1, 5}) {
    RandomProblem random(model, 77);
    RandomProblem::RheSpec spec;
    spec.intervals = 8;
    spec.block = 3;
    const auto problem = random.rhe(spec);
    problem->set_intervals(intervals);
    problem->finish();
    const Iterate guess = perturbed(*problem, RandomProblem::cold_start(*problem), random);
    const ProblemRecord record = round_trip(*problem, guess);
    EXPECT_EQ(record.intervals, intervals);
    EXPECT_EQ(record.first_interval(), 7 - intervals);
    // Without a guess it starts, and can be solved.
    ProblemRecord alone = record;
    alone.guess.reset();
    const auto built = build(alone, model);
    Iterate point(built->capacity());
    start(alone, *built, point);
    EXPECT_EQ(point.state(0)[model->state_count()],
              std::clamp(record.arrival_parameters[0], built->state_lower(0)[model->state_count()],
                         built->state_upper(0)[model->state_count()]));
    const auto solver = host().make_solver("gn_rti", parse_yaml("mode: converge", "options"));
    solver->setup(*built);
    EXPECT_EQ(solver->solve(point).status, Status::solved);
  }
}

TEST_P(EveryModel, ARampThatStartsAtTheWindowsEdgeOrNot) {
  for (const bool at_edge : {false, true}) {
    RandomProblem random(model, 5);
    RandomProblem::RheSpec spec;
    spec.intervals = 6;
    const auto problem = random.rhe(spec);
    std::vector<std::uint8_t> begins(6, 0);
    begins[0] = at_edge;
    begins[4] = 1;
    for (int j = 0; j < model->parameter_count(); ++j) {
      problem->set_blocks(j, begins.data(), Transition::ramp);
      problem->link(4, j, 1.0 / 3.0);
      if (at_edge) problem->link(0, j, 0.7);
    }
    problem->finish();
    const ProblemRecord record = round_trip(*problem, perturbed(*problem, RandomProblem::cold_start(*problem), random));
    const auto& first = model->description().parameters[0].name;
    EXPECT_EQ(record.block_starts.at(first), at_edge ? std::vector<int>({0, 4}) : std::vector<int>({4}));
    EXPECT_EQ(record.neighbour_variance.at(first).back(), 1.0 / 3.0);
  }
}

TEST_P(EveryModel, BlocksOfProcessNoiseKeepEveryBit) {
  const auto noisy = std::make_shared<StateNoiseModel>(model, std::vector{0}, std::vector{1});
  RandomProblem random(noisy, 6);
  RandomProblem::RheSpec spec;
  spec.intervals = 6;
  const auto problem = random.rhe(spec);
  const int noise = noisy->parameter_count() - 1;
  const std::uint8_t begins[] = {1, 0, 0, 1, 0, 0};
  problem->set_blocks(noise, begins, Transition::step);
  problem->set_block_weight(0, noise, 2.0 / 3.0);
  problem->set_block_weight(3, noise, 0.7);
  problem->finish();
  const ProblemRecord record =
      round_trip(*problem, perturbed(*problem, RandomProblem::cold_start(*problem), random), model);
  const auto& states = model->description().states;
  EXPECT_EQ(record.state_noise, std::vector{states[0].name});
  EXPECT_EQ(record.blocked_noise, std::vector{states[1].name});
  EXPECT_EQ(record.block_weights.at(states[1].name + "_noise"), (std::vector{2.0 / 3.0, 0.7}));
}

TEST_P(EveryModel, ControlKeepsEveryBit) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    RandomProblem random(model, seed);
    RandomProblem::RhcSpec spec;
    spec.intervals = 10;
    if (seed % 3 == 1) spec.blocked_inputs = {model->input_count() - 1};
    if (seed % 3 == 2)
      for (int j = 0; j < model->input_count(); ++j) spec.blocked_inputs.push_back(j);
    const auto problem = random.rhc(spec);
    for (int i = 0; i < spec.intervals; ++i) {
      problem->set_duration(i, 0.1 + 0.3 * random.uniform(0.0, 1.0));
      if (seed % 2 == 0) continue;
      problem->input_upper(i, 0) = i % 4 == 0 ? infinity : random.uniform(1.0, 2.0);
      problem->input_lower(i, model->input_count() - 1) = -random.uniform(0.5, 1.0);
    }
    // Beyond a bound, where there is one: which the problem then moves out of the way.
    for (int j = 0; j < model->state_count(); ++j)
      if (const double upper = model->description().states[j].upper; std::isfinite(upper))
        problem->given_state()[j] = upper + 0.2 * model->description().states[j].scale;
    std::vector<double> scratch(problem->scratch_size());
    const int moved = problem->finish(scratch);
    const Iterate guess = perturbed(*problem, RandomProblem::cold_start(*problem), random);
    const ProblemRecord record = round_trip(*problem, guess);
    EXPECT_EQ(record.interval_bounds.empty(), seed % 2 == 0);
    EXPECT_EQ(record.block_starts.size(), spec.blocked_inputs.size());
    const auto built = build(record, model);
    std::vector<double> room(built->scratch_size());
    EXPECT_EQ(dynamic_cast<RhcProblem&>(*built).finish(room), moved);
    ASSERT_FALSE(HasFailure());
  }
}

TEST_P(EveryModel, RatesKeepEveryBit) {
  std::vector<int> rated{model->input_count() - 1};
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    if (seed == 3 && model->input_count() > 1) rated.insert(rated.begin(), 0);
    RandomProblem random(std::make_shared<InputRateModel>(model, rated), seed);
    RandomProblem::RhcSpec spec;
    spec.intervals = 10;
    spec.adjust = [&](RhcProblem::Setup& setup, const RandomProblem::Drive&) {
      for (std::size_t k = 0; k < rated.size(); ++k)
        setup.rates.push_back({rated[k], model->state_count() + static_cast<int>(k)});
      if (seed % 2 == 0) setup.input_upper.assign(model->input_count(), 1.5);
      if (seed % 2 == 0) setup.input_lower.assign(model->input_count(), -0.5);
    };
    const auto problem = random.rhc(spec);
    const Iterate guess = perturbed(*problem, RandomProblem::cold_start(*problem), random);
    EXPECT_EQ(round_trip(*problem, guess, model).rates.size(), rated.size());
    ASSERT_FALSE(HasFailure());
  }
}

TEST(ProblemRecord, BoundsOfABicycleAreMovedAlike) {
  const auto model = host().make_model("bicycle_slip");
  RandomProblem random(model, 3);
  const auto problem = random.rhc({});
  problem->given_state()[3] = model->description().states[3].upper + 0.2;
  std::vector<double> scratch(problem->scratch_size());
  EXPECT_GT(problem->finish(scratch), 0) << "else the round trips above would prove less than they say";
  round_trip(*problem, RandomProblem::cold_start(*problem));
}

TEST_P(EveryModel, TheIntegratorIsKept) {
  const auto implicit = std::make_shared<const ImplicitModel>(model);
  for (const bool with_rates : {false, true}) {
    std::shared_ptr<const Model> decided = implicit;
    if (with_rates) decided = std::make_shared<InputRateModel>(implicit, std::vector<int>{0});
    RandomProblem random(decided, 5);
    RandomProblem::RhcSpec spec;
    spec.intervals = 6;
    spec.adjust = [&](RhcProblem::Setup& setup, const RandomProblem::Drive&) {
      if (with_rates) setup.rates.push_back({0, model->state_count()});
    };
    const auto problem = random.rhc(spec);
    const Iterate guess = perturbed(*problem, RandomProblem::cold_start(*problem), random);
    const ProblemRecord record = round_trip(*problem, guess, model);
    EXPECT_TRUE(record.is_implicit);
    EXPECT_FALSE(is_implicit(*as_integrated({}, implicit)));
    const auto again = build(record, model);
    EXPECT_TRUE(refill(record, *again));
    ProblemRecord other = record;
    other.is_implicit = false;
    EXPECT_FALSE(refill(other, *again)) << "it would be another problem";
    ASSERT_FALSE(HasFailure());
  }
  RandomProblem random(implicit, 6);
  const auto problem = random.rhe({});
  EXPECT_TRUE(round_trip(*problem, RandomProblem::cold_start(*problem), model).is_implicit);
}

TEST(ProblemRecord, RefusesWhatTheFormatHasNoWordsFor) {
  const auto model = host().make_model("bicycle_slip");
  RandomProblem random(model, 3);
  RandomProblem::RhcSpec spec;
  spec.blocked_inputs = {1, 0};
  EXPECT_THROW(record_of(*random.rhc(spec), nullptr, "x", "bicycle_slip", {}), Error);
}

TEST(ProblemRecord, OptionsKeepTheirMeaning) {
  const Settings options = parse_yaml("{a: 1.50, b: true, c: text, d: '007', e: [1, .inf], f: {g: null}}", "options");
  RandomProblem random(host().make_model("bicycle_slip"), 3);
  ProblemRecord record = record_of(*random.rhc({}), nullptr, "run/8", "bicycle_slip", options);
  record.origin = {{"run", "a \"name\""}, {"status", "infeasible"}};
  const ProblemRecord read = read_problem(problem_line(record), "dump.jsonl", 3);
  EXPECT_EQ(json_text(read.model_options), json_text(options));
  EXPECT_EQ(read.origin, record.origin);
  EXPECT_EQ(read.version, problem_format_version);
  EXPECT_EQ(read.step, 8);
  EXPECT_FALSE(read.guess.has_value());
}

// It cannot stop before the wall that it drives against.
constexpr const char* impossible = "{bounds: {u1: [4, 20], x_pos: [-20, 4]}, controller: {speed_bound_factor: .inf}}";

/// What a run solved, solved again from its line alone.
class Replayed : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(
    ProblemRecord, Replayed,
    ::testing::Values(
        "{}", "{estimator: {solver: {mode: converge}}, controller: {solver: {mode: converge}}}",
        "{estimator: {solver: {iterations: 3}}, controller: {solver: {iterations: 2}}}",
        "{blocking: {kappa: {name: structured, size: 5, overlap: 2, transition: ramp}}}",
        "{blocking: {kappa: {name: unblocked, neighbour_sigma: 0.04}}}",
        "{controller: {blocking: {u1: {name: pattern, lengths: [1, 2, 4, 8]}}}}",
        "{blocking: {kappa: {name: structured}}, estimator: {heading_starts: 4, initial: {sigma: {beta: 3}}}}",
        "{estimator: {robust: {outputs: [x_gps, y_gps]}, solver: {mode: converge}}}",
        "{estimator: {robust: {outputs: [x_gps, y_gps]}}}",
        "{estimator: {integrator: implicit}, controller: {integrator: implicit}}", impossible));

TEST_P(Replayed, GivesTheSameBits) {
  Settings settings = parse_yaml("{speed: 10, path: {laps: 1, radius: 12}}", "scenario");
  const auto put = [&](const auto& self, const Settings& map, const std::string& prefix) -> void {
    for (const auto& [key, value] : map.members()) {
      if (value.kind() == Settings::Kind::map && key != "kappa" && key != "u1") {
        self(self, value, prefix + key + ".");
      } else {
        settings.set(prefix + key, value);
      }
    }
  };
  put(put, parse_yaml(GetParam(), "variant"), "");
  const Scenario scenario(host(), settings);
  struct Solve {
    std::string line;
    Iterate result;
    Report report;
  };
  std::vector<Solve> solves;
  LoopHooks hooks;
  hooks.solved = [&](std::int64_t step, const HorizonProblem& problem, const Iterate& guess, const Iterate& result,
                     const Report& report) {
    EXPECT_GE(step, 0);
    const PluginChoice model = scenario.robot().model_choice();
    const ProblemRecord record = record_of(problem, &guess, fmt::format("run/{}", step), model.name, model.options);
    solves.push_back({problem_line(record), result, report});
  };
  const RunLog log = run_closed_loop(scenario, hooks);
  ASSERT_GE(solves.size(), 2 * log.samples.size());
  const auto failures =
      std::count_if(solves.begin(), solves.end(), [](const Solve& solve) { return !is_usable(solve.report.status); });
  EXPECT_EQ(failures > 0, std::string(GetParam()) == impossible);
  for (const Solve& live : solves) {
    const ProblemRecord record = read_problem(live.line, "dump.jsonl", 1);
    const auto problem = build(record, host().make_model(record.model, record.model_options));
    const PluginChoice choice = scenario.robot().solver_choice(record.kind);
    const auto solver = host().make_solver(choice.name, choice.options);
    solver->setup(*problem);
    Iterate point(problem->capacity());
    start(record, *problem, point);
    solver->prepare(point);
    const Report report = solver->solve(point);
    ASSERT_EQ(report.status, live.report.status) << record.id;
    ASSERT_EQ(report.iterations, live.report.iterations) << record.id;
    ASSERT_TRUE(same_bits("objective", 0, &report.objective, &live.report.objective, 1)) << record.id;
    expect_same_point(*problem, live.result, point);
    if (HasFatalFailure()) FAIL() << record.id;
  }
}

}  // namespace problem_record_test
}  // namespace rhec::sim
