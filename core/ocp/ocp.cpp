#include "rhec/core/ocp/ocp.hpp"

#include <algorithm>

#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/ocp/linearisation.hpp"

namespace rhec {

void Ocp::mark_dynamics(int interval, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept {
  std::fill_n(state_flags, state_count(interval + 1) * state_count(interval), 1);
  std::fill_n(control_flags, state_count(interval + 1) * control_count(interval), 1);
}

void Ocp::mark_limits(int stage, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept {
  std::fill_n(state_flags, limit_count(stage) * state_count(stage), 1);
  if (stage < intervals()) std::fill_n(control_flags, limit_count(stage) * control_count(stage), 1);
}

LimitCosts limit_costs(const Ocp& ocp, int stage, const double* values) noexcept {
  LimitCosts costs;
  for (int r = 0; r < ocp.limit_count(stage); ++r) {
    const double linear = ocp.limit_linear(stage)[r], value = values[r];
    const double excess = std::max(ocp.limit_lower(stage)[r] - value, value - ocp.limit_upper(stage)[r]);
    if (!(excess > 0.0))
      costs.slack += 0.0 * value;  // keeps NaN
    else if (linear < infinity)
      costs.slack += (linear + 0.5 * ocp.limit_quadratic(stage)[r] * excess) * excess;
    else
      costs.violation += excess;
  }
  return costs;
}

LimitCosts limit_costs(const StageQp& qp, StageRange range) noexcept {
  LimitCosts costs;
  for (int i = range.first; qp.has_limits() && i <= range.last; ++i)
    for (int r = 0; r < qp.limits(i); ++r) {
      const double excess = std::max(qp.limit_lower(i)[r], -qp.limit_upper(i)[r]);
      if (!(excess > 0.0)) continue;
      const double linear = qp.limit_linear(i)[r];
      if (linear < infinity)
        costs.slack += (linear + 0.5 * qp.limit_quadratic(i)[r] * excess) * excess;
      else
        costs.violation += excess;
    }
  return costs;
}

double slack_costs(const StageQp& qp, StageRange range) noexcept { return limit_costs(qp, range).slack; }

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
