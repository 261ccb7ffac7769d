// A step of gn_rti with every vehicle that ships and with two others: the articulated loader of plugins/template, built
// as a plugin author would, and a vehicle with sizes for which the core has no kernels. Horizons have 15 intervals;
// each vehicle drives its own scenario, with one value of every parameter.
#include <benchmark/benchmark.h>

#include <memory>
#include <utility>

#include "program.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rti_loop.hpp"

namespace rhec::bench {
namespace {

constexpr const char* noise_of_two_axles =
    "noise={outputs: {x_gps: 0.03, y_gps: 0.03, front: 0.01, rear: 0.01}, inputs: {v: 0.1, front_rate: 0.02, "
    "rear_rate: 0.02}}";

struct Vehicle {
  const char* model;
  const char* scenario;
  std::vector<std::string> assignments = {};
};
const Vehicle vehicles[] = {
    {"unicycle_traction", RHEC_SOURCE_DIRECTORY "/scenarios/unicycle_traction.yaml"},
    {"bicycle_slip", RHEC_SOURCE_DIRECTORY "/scenarios/figure8.yaml", {"path.laps=1", without_rates}},
    {"bicycle_sideslip", RHEC_SOURCE_DIRECTORY "/scenarios/bicycle_sideslip.yaml"},
    {"skid_steer", RHEC_SOURCE_DIRECTORY "/scenarios/skid_steer.yaml"},
    {"tractor_trailer", RHEC_SOURCE_DIRECTORY "/scenarios/tractor_trailer.yaml"},
    {"articulated (outside)",
     RHEC_SOURCE_DIRECTORY "/plugins/template/field.yaml",
     {"estimator.solver=gn_rti", "controller.solver=gn_rti", "controller.blocking={}"}},
    {"two_axle_steering (any size)",
     RHEC_SOURCE_DIRECTORY "/plugins/template/field.yaml",
     {"model=two_axle_steering", noise_of_two_axles, "estimator.solver=gn_rti", "controller.solver=gn_rti",
      "controller.blocking={}"}},
};

void add(const Host& host, const Vehicle& vehicle) {
  Drive how{.name = vehicle.model, .scenario = vehicle.scenario, .assignments = vehicle.assignments};
  for (const char* same : {"estimator.horizon=15", "controller.horizon=15", "blocking={}"})
    how.assignments.emplace_back(same);
  for (Sequence& sequence : drive(host, how)) {
    const auto kept = std::make_shared<Sequence>(std::move(sequence));
    const auto run = [host, kept](benchmark::State& state) {
      RtiLoop loop(*kept, host.make_solver("gn_rti"));
      std::vector<double> times;
      while (state.KeepRunning()) {
        loop.restart();
        for (std::size_t k = 0; k < kept->samples.size(); ++k) {
          if (!is_usable(loop.step().status)) throw Error(kept->name + ": a step failed");
          if (k > 0) times.push_back(loop.times().total_us());
        }
      }
      state.counters["median_us"] = sim::spread_of(times).median;
      state.counters["stage_states"] = kept->workspace->capacity().states;
      state.counters["stage_controls"] = kept->workspace->capacity().controls;
    };
    add_benchmark("models/" + kept->name, run);
  }
}

void register_all() {
  const Host host({RHEC_OUTSIDE_PLUGINS});
  for (const Vehicle& vehicle : vehicles) add(host, vehicle);
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) { return rhec::bench::run_program(count, words, rhec::bench::register_all); }
