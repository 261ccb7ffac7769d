#include "rhec/sim/tuning/tunable.hpp"
#include "rhec/plugins/robot/spans.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/plugins/robot/spans.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/tuning/drive_tuning.hpp"

namespace rhec::sim {
namespace {

/// How far off what a scenario says may well be.
struct Doubts {
  static constexpr double factor = std::numbers::ln10;  ///< of noise: ten times
  static constexpr double length_factor = 1.4;          ///< of a prior's length: four times
  static constexpr double speed = 0.1;                  ///< [m/s]
  static constexpr double angle = 0.05;                 ///< [rad]
  static constexpr double turn_rate = 0.02;             ///< [rad/s]
  static constexpr double delay = 0.2;                  ///< [s]
  static constexpr double length = 1.0;                 ///< of a lever arm [m]
};
// The search keeps to this many doubts about its start.
constexpr double widest = 3.0;

Tunable scale_of(const std::vector<std::string>& keys, double start, const std::string& unit, double doubt) {
  Tunable tunable;
  tunable.keys = keys;
  tunable.unit = unit;
  tunable.start = start;
  tunable.doubt = doubt;
  for (const std::string& key : keys)
    tunable.name += tunable.name.empty() ? key : ", " + key.substr(key.rfind('.') + 1);
  tunable.lower = tunable.value_at(-widest);
  tunable.upper = tunable.value_at(widest);
  return tunable;
}

Tunable offset_of(const std::string& key, double start, const std::string& unit, double doubt) {
  Tunable tunable;
  tunable.name = key;
  tunable.keys = {key};
  tunable.unit = unit;
  tunable.kind = Tunable::Kind::offset;
  tunable.start = start;
  tunable.doubt = doubt;
  tunable.lower = tunable.value_at(-widest);
  tunable.upper = tunable.value_at(widest);
  return tunable;
}

/// Numbers of a model that have a sign: lever arms.
void add_lever_arms(const Host& host, const Robot& robot, std::vector<Tunable>& all) {
  const PluginChoice model = robot.model_choice();
  for (const OptionRow& row : host.options(PluginKind::model, model.name)) {
    const bool has_sign = row.constraint.empty() || row.constraint.starts_with("between -");
    if (row.type != "number" || !has_sign) continue;
    const Settings* given = model.options.find(row.name);
    const double start = given ? given->as_number() : Settings::scalar(row.default_value).number().value_or(0.0);
    all.push_back(offset_of("model." + row.name, start, "m", Doubts::length));
  }
}

/// The process noise of a filter.
void add_process_noise(const Robot& robot, std::vector<Tunable>& all) {
  for (const Variable& parameter : robot.model()->description().parameters) {
    const Settings* given = robot.estimator_options().process_noise.find(parameter.name);
    const double start = given ? given->as_number() : ParameterWalk{}.process_noise;
    if (start > 0.0)
      all.push_back(
          scale_of({"estimator.process_noise." + parameter.name}, start, "per root of a step", Doubts::factor));
  }
}

/// How slip varies: the process noise of a filter, or the numbers of laws that the settings give, and of a loss.
void add_estimator(const Robot& robot, std::vector<Tunable>& all) {
  const EstimatorOptions& options = robot.estimator_options();
  if (options.name == "ekf") {
    add_process_noise(robot, all);
  } else {
    for (const Variable& parameter : robot.model()->description().parameters) {
      const Settings* prior = options.priors.find(parameter.name);
      if (!prior || prior->kind() != Settings::Kind::map) continue;
      for (const auto& [key, value] : prior->members()) {
        if (!value.number() || !(*value.number() > 0.0) || key == "mean" || key == "mean_sigma") continue;
        all.push_back(scale_of({fmt::format("estimator.priors.{}.{}", parameter.name, key)}, *value.number(), "",
                               key == "length" ? Doubts::length_factor : Doubts::factor));
      }
    }
  }
  if (const Settings* delta = options.robust.find("delta"))
    all.push_back(scale_of({"estimator.robust.delta"}, delta->as_number(), "sigma", Doubts::length_factor));
}

/// What is added to what a sensor or an input reads, where it can have a bias that is not estimated: of angles, speeds
/// and turn rates.
void add_offset(const Variable& variable, const std::string& kind, const Settings& settings,
                std::vector<Tunable>& all) {
  const double doubt = variable.unit == "rad"     ? Doubts::angle
                       : variable.unit == "m/s"   ? Doubts::speed
                       : variable.unit == "rad/s" ? Doubts::turn_rate
                                                  : 0.0;
  if (doubt == 0.0 || settings.find_path("noise.biases." + variable.name)) return;
  const std::string key = fmt::format("signals.{}.{}.offset", kind, variable.name);
  const Settings* given = settings.find_path(key);
  all.push_back(offset_of(key, given ? given->as_number() : 0.0, variable.unit, doubt));
}

/// Collects what can be tuned.
class Finder {
 public:
  Finder(const Host& host, const LogScenario& scenario)
      : host_(host), scenario_(scenario), robot_(scenario.variants().front().robot) {}

