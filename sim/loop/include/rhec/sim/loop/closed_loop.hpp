#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rhec/sim/problems/recording_solver.hpp"

namespace rhec::sim {

/// One sample of a closed loop, all at the time of its node.
struct Sample {
  std::int64_t step = 0;
  double time = 0.0;
  Eigen::VectorXd true_state, true_parameters;  ///< parameters: those of the ground at the vehicle's position
  Eigen::VectorXd state, parameters;            ///< estimated
  Eigen::VectorXd sigma;                        ///< standard deviations of [state; parameters]; empty if unknown
  double nees = 0.0;  ///< normalised estimation error squared of [state; parameters]; NaN without covariance
  std::vector<double> inputs;
  PathPoint reference;
  double tracking = 0.0;       ///< signed distance of the true position from the path [m]
  double heading_error = 0.0;  ///< true heading - that of the path there, in (-pi, pi]; 0 without a heading [rad]
  Status estimator_status = Status::solved, controller_status = Status::solved;
  bool estimator_fallback = false, controller_fallback = false, relaxed = false;
  HealthLevel health = HealthLevel::ok;            ///< of the estimate
  std::string findings = {};                       ///< why it is not ok, in words
  double estimator_us = 0.0, controller_us = 0.0;  ///< preparation and feedback of the solvers [us]
  std::string faults = {};             ///< what went wrong since the last sample: kinds joined by '+'; empty: nothing
  double estimator_feedback_us = 0.0;  ///< of this, the time after the measurement [us]
};

/// How a limit of the controller's terms was kept: by what the plans said of the sample that followed.
struct LimitRecord {
  std::int64_t violated = 0;  ///< samples in which it was not, by more than rounding and a step's tolerance
  double most = 0.0;          ///< by how much at most, in the limit's unit
};

struct RunLog {
  std::vector<Sample> samples;
  bool completed = false;  ///< the end of the path was reached
  std::string ended = {};  ///< why the run ended
  /// By output, what the estimator has learnt of its noise at the end; empty for one that does not adapt.
  std::map<std::string, EstimationMethod::OutputNoise> noise = {};
  Estimator::Counts counts = {};                   ///< of the estimator
  std::map<std::string, LimitRecord> limits = {};  ///< of the controller's terms, by name
};

/// Runs estimator -> controller -> ground truth until the path ends, the vehicle is lost, or the run takes far too
/// long.
RHEC_EXPORT RunLog run_closed_loop(const Scenario& scenario, const LoopHooks& hooks = {});

/// Errors of a run, mean absolute or root mean square.
struct ErrorSummary {
  std::map<std::string, double> parameters;  ///< by the model's names
  double position = 0.0;                     ///< Euclidean [m]
  double heading = 0.0;                      ///< [rad]
  double tracking = 0.0;                     ///< distance of the true position from the path [m]
};
/// How an estimator's covariance compares with its errors.
enum class Certainty { unknown, too_certain, right, too_cautious };
struct RunSummary {
  std::int64_t steps = 0;
  bool completed = false;
  std::string ended;
  ErrorSummary mae, rmse;
  ErrorSummary mae_after_start;  ///< without the first N_e samples
  double nees = 0.0;             ///< mean
  int nees_expected = 0;         ///< its expected value, the number of states and parameters
  /// Share of the samples whose truth is within two standard deviations of the estimate, by state and parameter; empty
  /// without a covariance. .954 is to be expected.
  std::map<std::string, double> within_two_sigma;
  Certainty certainty = Certainty::unknown;
  std::map<std::string, EstimationMethod::OutputNoise> noise;  ///< as in RunLog
  Spread estimator_us, controller_us;                          ///< zeros without solves
  std::map<std::string, std::int64_t> estimator_statuses, controller_statuses;
  std::int64_t fallbacks = 0;  ///< solves with unusable results
  std::int64_t solves = 0;
  Estimator::Counts counts;                    ///< of the estimator
  std::map<std::string, LimitRecord> limits;   ///< as in RunLog
  std::map<std::string, std::int64_t> health;  ///< samples by the level of the estimate's health
};
/// From where on a covariance is called wrong: mean NEES in units of its expected value, and the share of samples
/// within two standard deviations.
inline constexpr double most_nees = 1.5, least_nees = 0.5, least_share = 0.9;
/// Judges by these.
RHEC_EXPORT Certainty certainty_of(const RunSummary& summary) noexcept;
/// "too certain", "right", "too cautious"; empty if unknown.
RHEC_EXPORT std::string_view name_of(Certainty certainty) noexcept;
RHEC_EXPORT RunSummary summarise(const RunLog& log, const Scenario& scenario);

}  // namespace rhec::sim
