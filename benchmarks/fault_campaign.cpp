// Rides of estimators along drives on which something goes wrong. Reads jobs from the standard input, one object of
// JSON a line, and answers each with one:
//
//     {"scenario": "scenarios/figure8.yaml", "set": ["speed=5"], "samples": 400,
//      "riders": {"rhe": ["estimator.name=rhe"]}, "calm": {"rhe, trusting": ["estimator.health.watch=false"]},
//      "faults": {"spike": {"samples": 200, "list": "[{kind: spike, start: 9, sensors: [x_gps, y_gps], size: 100}]"}}}
//
// A drive is steered by what the simulation knows, so it is the same for all. First it is driven without faults, with
// the estimators `riders` and `calm`; then with each list of faults, with `riders`. The answer has what FaultMeasures
// and CalmMeasures say, by estimator and fault, or "error". scripts/fault-campaign makes the jobs, and tables of the
// answers.
#include <cstdlib>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/fault_measures.hpp"

namespace rhec::bench {
namespace {

using Assignments = std::vector<std::string>;

sim::Scenario scenario_with(const Host& host, const Settings& base, std::initializer_list<Assignments> all) {
  Settings settings = base;
  for (const Assignments& assignments : all)
    for (const std::string& assignment : assignments) apply_assignment(settings, assignment);
  return {host, settings};
}

std::vector<sim::Ride> ride(const Host& host, const Settings& base, const Assignments& drive,
                            const std::vector<Assignments>& estimators, int samples) {
  std::vector<sim::Scenario> riders;
  riders.reserve(estimators.size());
  for (const Assignments& estimator : estimators) riders.push_back(scenario_with(host, base, {drive, estimator}));
  return sim::ride_along(scenario_with(host, base, {drive}), riders, samples);
}

sim::Json answer(const Host& host, const sim::Json& job) {
  const Settings base = load_yaml(job.at("scenario").as_text());
  const auto drive = job.at("set").get<Assignments>();
  const int samples = job.at("samples").get<int>();
  std::vector<std::string> names;
  std::vector<Assignments> estimators;
  for (const char* group : {"riders", "calm"})
    for (const auto& [name, assignments] : job.at(group).items()) {
      names.push_back(name);
      estimators.push_back(assignments.get<Assignments>());
    }
  const std::vector<sim::Ride> without = ride(host, base, drive, estimators, samples);
  sim::Json result = {{"calm", sim::Json::object()}, {"faults", sim::Json::object()}, {"steps", 0}};
  std::int64_t steps = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    result["calm"][names[i]] = json_of(sim::measure_calm(without[i]));
    steps += std::ssize(without[i].samples);
  }
  estimators.resize(job.at("riders").size());
  for (const auto& [kind, fault] : job.at("faults").items()) {
    Assignments faulty = drive;
    faulty.push_back("faults=" + fault.at("list").as_text());
    const int wanted = fault.at("samples").get<int>();
    const std::vector<sim::Ride> rides = ride(host, base, faulty, estimators, wanted);
    for (std::size_t i = 0; i < rides.size(); ++i) {
      if (std::ssize(rides[i].samples) != wanted)
        throw Error(kind + ": the path ends before the ride does; choose a longer path");
      result["faults"][kind][names[i]] = json_of(sim::measure_fault(rides[i], without[i]));
      steps += wanted;
    }
  }
  result["steps"] = steps;
  result["after"] = std::vector<int>(sim::recovery_samples.begin(), sim::recovery_samples.end());
  return result;
}

}  // namespace
}  // namespace rhec::bench

int main() try {
  const rhec::Host host;
  for (std::string line; std::getline(std::cin, line);) {
    rhec::sim::Json result;
    try {
      result = rhec::bench::answer(host, rhec::sim::Json::parse(line));
    } catch (const rhec::Error& mistake) {
      result = {{"error", mistake.what()}};
    } catch (const rhec::sim::JsonError& mistake) {
      result = {{"error", mistake.what()}};
    }
    std::cout << result.dump() << std::endl;
  }
} catch (const std::exception& failure) {
  std::cerr << "fault_campaign: " << failure.what() << '\n';
  return EXIT_FAILURE;
}
