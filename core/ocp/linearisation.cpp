#include "rhec/core/ocp/linearisation.hpp"

#include <algorithm>
#include <cstring>

#include "rhec/core/base/assertion.hpp"

namespace rhec {

Linearisation::Linearisation(const Ocp& ocp)
    : qp_(ocp.capacity()), scratch_(ocp.scratch_size(), 0.0), ocp_(ocp), iterate_(ocp.capacity()) {}

double Linearisation::linearise(const Iterate& iterate, Hessian hessian) noexcept {
  RHEC_ASSERT(iterate.capacity() == qp_.capacity() && ocp_.capacity() == qp_.capacity(),
              "the OCP's capacity as it was");
  RHEC_ASSERT(ocp_.scratch_size() <= scratch_.size(), "the OCP's scratch as it was");
  remember(iterate);
  return ocp_.linearise(all_stages(ocp_), iterate, hessian, qp_, scratch_);
}

double Linearisation::linearise_for_residual(const Iterate& iterate, Hessian /*next*/) noexcept {
  return linearise(iterate, Hessian::none);
}

void Linearisation::prepare(const Iterate& iterate, Hessian hessian) noexcept { linearise(iterate, hessian); }

void Linearisation::refresh(const Iterate& iterate) noexcept {
  RHEC_ASSERT(is_at(iterate), "`prepare` at the same iterate comes first");
  ocp_.refresh(iterate, qp_, scratch_);
}

void Linearisation::remember(const Iterate& iterate) noexcept {
  is_known_ = true;
  std::copy_n(iterate.row(0), static_cast<std::ptrdiff_t>(ocp_.intervals() + 1) * qp_.stride(), iterate_.row(0));
}

bool Linearisation::is_at(const Iterate& iterate) const noexcept {
  const int N = ocp_.intervals();
  if (!is_known_ || qp_.intervals() != N) return false;
  for (int i = 0; i <= N; ++i)
    if (qp_.states(i) != ocp_.state_count(i) || (i < N && qp_.controls(i) != ocp_.control_count(i))) return false;
  const std::size_t bytes = static_cast<std::size_t>(N + 1) * qp_.stride() * sizeof(double);
  return std::memcmp(iterate_.row(0), iterate.row(0), bytes) == 0;
}

void Linearisation::forget() noexcept { is_known_ = false; }

}  // namespace rhec
