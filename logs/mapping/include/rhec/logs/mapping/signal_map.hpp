#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rhec/core/config/options.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/logs/mapping/local_plane.hpp"
#include "rhec/logs/signals/log.hpp"
#include "rhec/plugins/robot/option_section.hpp"

namespace rhec::logs {

/// What a variable is made of.
enum class SignalForm : std::uint8_t {
  value,  ///< one number
  east,
  north,
  up,         ///< latitude, longitude and height in the local plane [m]
  heading,    ///< of a quaternion x, y, z, w: the angle about the vertical [rad]
  mean,       ///< of all
  turn,       ///< (second - first) / track: the yaw rate of the speeds of a left and a right side
  direction,  ///< of a vector to the east and north, or from one fix to another: an angle [rad]
  yaw_rate,   ///< of an angular velocity x, y, z: about the vehicle's vertical
};

/// How one output or input is read from a log: sign * scale * unit * signal + offset.
struct SignalOptions {
  Settings from;
  SignalForm form = SignalForm::value;
  std::string unit;
  int sign = 1;
  std::optional<double> scale;
  double offset = 0.0;
  std::optional<double> radius, track, counts, wraps;
  std::vector<double> rpy;
  double delay = 0.0;
  bool derivative = false;
  std::string clock;
  Settings when, sigma, variance;
  double sigma_scale = 1.0, least_sigma = 0.0;
  RHEC_EXPORT static const OptionTable<SignalOptions>& table();
};

/// What else a record has to say so that a signal of it counts: a fix by its status, or by its own covariance.
struct SignalCondition {
  SignalName of;
  double at_least, at_most;
  bool holds(double value) const noexcept { return value >= at_least && value <= at_most; }
};

/// How accurate a record says that its value is.
struct StatedAccuracy {
  SignalName of;
  bool is_variance = false;  ///< else a standard deviation
};

/// The section `signals`.
struct SignalMapOptions {
  std::string clock;
  std::vector<double> origin;
  Settings outputs, inputs;
  RHEC_EXPORT static const OptionTable<SignalMapOptions>& table();
};
RHEC_EXPORT std::vector<OptionSection> signal_sections();

/// A variable with what it is made of.
struct MappedSignal {
  Variable variable;
  bool is_output = false;
  int index = 0;  ///< among the model's outputs or inputs
  SignalOptions options = {};
  std::vector<SignalName> from = {};
  std::vector<SignalCondition> conditions = {};  ///< on fields of the same records
  std::optional<StatedAccuracy> accuracy = {};   ///< a field of the same records; none: as the scenario says
  double factor = 1.0;                           ///< sign, scale, unit and radius
  bool is_angle = false;      ///< what is read is one: its differences are taken on the circle, unless it counts turns
  double sigma_factor = 1.0;  ///< of a stated standard deviation
  double period = 0.0;        ///< by which what is read begins anew; 0: never
};

/// Which signals of a log are a model's outputs and inputs. A variable that the section does not name is the signal of
/// the log that bears its name: the column `delta`, or the item of that name in the topics that `rhec run --log`
/// writes. `none`: it is not measured.
class RHEC_EXPORT SignalMap {
 public:
  /// Throws Error, with file, line and key, for names, units and forms that cannot be.
  SignalMap(const Settings& section, const ModelDescription& about);

  const std::vector<MappedSignal>& signals() const noexcept { return signals_; }
  const std::optional<GeodeticPoint>& origin() const noexcept { return origin_; }
  /// What these are in a log: with signals found by name, and without those that are `none`. Throws Error for an output
  /// or input that the log does not have.
  std::vector<MappedSignal> resolved(const Log& log) const;
  int outputs() const noexcept { return outputs_; }
  int inputs() const noexcept { return inputs_; }

 private:
  void add(const Settings& map, const std::vector<Variable>& variables, bool is_output);
  std::string clock_;
  std::optional<GeodeticPoint> origin_;
  std::vector<MappedSignal> signals_;  ///< without `from`: by name
  std::vector<bool> is_none_;
  std::vector<Settings> entries_;  ///< by signal: where it is told, or the section
  Settings section_;
  int outputs_ = 0, inputs_ = 0;
};

/// Topics that `rhec run --log` writes: what the sensors measured, and the inputs.
inline constexpr const char *measured_topic = "/rhec/measured", *inputs_topic = "/rhec/inputs";

}  // namespace rhec::logs
