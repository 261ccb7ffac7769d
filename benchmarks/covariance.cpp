// An estimator in its loop: the shares of the solver's step, of the estimate's covariance and of the rest in a call of
// `estimate`; and the time to take a new node, including the update of the arrival cost and the shift.
#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <random>
#include <utility>

#include "program.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/ocp/solver_decorator.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "ticks.hpp"

namespace rhec::bench {
namespace {

/// Times of the calls of an estimator's method and its solver [us].
struct Times {
  std::vector<double> add_node, solve, covariance, rest_of_estimate;
};

/// Unlike the core's TimedSolver it has a clock that resolves microseconds, and times covariances too.
class TickedSolver final : public SolverDecorator {
 public:
  TickedSolver(std::shared_ptr<Solver> solver, std::shared_ptr<Times> times)
      : SolverDecorator(std::move(solver)), times_(std::move(times)) {}
  using Solver::solve;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override {
    const auto begin = Ticks::now();
    const Report report = inner().solve(iterate, deadline);
    times_->solve.push_back(Ticks::microseconds(begin, Ticks::now()));
    return report;
  }
  bool covariances(const Iterate& iterate, StageRange nodes, std::span<double> blocks) noexcept override {
    const auto begin = Ticks::now();
    const bool are_there = inner().covariances(iterate, nodes, blocks);
    times_->covariance.push_back(Ticks::microseconds(begin, Ticks::now()));
    return are_there;
  }

 private:
  std::shared_ptr<Times> times_;
};

class TimedMethod final : public EstimationMethod {
 public:
  TimedMethod(std::unique_ptr<EstimationMethod> method, std::shared_ptr<Times> times)
      : method_(std::move(method)), times_(std::move(times)) {}
  const Model& model() const noexcept override { return method_->model(); }
  int substeps() const noexcept override { return method_->substeps(); }
  void start(Measured outputs) noexcept override { method_->start(outputs); }
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override {
    const auto begin = Ticks::now();
    method_->add(interval, outputs);
    times_->add_node.push_back(Ticks::microseconds(begin, Ticks::now()));
  }
  int most_between() const noexcept override { return method_->most_between(); }
  int reach() const noexcept override { return method_->reach(); }
  int most_reach() const noexcept override { return method_->most_reach(); }
  void rewind(int nodes) noexcept override { method_->rewind(nodes); }
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override {
    const auto begin = Ticks::now();
    method_->estimate(result, deadline);
    const double all = Ticks::microseconds(begin, Ticks::now());
    times_->rest_of_estimate.push_back(all - times_->solve.back() - times_->covariance.back());
  }
  void prepare() noexcept override { method_->prepare(); }
  void reset() noexcept override { method_->reset(); }
  bool rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept override {
    return method_->rebase(mean, covariance);
  }

 private:
  std::unique_ptr<EstimationMethod> method_;
  std::shared_ptr<Times> times_;
};

/// Takes the times of an estimator and of its solver.
class TimingHooks final : public RobotHooks {
 public:
  explicit TimingHooks(std::shared_ptr<Times> times) : times_(std::move(times)) {}
  std::shared_ptr<Solver> wrap_solver(std::string_view, std::shared_ptr<Solver> solver) const override {
    return std::make_shared<TickedSolver>(std::move(solver), times_);
  }
  std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const override {
    return std::make_unique<TimedMethod>(std::move(method), times_);
  }

 private:
  std::shared_ptr<Times> times_;
};

/// Estimates along a winding drive.
void run(benchmark::State& state, Robot robot) {
  constexpr int settling = 30, steps = 200;
  const auto times = std::make_shared<Times>();
  robot.add_hooks(std::make_shared<TimingHooks>(times));
  const Model& model = *robot.model();
  const double step = robot.step();
  while (state.KeepRunning()) {
    std::mt19937 random(1);  // NOLINT(cert-msc32-c,cert-msc51-cpp): the same noise each time
    std::normal_distribution<double> normal;
    const auto estimator = robot.make_estimator();
    double truth[4] = {0.0, 0.0, 0.1, 0.0}, next[4], outputs[3];
    for (int k = 0; k < settling + steps; ++k) {
      const double time = k * step;
      const double inputs[2] = {8.0, 0.3 * std::cos(time)}, slip[2] = {0.7 + 0.1 * std::sin(0.5 * time), 0.9};
      model.observe({.count = 1, .states = truth, .outputs = outputs});
      for (int j = 0; j < 3; ++j) outputs[j] += robot.output_sigmas()[j] * normal(random);
      estimator->push_measurement(time, outputs);
      if (estimator->estimate(time).fallback) throw Error("an estimate failed");
      estimator->push_input(time, inputs);
      model.integrate(
          {.count = 1, .states = truth, .inputs = inputs, .parameters = slip, .durations = &step, .next_states = next});
      std::copy_n(next, 4, truth);
    }
    const auto forget_settling = [](std::vector<double>& of) {
      of.erase(of.end() - settling - steps, of.end() - steps);
    };
    times->add_node.insert(times->add_node.end() - (settling + steps - 1), 0.0);  // the first sample does not call it
    for (auto* of : {&times->add_node, &times->solve, &times->covariance, &times->rest_of_estimate})
      forget_settling(*of);
  }
  state.counters["add_node_us"] = sim::spread_of(times->add_node).median;
  state.counters["solve_us"] = sim::spread_of(times->solve).median;
  state.counters["covariance_us"] = sim::spread_of(times->covariance).median;
  state.counters["covariance_p99_us"] = sim::spread_of(times->covariance).p99;
  state.counters["rest_us"] = sim::spread_of(times->rest_of_estimate).median;
}

void register_all() {
  const Host host;
  for (const Drive& how : usual_drives()) {
    if (!how.name.starts_with("figure8/")) continue;
    Settings settings = load_yaml(how.scenario);
    for (const std::string& assignment : how.assignments) apply_assignment(settings, assignment);
    const Robot robot = sim::Scenario(host, settings).robot();
    add_benchmark("covariance/" + how.name, [robot](benchmark::State& state) { run(state, robot); });
  }
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) { return rhec::bench::run_program(count, words, rhec::bench::register_all); }