  std::vector<Tunable> find() {
    add_noise();
    add_estimator(robot_, all_);
    add_log();
    add_lever_arms(host_, robot_, all_);
    return std::move(all_);
  }

 private:
  const ModelDescription& about() const { return robot_.model()->description(); }

  void add_noise() {
    const LogOptions& log = scenario_.log();
    const auto at = [](const std::vector<Variable>& variables, const std::string& name) {
      return std::find_if(variables.begin(), variables.end(), [&](const Variable& v) { return v.name == name; }) -
             variables.begin();
    };
    const auto sensor = [&](const char* kind, const std::vector<Variable>& variables, const std::vector<double>& sigmas,
                            const std::vector<std::string>& names) {
      std::vector<std::string> keys;
      keys.reserve(names.size());
      for (const std::string& name : names) keys.push_back(fmt::format("noise.{}.{}", kind, name));
      const auto first = at(variables, names.front());
      all_.push_back(scale_of(keys, sigmas[first], variables[first].unit, Doubts::factor));
    };
    const std::vector<double>& outputs = robot_.output_sigmas();
    if (outputs[at(about().outputs, log.position[0])] == outputs[at(about().outputs, log.position[1])]) {
      sensor("outputs", about().outputs, outputs, log.position);
    } else {
      for (const std::string& name : log.position) sensor("outputs", about().outputs, outputs, {name});
    }
    sensor("outputs", about().outputs, outputs, {log.steering});
    sensor("inputs", about().inputs, robot_.input_sigmas(), {log.speed});
    sensor("inputs", about().inputs, robot_.input_sigmas(), {log.steering_rate});
  }

  void add_log() {
    const LogOptions& log = scenario_.log();
    all_.push_back(offset_of("log.speed_bias", log.speed_bias, "m/s", Doubts::speed));
    all_.push_back(offset_of("log.steering_bias", log.steering_bias, "rad", Doubts::angle));
    all_.push_back(offset_of("log.fix_delay", log.fix_delay, "s", Doubts::delay));
    all_.push_back(offset_of("log.steering_delay", log.steering_delay, "s", Doubts::delay));
    if (scenario_.wheelbase() > 0.0)
      all_.push_back(offset_of("log.wheel_offset", log.wheel_offset, "m", Doubts::length));
  }

