#include "rhec/core/prior/prior_options.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/model/model.hpp"

namespace rhec {

ParameterRange::ParameterRange(const Variable& parameter) {
  const double lower = parameter.lower, upper = parameter.upper;
  if (std::isfinite(lower) && std::isfinite(upper)) {
    width = upper - lower;
    mean = 0.5 * (0.5 * (lower + upper) + std::clamp(parameter.nominal, lower, upper));
  } else {
    width = 2.0 * parameter.scale;
    mean = std::clamp(parameter.nominal, lower, upper);
  }
}

}  // namespace rhec
