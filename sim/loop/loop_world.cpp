#include "rhec/sim/loop/loop_world.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace rhec::sim {
namespace {

bool has_value(const std::vector<double>& outputs) {
  return std::any_of(outputs.begin(), outputs.end(), [](double value) { return !std::isnan(value); });
}

std::vector<SensorDrift> drifts_of(const std::vector<SensorError>& errors) {
  std::vector<SensorDrift> drifts;
  drifts.reserve(errors.size());
  for (const auto& [sigma, drift] : errors) drifts.push_back({sigma, drift});
  return drifts;
}

}  // namespace

SensorNoise noise_of(const Robot& robot) {
  return {.outputs = robot.output_sigmas(),
          .inputs = robot.input_sigmas(),
          .biases = drifts_of(robot.output_biases()),
          .scales = drifts_of(robot.output_scales())};
}

LoopWorld::LoopWorld(const Scenario& scenario, const SensorNoise& noise)
    : truth_(*scenario.robot().model(), scenario.terrain(), scenario.initial_state(), scenario.vehicle()),
      sensors_(*scenario.robot().model(), noise, static_cast<std::uint64_t>(scenario.options().seed)),
      faults_(scenario.faults(), scenario.robot().model()->description(),
              static_cast<std::uint64_t>(scenario.options().seed)),
      schedule_(scenario.sensor_timings()),
      actuators_(scenario.actuators()),
      is_plain_(schedule_.latencies().size() == 1 && !std::isfinite(schedule_.next_after(0.0))),
      outputs_(scenario.robot().model()->output_count()),
      row_(outputs_.size()),
      added_(outputs_.size()),
      measured_(scenario.robot().model()->input_count()),
      given_(measured_.size()) {}

void LoopWorld::measure(double time, bool is_sample) {
  faults_.begin(time);
  const Sensors::Motion motion{actuators_.applied().data(), truth_.parameters().data()};
  sensors_.observe(truth_.state().data(), outputs_.data(), has_moved_ ? &motion : nullptr);
  schedule_.keep_due(time, is_sample, outputs_);
  std::fill(added_.begin(), added_.end(), std::numeric_limits<double>::quiet_NaN());
  for (const double latency : schedule_.latencies()) {
    row_ = outputs_;
    schedule_.keep_latency(latency, row_);
    // A message of sensors that are due is sent, whatever a fault makes of it.
    if (!is_plain_ && !has_value(row_)) continue;
    faults_.change_outputs(row_.data());
    for (std::size_t j = 0; j < row_.size(); ++j)
      if (!std::isnan(row_[j])) added_[j] = row_[j] - outputs_[j];
    faults_.send(row_, latency, deliveries_);
  }
}

void LoopWorld::drive(const std::vector<double>& inputs, double time, double duration) {
  const double end = time + duration;
  given_ = inputs;
  faults_.change_applied_inputs(given_.data());
  double now = time;
  const auto go_to = [&](double then) {
    // The whole duration as it was given, not as a difference of times, which is rounded.
    const double piece = then == end && now == time ? duration : then - now;
    actuators_.advance(truth_, given_.data(), piece);
    sensors_.advance(piece);
    has_moved_ = true;
    now = then;
  };
  for (double next = schedule_.next_after(time); next < end - Deliveries::tolerance;
       next = schedule_.next_after(next)) {
    go_to(next);
    measure(next, false);
    given_ = inputs;
    faults_.change_applied_inputs(given_.data());
  }
  go_to(end);
}

const std::vector<double>& LoopWorld::measured_inputs(const std::vector<double>& inputs) {
  sensors_.measure_inputs(inputs.data(), measured_.data());
  faults_.change_measured_inputs(measured_.data());
  return measured_;
}

}  // namespace rhec::sim
