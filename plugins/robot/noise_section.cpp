#include "rhec/plugins/robot/noise_section.hpp"

#include <algorithm>

#include "rhec/core/config/options.hpp"
#include "rhec/plugins/robot/by_name.hpp"

namespace rhec {
namespace {

constexpr double share = 0.01;  // of a variable's typical magnitude

const NumbersByName& outputs_by_name() {
  static const NumbersByName map(
      "noise of outputs", {greater_than(0.0)},
      {{"OUTPUT", &ModelDescription::outputs, scaled_default(share), "of a measured output"}});
  return map;
}

const NumbersByName& inputs_by_name() {
  static const NumbersByName map("noise of inputs", {greater_than(0.0)},
                                 {{"INPUT", &ModelDescription::inputs, scaled_default(share), "of a measured input"}});
  return map;
}

const NumbersByName& states_by_name() {
  static const NumbersByName map(
      "noise of states", {at_least(0.0)},
      {{"STATE", &ModelDescription::states, constant_default(0.0),
        "process noise: by how much it strays from the model in a second, as a random walk; per square root of a "
        "second; 0: not at all"}});
  return map;
}

struct NoiseOptions {
  Settings outputs, inputs, states;
  bool adapt = true;

  static const OptionTable<NoiseOptions>& table() {
    static const auto rows =
        OptionTable<NoiseOptions>()
            .map("outputs", &NoiseOptions::outputs, outputs_by_name().rows())
            .map("inputs", &NoiseOptions::inputs, inputs_by_name().rows())
            .map("states", &NoiseOptions::states, states_by_name().rows())
            .flag("adapt", &NoiseOptions::adapt,
                  "bank, and rhe with priors: learn the noise of outputs while driving, from a fifth to five "
                  "times what is stated; not beside noise of states, from which it cannot be told");
    return rows;
  }
};

}  // namespace

NoiseSection::NoiseSection(const Settings& section, const ModelDescription& about) {
  const NoiseOptions options = NoiseOptions::table().parse(section, "noise");
  output_sigmas = outputs_by_name().read(options.outputs, about);
  input_sigmas = inputs_by_name().read(options.inputs, about);
  state_sigmas = states_by_name().read(options.states, about);
  const bool has_state_noise =
      std::any_of(state_sigmas.begin(), state_sigmas.end(), [](double sigma) { return sigma > 0.0; });
  if (const Settings* asked = section.find("adapt"); asked && options.adapt && has_state_noise)
    throw asked->error(
        "found true, beside process noise in noise.states: measurements do not tell the noise of sensors from that of "
        "the states that they measure; expected false, or neither");
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
