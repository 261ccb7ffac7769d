#include "rhec/plugins/robot/sensors.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "rhec/core/model/sensor_model.hpp"
#include "rhec/core/model/state_noise_model.hpp"

namespace rhec {
namespace {

/// Process noise over a step of a value of motion, of its sensor's noise. Given state and slip, several of these values
/// are functions of one input: without it, their covariance is singular.
constexpr double share_of_noise = 0.01;
/// Standard deviation of a value of motion at the first node, of its typical magnitude: nothing is known of it.
constexpr double wide = 10.0;

SensorModel::Errors errors_of(const NoiseSection& noise) {
  SensorModel::Errors errors;
  for (std::size_t j = 0; j < noise.biases.size(); ++j) {
    if (noise.biases[j].sigma > 0.0) errors.biased.push_back(static_cast<int>(j));
    if (noise.scales[j].sigma > 0.0) errors.scaled.push_back(static_cast<int>(j));
  }
  return errors;
}

std::shared_ptr<const SensorModel> sensor_model(const RobotContext& context) {
  SensorModel::Errors errors = errors_of(context.noise);
  if (errors.biased.empty() && errors.scaled.empty() && outputs_of_motion(*context.model).empty()) return nullptr;
  return std::make_shared<const SensorModel>(context.model, std::move(errors));
}

/// Null if there is none.
const SensorModel* sensors_in(const Model& model) noexcept {
  if (const auto* noisy = dynamic_cast<const StateNoiseModel*>(&model)) return sensors_in(noisy->vehicle());
  return dynamic_cast<const SensorModel*>(&model);
}

}  // namespace

std::shared_ptr<const RobotContext> with_sensors(std::shared_ptr<const RobotContext> context) {
  const auto model = sensor_model(*context);
  if (!model) return context;
  RobotContext changed = *context;
  const std::vector<Variable>& states = model->description().states;
  changed.about.states.insert(changed.about.states.end(), states.begin() + model->first_bias(), states.end());
  NoiseSection& noise = changed.noise;
  for (const int j : model->errors().biased) noise.state_sigmas.push_back(noise.biases[j].drift);
  for (const int j : model->errors().scaled) noise.state_sigmas.push_back(noise.scales[j].drift);
  for (const int j : model->motion().which())
    noise.state_sigmas.push_back(share_of_noise * noise.output_sigmas[j] / std::sqrt(context->step));
  changed.model = model;
  return std::make_shared<const RobotContext>(std::move(changed));
}

ModelDescription with_sensor_errors(const RobotContext& context) {
  ModelDescription about = context.about;
  if (const auto model = sensor_model(context)) {
    const std::vector<Variable>& states = model->description().states;
    about.states.insert(about.states.end(), states.begin() + model->first_bias(),
                        states.begin() + model->first_motion());
  }
  return about;
}

std::vector<double> initial_sensor_sigmas(const RobotContext& vehicle, const RobotContext& with_sensors) {
  std::vector<double> sigmas;
  if (&vehicle == &with_sensors) return sigmas;
  for (const SensorError& bias : vehicle.noise.biases)
    if (bias.sigma > 0.0) sigmas.push_back(bias.sigma);
  for (const SensorError& scale : vehicle.noise.scales)
    if (scale.sigma > 0.0) sigmas.push_back(scale.sigma);
  const std::vector<Variable>& states = with_sensors.about.states;
  for (std::size_t j = vehicle.about.states.size() + sigmas.size(); j < states.size(); ++j)
    sigmas.push_back(wide * states[j].scale);
  return sigmas;
}

bool senses_motion(const Model& model) noexcept {
  const SensorModel* const sensors = sensors_in(model);
  return sensors && sensors->motion().count() > 0;
}

std::vector<int> sensed_motion(const Model& model) {
  const SensorModel* const sensors = sensors_in(model);
  return sensors ? sensors->motion().which() : std::vector<int>{};
}

std::vector<ScaledOutput> scaled_outputs(const Model& model) {
  std::vector<ScaledOutput> scaled;
  const SensorModel* const sensors = sensors_in(model);
  if (!sensors) return scaled;
  const std::vector<int>& of_motion = sensors->motion().which();
  int state = sensors->first_scale();
  for (const int output : sensors->errors().scaled) {
    if (!std::ranges::binary_search(of_motion, output)) scaled.push_back({output, state});
    ++state;
  }
  return scaled;
}

}  // namespace rhec
