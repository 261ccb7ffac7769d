#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "rhec/core/estimation/estimator.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/files/csv.hpp"
#include "rhec/sim/problems/recording_solver.hpp"

namespace rhec::sim {

/// The section `log` of a scenario: how a drive was recorded and how its columns map to the model.
struct LogOptions {
  double wheel_offset = 0.0;    ///< lateral offset of the speed-measuring wheel, left of the axle's centre [m]
  double speed_bias = 0.0;      ///< speed reading when standing [m/s]
  double speed_scale = 1.0;     ///< speed by metre of reading, without bias
  double steering_bias = 0.0;   ///< steering reading when driving straight [rad]
  double steering_scale = 1.0;  ///< steering angle by radian of reading, without bias
  double fix_delay = 0.0;       ///< delay of the fixes' time stamps relative to the speed's [s]
  double steering_delay = 0.0;  ///< delay of the steering's readings relative to the speed's [s]
  double agreement = 1.0;       ///< a fix agrees with its neighbours if it is this close to the line between them [m]
  double neighbour_time = 1.0;  ///< and they are this close in time [s]
  std::vector<std::string> position{"x_gps", "y_gps"};  ///< outputs measured by a fix
  std::string steering = "delta";                       ///< output measured by the steering sensor
  std::string speed = "u1", steering_rate = "u2";       ///< inputs
  static const OptionTable<LogOptions>& table();
};

/// A scenario for recorded data: the keys of RobotOptions, how the log was recorded, and the variants to run side by
/// side.
struct LogScenarioOptions : RobotOptions {
  std::string name = "log";
  Settings log, variants;
  RHEC_EXPORT static const OptionTable<LogScenarioOptions>& table();
};

/// Sections of a scenario for recorded data, in addition to those of a robot.
RHEC_EXPORT std::vector<OptionSection> log_sections();

/// One of the estimators that run side by side: the scenario, overridden by the keys of its variant.
struct LogVariant {
  std::string name;
  Robot robot;
  Settings settings;  ///< the scenario with the variant's keys put over it, without `variants`
};

/// A scenario for recorded data with all its objects constructed. Throws Error, naming file, line and key, if it is
/// invalid. Without `variants` the scenario is the only variant; `chosen`, if not empty, names the variants to
/// construct.
class RHEC_EXPORT LogScenario {
 public:
  LogScenario(const Host& host, const Settings& settings, const std::vector<std::string>& chosen = {});
  const std::string& name() const noexcept { return name_; }
  const LogOptions& log() const noexcept { return log_; }
  double wheelbase() const noexcept { return wheelbase_; }
  const std::vector<LogVariant>& variants() const noexcept { return variants_; }

 private:
  std::string name_;
  LogOptions log_;
  double wheelbase_ = 0.0;
  std::vector<LogVariant> variants_;
};

/// A row of dead reckoning; NaN where a reading is missing.
struct DeadReckoning {
  double time = 0.0;   ///< of the readings, by the fixes' clock [s]; rows with equal stamps are spread evenly
  double stamp = 0.0;  ///< when the row becomes available, by the same clock
  double speed = 0.0, steering = 0.0;  ///< at the axle's centre [m/s]; without bias [rad]
};
/// A measured position; NaN where a coordinate is missing.
struct Fix {
  double time = 0.0, x = 0.0, y = 0.0;  ///< [s], [m]
  std::int64_t line = 0;                ///< in the file
  bool agrees = false;                  ///< with its neighbours, withheld or not
};

/// A recorded drive.
struct RecordedLog {
  std::vector<DeadReckoning> rows;
  std::vector<Fix> fixes;
  std::int64_t missing_speeds = 0, missing_steerings = 0, missing_coordinates = 0;
};
/// The files of a drive as they are, before anything of a scenario is applied to them.
struct LogTables {
  CsvTable rows, fixes;
};
/// Reads dead reckoning (time, wheel speed, steering angle) and fixes (time, x, y), comma-separated, without a header.
/// Missing readings are masked and counted. Throws Error, naming file and line, if a file is not such a log.
RHEC_EXPORT LogTables read_log_tables(const std::filesystem::path& dead_reckoning, const std::filesystem::path& gps);
/// What the tables mean to a scenario: its biases, scales and delays taken out.
RHEC_EXPORT RecordedLog recorded_log(const LogTables& tables, const LogScenario& scenario);
/// Both.
RHEC_EXPORT RecordedLog read_recorded_log(const std::filesystem::path& dead_reckoning, const std::filesystem::path& gps,
                                          const LogScenario& scenario);

/// Fixes withheld from the estimator to test its predictions: those with zero-based index i in the file where i mod
/// `every` = `phase`; every = 0: none.
struct HoldOut {
  int every = 0;
  int phase = 0;
  bool holds(std::size_t fix) const noexcept {
    return every > 0 && fix % static_cast<std::size_t>(every) == static_cast<std::size_t>(phase);
  }
};

/// An estimate at a node, or the prediction of a withheld fix.
struct LoggedEstimate {
  double time = 0.0;
  Eigen::VectorXd values, sigmas;  ///< of [state; parameters]
  std::int64_t fix = -1;           ///< index of the fix at this time; -1: a node between fixes
  bool held_out = false;
  double residual = std::numeric_limits<double>::quiet_NaN();  ///< distance of the fix from the estimate [m]
  bool fallback = false;
};
struct Replay {
  std::string name;  ///< of the variant, for files and figures
  std::vector<LoggedEstimate> estimates;
  Estimator::Counts counts;
  std::int64_t unpredicted = 0;  ///< withheld fixes before the first estimate
  std::vector<double> solve_us;  ///< preparation and feedback of each solve [us]
  double seconds = 0.0;          ///< of the whole replay
};
/// Replays a log through a new estimator: pushes all data in the order in which it became available and queries the
/// estimator at each node. Nodes lie at the fixes that are not withheld and at most the robot's step apart; nodes
/// between fixes measure only the steering. At the time of a withheld fix the estimator is queried without changing its
/// state.
RHEC_EXPORT Replay replay(const Robot& robot, const RecordedLog& log, const LogOptions& options,
                          const HoldOut& hold_out, const LoopHooks& hooks = {});

/// Prediction errors of withheld fixes.
struct PredictionErrors {
  std::int64_t count = 0;
  double median = 0.0;       ///< [m]
  double rmse_capped = 0.0;  ///< root mean square of errors capped at `error_cap` [m]
};
constexpr double error_cap = 5.0;
struct HeldOutSummary {
  PredictionErrors all, consistent;  ///< consistent: fixes that agree with their neighbours
};
/// A withheld fix without a prediction counts as `error_cap`.
RHEC_EXPORT HeldOutSummary summarise(const Replay& replay, const RecordedLog& log);

/// The files of a replay. The figure shows one replay and compares its parameters with another one's.
RHEC_EXPORT std::string estimates_csv(const std::vector<Replay>& replays, const RecordedLog& log,
                                      const LogScenario& scenario);
RHEC_EXPORT std::string summary_json(const std::vector<Replay>& replays, const RecordedLog& log,
                                     const LogScenario& scenario, const HoldOut& hold_out);
RHEC_EXPORT std::string times_csv(const std::vector<Replay>& replays);
RHEC_EXPORT std::string replay_svg(const Replay& replay, const RecordedLog& log, const LogScenario& scenario,
                                   const Replay* beside = nullptr);

}  // namespace rhec::sim
