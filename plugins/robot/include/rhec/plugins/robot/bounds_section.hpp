#pragma once

#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/plugins/robot/option_section.hpp"

namespace rhec {

/// The section `bounds`: lower and upper bounds of states, inputs and parameters.
class RHEC_EXPORT BoundsSection {
 public:
  BoundsSection(const Settings& section, const ModelDescription& about);
  static OptionSection documentation();

  /// The model's description, with the bounds of the configuration.
  const ModelDescription& bounded() const noexcept { return bounded_; }

 private:
  ModelDescription bounded_;
};

RHEC_EXPORT std::vector<double> lower_bounds_of(const std::vector<Variable>& variables);
RHEC_EXPORT std::vector<double> upper_bounds_of(const std::vector<Variable>& variables);

}  // namespace rhec
