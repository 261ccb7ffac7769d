#pragma once

#include <string>
#include <vector>

#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/scenario.hpp"

namespace rhec::sim {

/// scenarios/figure8.yaml with these assignments, for tests that are told the folder of scenarios as SCENARIOS.
inline Scenario figure8_with(const std::vector<std::string>& assignments) {
  Settings settings = load_yaml(SCENARIOS "/figure8.yaml");
  for (const std::string& assignment : assignments) apply_assignment(settings, assignment);
  return {Host(), settings};
}

}  // namespace rhec::sim
