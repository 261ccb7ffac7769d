#include "checks.hpp"

#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"

namespace rhec {

void check_weights(std::string_view what, const std::vector<double>& weights, const std::vector<Variable>& variables) {
  if (weights.size() != variables.size())
    throw Error(
        fmt::format("{}: {} given; expected {}, one for each variable", what, weights.size(), variables.size()));
  for (std::size_t j = 0; j < weights.size(); ++j)
    if (!(weights[j] >= 0.0) || !std::isfinite(weights[j]))
      throw Error(
          fmt::format("{}: {} for '{}'; expected a finite number of at least 0", what, weights[j], variables[j].name));
}

void fill_default_bounds(std::string_view what, std::vector<double>& lower, std::vector<double>& upper,
                         const std::vector<Variable>& variables, bool use_model) {
  const auto fill = [&](std::vector<double>& bounds, bool is_lower) {
    if (!bounds.empty()) return;
    for (const Variable& variable : variables) {
      const double none = is_lower ? -std::numeric_limits<double>::infinity() : std::numeric_limits<double>::infinity();
      bounds.push_back(!use_model ? none : is_lower ? variable.lower : variable.upper);
    }
  };
  fill(lower, true);
  fill(upper, false);
  if (lower.size() != variables.size() || upper.size() != variables.size())
    throw Error(fmt::format("{}: expected {} of each side, one for each variable", what, variables.size()));
  for (std::size_t j = 0; j < variables.size(); ++j)
    if (!(lower[j] <= upper[j]))
      throw Error(
          fmt::format("{}: [{}, {}] for '{}'; expected lower <= upper", what, lower[j], upper[j], variables[j].name));
}

}  // namespace rhec