  const Host& host_;
  const LogScenario& scenario_;
  const Robot& robot_;
  std::vector<Tunable> all_;
};

bool begins(const std::string& key, const std::string& with) {
  return key == with || (key.starts_with(with) && key[with.size()] == '.');
}

bool is_meant(const Tunable& tunable, const std::string& wish) {
  return std::any_of(tunable.keys.begin(), tunable.keys.end(), [&](const auto& key) { return begins(key, wish); });
}

/// A number that the settings name, of which nothing is known but what they say.
Tunable asked_for(const Settings& settings, const std::string& key, std::optional<std::pair<double, double>> range,
                  const std::string& where) {
  const Settings* at = settings.find_path(key);
  if (!at || !at->number() || !std::isfinite(*at->number()))
    throw Error(
        fmt::format("{}: the scenario has no number '{}'; write it there first, with a first guess", where, key));
  const double start = *at->number();
  Tunable tunable = start > 0.0 ? scale_of({key}, start, "", std::numbers::ln2)
                                : offset_of(key, start, "", std::max(0.5 * std::abs(start), 1.0));
  if (range) {
    const auto [lower, upper] = *range;
    if (!(lower < upper) || start < lower || start > upper)
      throw Error(fmt::format("{}: found [{}, {}]; expected [lower, upper] about the scenario's {}", where, lower,
                              upper, start));
    if (lower <= 0.0) tunable.kind = Tunable::Kind::offset;
    tunable.doubt = tunable.kind == Tunable::Kind::offset ? 0.25 * (upper - lower) : 0.25 * std::log(upper / lower);
    tunable.lower = lower;
    tunable.upper = upper;
  }
  return tunable;
}

std::vector<Tunable> with_wishes(std::vector<Tunable> all, const Settings& settings, const TuningWishes& wishes) {
  for (const std::string& wish : wishes.tune) {
    const std::string where = "--tune " + wish, key = wish.substr(0, wish.find('='));
    std::optional<std::pair<double, double>> range;
    if (key.size() < wish.size()) {
      const std::vector<double> ends = parse_yaml(wish.substr(key.size() + 1), where).as_numbers();
      if (ends.size() != 2) throw Error(fmt::format("{}: expected KEY, or KEY=[lower, upper]", where));
      range = {ends[0], ends[1]};
    }
    std::erase_if(all,
                  [&](const Tunable& tunable) { return tunable.keys.size() == 1 && tunable.keys[0] == key && range; });
    if (std::none_of(all.begin(), all.end(), [&](const Tunable& tunable) { return is_meant(tunable, key); }))
      all.push_back(asked_for(settings, key, range, where));
  }
  for (const std::string& wish : wishes.keep) {
    const std::size_t before = all.size();
    std::erase_if(all, [&](const Tunable& tunable) { return is_meant(tunable, wish); });
    if (all.size() == before) {
      std::vector<std::string> keys;
      for (const Tunable& tunable : all) keys.insert(keys.end(), tunable.keys.begin(), tunable.keys.end());
      throw Error(fmt::format("--keep {}: nothing of that name would be tuned; expected the start of one of {}", wish,
                              fmt::join(keys, ", ")));
    }
  }
  return all;
}

}  // namespace

double Tunable::value_at(double coordinate) const noexcept {
  const double value = kind == Kind::scale ? start * std::exp(doubt * coordinate) : start + doubt * coordinate;
  return is_whole ? std::round(value) : value;
}

double Tunable::coordinate_of(double value) const noexcept {
  return (kind == Kind::scale ? std::log(value / start) : value - start) / doubt;
}

double Tunable::error_of(double coordinate_error, double value) const noexcept {
  return doubt * coordinate_error * (kind == Kind::scale ? value : 1.0);
}

Settings with_values(Settings settings, const std::vector<Tunable>& tunables, const Eigen::VectorXd& at, int digits) {
  for (std::size_t i = 0; i < tunables.size(); ++i) {
    const double value = tunables[i].value_at(at[static_cast<Eigen::Index>(i)]);
    for (const std::string& key : tunables[i].keys)
      settings.set(key, Settings::scalar(fmt::format("{:.{}g}", value, digits)));
  }
  return settings;
}

std::vector<Tunable> tunables_of(const Host& host, const LogScenario& scenario, const TuningWishes& wishes) {
  return with_wishes(Finder(host, scenario).find(), scenario.variants().front().settings, wishes);
}

std::vector<Tunable> drive_tunables(const Host& host, const Robot& robot, const Settings& settings,
                                    const std::vector<Sensor>& sensors, const TuningWishes& wishes) {
  const ModelDescription& about = robot.model()->description();
  std::vector<Tunable> all;
  for (const Sensor& sensor : sensors) {
    std::vector<std::string> noises, delays;
    for (const int j : sensor.outputs) {
      noises.push_back("noise.outputs." + about.outputs[static_cast<std::size_t>(j)].name);
      delays.push_back("estimator.delays." + about.outputs[static_cast<std::size_t>(j)].name);
    }
    const auto first = static_cast<std::size_t>(sensor.outputs.front());
    all.push_back(scale_of(noises, robot.output_sigmas()[first], about.outputs[first].unit, Doubts::factor));
    const Settings* given = settings.find_path(delays.front());
    Tunable delay = offset_of(delays.front(), given ? given->as_number() : 0.0, "s", Doubts::delay);
    delay.keys = delays;
    delay.lower = 0.0;  // nothing is stamped before it is measured
    all.push_back(std::move(delay));
    for (const int j : sensor.outputs) add_offset(about.outputs[static_cast<std::size_t>(j)], "outputs", settings, all);
  }
  for (std::size_t j = 0; j < about.inputs.size() - about.noisy_states.size(); ++j) {
    if (robot.input_sigmas()[j] > 0.0)
      all.push_back(scale_of({"noise.inputs." + about.inputs[j].name}, robot.input_sigmas()[j], about.inputs[j].unit,
                             Doubts::factor));
    add_offset(about.inputs[j], "inputs", settings, all);
  }
  add_estimator(robot, all);
  add_lever_arms(host, robot, all);
  return with_wishes(std::move(all), settings, wishes);
}

std::vector<Tunable> controller_tunables(const Robot& robot, const Settings& settings) {
  const ModelDescription& about = robot.model()->description();
  std::vector<Tunable> all;
  for (const std::string section :
       {"controller.weights.stage", "controller.weights.terminal", "controller.weights.rates"}) {
    const Settings* weights = settings.find_path(section);
    if (!weights) continue;
    for (const auto* variables : {&about.states, &about.inputs}) {
      // By value and unit.
      std::vector<std::pair<const Variable*, double>> seen;
      for (std::size_t j = 0; j < variables->size(); ++j) {
        const Variable& variable = (*variables)[j];
        const Settings* weight = weights->find(variable.name);
        if (!weight || !(weight->as_number() > 0.0)) continue;
        const int state = variables == &about.states ? static_cast<int>(j) : -1;
        const bool is_position = state >= 0 && (state == about.roles.position_x || state == about.roles.position_y);
        if (is_position && section.ends_with("stage")) continue;
        const std::string key = section + "." + variable.name;
        const double value = weight->as_number();
        const auto same = std::find_if(seen.begin(), seen.end(), [&](const auto& other) {
          return other.second == value && other.first->unit == variable.unit;
        });
        if (same == seen.end()) {
          all.push_back(scale_of({key}, value, "", std::numbers::ln10));
        } else {
          Tunable& with = *(all.end() - (seen.end() - same));
          with.keys.push_back(key);
          with.name += ", " + variable.name;
          continue;
        }
        seen.emplace_back(&variable, value);
      }
    }
  }
  if (all.empty())
    throw settings.error("controller.weights: found no positive weight to tune; expected e.g. stage: {u2: 1}");
  const Settings* horizon = settings.find_path("controller.horizon");
  Tunable length =
      scale_of({"controller.horizon"},
               horizon ? span_in_intervals(*horizon, robot.step()).as_integer() : RhcProblem::Setup{}.max_intervals,
               "intervals", std::numbers::ln2);
  length.is_whole = true;
  length.lower = std::max(2.0, std::round(length.value_at(-1.0)));
  length.upper = length.value_at(1.0);
  all.push_back(length);
  return all;
}

}  // namespace rhec::sim
