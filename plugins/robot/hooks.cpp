#include "rhec/plugins/robot/hooks.hpp"

#include <utility>

namespace rhec {
namespace {

class NodeHooks final : public RobotHooks {
 public:
  explicit NodeHooks(std::shared_ptr<NodeLog> log) : log_(std::move(log)) {}
  std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const override {
    return std::make_unique<NodeRecorder>(std::move(method), log_);
  }

 private:
  std::shared_ptr<NodeLog> log_;
};

}  // namespace

std::shared_ptr<const RobotHooks> recording_nodes(std::shared_ptr<NodeLog> log) {
  return std::make_shared<NodeHooks>(std::move(log));
}

std::shared_ptr<Solver> RobotHooks::wrap_solver(std::string_view, std::shared_ptr<Solver> solver) const {
  return solver;
}

std::unique_ptr<EstimationMethod> RobotHooks::wrap_method(std::unique_ptr<EstimationMethod> method) const {
  return method;
}

std::shared_ptr<SlipMap> RobotHooks::provide_map(const MemorySection&, std::shared_ptr<SlipMap> map) const {
  return map;
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

std::shared_ptr<SlipMap> RobotHookChain::provide_map(const MemorySection& memory, std::shared_ptr<SlipMap> map) const {
  for (const auto& link : links_) map = link->provide_map(memory, std::move(map));
  return map;
}

}  // namespace rhec
