#pragma once

#include <map>
#include <string>

#include "rhec/sim/store/sweep_runs.hpp"

namespace rhec::sim {

/// A group of a sweep: values as JSON by their keys, and so many runs.
inline RunGroup group_of(std::map<std::string, std::string> keys, int runs = 1) {
  RunGroup group;
  group.keys = std::move(keys);
  for (int seed = 1; seed <= runs; ++seed) group.outcomes.push_back({seed, {}});
  return group;
}

}  // namespace rhec::sim
