#pragma once

#include <string>
#include <utility>
#include <vector>

#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/comparison/comparison.hpp"

// What comparisons are made of, for tests that are told the folders of scenarios and of the toy solver.
namespace rhec::sim {

inline const Host& host() {
  static const Host found({TOY_FOLDER});
  return found;
}

/// A run of a second at most.
inline Settings short_scenario() {
  Settings settings = load_yaml(SCENARIOS "/figure8.yaml");
  for (const char* assignment : {"speed=10", "path.laps=1", "path.radius=8"}) apply_assignment(settings, assignment);
  return settings;
}

inline Backend backend(const std::string& label, const std::string& solver,
                       const std::vector<std::string>& assignments = {}) {
  Backend result{label, solver, Settings::map()};
  for (const std::string& assignment : assignments) apply_assignment(result.options, assignment);
  return result;
}

inline Backend converged() { return backend("converged", "gn_rti", {"mode=converge"}); }

inline ComparisonOptions comparing(std::vector<Backend> backends) {
  ComparisonOptions options;
  options.backends = std::move(backends);
  options.reference = converged();
  options.closed_loop = false;
  options.every = 1;
  return options;
}

/// Every solver there is, but for the toy.
inline std::vector<Backend> all_backends() {
  std::vector<Backend> backends{backend("rti", "gn_rti", {"mode=rti"}), converged()};
  for (const std::string& name : host().names(PluginKind::solver))
    if (name != "gn_rti" && name != "toy_solver") backends.push_back(backend(name, name));
  return backends;
}

}  // namespace rhec::sim
