// The solvers that are not for real time. Of ipopt, how much of a warm-started solve is the evaluation of the problem;
// sparse_sqp against ipopt on the same problems at the same accuracy, warm-started along a sequence; and what
// sparse_sqp costs against the length of the horizon.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "long_problems.hpp"
#include "program.hpp"
#include "rhec/core/error.hpp"
#include "rhec/plugins/yaml.hpp"
#include "rhec/sim/spread.hpp"
#include "rti_loop.hpp"

namespace rhec::bench {
namespace {

constexpr const char* accuracy = "{tolerance: 1e-8}";

/// An Ocp that adds up the time that is spent in evaluating it.
class TimedOcp final : public Ocp {
 public:
  TimedOcp(const Ocp& ocp, double& us) : ocp_(&ocp), us_(&us) {}
  OcpKind kind() const noexcept override { return ocp_->kind(); }
  Capacity capacity() const noexcept override { return ocp_->capacity(); }
  int intervals() const noexcept override { return ocp_->intervals(); }
  int state_count(int node) const noexcept override { return ocp_->state_count(node); }
  int control_count(int interval) const noexcept override { return ocp_->control_count(interval); }
  const double* initial_state() const noexcept override { return ocp_->initial_state(); }
  const double* state_lower(int node) const noexcept override { return ocp_->state_lower(node); }
  const double* state_upper(int node) const noexcept override { return ocp_->state_upper(node); }
  const double* control_lower(int interval) const noexcept override { return ocp_->control_lower(interval); }
  const double* control_upper(int interval) const noexcept override { return ocp_->control_upper(interval); }
  bool has_second_derivatives() const noexcept override { return ocp_->has_second_derivatives(); }
  std::size_t scratch_size() const noexcept override { return ocp_->scratch_size(); }
  void mark_dynamics(int interval, std::uint8_t* of_states, std::uint8_t* of_controls) const noexcept override {
    timed([&] { ocp_->mark_dynamics(interval, of_states, of_controls); });
  }
  double evaluate_stages(const Iterate& point, double* defects, double* stage_costs,
                         std::span<double> scratch) const noexcept override {
    double objective = 0.0;
    timed([&] { objective = ocp_->evaluate_stages(point, defects, stage_costs, scratch); });
    return objective;
  }
  void simulate_interval(int interval, Iterate& point, std::span<double> scratch) const noexcept override {
    timed([&] { ocp_->simulate_interval(interval, point, scratch); });
  }
  void linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                 std::span<double> scratch) const noexcept override {
    timed([&] { ocp_->linearise(range, point, hessian, qp, scratch); });
  }
  void refresh(const Iterate& point, StageQp& qp, std::span<double> scratch) const noexcept override {
    timed([&] { ocp_->refresh(point, qp, scratch); });
  }

 private:
  template <class Work>
  void timed(const Work& work) const noexcept {
    const auto begin = Ticks::now();
    work();
    *us_ += Ticks::microseconds(begin, Ticks::now());
  }
  const Ocp* ocp_;
  double* us_;
};

/// A solver that is asked about timed problems.
class EvaluationTimer final : public Solver {
 public:
  explicit EvaluationTimer(std::shared_ptr<Solver> solver) : solver_(std::move(solver)) {}
  double evaluation_us = 0.0;

  std::string why_not(const Ocp& ocp) const override { return solver_->why_not(ocp); }
  void setup(const Ocp& ocp) override { solver_->setup(ocp); }
  void prepare(const Ocp& ocp, const Iterate& guess) noexcept override {
    solver_->prepare(TimedOcp(ocp, evaluation_us), guess);
  }
  using Solver::solve;
  Report solve(const Ocp& ocp, Iterate& point, Clock::time_point deadline) noexcept override {
    return solver_->solve(TimedOcp(ocp, evaluation_us), point, deadline);
  }
  void reset() noexcept override { solver_->reset(); }

 private:
  std::shared_ptr<Solver> solver_;
};

/// Solves along a sequence; adds the times of all but the first sample.
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

double sum_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum;
}

void compare(benchmark::State& state, const Host& host, const Sequence& sequence) {
  const auto make = [&](const char* name) { return host.make_solver(name, parse_yaml(accuracy, "benchmark")); };
  RtiLoop sparse_sqp(sequence, make("sparse_sqp")), ipopt(sequence, make("ipopt"));
  Pass of_sparse_sqp, of_ipopt;
  while (state.KeepRunning()) {
    of_sparse_sqp.run(sparse_sqp, sequence);
    of_ipopt.run(ipopt, sequence);
  }
  const auto timer = std::make_shared<EvaluationTimer>(make("ipopt"));
  RtiLoop timed(sequence, timer);
  Pass of_timed;
  // The first sample's evaluations are not those of a warm start.
  timed.restart();
  timed.step();
  const double cold = timer->evaluation_us;
  timer->evaluation_us = 0.0;
  of_timed.run(timed, sequence);
  const double evaluation_us = timer->evaluation_us - cold;

  auto& counters = state.counters;
  counters["sparse_sqp_us"] = sim::spread_of(of_sparse_sqp.times).median;
  counters["ipopt_us"] = sim::spread_of(of_ipopt.times).median;
  counters["ratio"] = sim::spread_of(of_ipopt.times).median / sim::spread_of(of_sparse_sqp.times).median;
  counters["sparse_sqp_iterations"] = sim::spread_of(of_sparse_sqp.iterations).median;
  counters["ipopt_iterations"] = sim::spread_of(of_ipopt.iterations).median;
  counters["sparse_sqp_worst_kkt"] = of_sparse_sqp.worst_kkt;
  counters["ipopt_worst_kkt"] = of_ipopt.worst_kkt;
  counters["ipopt_evaluation_share"] = evaluation_us / sum_of(of_timed.times);
}

/// The first problem of a sequence from a guess near by, with a solver that has forgotten all, to the tolerance.
void solve_alone(benchmark::State& state, const Host& host, const Sequence& sequence) {
  RtiLoop loop(sequence, host.make_solver("sparse_sqp", parse_yaml(accuracy, "benchmark")));
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
