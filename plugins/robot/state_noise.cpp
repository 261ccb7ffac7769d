#include "rhec/plugins/robot/state_noise.hpp"

#include <cstddef>
#include <utility>
#include <vector>

#include "rhec/core/model/state_noise_model.hpp"

namespace rhec {

std::shared_ptr<const RobotContext> with_state_noise(std::shared_ptr<const RobotContext> context) {
  std::vector<int> states;
  for (std::size_t j = 0; j < context->noise.state_sigmas.size(); ++j)
    if (context->noise.state_sigmas[j] > 0.0) states.push_back(static_cast<int>(j));
  if (states.empty()) return context;
  RobotContext changed = *context;
  auto model = std::make_shared<const StateNoiseModel>(context->model, states);
  const std::vector<Variable>& inputs = model->description().inputs;
  changed.about.inputs.insert(changed.about.inputs.end(), inputs.end() - std::ssize(states), inputs.end());
  changed.about.noisy_states = states;
  for (const int j : states) changed.noise.input_sigmas.push_back(context->noise.state_sigmas[j]);
  changed.model = std::move(model);
  return std::make_shared<const RobotContext>(std::move(changed));
}

}  // namespace rhec
