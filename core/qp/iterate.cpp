#include "rhec/core/qp/iterate.hpp"

#include <algorithm>
#include <cmath>

namespace rhec {

Iterate::Iterate(const Capacity& capacity)
    : capacity_(capacity),
      row_(capacity.row()),
      values_(static_cast<std::size_t>(capacity.intervals + 1) * capacity.row()),
      costates_(values_.size()),
      bounds_(values_.size()),
      limits_(static_cast<std::size_t>(capacity.intervals + 1) * capacity.limit_row()) {}

bool Iterate::is_finite() const noexcept {
  const auto finite = [](const AlignedDoubles& v) {
    return std::all_of(v.begin(), v.end(), [](double value) { return std::isfinite(value); });
  };
  return finite(values_) && finite(costates_) && finite(bounds_) && finite(limits_);
}

void Iterate::clear_multipliers() noexcept {
  for (auto* v : {&costates_, &bounds_, &limits_}) std::fill(v->begin(), v->end(), 0.0);
}

}  // namespace rhec
