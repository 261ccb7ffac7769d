#pragma once

#include <limits>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

struct Spread {
  double median = std::numeric_limits<double>::quiet_NaN(), p99 = median, max = median;
};
/// Of the values that are not NaN; NaN where there is none. A quantile is the least value that is at least as large as
/// that share of all.
RHEC_EXPORT Spread spread_of(std::vector<double> values);

}  // namespace rhec::sim
