#pragma once

#include <vector>

#include "rhec/logs/mapping/drive.hpp"
#include "rhec/sim/tuning/log_tuning.hpp"

namespace rhec::sim {

/// Tunes a scenario (one variant, without `variants`) on a log with the vehicle's own sensors, as `tune_on_log` does on
/// dead reckoning and fixes. Measurements of all sensors count in the likelihood; of those of the position, or of the
/// first sensor where there is none (`sensor_to_withhold`), some are withheld. Throws Error if the log has fewer than
/// `least_fixes` measurements, or the scenario is wrong.
RHEC_EXPORT LogTuning tune_on_drive(const Host& host, const Settings& settings, const logs::Drive& drive,
                                    const LogTuningOptions& options, const TuningHooks& hooks = {});

/// The numbers that are tuned on a drive: the noise of `sensors` and of inputs, delays of sensors, offsets of what they
/// and the inputs read (`signals`), lever arms, and how slip varies.
RHEC_EXPORT std::vector<Tunable> drive_tunables(const Host& host, const Robot& robot, const Settings& settings,
                                                const std::vector<Sensor>& sensors, const TuningWishes& wishes);

}  // namespace rhec::sim
