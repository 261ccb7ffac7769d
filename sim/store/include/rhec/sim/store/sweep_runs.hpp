#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// Of one seed: the measures, or none where the run was not completed. NaN where a run does not have one.
struct SeedOutcome {
  std::optional<std::int64_t> seed;
  std::vector<double> values;  ///< as many as measures were known then; empty: not completed
};

/// Runs of one configuration, which differ in their seed alone.
struct RunGroup {
  std::map<std::string, std::string> keys;  ///< dotted keys and their values as JSON, without the seed
  std::vector<SeedOutcome> outcomes;
};

/// What a sweep's database holds.
struct SweepRuns {
  std::vector<std::string> measures;  ///< "mae.kappa", "rhe.median", ...
  std::vector<RunGroup> groups;
  std::map<std::string, std::int64_t> statuses;
  std::vector<std::string> programs;
  std::int64_t total = 0;
};

/// Throws Error for a file that is no database of this version, is cut off, or has no runs.
RHEC_EXPORT SweepRuns read_sweep_runs(const std::filesystem::path& file);

}  // namespace rhec::sim
