#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rhec/sim/files/json.hpp"
#include "rhec/sim/replay/drive_replay.hpp"

namespace rhec::sim {

/// Innovations of one sensor.
struct SensorSummary {
  std::string name;
  std::int64_t used = 0, rejected = 0;
  double nis = 0.0;       ///< mean of those used, normalised innovation squared; NaN without any
  double expected = 0.0;  ///< mean number of values of a measurement: what the NIS is to be
  struct Output {
    std::string name, unit;
    double rms = 0.0;          ///< of the innovations used
    double expected = 0.0;     ///< root mean square of their stated standard deviations
    double correlation = 0.0;  ///< between an innovation and the next; 0 to be expected
  };
  std::vector<Output> outputs;
};

/// How well withheld measurements were predicted.
struct AccuracySummary {
  std::string sensor;
  std::int64_t count = 0, unpredicted = 0;
  double median = 0.0, rms = 0.0, most = 0.0;  ///< of the distance
  std::vector<SensorSummary::Output> outputs;  ///< `rms` alone
};

/// The entry that belongs to an output of the model, of what an innovation has of its sensor's outputs: `values` or
/// `sigmas`. NaN for outputs of other sensors, and where some are missing, since it is not known which.
RHEC_EXPORT double of_output(const std::vector<double>& entries, const DriveInnovation& innovation,
                             const DriveReplay& replay, int output) noexcept;

RHEC_EXPORT std::vector<SensorSummary> summarise_innovations(const DriveReplay& replay, const Robot& robot);
RHEC_EXPORT AccuracySummary summarise_predictions(const DriveReplay& replay, const Robot& robot);

/// A drive estimated by one variant: with all its measurements, and, for its accuracy, with some withheld.
struct DriveResult {
  DriveReplay all, withheld;
};

/// The files of a drive. Rows of a result that has a smoothed estimate are in `all`.
RHEC_EXPORT std::string drive_estimates_csv(const std::vector<DriveResult>& results, const Robot& robot);
/// What was measured of the outputs, in the order of arrival, and which of it `result` predicted without having seen
/// it.
RHEC_EXPORT std::string measurements_csv(const DriveResult& result, const Robot& robot, const logs::Drive& drive);
RHEC_EXPORT std::string innovations_csv(const std::vector<DriveResult>& results, const Robot& robot);
RHEC_EXPORT std::string predictions_csv(const std::vector<DriveResult>& results, const Robot& robot);
RHEC_EXPORT std::string drive_times_csv(const std::vector<DriveResult>& results);
RHEC_EXPORT std::string drive_summary_json(const std::vector<DriveResult>& results, const std::string& name,
                                           const Robot& robot, const logs::Drive& drive, const std::string& log,
                                           const HoldOut& hold_out);
RHEC_EXPORT std::string drive_svg(const DriveResult& result, const std::string& title, const Robot& robot,
                                  const logs::Drive& drive, const DriveReplay* beside = nullptr);

}  // namespace rhec::sim
