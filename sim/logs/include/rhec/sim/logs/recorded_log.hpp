#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "rhec/core/estimation/estimator.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/problems/recording_solver.hpp"

namespace rhec::sim {

/// The section `log` of a scenario: how a drive was recorded, and what its columns mean to the model.
struct LogOptions {
  double wheel_offset = 0.0;    ///< the speed was measured at a wheel this far left of the axle's middle [m]
  double steering_bias = 0.0;   ///< the steering's reading when driving straight [rad]
  double fix_delay = 0.0;       ///< how much later than the dead reckoning a fix is stamped [s]
  double agreement = 1.0;       ///< a fix agrees with its neighbours where it is this near to the line between them [m]
  double neighbour_time = 1.0;  ///< and they are this near in time [s]
  std::vector<std::string> position{"x_gps", "y_gps"};  ///< outputs that a fix measures
  std::string steering = "delta";                       ///< output that the steering's reading is
  std::string speed = "u1", steering_rate = "u2";       ///< inputs
  static const OptionTable<LogOptions>& table();
};

/// A scenario for recorded data: the keys of RobotOptions, how the log was recorded, and what to run side by side.
struct LogScenarioOptions : RobotOptions {
  std::string name = "log";
  Settings log, variants;
  static const OptionTable<LogScenarioOptions>& table();
};

/// The sections that a scenario for recorded data has beside those of a robot.
RHEC_EXPORT std::vector<OptionSection> log_sections();

/// One of the estimators that run side by side: the scenario with the keys of its variant put over it.
struct LogVariant {
  std::string name;
  Robot robot;
};

/// A scenario for recorded data with all that it names made. Throws Error for whatever is wrong, naming file, line and
/// key. Without `variants` it is one variant itself; `chosen` (where not empty) are the names of those to be made.
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
  double time = 0.0;                   ///< [s]; rows of one stamp are spread evenly until the next
  double stamp = 0.0;                  ///< as recorded: when the row is known
  double speed = 0.0, steering = 0.0;  ///< of the axle's middle [m/s], without the bias [rad]
};
/// A measured position; NaN where a coordinate is missing.
struct Fix {
  double time = 0.0, x = 0.0, y = 0.0;  ///< [s], [m]
  std::int64_t line = 0;                ///< of the file
  bool agrees = false;                  ///< with its neighbours, whether these are withheld or not
};

/// A drive as it was recorded.
struct RecordedLog {
  std::vector<DeadReckoning> rows;
  std::vector<Fix> fixes;
  std::int64_t missing_speeds = 0, missing_steerings = 0, missing_coordinates = 0;
};
/// Reads dead reckoning (time, wheel speed, steering angle) and fixes (time, x, y), comma-separated, without a header.
/// Missing readings are masked and counted. Throws Error naming file and line for all that is no such log.
RHEC_EXPORT RecordedLog read_recorded_log(const std::filesystem::path& dead_reckoning, const std::filesystem::path& gps,
                                          const LogScenario& scenario);

/// Which fixes are withheld from the estimator, so that they can be predicted: those whose place in the file, counted
/// from 0, leaves the rest `phase` when divided by `every`; every = 0: none.
struct HoldOut {
  int every = 0;
  int phase = 0;
  bool holds(std::size_t fix) const noexcept {
    return every > 0 && fix % static_cast<std::size_t>(every) == static_cast<std::size_t>(phase);
  }
};

/// An estimate at a node, or the prediction of a fix that was withheld.
struct LoggedEstimate {
  double time = 0.0;
  Eigen::VectorXd values, sigmas;  ///< of [state; parameters]
  std::int64_t fix = -1;           ///< the place of the fix at this time; -1: a node between fixes
  bool held_out = false;
  double residual = std::numeric_limits<double>::quiet_NaN();  ///< distance of the fix from the estimate [m]
  bool fallback = false;
};
struct Replay {
  std::string name;  ///< of the variant, for files and pictures
  std::vector<LoggedEstimate> estimates;
  Estimator::Counts counts;
  std::int64_t unpredicted = 0;  ///< withheld fixes before there was an estimate
  std::vector<double> solve_us;  ///< preparation and feedback of each solve [us]
  double seconds = 0.0;          ///< of the whole replay
};
/// Drives through a log with an estimator made anew: everything is pushed in the order in which it became known, and
/// the estimator is asked at each node. Nodes lie at the fixes that are not withheld and at most the robot's step
/// apart; between fixes they measure the steering alone. A withheld fix is asked for at its time and leaves no trace.
RHEC_EXPORT Replay replay(const Robot& robot, const RecordedLog& log, const LogOptions& options,
                          const HoldOut& hold_out, const LoopHooks& hooks = {});

/// How well withheld fixes were predicted.
struct PredictionErrors {
  std::int64_t count = 0;
  double median = 0.0;       ///< [m]
  double rmse_capped = 0.0;  ///< root mean square, an error above `error_cap` counting as that [m]
};
constexpr double error_cap = 5.0;
struct HeldOutSummary {
  PredictionErrors all, consistent;  ///< consistent: fixes that agree with their neighbours
};
/// A withheld fix of which there was no prediction counts with the cap.
RHEC_EXPORT HeldOutSummary summarise(const Replay& replay, const RecordedLog& log);

/// The files of a replay. The picture shows one, and the parameters of another one beside it.
RHEC_EXPORT std::string estimates_csv(const std::vector<Replay>& replays, const RecordedLog& log,
                                      const LogScenario& scenario);
RHEC_EXPORT std::string summary_json(const std::vector<Replay>& replays, const RecordedLog& log,
                                     const LogScenario& scenario, const HoldOut& hold_out);
RHEC_EXPORT std::string times_csv(const std::vector<Replay>& replays);
RHEC_EXPORT std::string replay_svg(const Replay& replay, const RecordedLog& log, const LogScenario& scenario,
                                   const Replay* beside = nullptr);

}  // namespace rhec::sim
