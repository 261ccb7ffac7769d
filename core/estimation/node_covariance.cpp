#include "node_covariance.hpp"

#include <algorithm>
#include <cmath>

namespace rhec {

NodeCovariance::NodeCovariance(const HorizonProblem& problem)
    : qp_(problem.capacity()), riccati_(problem.capacity()), no_active_bounds_(problem.capacity()) {
  const auto states = static_cast<std::size_t>(problem.capacity().states);
  covariances_.assign((static_cast<std::size_t>(problem.capacity().intervals) + 1) * states * states, 0.0);
  scratch_.assign(problem.scratch_size(), 0.0);
}

const double* NodeCovariance::find(const HorizonProblem& problem, Solver& solver, const Iterate& point,
                                   int node) noexcept {
  const int ns = problem.capacity().states;
  const bool is_last = node == problem.intervals();
  double* const of_node = covariances_.data() + (is_last ? 0 : static_cast<std::ptrdiff_t>(node) * ns * ns);
  if (!is_last || !solver.covariances(point, {node, node}, covariances_)) {
    problem.linearise(all_stages(problem), point, Hessian::gauss_newton, qp_, scratch_);
    riccati_.factor_for_covariances(qp_, no_active_bounds_);
    riccati_.covariances(qp_, is_last ? nullptr : covariances_.data(), is_last ? of_node : nullptr);
  }
  return std::all_of(of_node, of_node + ns * ns, [](double value) { return std::isfinite(value); }) ? of_node : nullptr;
}

}  // namespace rhec
