#include "rhec/plugins/robot/hooks.hpp"

#include <utility>

namespace rhec {

std::shared_ptr<Solver> RobotHooks::wrap_solver(std::string_view, std::shared_ptr<Solver> solver) const {
  return solver;
}

std::unique_ptr<EstimationMethod> RobotHooks::wrap_method(std::unique_ptr<EstimationMethod> method) const {
  return method;
}

void RobotHookChain::add(std::shared_ptr<const RobotHooks> hooks) { links_.push_back(std::move(hooks)); }

std::shared_ptr<Solver> RobotHookChain::wrap_solver(std::string_view kind, std::shared_ptr<Solver> solver) const {
  for (const auto& link : links_) solver = link->wrap_solver(kind, std::move(solver));
  return solver;
}

std::unique_ptr<EstimationMethod> RobotHookChain::wrap_method(std::unique_ptr<EstimationMethod> method) const {
  for (const auto& link : links_) method = link->wrap_method(std::move(method));
  return method;
}

}  // namespace rhec
