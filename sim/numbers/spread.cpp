#include "rhec/sim/numbers/spread.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace rhec::sim {

Spread spread_of(std::vector<double> values) {
  std::erase_if(values, [](double value) { return std::isnan(value); });
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
    return values[std::max<std::size_t>(rank, 1) - 1];
  };
  return {at(0.5), at(0.99), values.back()};
}

}  // namespace rhec::sim
