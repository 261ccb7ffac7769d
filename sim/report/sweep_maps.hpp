#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "rhec/sim/files/json.hpp"
#include "sweep_settings.hpp"

namespace rhec::sim {

/// The values of one axis, choice or setting, as JSON texts.
using Setting = std::vector<std::string>;

/// The groups of one cell of a map: one group, or several that are averaged.
using Cell = std::vector<const RunGroup*>;

struct SweepMap {
  Setting setting;
  bool is_blocking = false;
  std::map<std::pair<std::string, std::string>, Cell> cells;  ///< by the values on the axes
  const RunGroup *reference = nullptr, *unblocked = nullptr;
  std::int64_t runs() const;
};

struct SweepAxis {
  std::string key, label;
  std::vector<std::string> values;
};

/// The groups of a sweep, arranged in maps.
struct SweepMaps {
  std::vector<SweepAxis> axes;
  std::vector<VariedKey> choice_keys;  ///< the keys whose values are the maps' settings
  std::vector<SweepMap> maps;
  std::vector<const RunGroup*> others;  ///< groups on no map
};

/// Maps over block length and overlap, for a sweep of blockings.
SweepMaps blocking_maps(const std::vector<RunGroup>& groups, const SweepSettings& settings, Json& notes);
/// Maps over any keys.
SweepMaps general_maps(const std::vector<RunGroup>& groups, const SweepSettings& settings, Json& notes);

}  // namespace rhec::sim
