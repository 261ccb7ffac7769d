#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::logs {

/// A unit: `factor` of the SI unit `si`, e.g. "km/h" is 1/3.6 of "m/s".
struct Unit {
  double factor = 1.0;
  std::string si;
};
/// Empty for an unknown name.
RHEC_EXPORT std::optional<Unit> find_unit(std::string_view name);
/// A unit as people write it in the head of a column ("°", "kmh", "1/min"), by its name here; empty: none is known.
RHEC_EXPORT std::string unit_of_header(std::string_view text);
RHEC_EXPORT std::vector<std::string> unit_names();

}  // namespace rhec::logs
