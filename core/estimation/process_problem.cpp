#include "process_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace rhec {

std::shared_ptr<const ProcessModel> make_process_model(const std::shared_ptr<const Model>& vehicle,
                                                       const PriorBank& bank) {
  std::vector<int> counts(vehicle->parameter_count());
  for (int j = 0; j < vehicle->parameter_count(); ++j) counts[j] = bank.process_states(j);
  return std::make_shared<ProcessModel>(vehicle, std::move(counts));
}

RheProblem make_process_problem(std::shared_ptr<const ProcessModel> model, RheProblem::Setup setup) {
  const ModelDescription& vehicle = model->vehicle().description();
  const auto fill_up = [](std::vector<double>& bounds, const std::vector<Variable>& variables, auto bound) {
    if (bounds.empty())
      for (const Variable& variable : variables) bounds.push_back(bound(variable));
  };
  fill_up(setup.state_lower, vehicle.states, [](const Variable& v) { return v.lower; });
  fill_up(setup.state_upper, vehicle.states, [](const Variable& v) { return v.upper; });
  fill_up(setup.parameter_lower, vehicle.parameters, [](const Variable& v) { return v.lower; });
  fill_up(setup.parameter_upper, vehicle.parameters, [](const Variable& v) { return v.upper; });
  for (std::size_t j = 0; j < vehicle.parameters.size(); ++j) {
    const auto states = static_cast<std::size_t>(model->process_states(static_cast<int>(j)));
    setup.state_lower.push_back(setup.parameter_lower[j]);
    setup.state_upper.push_back(setup.parameter_upper[j]);
    setup.state_lower.resize(setup.state_lower.size() + states - 1, -infinity);
    setup.state_upper.resize(setup.state_upper.size() + states - 1, infinity);
    setup.input_weights.resize(setup.input_weights.size() + states, 1.0);
    if (!setup.input_lower.empty()) {
      setup.input_lower.resize(setup.input_lower.size() + states, -infinity);
      setup.input_upper.resize(setup.input_upper.size() + states, infinity);
    }
  }
  setup.parameter_lower.clear();
  setup.parameter_upper.clear();
  setup.one_block.clear();
  return {std::move(model), std::move(setup)};
}

InformationOf::InformationOf(Eigen::Index n)
    : sigmas_(Eigen::VectorXd::Zero(n)), scaled_(Eigen::MatrixXd::Zero(n, n)), inverse_(scaled_) {
  factor_.compute(Eigen::MatrixXd::Identity(n, n));  // which has room then
}

void InformationOf::find(const Eigen::MatrixXd& covariance, Eigen::MatrixXd& information) noexcept {
  const Eigen::Index n = covariance.rows();
  for (Eigen::Index j = 0; j < n; ++j) sigmas_[j] = std::sqrt(std::max(covariance(j, j), 1e-30));
  // A covariance of full rank may lose it in rounding, if its correlations are almost 1.
  for (const double added : {0.0, 1e-12, 1e-9, 1e-6}) {
    for (Eigen::Index c = 0; c < n; ++c)
      for (Eigen::Index r = 0; r < n; ++r)
        scaled_(r, c) = covariance(r, c) / (sigmas_[r] * sigmas_[c]) + (r == c ? added : 0.0);
    factor_.compute(scaled_);
    if (factor_.info() == Eigen::Success) break;
  }
  inverse_.setIdentity();
  factor_.solveInPlace(inverse_);
  for (Eigen::Index c = 0; c < n; ++c)
    for (Eigen::Index r = 0; r < n; ++r)
      information(r, c) = 0.5 * (inverse_(r, c) + inverse_(c, r)) / (sigmas_[r] * sigmas_[c]);
}

}  // namespace rhec
