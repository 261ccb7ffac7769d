#include "noise_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/state_noise_model.hpp"

namespace rhec {
namespace {

using Setup = RecedingHorizonEstimation::Setup;

std::string name_of(const Model& model, int state) {
  const auto& states = model.description().states;
  return state >= 0 && state < std::ssize(states) ? states[static_cast<std::size_t>(state)].name
                                                  : fmt::format("number {}", state);
}

/// The index of a state's noise among the inputs.
std::size_t input_of(const Model& model, int state) {
  const std::vector<int>& noisy = model.description().noisy_states;
  const auto found = std::find(noisy.begin(), noisy.end(), state);
  if (found == noisy.end())
    throw Error(fmt::format("estimator: state '{}' has no process noise that could be blocked; give it some",
                            name_of(model, state)));
  return static_cast<std::size_t>(model.input_count() - (noisy.end() - found));
}

}  // namespace

std::string RecedingHorizonEstimation::why_not_noise(const Blocking& blocking, int horizon) {
  if (std::string reason = blocking.why_not(horizon); !reason.empty()) return reason;
  if (blocking.transition() == Transition::ramp || blocking.neighbour_sigma())
    return "blocks of process noise jump, and know nothing of each other; expected neither a ramp nor a "
           "neighbour_sigma";
  const int length = 2 * horizon;
  std::vector<std::uint8_t> of_run(static_cast<std::size_t>(length)), of_window(of_run);
  blocking.starts({0, length}, of_run.data());
  for (int first = 1; first <= horizon; ++first) {
    blocking.starts({first, length - first}, of_window.data());
    for (int i = first + 1; i < length; ++i)
      if (of_run[i] != of_window[i - first])
        return "blocks of process noise have their borders at fixed intervals of the run, and these move with the "
               "horizon; expected others, such as those of 'anchor: time'";
  }
  return {};
}

std::shared_ptr<const Model> with_noise_blocks(const std::shared_ptr<const Model>& model, const Setup& setup) {
  if (setup.noises.empty()) return model;
  std::vector<int> blocked;
  for (const Setup::BlockedNoise& noise : setup.noises) {
    input_of(*model, noise.state);
    blocked.push_back(noise.state);
  }
  const auto* noisy = dynamic_cast<const StateNoiseModel*>(model.get());
  if (!noisy) throw Error("estimator: the process noise of this model cannot be blocked; expected a StateNoiseModel");
  std::vector<int> others;
  for (const int state : noisy->states())
    if (std::ranges::count(blocked, state) == 0) others.push_back(state);
  return std::make_shared<StateNoiseModel>(noisy->shared_vehicle(), std::move(others), std::move(blocked));
}

Setup with_noise_blocks(const Model& model, Setup setup) {
  if (setup.noises.empty()) return setup;
  std::vector<std::size_t> inputs;
  const Eigen::Index n = setup.initial_mean.size(), added = std::ssize(setup.noises);
  setup.initial_mean.conservativeResize(n + added);
  setup.initial_mean.tail(added).setZero();
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n + added, n + added);
  covariance.topLeftCorner(setup.initial_covariance.rows(), setup.initial_covariance.cols()) = setup.initial_covariance;
  for (Eigen::Index k = 0; k < added; ++k) {
    const Setup::BlockedNoise& noise = setup.noises[static_cast<std::size_t>(k)];
    const std::string name = name_of(model, noise.state) + "_noise";
    if (const std::string reason =
            RecedingHorizonEstimation::why_not_noise(*noise.blocking, setup.problem.max_intervals);
        !reason.empty())
      throw Error(fmt::format("blocking of '{}': {}", name, reason));
    inputs.push_back(input_of(model, noise.state));
    const double weight = setup.problem.input_weights.at(inputs.back());
    if (!(weight > 0.0) || !std::isfinite(weight))
      throw Error(fmt::format("blocking of '{}': its weight is {}; expected a number above 0", name, weight));
    covariance(n + k, n + k) = 1.0 / weight;
    setup.blockings.push_back(noise.blocking);
    setup.walks.push_back({.process_noise = 0.0, .noise_sigma = 1.0 / std::sqrt(weight)});
  }
  setup.initial_covariance = std::move(covariance);
  // Without the model's own bounds for the vehicle's parameters, there would be none for noise either.
  const auto& parameters = model.description().parameters;
  const auto fill = [&](std::vector<double>& bounds, double Variable::*own, double none) {
    if (bounds.empty())
      for (const Variable& parameter : parameters) bounds.push_back(parameter.*own);
    bounds.resize(bounds.size() + setup.noises.size(), none);
  };
  fill(setup.problem.parameter_lower, &Variable::lower, -std::numeric_limits<double>::infinity());
  fill(setup.problem.parameter_upper, &Variable::upper, std::numeric_limits<double>::infinity());
  std::sort(inputs.begin(), inputs.end(), std::greater<>());
  for (auto* of_inputs : {&setup.problem.input_weights, &setup.problem.input_lower, &setup.problem.input_upper})
    for (const std::size_t input : inputs)
      if (!of_inputs->empty()) of_inputs->erase(of_inputs->begin() + static_cast<std::ptrdiff_t>(input));
  return setup;
}

}  // namespace rhec
