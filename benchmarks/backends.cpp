// The solvers that are not for real time. For ipopt, the share of a warm-started solve spent in rhec: in evaluating the
// problem and in the plugin. sparse_sqp against ipopt on the same problems at the same accuracy, warm-started along a
// sequence. And the time of sparse_sqp against the length of the horizon.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "long_problems.hpp"
#include "program.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/ocp/solver_decorator.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rti_loop.hpp"
#include "solvers/ipopt/ipopt_solver.hpp"

namespace rhec::bench {
namespace {

constexpr double tolerance = 1e-8;
constexpr int passes = 3;  // for the share of ipopt's time spent in rhec
Settings accuracy() { return parse_yaml(fmt::format("{{tolerance: {}}}", tolerance), "benchmark"); }

/// The ipopt plugin linked into this program, since only its class tells how much time a solve spent in Ipopt itself.
class Observed final : public SolverDecorator {
 public:
  Observed() : Observed(std::make_shared<ipopt::IpoptSolver>(options())) {}
  std::vector<double> our_shares;  ///< of the time of each solve

  using Solver::solve;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override {
    const auto begin = Ticks::now();
    const Report report = inner().solve(iterate, deadline);
    our_shares.push_back(1.0 - ipopt_->backend_us() / Ticks::microseconds(begin, Ticks::now()));
    return report;
  }
  Report feedback(Iterate& iterate, Clock::time_point deadline) noexcept override { return solve(iterate, deadline); }

 private:
  explicit Observed(const std::shared_ptr<ipopt::IpoptSolver>& solver)
      : SolverDecorator(solver), ipopt_(solver.get()) {}
  static ipopt::IpoptOptions options() {
    ipopt::IpoptOptions options;
    options.tolerance = tolerance;
    return options;
  }
  const ipopt::IpoptSolver* ipopt_;
};

/// Solves along a sequence; collects the times of all samples but the first.
struct Pass {
  std::vector<double> times, iterations;
  double worst_kkt = 0.0;

  void run(RtiLoop& loop, const Sequence& sequence) {
    loop.restart();
    for (std::size_t k = 0; k < sequence.samples.size(); ++k) {
      const Report& report = loop.step();
      if (report.status != Status::solved)
        throw Error(sequence.name + ": sample " + std::to_string(k) + " was not solved: " + name_of(report.status));
      if (k == 0) continue;
      times.push_back(loop.times().total_us());
      iterations.push_back(report.iterations);
      worst_kkt = std::max(worst_kkt, report.kkt.largest());
    }
  }
};

void compare(benchmark::State& state, const Host& host, const Sequence& sequence) {
  const auto make = [&](const char* name) { return host.make_solver(name, accuracy()); };
  RtiLoop sparse_sqp(sequence, make("sparse_sqp")), ipopt(sequence, make("ipopt"));
  Pass of_sparse_sqp, of_ipopt;
  while (state.KeepRunning()) {
    of_sparse_sqp.run(sparse_sqp, sequence);
    of_ipopt.run(ipopt, sequence);
  }
  const auto observed = std::make_shared<Observed>();
  RtiLoop loop(sequence, observed);
  std::vector<double> our_shares;
  for (int pass = 0; pass < passes; ++pass) {
    observed->our_shares.clear();
    loop.restart();
    for (std::size_t k = 0; k < sequence.samples.size(); ++k) loop.step();
    our_shares.insert(our_shares.end(), observed->our_shares.begin() + 1,
                      observed->our_shares.end());  // without the first
  }

  auto& counters = state.counters;
  counters["sparse_sqp_us"] = sim::spread_of(of_sparse_sqp.times).median;
  counters["ipopt_us"] = sim::spread_of(of_ipopt.times).median;
  counters["ratio"] = sim::spread_of(of_ipopt.times).median / sim::spread_of(of_sparse_sqp.times).median;
  counters["sparse_sqp_iterations"] = sim::spread_of(of_sparse_sqp.iterations).median;
  counters["ipopt_iterations"] = sim::spread_of(of_ipopt.iterations).median;
  counters["sparse_sqp_worst_kkt"] = of_sparse_sqp.worst_kkt;
  counters["ipopt_worst_kkt"] = of_ipopt.worst_kkt;
  counters["ipopt_our_share"] = sim::spread_of(our_shares).median;
}

/// Solves the first problem of a sequence to the tolerance, from a nearby guess, with a solver that was reset.
void solve_alone(benchmark::State& state, const Host& host, const Sequence& sequence) {
  RtiLoop loop(sequence, host.make_solver("sparse_sqp", accuracy()));
  std::vector<double> times;
  while (state.KeepRunning()) {
    loop.restart();
    if (loop.step().status != Status::solved) throw Error(sequence.name + ": was not solved");
    times.push_back(loop.times().total_us());
  }
  state.counters["intervals"] = sequence.workspace->intervals();
  state.counters["median_us"] = sim::spread_of(times).median;
  state.counters["least_us"] = *std::min_element(times.begin(), times.end());
  state.counters["iterations"] = loop.report().iterations;
}

using Run = void(benchmark::State& state, const Host& host, const Sequence& sequence);

void add(const std::string& name, const Host& host, Sequence sequence, Run* run, int iterations) {
  const auto kept = std::make_shared<Sequence>(std::move(sequence));
  add_benchmark(
      name, [=](benchmark::State& state) { run(state, host, *kept); }, iterations);
}

void register_all() {
  const Host host;
  constexpr int block = 20, samples = 4;
  std::vector<Sequence> sequences = drive(host, usual_drives().front());
  sequences.push_back(long_estimation(host, 1000, samples, block, Blocks::moving));
  sequences.push_back(long_control(host, 1000, samples));
  for (Sequence& sequence : sequences) {
    const std::string name = "same_problem/" + sequence.name;
    add(name, host, std::move(sequence), compare, 1);
  }
  for (const int intervals : {100, 200, 500, 1000, 2000, 5000, 10000})
    add("sparse_sqp/" + std::to_string(intervals), host, long_estimation(host, intervals, 1, block, Blocks::fixed),
        solve_alone, 5);
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) { return rhec::bench::run_program(count, words, rhec::bench::register_all); }
