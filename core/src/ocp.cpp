#include "rhec/core/ocp.hpp"

#include <algorithm>

namespace rhec {

void Ocp::mark_dynamics(int interval, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept {
  std::fill_n(state_flags, state_count(interval + 1) * state_count(interval), 1);
  std::fill_n(control_flags, state_count(interval + 1) * control_count(interval), 1);
}

void Ocp::remember_in(StageQp& /*qp*/) const {}

bool Ocp::is_made_at(const Iterate& /*point*/, const StageQp& /*qp*/) const noexcept { return false; }

}  // namespace rhec
