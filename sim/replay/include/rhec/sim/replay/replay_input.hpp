#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/replay/drive_smoothing.hpp"
#include "rhec/sim/replay/replay_scenario.hpp"
#include "rhec/sim/replay/replay_summary.hpp"

namespace rhec::sim {

/// A log that the variants of a scenario are to estimate.
struct RHEC_EXPORT ReplayInput {
  /// Throws Error if the log does not have what a variant asks for.
  ReplayInput(ReplayScenario asking, const HoldOut& withheld, const logs::Log& recorded);
  /// About how many estimates a variant makes.
  std::int64_t estimates(std::size_t variant) const;
  ReplayScenario scenario;
  HoldOut hold_out;
  std::string log;                  ///< its name
  std::vector<logs::Drive> drives;  ///< by variant: each has signals of its own
};

/// A variant's estimates with all measurements, and, if some are to be withheld, predictions by a replay of its own.
/// Progress counts both; other hooks see the first, and `withheld_robot` is added to the robot of the second.
RHEC_EXPORT DriveResult estimate_variant(const ReplayInput& input, std::size_t variant, const LoopHooks& hooks,
                                         std::shared_ptr<const RobotHooks> withheld_robot = {});

/// A variant with hindsight: `all` as by `smooth_drive` with all measurements; `withheld` has interpolations.
struct SmoothedVariant {
  SmoothedDriveReplay all;
  DriveReplay withheld;
};
RHEC_EXPORT SmoothedVariant smooth_variant(const ReplayInput& input, std::size_t variant, const LoopHooks& hooks = {});

/// estimates.csv, measurements.csv, innovations.csv, predictions.csv, times.csv, summary.json and run.svg, whose curves
/// are those of the first result, with `beside` behind them. The folder is not committed. Returns the text of
/// summary.json.
RHEC_EXPORT std::string write_drive_files(OutputFolder& folder, const ReplayInput& input,
                                          const std::vector<DriveResult>& results, const DriveReplay* beside = nullptr);

}  // namespace rhec::sim
