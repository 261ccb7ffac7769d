#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/check/finding.hpp"
#include "rhec/sim/numbers/spread.hpp"

/// Checks of a new model before its first run; docs/check.md explains each.
namespace rhec::sim {

/// Information that one estimation horizon of a drive contains, without a prior, about its initial state and the
/// parameters. Measured inputs are unknowns too, measured with their noise.
struct DriveInformation {
  std::string name;     ///< "straight", "turn", "slalom" or "standing"
  std::string meaning;  ///< a phrase with the speed
  int unknowns = 0;     ///< entries of the state, blocks of parameters, and errors of sensors where these are unknown
  int rank = 0;         ///< singular values of the square root of the information, in scales, above rank_threshold
                        ///< times the largest
  double condition = 0.0;               ///< of that square root, over those singular values
  std::vector<double> parameter_sigma;  ///< by parameter: attainable standard deviation (Cramer-Rao) of the
                                        ///< best-determined block; infinite if none is determined
  std::vector<bool> state_determined;   ///< by state
  std::vector<double> error_sigma;  ///< by error of a sensor that is unknown (ModelCheckOptions), as parameter_sigma
  std::vector<std::string> undetermined;  ///< combinations of unknowns, each in its scale: "0.71 x - 0.71 p"
  std::string weakest;                    ///< the least determined of the determined combinations
  std::string unusable;                   ///< why the analysis failed; empty: it succeeded
};
inline constexpr double rank_threshold = 1e-8;

/// Evaluation times per stage, in a range of 16 stages, with one instruction set [ns].
struct EvaluationTimes {
  std::string instruction_set;
  Spread values, jacobians, hessians, outputs;  ///< hessians: NaN if the model has none
};

struct RHEC_EXPORT ModelCheck {
  std::string model;
  std::uint64_t seed = 0;
  std::vector<std::string> parameters, states;
  std::vector<Finding> findings;  ///< in the order of the checks, at least one per check
  std::vector<DriveInformation> drives;
  std::vector<EvaluationTimes> times;

  int count(Verdict verdict) const;
  Verdict verdict() const;  ///< fail or warn if there is such a finding, else pass
};

struct ModelCheckOptions {
  std::uint64_t seed = 1;
  int samples = 4096;                ///< in the search for NaN
  std::optional<double> speed = {};  ///< ground speed of the drives [m/s]; none: derived from the inputs' scales
  double interval = 0.2;             ///< [s]
  int horizon = 15;                  ///< intervals; capped at `longest_horizon`
  std::optional<int> substeps = {};  ///< none: as many as the model needs
  /// Standard deviations; empty: as in Robot. Clamped to between 1e-9 and 1e9 scales.
  std::vector<double> output_sigmas = {}, input_sigmas = {};
  /// Which outputs have a bias or a scale error that is estimated: judged are these, and the parameters beside them.
  std::vector<int> biased = {}, scaled = {};
  /// What is known of these errors without measurements, as standard deviations; empty: nothing.
  std::vector<double> bias_sigmas = {}, scale_sigmas = {};
  std::vector<std::shared_ptr<const Blocking>> blockings = {};  ///< by parameter; empty: one value over the horizon
  static constexpr int longest_horizon = 100;
};

/// Runs all checks of a model within the bounds of `within`, which describes the same variables. If errors in the
/// description make the model unusable (no scale, a role without a variable), skips the other checks. On return the
/// model uses its fastest instruction set, as after construction. Throws Error if the options do not fit the model.
RHEC_EXPORT ModelCheck check_model(Model& model, const ModelDescription& within, const ModelCheckOptions& options = {});
RHEC_EXPORT ModelCheck check_model(Model& model, const ModelCheckOptions& options = {});

/// Checks a robot's model, with the robot's noise, bounds, step, horizon and blocking instead of those of `options`.
RHEC_EXPORT ModelCheck check_model(const Host& host, const Robot& robot, ModelCheckOptions options = {});

/// As a JSON object; non-finite numbers become null.
RHEC_EXPORT std::string check_json(const ModelCheck& check);

}  // namespace rhec::sim
