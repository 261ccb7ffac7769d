// What gn_rti promises beyond the conformance of every solver.

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <new>

#include "../core/random_problem.hpp"
#include "rhec/core/receding_horizon_estimation.hpp"
#include "rhec/core/shift.hpp"
#include "rhec/plugins/host.hpp"
#include "rhec/plugins/yaml.hpp"

namespace {
std::atomic<long> allocations{0};
}  // namespace

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
// The compiler sees both ends and not that they fit.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace rhec {
namespace {

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
  const long before_all = allocations;
  const auto model = bicycle();
  EXPECT_GT(allocations, before_all) << "the counter does not count";
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
        const long before = allocations;
        for (int repeat = 0; repeat < 3; ++repeat) {
          solver->prepare(*problem, point);
          solver->solve(*problem, point);
        }
        solver->reset();
        EXPECT_EQ(allocations - before, 0) << options << ", seed " << seed;
      }
    }
  }
}

TEST(GnRti, AStepIsTheSamePreparedOrNot) {
  RandomProblem random(bicycle(), 3);
  const auto problem = random.rhe(blocks_of(4));
  const auto converged = gn_rti("{mode: converge}"), step = gn_rti("{mode: rti}");
  converged->setup(*problem);
  step->setup(*problem);
  Iterate base = RandomProblem::cold_start(*problem);
  converged->solve(*problem, base);
  for (int j = 0; j < 3; ++j) problem->output(problem->intervals())[j] += 0.02;
  // Prepared with the old measurement, fed the new one; against all at once.
  Iterate prepared = base, direct = base;
  for (int j = 0; j < 3; ++j) problem->output(problem->intervals())[j] -= 0.02;
  step->prepare(*problem, prepared);
  for (int j = 0; j < 3; ++j) problem->output(problem->intervals())[j] += 0.02;
  EXPECT_EQ(step->solve(*problem, prepared).status, Status::step_taken);
  EXPECT_EQ(step->solve(*problem, direct).status, Status::step_taken);
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
  converged->solve(*problem, point);
  step->prepare(*problem, point);
  problem->given_state()[0] += 0.01;
  problem->given_parameters()[0] -= 0.01;
  problem->finish(scratch);
  const Report report = step->solve(*problem, point);
  EXPECT_EQ(report.status, Status::step_taken);
  EXPECT_EQ(report.factorisations, 1) << "the prepared factorisation should have been enough";
  Iterate exact = point;
  converged->solve(*problem, exact);
  EXPECT_NEAR(problem->evaluate(point, nullptr, scratch), problem->evaluate(exact, nullptr, scratch),
              1e-4 * (1.0 + problem->evaluate(exact, nullptr, scratch)));
}

TEST(GnRti, GivesUpOnNothingButSaysSoAtTheIterationLimit) {
  RandomProblem random(bicycle(), 5);
  const auto problem = random.rhc(off_by(0.5));
  const auto solver = gn_rti("{mode: converge, max_iterations: 1, tolerance: 1e-14}");
  solver->setup(*problem);
  Iterate point = RandomProblem::cold_start(*problem);
  const Report report = solver->solve(*problem, point);
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

}  // namespace
}  // namespace rhec
