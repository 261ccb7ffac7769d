// Errors of closed loops, for loops.py: runs a scenario with several seeds.
//
//     machine_closed_loops SCENARIO KEY=VALUE SEEDS
//
// A line is a seed, a name and a mean absolute error; `completed` is 1 where the end of the path was reached.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <string>

#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/closed_loop.hpp"

namespace {

void run(const rhec::Host& host, const rhec::Settings& settings, int seed) {
  rhec::Settings seeded = settings;
  rhec::apply_assignment(seeded, fmt::format("seed={}", seed));
  const rhec::sim::Scenario scenario(host, seeded);
  const rhec::sim::RunSummary summary = summarise(run_closed_loop(scenario), scenario);
  const auto write = [seed](const std::string& name, double value) { fmt::print("{} {} {}\n", seed, name, value); };
  write("completed", summary.completed ? 1.0 : 0.0);
  for (const auto& [name, error] : summary.mae.parameters) write(name, error);
  write("position", summary.mae.position);
  write("heading", summary.mae.heading);
  write("tracking", summary.mae.tracking);
}

}  // namespace

int main(int count, char** words) try {
  if (count != 4) throw rhec::Error("expected a scenario, an assignment and a number of seeds");
  const rhec::Host host;
  rhec::Settings settings = rhec::load_yaml(words[1]);
  rhec::apply_assignment(settings, words[2]);
  for (int seed = 1; seed <= std::stoi(words[3]); ++seed) run(host, settings, seed);
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "machine_closed_loops: {}\n", error.what());
  return 1;
}
