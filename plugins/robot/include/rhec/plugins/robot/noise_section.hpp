#pragma once

#include <string>
#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/plugins/robot/option_section.hpp"

namespace rhec {

/// What a sensor adds to its output, by a factor or as it is: its standard deviation at the start, and by how much it
/// drifts, per square root of a second. Zeros: none.
struct SensorError {
  double sigma = 0.0, drift = 0.0;
};

/// The section `noise`: standard deviations of the measured variables.
struct RHEC_EXPORT NoiseSection {
  /// `left_out`: outputs that the model has, but that are not measured (`model.outputs`). What is said of them counts
  /// for nothing, and is noted.
  NoiseSection(const Settings& section, const ModelDescription& about, const std::vector<std::string>& left_out = {});
  static OptionSection documentation();

  std::vector<double> output_sigmas, input_sigmas;
  std::vector<double> state_sigmas;         ///< process noise, per square root of a second; 0: none
  std::vector<SensorError> biases, scales;  ///< by output
  bool adapt = true;                        ///< whether estimators that can do so learn the noise of outputs
  std::vector<std::string> notes;           ///< what was passed over, with file and line
};

/// Default standard deviations of measured variables: a fraction of their typical magnitudes.
RHEC_EXPORT std::vector<double> default_sigmas(const std::vector<Variable>& variables);

}  // namespace rhec
