#pragma once

#include <limits>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

struct Spread {
  double median = std::numeric_limits<double>::quiet_NaN(), p99 = median, max = median;
};
/// Spread of the values that are not NaN; NaN if there are none. A quantile is the smallest value that is at least as
/// large as that share of all values.
RHEC_EXPORT Spread spread_of(std::vector<double> values);

}  // namespace rhec::sim
