#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/sim/store/sweep_runs.hpp"

namespace rhec::sim {

/// What a sweep found, a row for each setting: means over the completed runs of its seeds.
struct SweepTable {
  struct Row {
    std::vector<std::string> values;  ///< by key; "-" where the setting does not have it
    std::int64_t runs = 0, completed = 0;
    std::vector<double> means;  ///< by measure; NaN without a completed run
  };
  std::vector<std::string> keys;      ///< that differ between settings, in the order of their names
  std::vector<std::string> measures;  ///< mean absolute errors: "kappa", "position", ...
  std::vector<Row> rows;              ///< the least mean of the first measure first, those without one last
};

RHEC_EXPORT SweepTable sweep_table(const SweepRuns& runs);

}  // namespace rhec::sim
