#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "rhec/core/place/slip_map.hpp"
#include "rhec/plugins/robot/memory_section.hpp"

namespace rhec::sim {

/// What the file of a map holds: one SQLite database that any machine can read (docs/rooms/sim.md).
struct RHEC_EXPORT SlipMapContent {
  MapIdentity identity;
  double cell = 0.0;  ///< side of the lattice's cells [m]
  std::vector<SlipMap::Cell> cells;

  /// Time of the newest cell; 0 of an empty map [s].
  double newest() const noexcept;
};

/// Reads a map. Throws Error, naming the file, if there is none, if it is no map of slip or one of another version, if
/// it is cut short, or if a number in it cannot be right.
RHEC_EXPORT SlipMapContent read_slip_map(const std::filesystem::path& file);

/// Writes a map aside and moves it into place, so that the file is never half written. Throws Error if it cannot be
/// written; the file is then as it was.
RHEC_EXPORT void write_slip_map(const std::filesystem::path& file, const SlipMapContent& content);

/// Why a map cannot be used for, or merged with, what has the other identity; empty if it can.
RHEC_EXPORT std::string why_not(const MapIdentity& map, const MapIdentity& wanted);

/// Merges the content into a map whose origin is that of `identity`. Throws Error, naming the file, if the vehicles,
/// frames or cells differ.
RHEC_EXPORT void merge_slip_map(const SlipMapContent& content, const std::filesystem::path& file,
                                const MapIdentity& identity, SlipMap& map);

}  // namespace rhec::sim
