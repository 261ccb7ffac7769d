// A step of gn_rti for a chain of masses on springs (Wirsching, Bock and Diehl 2006) with 15, 21 and 27 states, three
// inputs and 40 intervals of 0.2 s: by Gauss-Newton, with the exact Hessian, and as configured by default. The moved
// end is thrown off its place for a second, as in the paper, and brought back; so again with other throws.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "program.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rti_loop.hpp"

namespace rhec::bench {
namespace {

constexpr int intervals = 40, thrown_for = 5, steps_after = 200, throws = 4;
constexpr double duration = 0.2;  // [s]

int masses_of(const Model& model) { return (model.state_count() - 3) / 6; }

/// The chain at rest with its end at (1, 0, 0) m: masses that give way to the forces on them.
std::vector<double> at_rest(const Model& model) {
  const int masses = masses_of(model), end = 3 * masses;
  std::vector<double> x(static_cast<std::size_t>(model.state_count()), 0.0), rates(x.size());
  for (int i = 0; i <= masses; ++i) x[3 * i] = (i + 1.0) / (masses + 1);
  const double u[3] = {};
  for (double largest = 1.0; largest > 1e-11;) {
    model.rates(x.data(), u, nullptr, rates.data());
    largest = 0.0;
    for (int j = 0; j < end; ++j) {
      x[j] += 0.005 * rates[end + 3 + j];
      largest = std::max(largest, std::abs(rates[end + 3 + j]));
    }
  }
  return x;
}

RhcProblem::Setup setup_of(const Model& model) {
  const int end = 3 * masses_of(model);
  RhcProblem::Setup setup;
  setup.max_intervals = intervals;
  setup.state_weights.assign(static_cast<std::size_t>(model.state_count()), 0.0);
  std::fill_n(setup.state_weights.begin() + end, 3, 25.0);                           // the end's position
  std::fill(setup.state_weights.begin() + end + 3, setup.state_weights.end(), 1.0);  // velocities
  setup.terminal_weights = setup.state_weights;
  setup.input_weights.assign(3, 0.01);
  return setup;
}

/// The closed loop with a solver that converges, sample by sample.
Sequence thrown_chain(const Host& host, const std::shared_ptr<Model>& model, unsigned seed) {
  Sequence made{.name = model->description().name, .kind = "rhc", .model = model};
  const int nx = model->state_count();
  const std::vector<double> rest = at_rest(*model);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  double thrown[3] = {-1.0, 1.0, 1.0};
  if (seed > 0)
    for (double& speed : thrown) speed = any(random);
  std::vector<double> x = rest, next(x.size());
  const auto move = [&](const double* u) {
    model->integrate({.count = 1, .states = x.data(), .inputs = u, .durations = &duration, .next_states = next.data()});
    x = next;
  };
  for (int k = 0; k < thrown_for; ++k) move(thrown);
  RhcProblem problem(model, setup_of(*model));
  problem.set_intervals(intervals);
  for (int i = 0; i < intervals; ++i) problem.set_duration(i, duration);
  for (int i = 0; i <= intervals; ++i) std::copy(rest.begin(), rest.end(), problem.state_reference(i));
  std::vector<double> scratch(problem.scratch_size());
  const std::shared_ptr<Solver> solver = host.make_solver("gn_rti", parse_yaml("{mode: converge}", "benchmark"));
  solver->setup(problem);
  Iterate point(problem.capacity());
  for (int k = 0; k < steps_after; ++k) {
    std::copy(x.begin(), x.end(), problem.given_state());
    problem.finish(scratch);
    if (k == 0) {
      std::copy(x.begin(), x.end(), point.state(0));
      roll_out(problem, point, scratch);
      made.workspace = std::make_unique<RhcProblem>(problem);
      made.start = point;
    }
    made.samples.push_back({std::make_unique<RhcProblem>(problem), k > 0});
    if (const Report report = solver->solve(point); !is_usable(report.status))
      throw Error(made.name + ": the loop is not solved: " + name_of(report.status));
    double u[3];
    for (int j = 0; j < 3; ++j) u[j] = point.control(0)[j];
    move(u);
    // A breath of wind, so that the chain does not come to rest.
    for (int j = nx - 3 * masses_of(*model); j < nx; ++j) x[j] += 0.01 * any(random);
  }
  return made;
}

void add(const Host& host, const std::string& name) {
  const std::shared_ptr<Model> model = host.make_model(name);
  const auto sequences = std::make_shared<std::vector<Sequence>>();
  for (unsigned seed = 0; seed < throws; ++seed) sequences->push_back(thrown_chain(host, model, seed));
  for (const std::string hessian : {"gauss_newton", "exact", "auto"}) {
    const auto run = [host, sequences, model, hessian](benchmark::State& state) {
      std::vector<double> times, feedback;
      std::vector<std::unique_ptr<RtiLoop>> loops;
      const auto make_solver = [&] {
        return host.make_solver("gn_rti", parse_yaml("{hessian: " + hessian + "}", "benchmark"));
      };
      for (const Sequence& sequence : *sequences) loops.push_back(std::make_unique<RtiLoop>(sequence, make_solver()));
      int failed = 0;
      while (state.KeepRunning()) {
        for (std::size_t s = 0; s < loops.size(); ++s) {
          loops[s]->restart();
          for (std::size_t k = 0; k < (*sequences)[s].samples.size(); ++k) {
            failed += !is_usable(loops[s]->step().status);
            if (k > 0) times.push_back(loops[s]->times().total_us());
          }
        }
      }
      std::vector<double> excess;
      const std::shared_ptr<Solver> converging =
          host.make_solver("gn_rti", parse_yaml("{mode: converge, tolerance: 1.0e-6}", "benchmark"));
      for (const Sequence& sequence : *sequences) {
        const std::vector<double> of = excess_objectives(sequence, make_solver(), converging);
        excess.insert(excess.end(), of.begin() + 1, of.end());
      }
      state.counters["median_us"] = sim::spread_of(times).median;
      state.counters["p99_us"] = sim::spread_of(times).p99;
      state.counters["failed"] = failed;
      state.counters["mean_excess"] = std::accumulate(excess.begin(), excess.end(), 0.0) / excess.size();
      state.counters["largest_excess"] = *std::max_element(excess.begin(), excess.end());
    };
    add_benchmark(std::string("chain/").append(name).append("/").append(hessian), run);
  }
}

void register_all() {
  const Host host({RHEC_OUTSIDE_PLUGINS});
  for (const char* name : {"chain_15", "chain_21", "chain_27"}) add(host, name);
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) { return rhec::bench::run_program(count, words, rhec::bench::register_all); }
