#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// The measures of one seed's run; empty if the run was not completed. NaN for a measure that a run does not have.
struct SeedOutcome {
  std::optional<std::int64_t> seed;
  std::vector<double> values;  ///< one per measure known at that time; empty: not completed
};

/// Runs of one configuration, which differ only in their seed.
struct RunGroup {
  std::map<std::string, std::string> keys;  ///< dotted keys and their values as JSON, without the seed
  std::vector<SeedOutcome> outcomes;
};

/// Content of a sweep's database.
struct SweepRuns {
  std::vector<std::string> measures;  ///< "mae.kappa", "rhe.median", ...
  std::vector<RunGroup> groups;
  std::map<std::string, std::int64_t> statuses;
  std::vector<std::string> programs;
  std::int64_t total = 0;
};

/// Throws Error if the file is not a database of this version, is truncated, or has no runs.
RHEC_EXPORT SweepRuns read_sweep_runs(const std::filesystem::path& file);

}  // namespace rhec::sim
