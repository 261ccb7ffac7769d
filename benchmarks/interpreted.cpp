// What the interpreter costs: a step of gn_rti with a vehicle's plugin and with the same vehicle as equations, on the
// same recorded problems, in turns. Horizons have 15 and 30 intervals, with one value of every parameter; the Hessian
// is that of Gauss-Newton, or exact. The ratio is that of the median times of a step.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "program.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rti_loop.hpp"

namespace rhec::bench {
namespace {

struct Vehicle {
  const char *name, *scenario, *equations;
  std::vector<std::string> assignments = {};
};
const Vehicle vehicles[] = {
    {"bicycle_slip", "figure8", RHEC_SOURCE_DIRECTORY "/examples/vehicles/bicycle.yaml", {"path.laps=1"}},
    {"skid_steer", "skid_steer", RHEC_SOURCE_DIRECTORY "/examples/vehicles/skid_steer.yaml"},
};

/// A loop over a sequence, and the times of its steps but for the first.
class TimedLoop {
 public:
  TimedLoop(Sequence sequence, std::shared_ptr<Solver> solver)
      : sequence_(std::move(sequence)), loop_(sequence_, std::move(solver)) {}
  void pass() {
    loop_.restart();
    for (std::size_t k = 0; k < sequence_.samples.size(); ++k) {
      if (!is_usable(loop_.step().status)) throw Error(sequence_.name + ": a step failed");
      if (k > 0) times_.push_back(loop_.times().total_us());
    }
  }
  double median() const { return sim::spread_of(times_).median; }

 private:
  Sequence sequence_;
  RtiLoop loop_;
  std::vector<double> times_;
};

void add(const Host& host, const Vehicle& vehicle, int horizon) {
  Drive how{.name = vehicle.name,
            .scenario = std::string(RHEC_SOURCE_DIRECTORY "/scenarios/") + vehicle.scenario + ".yaml",
            .assignments = vehicle.assignments};
  for (const char* section : {"estimator", "controller"})
    how.assignments.push_back(std::string(section) + ".horizon=" + std::to_string(horizon));
  how.assignments.emplace_back("blocking={}");
  for (auto& recorded : record(host, how)) {
    const auto records = std::make_shared<const std::vector<sim::ProblemRecord>>(std::move(recorded));
    const std::string kind = records->front().kind;
    for (const std::string hessian : {"gauss_newton", "exact"}) {
      const auto run = [host, records, vehicle, hessian](benchmark::State& state) {
        const sim::ProblemRecord& first = records->front();
        const auto make = [&](const std::string& model) {
          return std::make_unique<TimedLoop>(
              sequence_of(*records, host.make_model(model, first.model_options)),
              host.make_solver("gn_rti", parse_yaml("{hessian: " + hessian + "}", "benchmark")));
        };
        const auto compiled = make(first.model), interpreted = make(vehicle.equations);
        while (state.KeepRunning()) {
          compiled->pass();
          interpreted->pass();
        }
        state.counters["compiled_us"] = compiled->median();
        state.counters["interpreted_us"] = interpreted->median();
        state.counters["ratio"] = interpreted->median() / compiled->median();
      };
      std::string name = "interpreted/";
      name.append(vehicle.name).append("/").append(kind).append("/").append(std::to_string(horizon)).append("/");
      add_benchmark(name.append(hessian), run);
    }
  }
}

void register_all() {
  const Host host;
  for (const Vehicle& vehicle : vehicles)
    for (const int horizon : {15, 30}) add(host, vehicle, horizon);
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) { return rhec::bench::run_program(count, words, rhec::bench::register_all); }
