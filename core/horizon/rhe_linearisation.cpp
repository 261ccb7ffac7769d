#include "rhe_linearisation.hpp"

#include "rhec/core/base/padded.hpp"

namespace rhec {

RheLinearisation::RheLinearisation(const RheProblem& problem)
    : HorizonLinearisation(problem),
      problem_(problem),
      outputs_(problem.capacity().intervals + 1, padded(problem.model().output_count()),
               static_cast<std::ptrdiff_t>(problem.model().output_count()) * padded(problem.model().state_count())) {}

void RheLinearisation::forget() noexcept {
  HorizonLinearisation::forget();
  outputs_.forget();
}

double RheLinearisation::write_cost(StageRange range, const Iterate& iterate, Hessian hessian,
                                    CostParts parts) noexcept {
  return problem_.write_cost(range, iterate, hessian, parts, qp_, knows_anything() ? &outputs_ : nullptr, scratch_);
}

void RheLinearisation::move_nodes(int steps) noexcept {
  outputs_.move(steps, known_nodes(), [this](int node) { return same_node(node); });
}

}  // namespace rhec
