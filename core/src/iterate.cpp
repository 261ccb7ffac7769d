#include "rhec/core/iterate.hpp"

#include <algorithm>
#include <cmath>

namespace rhec {

Iterate::Iterate(const Capacity& capacity)
    : capacity_(capacity),
      states_(static_cast<std::size_t>(capacity.intervals + 1) * capacity.states),
      controls_(static_cast<std::size_t>(capacity.intervals) * capacity.controls),
      costates_(states_.size()),
      state_bounds_(states_.size()),
      control_bounds_(controls_.size()) {}

bool Iterate::is_finite() const noexcept {
  const auto finite = [](const std::vector<double>& v) {
    return std::all_of(v.begin(), v.end(), [](double value) { return std::isfinite(value); });
  };
  return finite(states_) && finite(controls_) && finite(costates_) && finite(state_bounds_) && finite(control_bounds_);
}

void Iterate::clear_multipliers() noexcept {
  for (auto* v : {&costates_, &state_bounds_, &control_bounds_}) std::fill(v->begin(), v->end(), 0.0);
}

}  // namespace rhec
