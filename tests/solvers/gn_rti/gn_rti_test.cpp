// What gn_rti promises beyond the conformance of every solver.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/shift.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/ocp/hessian_choice.hpp"
#include "rhec/core/qp/riccati.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/allocations.hpp"
#include "support/other_model.hpp"
#include "support/random_problem.hpp"
#include "support/wide_vehicle.hpp"

namespace rhec {
namespace gn_rti_test {

using testing::RandomProblem;

const Host& host() {
  static const Host one;
  return one;
}
std::shared_ptr<Solver> gn_rti(const std::string& options) {
  return host().make_solver("gn_rti", parse_yaml(options, "options"));
}
std::shared_ptr<const Model> bicycle() { return host().make_model("bicycle_slip"); }

RandomProblem::RhcSpec off_by(double share) {
  RandomProblem::RhcSpec spec;
  spec.off = share;
  return spec;
}
RandomProblem::RheSpec blocks_of(int intervals) {
  RandomProblem::RheSpec spec;
  spec.block = intervals;
  return spec;
}

TEST(GnRti, AllocatesNothingAfterSetup) {
  const long before_all = allocation_count();
  const auto model = bicycle();
  EXPECT_GT(allocation_count(), before_all) << "the counter does not count";
  for (const char* options :
       {"{mode: rti}", "{mode: converge}", "{mode: converge, hessian: exact}", "{mode: rti, iterations: 3}"}) {
    for (unsigned seed = 1; seed <= 4; ++seed) {
      RandomProblem random(model, seed);
      RandomProblem::RheSpec spec;
      spec.block = static_cast<int>(seed) - 1;
      spec.robust = seed == 2;
      const auto rhe = random.rhe(spec);
      const auto rhc = random.rhc(off_by(0.4));
      const HorizonProblem* problems[] = {rhe.get(), rhc.get()};
      for (const HorizonProblem* problem : problems) {
        const auto solver = gn_rti(options);
        solver->setup(*problem);
        Iterate point = RandomProblem::cold_start(*problem);
        const long before = allocation_count();
        for (int repeat = 0; repeat < 3; ++repeat) {
          solver->prepare(point);
          solver->solve(point);
        }
        solver->reset();
        EXPECT_EQ(allocation_count() - before, 0) << options << ", seed " << seed;
      }
    }
  }
}

template <class Scalar>
struct Wide20 : testing::WideVehicle<20, Scalar> {};

/// Twenty states that are to come to rest over a long horizon: small residuals, and a Hessian that takes many
/// operations.
RhcProblem wide_control() {
  RhcProblem::Setup setup;
  setup.max_intervals = 40;
  setup.state_weights.assign(20, 1.0);
  setup.terminal_weights.assign(20, 1.0);
  setup.input_weights.assign(2, 1.0);
  RhcProblem problem(std::make_shared<FormulaModel<Wide20>>(Wide20<double>{}, testing::about_wide_vehicle(20)), setup);
  problem.set_intervals(40);
  for (int i = 0; i < 40; ++i) problem.set_duration(i, 0.05);
  std::fill_n(problem.given_state(), 20, 0.05);
  std::fill_n(problem.given_parameters(), 2, 0.3);
  return problem;
}

// Exact at first; once its steps have shown that it gains nothing, the steps are those of Gauss-Newton.
TEST(GnRti, TakesGaussNewtonWhereTheExactHessianGainsLittle) {
  RhcProblem problem = wide_control();
  std::vector<double> scratch(problem.scratch_size());
  problem.finish(scratch);
  const auto of_auto = gn_rti("{}"), exact = gn_rti("{hessian: exact}"),
             gauss_newton = gn_rti("{hessian: gauss_newton}");
  for (const auto& solver : {of_auto, exact, gauss_newton}) solver->setup(problem);
  Iterate point(problem.capacity());
  roll_out(problem, point, scratch);
  ASSERT_TRUE(is_usable(of_auto->solve(point).status));
  const auto is_the_step_of = [&](Solver& other) {
    Iterate same = point;
    other.prepare(same);
    other.solve(same);
    of_auto->prepare(point);
    EXPECT_EQ(of_auto->solve(point).status, Status::step_taken);
    bool is_same = true;
    for (int i = 0; i < 40; ++i)
      for (int j = 0; j < 2; ++j) is_same &= same.control(i)[j] == point.control(i)[j];
    return is_same;
  };
  int exact_steps = 0, gauss_newton_steps = 0;
  for (int k = 0; k < 30; ++k) {
    problem.given_state()[k % 20] += 0.01;
    problem.finish(scratch);
    if (k == 0) exact_steps += is_the_step_of(*exact);
    const bool is_exact = k < HessianChoice::trial_steps - 1;
    (is_exact ? exact_steps : gauss_newton_steps) += is_the_step_of(is_exact ? *exact : *gauss_newton);
  }
  EXPECT_EQ(exact_steps, HessianChoice::trial_steps);
  EXPECT_EQ(gauss_newton_steps, 30 - (HessianChoice::trial_steps - 1));
}

TEST(GnRti, AStepIsTheSamePreparedOrNot) {
  RandomProblem random(bicycle(), 3);
  const auto problem = random.rhe(blocks_of(4));
  const auto converged = gn_rti("{mode: converge}"), step = gn_rti("{mode: rti}");
  converged->setup(*problem);
  step->setup(*problem);
  Iterate base = RandomProblem::cold_start(*problem);
  converged->solve(base);
  for (int j = 0; j < 3; ++j) problem->output(problem->intervals())[j] += 0.02;
  // Prepared with the old measurement, fed the new one; against all at once.
  Iterate prepared = base, direct = base;
  for (int j = 0; j < 3; ++j) problem->output(problem->intervals())[j] -= 0.02;
  step->prepare(prepared);
  for (int j = 0; j < 3; ++j) problem->output(problem->intervals())[j] += 0.02;
  EXPECT_EQ(step->solve(prepared).status, Status::step_taken);
  EXPECT_EQ(step->solve(direct).status, Status::step_taken);
  for (int i = 0; i <= problem->intervals(); ++i)
    for (int j = 0; j < problem->state_count(i); ++j) EXPECT_NEAR(prepared.state(i)[j], direct.state(i)[j], 1e-12);
}

TEST(GnRti, PreparesControlForAnotherInitialState) {
  RandomProblem random(bicycle(), 4);
  const auto problem = random.rhc({});
  std::vector<double> scratch(problem->scratch_size());
  const auto converged = gn_rti("{mode: converge}"), step = gn_rti("{mode: rti}");
  converged->setup(*problem);
  step->setup(*problem);
  Iterate point = RandomProblem::cold_start(*problem);
  converged->solve(point);
  step->prepare(point);
  problem->given_state()[0] += 0.01;
  problem->given_parameters()[0] -= 0.01;
  problem->finish(scratch);
  const Report report = step->solve(point);
  EXPECT_EQ(report.status, Status::step_taken);
  EXPECT_EQ(report.factorisations, 1) << "the prepared factorisation should have been enough";
  Iterate exact = point;
  converged->solve(exact);
  EXPECT_NEAR(problem->evaluate(point, nullptr, scratch), problem->evaluate(exact, nullptr, scratch),
              1e-4 * (1.0 + problem->evaluate(exact, nullptr, scratch)));
}

/// Asks another model, and once in a while gets no number.
class UnsureModel final : public OtherModel {
 public:
  using OtherModel::OtherModel;
  void integrate_rows(const IntervalRows& request) const noexcept override {
    OtherModel::integrate_rows(request);
    if (calls_until_nan-- == 0) request.next_states[0] = std::numeric_limits<double>::quiet_NaN();
  }
  mutable int calls_until_nan = -1;
};

void expect_same_bits(const Ocp& ocp, const Iterate& a, const Iterate& b, const std::string& where) {
  for (int i = 0; i <= ocp.intervals(); ++i) {
    for (int j = 0; j < ocp.state_count(i); ++j) {
      ASSERT_EQ(a.state(i)[j], b.state(i)[j]) << where << ": state " << i;
      ASSERT_EQ(a.costate(i)[j], b.costate(i)[j]) << where << ": costate " << i;
    }
    if (i == ocp.intervals()) break;
    for (int j = 0; j < ocp.control_count(i); ++j)
      ASSERT_EQ(a.control(i)[j], b.control(i)[j]) << where << ": control " << i;
  }
}

TEST(GnRti, AnswersFirstAndJudgesAfterwards) {
  for (const std::string options : {"{mode: rti}", "{mode: rti, iterations: 3}", "{mode: converge}"}) {
    for (const bool control : {false, true}) {
      RandomProblem random(bicycle(), 21);
      std::unique_ptr<HorizonProblem> problem;
      if (control) {
        problem = random.rhc(off_by(0.05));
      } else {
        problem = random.rhe(blocks_of(4));
      }
      const auto at_once = gn_rti(options), in_parts = gn_rti(options), without_finish = gn_rti(options),
                 converged = gn_rti("{mode: converge}");
      for (const auto& solver : {at_once, in_parts, without_finish, converged}) solver->setup(*problem);
      Iterate start = RandomProblem::cold_start(*problem);
      converged->solve(start);
      GuessShifter shifters[] = {GuessShifter(*problem), GuessShifter(*problem), GuessShifter(*problem)};
      Iterate whole = start, parts = start, unfinished = start;
      for (int sample = 0; sample < 6; ++sample) {
        const std::string where = options + ", sample " + std::to_string(sample);
        shifters[0].take(*problem, whole);
        shifters[1].take(*problem, parts);
        shifters[2].take(*problem, unfinished);
        if (control) {
          static_cast<RhcProblem&>(*problem).given_state()[1] += 0.002;
        } else {
          static_cast<RheProblem&>(*problem).output(problem->intervals())[0] += 0.002;
        }
        shifters[0].apply(1, *problem, whole);
        shifters[1].apply(1, *problem, parts);
        shifters[2].apply(1, *problem, unfinished);
        at_once->prepare(whole);
        in_parts->prepare(parts);
        without_finish->prepare(unfinished);
        const Report expected = at_once->solve(whole);
        Report report = in_parts->feedback(parts, Clock::time_point::max());
        expect_same_bits(*problem, parts, whole, where + ", answered");
        in_parts->finish(parts, report);
        expect_same_bits(*problem, parts, whole, where + ", finished");
        EXPECT_EQ(report.status, expected.status) << where;
        EXPECT_EQ(report.iterations, expected.iterations) << where;
        EXPECT_EQ(report.objective, expected.objective) << where;
        EXPECT_EQ(report.kkt.largest(), expected.kkt.largest()) << where;
        // It costs time to leave it out, and nothing else.
        without_finish->feedback(unfinished, Clock::time_point::max());
        expect_same_bits(*problem, unfinished, whole, where + ", not finished");
        if (HasFatalFailure()) return;
      }
    }
  }
}

TEST(GnRti, TakesAStepBackThatComesToNothing) {
  for (const int iterations : {1, 2}) {
    const auto model = std::make_shared<UnsureModel>(bicycle());
    RandomProblem random(model, 8);
    const auto problem = random.rhc(off_by(0.1));
    const auto solver = gn_rti("{mode: rti, iterations: " + std::to_string(iterations) + "}"),
               one_less = gn_rti("{mode: rti}"), converged = gn_rti("{mode: converge}");
    for (const auto& each : {solver, one_less, converged}) each->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    converged->solve(point);
    problem->given_state()[0] += 0.01;
    Iterate before = point;
    if (iterations > 1) one_less->solve(before);
    Report report = solver->feedback(point, Clock::time_point::max());
    ASSERT_EQ(report.status, Status::step_taken);
    EXPECT_TRUE(point.is_finite());
    model->calls_until_nan = 0;
    solver->finish(point, report);
    expect_same_bits(*problem, point, before, "taken back");
    EXPECT_EQ(report.status, iterations > 1 ? Status::iteration_limit : Status::stalled);
    EXPECT_EQ(report.iterations, iterations - 1);
    EXPECT_TRUE(std::isfinite(report.objective));
    EXPECT_TRUE(std::isfinite(report.kkt.largest()));
    // And goes on from there.
    EXPECT_EQ(solver->solve(point).status, Status::step_taken);
  }
}

TEST(GnRti, GivesTheCovariancesOfItsLinearisation) {
  RandomProblem random(bicycle(), 9);
  for (const int block : {0, 4}) {
    const auto problem = random.rhe(blocks_of(block));
    const auto solver = gn_rti("{mode: converge}");
    solver->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    ASSERT_EQ(solver->solve(point).status, Status::solved);
    const int N = problem->intervals(), ns = problem->capacity().states;
    std::vector<double> scratch(problem->scratch_size()), expected((N + 1) * ns * ns), all(expected), last(ns * ns);
    StageQp qp(problem->capacity());
    Riccati riccati(problem->capacity());
    problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, qp, scratch);
    riccati.factor(qp, ActiveSet(problem->capacity()));
    riccati.covariances(qp, expected.data(), nullptr);
    ASSERT_TRUE(solver->covariances(point, all_stages(*problem), all));
    ASSERT_TRUE(solver->covariances(point, {N, N}, last));
    for (std::size_t k = 0; k < expected.size(); ++k) EXPECT_NEAR(all[k], expected[k], 1e-12 * (1 + std::abs(all[k])));
    for (std::size_t k = 0; k < last.size(); ++k) {
      const double of_all = all[all.size() - last.size() + k];
      EXPECT_NEAR(last[k], of_all, 1e-12 * (1 + std::abs(of_all)));
    }
    EXPECT_FALSE(solver->covariances(point, {1, 2}, all)) << "it has all or the last one";
    EXPECT_FALSE(solver->covariances(point, all_stages(*problem), last)) << "there is no room for all";
    // What was prepared for the next sample is not to be disturbed.
    solver->prepare(point);
    EXPECT_FALSE(solver->covariances(point, {N, N}, last));
  }
}

TEST(GnRti, GivesUpOnNothingButSaysSoAtTheIterationLimit) {
  RandomProblem random(bicycle(), 5);
  const auto problem = random.rhc(off_by(0.5));
  const auto solver = gn_rti("{mode: converge, max_iterations: 1, tolerance: 1e-14}");
  solver->setup(*problem);
  Iterate point = RandomProblem::cold_start(*problem);
  const Report report = solver->solve(point);
  EXPECT_EQ(report.status, Status::iteration_limit);
  EXPECT_STRNE(advice_for(report.status), "");
  EXPECT_TRUE(point.is_finite());
}

/// Drives the bicycle in an S and estimates with the given blockings; returns all estimates, bit by bit.
std::vector<double> estimates(const std::string& kappa, const std::string& mu, int horizon, int steps) {
  const auto model = bicycle();
  RecedingHorizonEstimation::Setup setup;
  setup.problem.max_intervals = horizon;
  setup.problem.output_weights = {1111.0, 1111.0, 3284.0};
  setup.problem.input_weights = {100.0, 100.0};
  for (const std::string& blocking : {kappa, mu}) {
    const Settings section = parse_yaml(blocking, "blocking");
    setup.blockings.push_back(host().make_blocking(section.find("name")->as_text(), section));
    setup.walks.push_back({});
  }
  setup.initial_mean = Eigen::VectorXd::Zero(6);
  setup.initial_mean.tail(2).setConstant(0.5);
  setup.initial_covariance = Eigen::MatrixXd::Identity(6, 6) * 0.01;
  RecedingHorizonEstimation method(model, gn_rti("{mode: rti}"), setup);
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  double x[4] = {0.0, 0.0, 0.0, 0.0};
  Estimate estimate;
  estimate.state.resize(4);
  estimate.parameters.resize(2);
  estimate.covariance.resize(6, 6);
  std::vector<double> all;
  for (int k = 0; k <= steps; ++k) {
    const double y[3] = {x[0] - 0.4 * std::cos(x[2]) + 0.03 * normal(random),
                         x[1] - 0.4 * std::sin(x[2]) + 0.03 * normal(random), x[3] + 0.017 * normal(random)};
    const double u[2] = {4.0, 0.3 * std::sin(0.3 * k)};
    if (k == 0) {
      method.start(y);
    } else {
      const double measured[2] = {4.0 + 0.1 * normal(random), 0.3 * std::sin(0.3 * (k - 1)) + 0.1 * normal(random)};
      method.add_node(0.2, measured, y);
    }
    method.estimate(estimate, Clock::time_point::max());
    all.insert(all.end(), estimate.state.begin(), estimate.state.end());
    all.insert(all.end(), estimate.parameters.begin(), estimate.parameters.end());
    all.insert(all.end(), estimate.covariance.data(), estimate.covariance.data() + 36);
    const double p[2] = {0.8 + 0.1 * std::sin(0.1 * k), 0.9}, dt = 0.2;
    Model::Intervals request;
    request.count = 1;
    request.states = x;
    request.inputs = u;
    request.parameters = p;
    request.durations = &dt;
    double next[4];
    request.next_states = next;
    model->integrate(request);
    std::copy_n(next, 4, x);
  }
  return all;
}

void expect_same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(double)), 0);
}

