#include "rhec/core/ocp/ocp.hpp"

#include <algorithm>

#include "rhec/core/base/assertion.hpp"
#include "rhec/core/ocp/linearisation.hpp"

namespace rhec {

void Ocp::mark_dynamics(int interval, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept {
  std::fill_n(state_flags, state_count(interval + 1) * state_count(interval), 1);
  std::fill_n(control_flags, state_count(interval + 1) * control_count(interval), 1);
}

std::unique_ptr<Linearisation> Ocp::make_linearisation() const { return std::make_unique<Linearisation>(*this); }

void roll_out(const Ocp& ocp, Iterate& iterate, std::span<double> scratch) noexcept {
  RHEC_ASSERT(iterate.capacity() == ocp.capacity(), "an iterate of the OCP's capacity");
  RHEC_ASSERT(scratch.size() >= ocp.scratch_size(), "scratch of the OCP's `scratch_size()`");
  for (int i = 0; i < ocp.intervals(); ++i)
    for (int j = 0; j < ocp.control_count(i); ++j)
      iterate.control(i)[j] =
          std::min(std::max(iterate.control(i)[j], ocp.control_lower(i)[j]), ocp.control_upper(i)[j]);
  if (ocp.initial_state()) {
    std::copy_n(ocp.initial_state(), ocp.state_count(0), iterate.state(0));
  } else {
    for (int j = 0; j < ocp.state_count(0); ++j)
      iterate.state(0)[j] = std::min(std::max(iterate.state(0)[j], ocp.state_lower(0)[j]), ocp.state_upper(0)[j]);
  }
  ocp.simulate(iterate, scratch);
}

}  // namespace rhec
