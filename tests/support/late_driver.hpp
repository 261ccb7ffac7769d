#pragma once

#include <cmath>
#include <vector>

#include "rhec/core/estimation/estimation_method.hpp"

namespace rhec::testing {

/// Drives a method node by node. Outputs that come late are used as Estimator does it: nodes are taken back, and added
/// anew with what is known by then.
class LateDriver {
 public:
  explicit LateDriver(EstimationMethod& method) : method_(method) {}
  void start(const double* outputs) {
    nodes_ = {{0.0, {}, row(outputs)}};
    method_.start(outputs);
  }
  void add_node(double duration, const double* inputs, const double* outputs) {
    nodes_.push_back({duration, {inputs, inputs + method_.model().input_count()}, row(outputs)});
    method_.add_node(duration, inputs, outputs);
  }
  /// False, and nothing happens, if the node is out of reach.
  bool amend(int back, const double* outputs) {
    if (back + 1 > method_.reach()) return false;
    method_.rewind(back + 1);
    const std::size_t first = nodes_.size() - 1 - static_cast<std::size_t>(back);
    for (std::size_t j = 0; j < nodes_[first].outputs.size(); ++j)
      if (!std::isnan(outputs[j])) nodes_[first].outputs[j] = outputs[j];
    for (std::size_t i = first; i < nodes_.size(); ++i) {
      const Node& node = nodes_[i];
      if (i == 0)
        method_.start(node.outputs.data());
      else
        method_.add_node(node.duration, node.inputs.data(), node.outputs.data());
    }
    return true;
  }

 private:
  struct Node {
    double duration;
    std::vector<double> inputs, outputs;
  };
  std::vector<double> row(const double* outputs) const { return {outputs, outputs + method_.model().output_count()}; }
  EstimationMethod& method_;
  std::vector<Node> nodes_;
};

}  // namespace rhec::testing
