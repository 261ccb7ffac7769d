// The floor: a hand-written step for one vehicle, from an iterate of a recorded sequence at which gn_rti took a step.
// Both steps must agree.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "floor_kernels.hpp"
#include "program.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rti_loop.hpp"

namespace rhec::bench {
namespace {

constexpr double same_step = 1e-9;

/// A problem, its guess, and the iterate after gn_rti's step.
struct Moment {
  const HorizonProblem* problem;
  Iterate guess, result;
};

bool is_bound_active(const Moment& moment) {
  const Iterate& point = moment.result;
  double largest = 0.0;
  for (int i = 0; i <= moment.problem->intervals(); ++i) {
    for (int j = 0; j < moment.problem->state_count(i); ++j)
      largest = std::max(largest, std::abs(point.state_bound(i)[j]));
    if (i == moment.problem->intervals()) break;
    for (int j = 0; j < moment.problem->control_count(i); ++j)
      largest = std::max(largest, std::abs(point.control_bound(i)[j]));
  }
  return largest > 0.0;
}

/// The first step after the middle of a sequence at which no bound is active. A controller's given slip is written to
/// its guess, since the floor also takes it as given.
Moment choose_moment(const Host& host, const Sequence& sequence) {
  RtiLoop loop(sequence, host.make_solver("gn_rti"));
  loop.keep_guess = true;
  loop.restart();
  const std::size_t count = sequence.samples.size();
  for (std::size_t k = 0; k < count; ++k) {
    const Report& report = loop.step();
    if (k < count / 2 || report.factorisations > 1) continue;
    Moment moment{&loop.problem(), loop.guess(), loop.point()};
    if (sequence.kind == "rhc") {
      for (int i = 0; i <= loop.problem().intervals(); ++i)
        std::copy_n(loop.problem().initial_state() + 4, 2, moment.guess.state(i) + 4);
      moment.result = moment.guess;
      const auto solver = host.make_solver("gn_rti");
      solver->setup(loop.problem());
      if (solver->solve(moment.result).factorisations > 1) continue;
    }
    if (!is_bound_active(moment)) return moment;
  }
  throw Error(sequence.name + ": a bound is active at every step; nothing for the floor to compute");
}

floor::Vehicle vehicle_of(const HorizonProblem& problem) {
  // The values of the scenarios and the reference problems; with others the steps would not agree.
  return {.wheelbase = 1.4, .gps_offset = 0.4, .step = problem.duration(0)};
}

void take_point(const Moment& moment, floor::Row* rows) {
  for (int i = 0; i <= moment.problem->intervals(); ++i) {
    std::copy_n(moment.guess.state(i), 6, rows[i].at);
    if (i < moment.problem->intervals()) std::copy_n(moment.guess.control(i), 2, rows[i].at + 6);
  }
}

void fill(const Moment& moment, floor::Estimation& data) {
  const auto& problem = static_cast<const RheProblem&>(*moment.problem);
  data.vehicle = vehicle_of(problem);
  take_point(moment, data.point);
  for (int i = 0; i <= problem.intervals(); ++i) {
    std::copy_n(problem.output(i), 3, data.measured[i].at);
    if (i < problem.intervals()) std::copy_n(problem.measured_input(i), 2, data.measured[i].at + 3);
  }
  for (int j = 0; j < 3; ++j) data.output_weights.at[j] = 2.0 * problem.setup().output_weights[j];
  for (int j = 0; j < 2; ++j) data.input_weights.at[j] = 2.0 * problem.setup().input_weights[j];
  for (int r = 0; r < 6; ++r) {
    data.arrival_mean.at[r] = problem.arrival_mean[r];
    for (int c = 0; c < 6; ++c) data.arrival_information[r].at[c] = 2.0 * problem.arrival_information(r, c);
  }
}

void fill(const Moment& moment, floor::Control& data) {
  const auto& problem = static_cast<const RhcProblem&>(*moment.problem);
  data.vehicle = vehicle_of(problem);
  take_point(moment, data.point);
  for (int i = 0; i <= problem.intervals(); ++i) {
    std::copy_n(moment.guess.costate(i), 4, data.costates[i].at);
    std::copy_n(problem.state_reference(i), 4, data.reference[i].at);
    if (i < problem.intervals()) std::copy_n(problem.input_reference(i), 2, data.reference[i].at + 6);
  }
  for (int j = 0; j < 4; ++j) {
    data.stage_weights.at[j] = 2.0 * problem.setup().state_weights[j];
    data.terminal_weights.at[j] = 2.0 * problem.setup().terminal_weights[j];
  }
  for (int j = 0; j < 2; ++j) data.stage_weights.at[6 + j] = 2.0 * problem.setup().input_weights[j];
  std::copy_n(problem.initial_state(), 4, data.initial_state.at);
}

/// Throws Error if the floor's step differs from gn_rti's.
void compare(const std::string& name, const Moment& moment, const floor::Workspace& work, int states) {
  double worst = 0.0;
  const auto look = [&](double ours, double theirs, double scale) {
    if (!(std::abs(ours - theirs) <= same_step * scale)) worst = std::max(worst, std::abs(ours - theirs) / scale);
    if (std::isnan(ours)) worst = INFINITY;
  };
  double largest_costate = 1.0;
  for (int i = 0; i <= moment.problem->intervals(); ++i)
    for (int j = 0; j < states; ++j) largest_costate = std::max(largest_costate, std::abs(moment.result.costate(i)[j]));
  for (int i = 0; i <= moment.problem->intervals(); ++i) {
    for (int j = 0; j < states; ++j) {
      look(work.step[i].at[j], moment.result.state(i)[j] - moment.guess.state(i)[j], 1.0);
      if (i > 0) look(work.costates[i].at[j], moment.result.costate(i)[j], largest_costate);
    }
    if (i == moment.problem->intervals()) break;
    for (int j = 0; j < 2; ++j)
      look(work.step[i].at[6 + j], moment.result.control(i)[j] - moment.guess.control(i)[j], 1.0);
  }
  if (worst > 0.0)
    throw Error(name + ": the floor's step differs from gn_rti's by " + std::to_string(worst) +
                "; expected less than " + std::to_string(same_step));
}

template <int N, class Data>
void run(benchmark::State& state, const Data& data, floor::Workspace& work) {
  std::vector<double> linearise, total;
  linearise.reserve(1 << 20);
  total.reserve(1 << 20);
  while (state.KeepRunning()) {
    const auto begin = Ticks::now();
    floor::linearise<N>(data, work);
    const auto linearised = Ticks::now();
    floor::solve<N>(data, work);
    const auto end = Ticks::now();
    benchmark::DoNotOptimize(work.step[N].at[0]);
    if (total.size() == total.capacity()) continue;
    linearise.push_back(Ticks::microseconds(begin, linearised));
    total.push_back(linearise.back() + Ticks::microseconds(linearised, end));
  }
  state.counters["median_us"] = sim::spread_of(total).median;
  state.counters["p99_us"] = sim::spread_of(total).p99;
  state.counters["linearise_us"] = sim::spread_of(linearise).median;
}

template <int N, class Data>
void add(const Host& host, const Sequence& sequence, int states) {
  const auto data = std::make_shared<Data>();
  const auto work = std::make_shared<floor::Workspace>();
  const Moment moment = choose_moment(host, sequence);
  fill(moment, *data);
  floor::prepare_constants(*data, *work);
  for (int repeat = 0; repeat < 2; ++repeat) {  // again, with the workspace that the first step left
    floor::linearise<N>(*data, *work);
    floor::solve<N>(*data, *work);
    compare(sequence.name, moment, *work, states);
  }
  add_benchmark("floor/" + sequence.name, [data, work](benchmark::State& state) { run<N>(state, *data, *work); });
}

void register_all() {
  const Host host;
  std::vector<Sequence> sequences = references_or_word(host);
  for (Sequence& own : drive(host, usual_drives().front())) sequences.push_back(std::move(own));
  for (const Sequence& sequence : sequences) {
    const int N = sequence.workspace->intervals();
    const bool blocked = sequence.name.find("/sbo") != std::string::npos;
    if (sequence.kind == "rhe" && N == 14 && !blocked) add<14, floor::Estimation>(host, sequence, 6);
    if (sequence.kind == "rhe" && N == 15 && !blocked) add<15, floor::Estimation>(host, sequence, 6);
    if (sequence.kind == "rhc" && N == 15) add<15, floor::Control>(host, sequence, 4);
  }
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) { return rhec::bench::run_program(count, words, rhec::bench::register_all); }
