// Numbers that have to be the same on every kind of processor, but for rounding: of each vehicle that is named,
// evaluations of its model, and one step of gn_rti on problems of estimation and of control.
//
//     machine_numbers VEHICLE ...
//
// A line is a kind, a vehicle, what it is of, and hexadecimal numbers; compare.py holds the lines of two machines
// against each other.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/random_problem.hpp"

namespace {

using rhec::HorizonProblem;
using rhec::Iterate;
using rhec::Model;
using rhec::testing::RandomProblem;

constexpr int stage_count = 15;
constexpr int seed_count = 3;

void write(const std::string& kind, const std::string& vehicle, const std::string& what,
           std::span<const double> values) {
  fmt::print("{} {} {}", kind, vehicle, what);
  for (const double value : values) fmt::print(" {:a}", value);
  fmt::print("\n");
}

/// F, h and all of their derivatives along a drive, by the kernels of an instruction set. A ramp leads from the slip of
/// an interval to that of the next.
void write_evaluations(const std::shared_ptr<const Model>& shared, const std::string& vehicle, const std::string& set) {
  const Model& model = *shared;
  const bool second = model.has_second_derivatives();
  const int nx = model.state_count(), ny = model.output_count();
  RandomProblem random(shared, 1);
  const RandomProblem::Drive drive = random.drive(random.durations(stage_count + 1, 0.05, 0.25), false);
  for (const bool ramp : {false, true}) {
    for (const int substeps : {1, 3}) {
      const int nz = nx + model.input_count() + (ramp ? 2 : 1) * model.parameter_count();
      std::vector<double> next(stage_count * nx), jacobians(stage_count * nx * nz), multipliers(stage_count * nx, 1.0),
          hessians(stage_count * nz * nz);
      model.integrate({.count = stage_count,
                       .states = drive.states.data(),
                       .inputs = drive.inputs.data(),
                       .parameters = drive.parameters.data(),
                       .parameters_end = ramp ? drive.parameters.data() + model.parameter_count() : nullptr,
                       .durations = drive.durations.data(),
                       .substeps = substeps,
                       .next_states = next.data(),
                       .jacobians = jacobians.data(),
                       .multipliers = second ? multipliers.data() : nullptr,
                       .hessians = second ? hessians.data() : nullptr});
      const std::string of = fmt::format("{}/{}/{}", set, ramp ? "ramp" : "held", substeps);
      write("evaluation", vehicle, of + "/F", next);
      write("evaluation", vehicle, of + "/dF", jacobians);
      if (second) write("evaluation", vehicle, of + "/d2F", hessians);
    }
  }
  std::vector<double> outputs(stage_count * ny), jacobians(stage_count * ny * nx), multipliers(stage_count * ny, 1.0),
      hessians(stage_count * nx * nx);
  model.observe({.count = stage_count,
                 .states = drive.states.data(),
                 .outputs = outputs.data(),
                 .jacobians = jacobians.data(),
                 .multipliers = second ? multipliers.data() : nullptr,
                 .hessians = second ? hessians.data() : nullptr});
  write("evaluation", vehicle, set + "/h", outputs);
  write("evaluation", vehicle, set + "/dh", jacobians);
  if (second) write("evaluation", vehicle, set + "/d2h", hessians);
}

/// The iterate after one step from the usual cold start.
void write_step(rhec::Solver& solver, const HorizonProblem& problem, const std::string& vehicle,
                const std::string& what) {
  solver.setup(problem);
  Iterate point = RandomProblem::cold_start(problem);
  solver.prepare(point);
  const rhec::Report report = solver.solve(point);
  if (!rhec::is_usable(report.status))
    throw rhec::Error(fmt::format("{}: {}: gn_rti made no step: {}", vehicle, what, rhec::name_of(report.status)));
  std::vector<double> values;
  for (int i = 0; i <= problem.intervals(); ++i)
    values.insert(values.end(), point.row(i), point.row(i) + point.capacity().states + point.capacity().controls);
  write("step", vehicle, what, values);
}

void write_steps(const rhec::Host& host, const std::shared_ptr<const Model>& model, const std::string& vehicle) {
  const auto solver = host.make_solver("gn_rti", rhec::parse_yaml("{mode: rti}", "options"));
  for (unsigned seed = 1; seed <= seed_count; ++seed) {
    RandomProblem random(model, seed);
    RandomProblem::RheSpec estimation;
    estimation.block = 3;
    write_step(*solver, *random.rhe(estimation), vehicle, fmt::format("rhe/{}", seed));
    write_step(*solver, *random.rhc({}), vehicle, fmt::format("rhc/{}", seed));
  }
}

}  // namespace

int main(int count, char** words) try {
  if (count < 2) throw rhec::Error("expected names of vehicles");
  const rhec::Host host;
  for (const std::string vehicle : std::span(words + 1, words + count)) {
    const std::shared_ptr<Model> model = host.make_model(vehicle);
    write_evaluations(model, vehicle, "widest");  // the set that the machine is given
    write_steps(host, model, vehicle);
    model->use_instruction_set("generic");
    write_evaluations(model, vehicle, "generic");
  }
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "machine_numbers: {}\n", error.what());
  return 1;
}
