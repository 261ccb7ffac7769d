#include "rhec/sim/loop/smoothed_drive.hpp"

#include <cmath>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "consistency.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/loop/run_files.hpp"

namespace rhec::sim {

SmoothedDrive smooth_closed_loop(const Scenario& scenario, const LoopHooks& hooks) {
  const auto nodes = std::make_shared<NodeLog>();
  const auto both = std::make_shared<RobotHookChain>();
  if (hooks.robot) both->add(hooks.robot);
  both->add(recording_nodes(nodes));
  LoopHooks recording = hooks;
  recording.robot = both;
  SmoothedDrive drive;
  drive.causal = run_closed_loop(scenario, recording);

  const Robot& robot = scenario.robot();
  const SmoothedRun run = robot.make_smoother(scenario.initial_state())->estimate(*nodes, robot.smoothing_deadline());
  const auto samples = std::ssize(drive.causal.samples);
  if (run.intervals() + 1 != samples)
    throw Error(fmt::format("smoother: {} nodes for {} samples of the drive", run.intervals() + 1, samples));
  drive.report = run.report;
  drive.laws = run.laws;
  drive.intervals = run.intervals();
  drive.has_sigmas = !run.covariances.empty();
  drive.solve_seconds = run.solve_seconds;
  drive.smoothed = drive.causal;
  const ModelDescription& about = robot.estimated_description();
  const std::ptrdiff_t nx = robot.estimator_model()->state_count(), np = std::ssize(about.parameters), n = nx + np;
  Consistency consistency(about);
  for (std::ptrdiff_t i = 0; i < samples; ++i) {
    Sample& sample = drive.smoothed.samples[static_cast<std::size_t>(i)];
    sample.state = Eigen::Map<const Eigen::VectorXd>(run.states.data() + i * nx, std::ssize(about.states));
    sample.parameters = Eigen::Map<const Eigen::VectorXd>(run.node_parameters.data() + i * np, np);
    Eigen::MatrixXd covariance;
    if (drive.has_sigmas) covariance = Eigen::Map<const Eigen::MatrixXd>(run.covariances.data() + i * n * n, n, n);
    consistency.write(covariance, sample);
    sample.estimator_status = run.report.status;
    sample.estimator_fallback = !is_usable(run.report.status);
    sample.estimator_us = 1e6 * run.solve_seconds / static_cast<double>(samples);
    sample.estimator_feedback_us = sample.estimator_us;
  }
  return drive;
}

std::string summary_json(const SmoothedDrive& drive, const Scenario& scenario) {
  Json json = json_of(summarise(drive.smoothed, scenario));
  json["causal"] = json_of(summarise(drive.causal, scenario));
  Json& smoother = json["smoother"];
  smoother["status"] = name_of(drive.report.status);
  smoother["intervals"] = drive.intervals;
  smoother["iterations"] = drive.report.iterations;
  smoother["kkt_residual"] = drive.report.kkt.largest();
  smoother["laws"] = Json::array();
  for (const SmoothedRun::Law& law : drive.laws)
    smoother["laws"].push_back({{"by_parameter", law.texts}, {"probability", law.probability}});
  return json.dump(2) + "\n";
}

}  // namespace rhec::sim
