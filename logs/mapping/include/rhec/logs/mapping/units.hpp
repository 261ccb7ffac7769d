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
RHEC_EXPORT std::vector<std::string> unit_names();

}  // namespace rhec::logs
