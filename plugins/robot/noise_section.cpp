#include "rhec/plugins/robot/noise_section.hpp"

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

struct NoiseOptions {
  Settings outputs, inputs;
  bool adapt = true;

  static const OptionTable<NoiseOptions>& table() {
    static const auto rows =
        OptionTable<NoiseOptions>()
            .map("outputs", &NoiseOptions::outputs, outputs_by_name().rows())
            .map("inputs", &NoiseOptions::inputs, inputs_by_name().rows())
            .flag("adapt", &NoiseOptions::adapt,
                  "bank, and rhe with priors: learn the noise of outputs while driving, from a fifth to five "
                  "times what is stated");
    return rows;
  }
};

}  // namespace

NoiseSection::NoiseSection(const Settings& section, const ModelDescription& about) {
  const NoiseOptions options = NoiseOptions::table().parse(section, "noise");
  output_sigmas = outputs_by_name().read(options.outputs, about);
  input_sigmas = inputs_by_name().read(options.inputs, about);
  adapt = options.adapt;
}

OptionSection NoiseSection::documentation() {
  return {
      "noise",
      "Standard deviations of what is measured, in the variable's unit; a simulation draws its noise from them too.",
      NoiseOptions::table().schema()};
}

std::vector<double> default_sigmas(const std::vector<Variable>& variables) {
  std::vector<double> sigmas;
  sigmas.reserve(variables.size());
  for (const Variable& variable : variables) sigmas.push_back(share * variable.scale);
  return sigmas;
}

}  // namespace rhec
