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
#include "rhec/sim/numbers/spread.hpp"

/// What the author of a model wants to know before a first run; docs/check.md explains each check.
namespace rhec::sim {

/// `skip`: there was nothing to check, or no way to.
enum class Verdict { pass, skip, warn, fail };
RHEC_EXPORT std::string_view word_of(Verdict verdict);

struct Finding {
  std::string check;  ///< "description", "symmetry", "straight_motion", "derivatives", "numbers", "scaling",
                      ///< "observability" or "time"
  Verdict verdict = Verdict::pass;
  std::string where;                                    ///< which variable or entry; empty: the whole model
  std::string found;                                    ///< one phrase, with numbers
  std::string advice;                                   ///< what to do; empty where nothing
  std::vector<std::pair<std::string, double>> numbers;  ///< those of `found`, by name
};

/// What one estimation horizon of one drive says, without prior, of the state at its start and of the parameters.
/// Measured inputs are unknowns, too, that are measured with their noise.
struct DriveInformation {
  std::string name;        ///< "straight", "turn", "slalom" or "standing"
  std::string meaning;     ///< one phrase, with the speed
  int unknowns = 0;        ///< entries of the state and blocks of parameters
  int rank = 0;            ///< singular values of the square root of the information, in scales, above rank_threshold
                           ///< times the largest
  double condition = 0.0;  ///< of that square root, over those
  std::vector<double> parameter_sigma;  ///< by parameter: attainable standard deviation (Cramer-Rao) of the block that
                                        ///< is known best; infinite where none is determined
  std::vector<bool> state_determined;   ///< by state
  std::vector<std::string> undetermined;  ///< combinations of unknowns, each in its scale: "0.71 x - 0.71 p"
  std::string weakest;                    ///< the combination that is determined least of those that are
  std::string unusable;                   ///< why all of this could not be found; empty: it could
};
inline constexpr double rank_threshold = 1e-8;

/// Of one stage of a range of 16, on one instruction set [ns].
struct EvaluationTimes {
  std::string instruction_set;
  Spread values, jacobians, hessians, outputs;  ///< hessians: NaN where the model has none
};

struct RHEC_EXPORT ModelCheck {
  std::string model;
  std::uint64_t seed = 0;
  std::vector<std::string> parameters, states;
  std::vector<Finding> findings;  ///< in the order of the checks, at least one of each
  std::vector<DriveInformation> drives;
  std::vector<EvaluationTimes> times;

  int count(Verdict verdict) const;
  Verdict verdict() const;  ///< fail or warn where there is such a finding, else pass
};

struct ModelCheckOptions {
  std::uint64_t seed = 1;
  int samples = 4096;                ///< of the search for NaN
  std::optional<double> speed = {};  ///< over ground, of the drives [m/s]; none: as the inputs' scales make it
  double interval = 0.2;             ///< [s]
  int horizon = 15;                  ///< intervals; `longest_horizon` of them are looked at at most
  int substeps = 1;
  /// Standard deviations, as in Robot where empty. Those beyond 1e-9 and 1e9 scales count as that.
  std::vector<double> output_sigmas = {}, input_sigmas = {};
  std::vector<std::shared_ptr<const Blocking>> blockings = {};  ///< by parameter; empty: one value over the horizon
  static constexpr int longest_horizon = 100;
};

/// All checks of a model within the bounds of `within`, which describes the same variables. What the description gets
/// wrong may leave nothing to try the model with (no scale, a role that points nowhere): the other checks are skipped
/// then. The model is left with its fastest instruction set, as it was made. Throws Error where the options do not fit
/// the model.
RHEC_EXPORT ModelCheck check_model(Model& model, const ModelDescription& within, const ModelCheckOptions& options = {});
RHEC_EXPORT ModelCheck check_model(Model& model, const ModelCheckOptions& options = {});

/// The model of a robot, with its noise, bounds, step, horizon and blocking in place of those of `options`.
RHEC_EXPORT ModelCheck check_model(const Host& host, const Robot& robot, ModelCheckOptions options = {});

/// As an object of JSON; numbers that are not finite are null.
RHEC_EXPORT std::string check_json(const ModelCheck& check);

}  // namespace rhec::sim
