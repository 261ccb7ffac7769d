#include "rhec/sim/world/truth.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/step_requirement.hpp"

namespace rhec::sim {
namespace {

// Maximum number of steps merged into one.
constexpr int longest = 5;
// Error tolerance of merged steps, in typical magnitudes of a state.
constexpr double seen = 1e-8;

void check_sigmas(const char* kind, const std::vector<double>& sigmas, const std::vector<Variable>& variables) {
  if (!sigmas.empty() && sigmas.size() != variables.size()) {
    throw Error(fmt::format("simulation: {} standard deviation(s) for {} {}(s); give one each, or none at all",
                            sigmas.size(), variables.size(), kind));
  }
  for (std::size_t i = 0; i < sigmas.size(); ++i) {
    if (!(std::isfinite(sigmas[i]) && sigmas[i] >= 0.0)) {
      throw Error(fmt::format("simulation: the standard deviation of {} '{}' is {}; expected 0 or more", kind,
                              variables[i].name, sigmas[i]));
    }
  }
}

}  // namespace

TruthVehicle::TruthVehicle(const Model& model, const SlipField& field, const Eigen::VectorXd& initial_state,
                           const TruthOptions& options)
    : model_(&model), field_(&field), options_(options), state_(initial_state) {
  const ModelDescription& description = model.description();
  const int n_x = model.state_count(), n_p = model.parameter_count();
  if (description.roles.position_x < 0 || description.roles.position_y < 0) {
    throw Error(
        fmt::format("truth vehicle: model '{}' does not say which states are its position, by which slip is looked "
                    "up; set position_x and position_y among its roles",
                    description.name));
  }
  if (field.channels() != n_p) {
    throw Error(
        fmt::format("truth vehicle: the slip field has {} channel(s), but model '{}' has {} parameter(s); give one "
                    "channel per parameter",
                    field.channels(), description.name, n_p));
  }
  if (initial_state.size() != n_x) {
    throw Error(fmt::format("truth vehicle: the initial state has {} value(s), but model '{}' has {} state(s)",
                            initial_state.size(), description.name, n_x));
  }
  if (!(std::isfinite(options.step) && options.step > 0.0)) {
    throw Error(fmt::format("truth vehicle: step is {}; expected a time greater than 0 s", options.step));
  }
  lower_.resize(n_x);
  upper_.resize(n_x);
  scales_.resize(n_x);
  for (int i = 0; i < n_x; ++i) {
    const Variable& variable = description.states[i];
    lower_[i] = variable.lower;
    upper_[i] = variable.upper;
    scales_[i] = variable.scale;
    const bool inside = !options.mechanical_stops || (state_[i] >= lower_[i] && state_[i] <= upper_[i]);
    if (!std::isfinite(state_[i]) || !inside) {
      throw Error(fmt::format("truth vehicle: the initial {} is {} {}; expected a value in [{}, {}]", variable.name,
                              state_[i], variable.unit, lower_[i], upper_[i]));
    }
  }
  for (Eigen::VectorXd* vector : {&stage_state_, &rates_, &stage_rates_, &end_rates_, &sum_rates_})
    vector->setZero(n_x);
  for (Eigen::VectorXd* vector :
       {&parameters_, &mean_parameters_, &stage_parameters_, &step_parameters_, &sum_parameters_}) {
    vector->setZero(n_p);
  }
  check_sigmas("process noise of state", options.noise, description.states);
  for (std::size_t j = 0; j < options.noise.size(); ++j)
    noise_.emplace_back(options.seed, fmt::format("process noise of {}", description.states[j].name));
  shorten_steps();
  position_x_ = description.roles.position_x;
  position_y_ = description.roles.position_y;
  look_up(state_.data(), parameters_.data());
  mean_parameters_ = parameters_;
}

/// The true vehicle is followed, however short its time constants. A model that is no formula is asked for its rates
/// alone.
void TruthVehicle::shorten_steps() {
  if (!model_->graph()) return;
  const ModelDescription& about = model_->description();
  const auto points = operating_points(*model_, about, nominal_values(about.parameters));
  const StepRequirement needed = step_requirement(*model_, points, options_.step);
  if (needed.mode_substeps == 0)
    throw Error(
        fmt::format("truth vehicle: model '{}' has a time constant of {:.3g} s, in the state '{}', which {} steps in "
                    "{:g} s do not follow; shorten `vehicle.step`, or leave out of the model what settles so fast",
                    about.name, needed.time_constant, about.states[needed.state].name, StepRequirement::most_substeps,
                    options_.step));
  options_.step /= needed.mode_substeps;
}

void TruthVehicle::look_up(const double* state, double* parameters) const noexcept {
  field_->sample(state[position_x_], state[position_y_], parameters);
}

/// True if it had to move the state.
bool TruthVehicle::stop(double* state) const noexcept {
  if (!options_.mechanical_stops) return false;
  bool stopped = false;
  for (Eigen::Index j = 0; j < lower_.size(); ++j) {
    const double inside = std::min(std::max(state[j], lower_[j]), upper_[j]);
    stopped = stopped || inside != state[j];
    state[j] = inside;
  }
  return stopped;
}

/// Steps from the state, whose slip and rates are known, to the next one with its slip and rates. With `must_fit`, does
/// not step and returns false if the error estimate exceeds the tolerance.
bool TruthVehicle::step(const double* inputs, double duration, bool must_fit) noexcept {
  constexpr double reach[] = {0.0, 0.5, 0.5, 1.0};
  constexpr double weight[] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
  const Eigen::Index n_x = state_.size(), n_p = parameters_.size();
  const double* const state = state_.data();
  double *stage_state = stage_state_.data(), *stage_parameters = stage_parameters_.data(), *rates = stage_rates_.data();
  double *sum_rates = sum_rates_.data(), *sum_parameters = step_parameters_.data();
  bool stopped = false;
  stage_rates_ = rates_;
  stage_parameters_ = parameters_;
  for (int stage = 0; stage < 4; ++stage) {
    if (stage > 0) {
      for (Eigen::Index j = 0; j < n_x; ++j) stage_state[j] = state[j] + reach[stage] * duration * rates[j];
      stopped = stop(stage_state) || stopped;
      look_up(stage_state, stage_parameters);
      model_->rates(stage_state, inputs, stage_parameters, rates);
    }
    for (Eigen::Index j = 0; j < n_x; ++j) sum_rates[j] = (stage > 0 ? sum_rates[j] : 0.0) + weight[stage] * rates[j];
    for (Eigen::Index j = 0; j < n_p; ++j)
      sum_parameters[j] = (stage > 0 ? sum_parameters[j] : 0.0) + weight[stage] * duration * stage_parameters[j];
  }
  for (Eigen::Index j = 0; j < n_x; ++j) stage_state[j] = state[j] + duration * sum_rates[j];
  stopped = stop(stage_state) || stopped;
  look_up(stage_state, stage_parameters);
  double* const end_rates = end_rates_.data();
  model_->rates(stage_state, inputs, stage_parameters, end_rates);
  if (must_fit) {
    if (stopped) return false;
    // With the rates at the end instead of those of the last stage, the step is of third order (Hairer, Norsett &
    // Wanner 1993, II.4): the difference of the two bounds the error with a wide margin.
    for (Eigen::Index j = 0; j < n_x; ++j)
      if (!(std::abs(duration / 6.0 * (rates[j] - end_rates[j])) <= seen * scales_[j])) return false;
  }
  state_.swap(stage_state_);
  parameters_.swap(stage_parameters_);
  rates_.swap(end_rates_);
  sum_parameters_ += step_parameters_;
  return true;
}

void TruthVehicle::advance(const double* inputs, double duration) noexcept {
  if (!(duration > 0.0)) return;
  // A duration that is a whole number of steps up to rounding takes that number.
  const int steps = std::max(1, static_cast<int>(std::ceil(duration / options_.step - 1e-9)));
  sum_parameters_.setZero();
  model_->rates(state_.data(), inputs, parameters_.data(), rates_.data());
  int most = field_->is_smooth() ? longest : 1;
  for (int done = 0; done < steps;) {
    int at_once = std::min(most, steps - done);
    while (!step(inputs, duration * at_once / steps, at_once > 1)) at_once = most = at_once / 2;
    done += at_once;
  }
  time_ += duration;
  mean_parameters_ = sum_parameters_ / duration;
  if (!noise_.empty()) disturb(duration);
}

/// Every state has its own random stream, whether it is disturbed or not.
void TruthVehicle::disturb(double duration) noexcept {
  for (std::size_t j = 0; j < noise_.size(); ++j)
    state_[static_cast<Eigen::Index>(j)] += std::sqrt(duration) * options_.noise[j] * noise_[j].normal();
  stop(state_.data());
  look_up(state_.data(), parameters_.data());
}

Sensors::Sensors(const Model& model, const SensorNoise& noise, std::uint64_t seed)
    : model_(&model), motion_(model), values_(motion_.count()) {
  const ModelDescription& description = model.description();
  const auto fill = [&](std::vector<Channel>& channels, const char* kind, const std::vector<double>& sigmas,
                        const std::vector<Variable>& variables) {
    check_sigmas(kind, sigmas, variables);
    for (std::size_t i = 0; i < variables.size(); ++i) {
      channels.push_back({sigmas.empty() ? 0.0 : sigmas[i],
                          RandomStream(seed, fmt::format("noise of {} {}", kind, variables[i].name))});
    }
  };
  fill(outputs_, "output", noise.outputs, description.outputs);
  fill(inputs_, "input", noise.inputs, description.inputs);
  std::vector<double> errors;
  const auto draw = [&](const char* kind, const std::vector<SensorDrift>& given) {
    for (std::size_t j = 0; j < given.size(); ++j) {
      if (!(given[j].sigma > 0.0)) continue;
      walks_.push_back({static_cast<int>(j), given[j].drift,
                        RandomStream(seed, fmt::format("{} of output {}", kind, description.outputs[j].name))});
      errors.push_back(given[j].sigma * walks_.back().random.normal());
    }
  };
  draw("bias", noise.biases);
  biases_ = std::ssize(walks_);
  draw("scale error", noise.scales);
  errors_ = Eigen::Map<const Eigen::VectorXd>(errors.data(), std::ssize(errors));
}

void Sensors::advance(double duration) noexcept {
  const double root = std::sqrt(duration);
  for (std::size_t k = 0; k < walks_.size(); ++k)
    errors_[static_cast<Eigen::Index>(k)] += root * walks_[k].drift * walks_[k].random.normal();
}

void Sensors::observe(const double* state, double* outputs, const Motion* motion) noexcept {
  model_->observe({.count = 1, .states = state, .outputs = outputs});
  values_.setConstant(std::numeric_limits<double>::quiet_NaN());
  if (motion)
    motion_.evaluate({.count = 1,
                      .states = state,
                      .inputs = motion->inputs,
                      .parameters = motion->parameters,
                      .outputs = values_.data()});
  for (std::size_t k = 0; k < motion_.which().size(); ++k) outputs[motion_.which()[k]] = values_[std::ptrdiff_t(k)];
  // Scale errors first, then biases.
  for (std::ptrdiff_t k = std::ssize(walks_); k-- > 0;) {
    double& output = outputs[walks_[static_cast<std::size_t>(k)].output];
    output = k < biases_ ? output + errors_[k] : (1.0 + errors_[k]) * output;
  }
  for (Channel& channel : outputs_) *outputs++ += channel.sigma * channel.random.normal();
}

void Sensors::measure_inputs(const double* inputs, double* measured) noexcept {
  for (Channel& channel : inputs_) *measured++ = *inputs++ + channel.sigma * channel.random.normal();
}

}  // namespace rhec::sim
