#include "rhe_linearisation.hpp"

#include "rhec/core/base/padded.hpp"

namespace rhec {

RheLinearisation::RheLinearisation(const RheProblem& problem)
    : HorizonLinearisation(problem),
      problem_(problem),
      outputs_(problem.capacity().intervals + 1, padded(problem.model().output_count()),
               static_cast<std::ptrdiff_t>(problem.model().output_count()) * padded(problem.model().state_count())),
      between_(problem.capacity().intervals, problem.setup().most_between, problem.between_key_size(),
               problem.between_said_size(), problem.between_kept_size()) {}

void RheLinearisation::forget() noexcept {
  HorizonLinearisation::forget();
  outputs_.forget();
  between_.forget();
}

double RheLinearisation::write_cost(StageRange range, const Iterate& iterate, Hessian hessian,
                                    CostParts parts) noexcept {
  const bool is_moving = knows_anything();
  return problem_.write_cost(range, iterate, hessian, parts, qp_, is_moving ? &outputs_ : nullptr,
                             is_moving ? &between_ : nullptr, scratch_);
}

void RheLinearisation::move_nodes(int steps) noexcept {
  outputs_.move(steps, known_nodes(), [this](int node) { return same_node(node); });
  between_.move(steps);
}

}  // namespace rhec