TEST(Identities, OverlapZeroAndOneAreTheSameToTheLastBit) {
  for (const int size : {1, 2, 3, 5, 30})
    expect_same_bits(
        estimates("{name: structured, size: " + std::to_string(size) + ", overlap: 0}", "{name: full_horizon}", 15, 40),
        estimates("{name: structured, size: " + std::to_string(size) + ", overlap: 1}", "{name: full_horizon}", 15,
                  40));
}

TEST(Identities, BlocksOfOneAreUnblockedToTheLastBit) {
  for (const char* link : {"", ", neighbour_sigma: 0.04"})
    expect_same_bits(
        estimates(std::string("{name: structured, size: 1, overlap: 1") + link + "}", "{name: full_horizon}", 15, 40),
        estimates(std::string("{name: unblocked") + link + "}", "{name: full_horizon}", 15, 40));
}

TEST(Identities, WithNoBorderInViewTheStructureIsThatOfFullHorizonBlocking) {
  // Until the first border comes into view, a block of 100 is the whole horizon.
  expect_same_bits(estimates("{name: structured, size: 100}", "{name: full_horizon}", 15, 60),
                   estimates("{name: full_horizon}", "{name: full_horizon}", 15, 60));
}

}  // namespace gn_rti_test
}  // namespace rhec
