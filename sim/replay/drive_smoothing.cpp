#include "rhec/sim/replay/drive_smoothing.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/logs/smoothing.hpp"

namespace rhec::sim {
namespace {

using Seconds = std::chrono::duration<double>;

}  // namespace

SmoothedDriveReplay smooth_drive(const std::string& name, const Robot& robot, const logs::Drive& drive,
                                 const HoldOut& hold_out, const std::optional<Eigen::VectorXd>& simulated_start,
                                 const LoopHooks& hooks) {
  SmoothedDriveReplay result;
  const auto nodes = std::make_shared<NodeLog>();
  Robot recorded = robot;
  recorded.add_hooks(recording_nodes(nodes));
  result.causal = replay_drive(recorded, drive, hold_out, simulated_start, hooks);
  result.causal.name = name + causal_suffix;
  if (result.causal.estimates.empty()) throw Error("the log has no measurement that is not withheld");
  const auto begin = Clock::now();
  const SmoothedRun run =
      robot.make_smoother(start_of(robot, drive, simulated_start))->estimate(*nodes, robot.smoothing_deadline());
  result.report = run.report;
  result.laws = run.laws;
  result.intervals = run.intervals();
  result.has_sigmas = !run.covariances.empty();
  result.solve_seconds = run.solve_seconds;

  const Model& model = *robot.estimator_model();
  const int nx = model.state_count(), np = model.parameter_count();
  const Eigen::Index results = std::ssize(robot.estimated_description().states);
  const std::ptrdiff_t n = std::ptrdiff_t{nx} + np;
  const double first_time = result.causal.start;
  result.smoothed = result.causal;
  result.smoothed.name = name;
  result.smoothed.seconds = Seconds(Clock::now() - begin).count();
  result.smoothed.solve_us = {1e6 * run.solve_seconds};
  result.smoothed.counts.estimates = 1;
  result.smoothed.counts.fallbacks = is_usable(run.report.status) ? 0 : 1;
  std::vector<double> state(static_cast<std::size_t>(nx)), parameters(static_cast<std::size_t>(np));
  for (DriveEstimate& entry : result.smoothed.estimates) {
    const double time = entry.time - first_time;
    state_at(run, model, robot.substeps(), time, state.data());
    const std::ptrdiff_t node = node_at(run, time);
    std::copy_n(run.node_parameters.data() + node * np, np, parameters.data());
    std::copy_n(state.data(), results, entry.values.data());
    std::copy_n(parameters.data(), np, entry.values.data() + results);
    entry.fallback = !is_usable(run.report.status);
    if (!result.has_sigmas) {
      entry.sigmas.setConstant(std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    for (std::ptrdiff_t j = 0; j < results + np; ++j) {
      const std::ptrdiff_t k = j < results ? j : nx + j - results;
      entry.sigmas[j] = std::sqrt(std::max(0.0, run.covariances[node * n * n + k * n + k]));
    }
  }
  std::vector<double> outputs(static_cast<std::size_t>(model.output_count()));
  for (DrivePrediction& prediction : result.smoothed.predictions) {
    state_at(run, model, robot.substeps(), prediction.time - first_time, state.data());
    Model::Nodes request;
    request.count = 1;
    request.states = state.data();
    request.outputs = outputs.data();
    model.observe(request);
    const Sensor& sensor = result.smoothed.sensors[static_cast<std::size_t>(result.smoothed.withheld_sensor)];
    double squares = 0.0;
    for (std::size_t i = 0; i < sensor.outputs.size(); ++i) {
      const auto j = static_cast<std::size_t>(sensor.outputs[i]);
      const double measured = drive.values_of(drive.events[prediction.event])[j];
      prediction.residuals[i] =
          model.description().outputs[j].is_angle ? angle_difference(measured, outputs[j]) : measured - outputs[j];
      if (!std::isnan(prediction.residuals[i])) squares += prediction.residuals[i] * prediction.residuals[i];
    }
    prediction.distance = std::sqrt(squares);
  }
  return result;
}

}  // namespace rhec::sim
