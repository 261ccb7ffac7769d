#include "rhec/plugins/robot/noise_section.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "rhec/core/config/options.hpp"
#include "rhec/plugins/robot/by_name.hpp"

namespace rhec {
namespace {

constexpr double share = 0.01;  // of a variable's typical magnitude

const SigmasByName& outputs_by_name() {
  static const SigmasByName map(
      "noise of outputs", {greater_than(0.0)},
      {{"OUTPUT", &ModelDescription::outputs, scaled_default(share), "of a measured output"}});
  return map;
}

const SigmasByName& inputs_by_name() {
  static const SigmasByName map("noise of inputs", {greater_than(0.0)},
                                {{"INPUT", &ModelDescription::inputs, scaled_default(share), "of a measured input"}});
  return map;
}

const SigmasByName& states_by_name() {
  static const SigmasByName map(
      "noise of states", {at_least(0.0)},
      {{"STATE", &ModelDescription::states, constant_default(0.0),
        "process noise: by how much it strays from the model in a second, as a random walk; per square root of a "
        "second; 0: not at all"}});
  return map;
}

/// {sigma: ..., drift: ...}
struct SensorErrorValue {
  static const OptionTable<SensorError>& table() {
    static const auto rows =
        OptionTable<SensorError>()
            .number("sigma", &SensorError::sigma, "standard deviation at the start", greater_than(0.0))
            .number("drift", &SensorError::drift, "of its random walk, per square root of a second", at_least(0.0));
    return rows;
  }
  static SensorError read(const Settings& from, const OptionContext& context) {
    SensorError error = table().parse(from, context.owner);
    for (const char* const key : {"sigma", "drift"})
      if (const Settings* const given = from.find(key)) SigmaValue{any()}.read(*given, context);
    if (!(std::isfinite(error.sigma) && error.sigma > 0.0 && std::isfinite(error.drift)))
      throw from.error("expected a finite sigma above 0, and a finite drift, as in {sigma: 0.02, drift: 0.001}");
    return error;
  }
  static std::string type() { return "map"; }
  static std::string constraint() { return "sigma > 0, drift >= 0"; }
};

DefaultByName<SensorError> no_error() {
  return {"none", [](const ModelDescription&, const Variable&, std::size_t) { return SensorError{}; }};
}

ByName<SensorErrorValue> sensor_errors(const char* owner) {
  return {owner, {}, {{"OUTPUT", &ModelDescription::outputs, no_error(), ""}}};
}
const ByName<SensorErrorValue>& biases_by_name() {
  static const auto map = sensor_errors("biases of outputs");
  return map;
}
const ByName<SensorErrorValue>& scales_by_name() {
  static const auto map = sensor_errors("scale errors of outputs");
  return map;
}

/// Of a sensor's sigma and drift.
std::vector<OptionRow> sensor_error_rows(const char* meaning) {
  std::vector<OptionRow> rows = SensorErrorValue::table().schema();
  for (OptionRow& row : rows) {
    row.name = "OUTPUT." + row.name;
    if (row.name == "OUTPUT.sigma") {
      row.default_value = "none";
      row.meaning = fmt::format("{}: {}", meaning, row.meaning);
    }
  }
  return rows;
}

struct NoiseOptions {
  Settings outputs, inputs, states, biases, scales;
  bool adapt = true;

  static const OptionTable<NoiseOptions>& table() {
    static const auto rows =
        OptionTable<NoiseOptions>()
            .map("outputs", &NoiseOptions::outputs, outputs_by_name().rows())
            .map("inputs", &NoiseOptions::inputs, inputs_by_name().rows())
            .map("states", &NoiseOptions::states, states_by_name().rows())
            .map("biases", &NoiseOptions::biases, sensor_error_rows("the sensor reads a bias more, which is estimated"))
            .map("scales", &NoiseOptions::scales,
                 sensor_error_rows("the sensor reads (1 + k) times as much, and k is estimated"))
            .flag("adapt", &NoiseOptions::adapt,
                  "bank, and rhe with priors: learn the noise of outputs while driving, from a fifth to five "
                  "times what is stated; of outputs of motion only what comes between nodes, and not beside noise of "
                  "states or drifting sensors, from which it cannot be told");
    return rows;
  }
};

}  // namespace

NoiseSection::NoiseSection(const Settings& section, const ModelDescription& about,
                           const std::vector<std::string>& left_out) {
  const NoiseOptions options = NoiseOptions::table().parse(section, "noise");
  output_sigmas = outputs_by_name().read(options.outputs, about, left_out);
  input_sigmas = inputs_by_name().read(options.inputs, about);
  state_sigmas = states_by_name().read(options.states, about);
  biases = biases_by_name().read(options.biases, about, left_out);
  scales = scales_by_name().read(options.scales, about, left_out);
  for (const Settings* map : {&options.outputs, &options.biases, &options.scales})
    for (const std::string& name : left_out)
      if (const Settings* unused = map->find(name))
        notes.emplace_back(
            unused->error("passed over, since model.outputs leaves this sensor out; take it out, or name it there")
                .what());
  const auto drifts = [](const SensorError& error) { return error.drift > 0.0; };
  const bool has_drift =
      std::any_of(biases.begin(), biases.end(), drifts) || std::any_of(scales.begin(), scales.end(), drifts);
  const bool has_state_noise =
      has_drift || std::any_of(state_sigmas.begin(), state_sigmas.end(), [](double sigma) { return sigma > 0.0; });
  if (const Settings* asked = section.find("adapt"); asked && options.adapt && has_state_noise)
    throw asked->error(
        "found true, beside process noise in noise.states or a drift of a sensor: measurements do not tell the noise "
        "of sensors from that of the states that they measure; expected false, or neither");
  adapt = options.adapt && !has_state_noise;
}

OptionSection NoiseSection::documentation() {
  return {"noise",
          "Standard deviations of what is measured, in the variable's unit, and of states that stray from the model. A "
          "simulation draws its noise from those of what is measured.",
          NoiseOptions::table().schema()};
}

std::vector<double> default_sigmas(const std::vector<Variable>& variables) {
  std::vector<double> sigmas;
  sigmas.reserve(variables.size());
  for (const Variable& variable : variables) sigmas.push_back(share * variable.scale);
  return sigmas;
}

}  // namespace rhec
