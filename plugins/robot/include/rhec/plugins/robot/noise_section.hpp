#pragma once

#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/plugins/robot/option_section.hpp"

namespace rhec {

/// The section `noise`: standard deviations of the measured variables.
struct RHEC_EXPORT NoiseSection {
  NoiseSection(const Settings& section, const ModelDescription& about);
  static OptionSection documentation();

  std::vector<double> output_sigmas, input_sigmas;
  std::vector<double> state_sigmas;  ///< process noise, per square root of a second; 0: none
  bool adapt = true;                 ///< whether estimators that can do so learn the noise of outputs
};

/// Default standard deviations of measured variables: a fraction of their typical magnitudes.
RHEC_EXPORT std::vector<double> default_sigmas(const std::vector<Variable>& variables);

}  // namespace rhec
