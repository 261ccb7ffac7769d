#include "rhec/sim/logs/smoothing.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

using Seconds = std::chrono::duration<double>;

}  // namespace

std::ptrdiff_t node_at(const SmoothedRun& run, double time) {
  constexpr double rounding = 1e-6;  // the timeline merges stamps this close into one node [s]
  const auto after = std::upper_bound(run.times.begin(), run.times.end(), time + rounding);
  return std::max<std::ptrdiff_t>(0, after - run.times.begin() - 1);
}

SmoothedReplay smooth(const std::string& name, const Robot& robot, const RecordedLog& log, const LogOptions& options,
                      const HoldOut& hold_out, const LoopHooks& hooks) {
  SmoothedReplay result;
  const auto nodes = std::make_shared<NodeLog>();
  Robot recorded = robot;
  recorded.add_hooks(recording_nodes(nodes));
  result.causal = replay(recorded, log, options, hold_out, hooks);
  result.causal.name = name + causal_suffix;
  if (result.causal.estimates.empty()) throw Error("the log has no fix that is not withheld: nothing can be estimated");

  const auto start = Clock::now();
  const SmoothedRun run = robot.make_smoother()->estimate(*nodes, robot.smoothing_deadline());
  result.smoothed.seconds = Seconds(Clock::now() - start).count();
  result.solve_seconds = run.solve_seconds;
  result.report = run.report;
  result.intervals = run.intervals();
  result.laws = run.laws;
  result.has_sigmas = !run.covariances.empty();

  const Model& model = *robot.estimator_model();
  const int nx = model.state_count(), np = model.parameter_count();
  const std::ptrdiff_t n = std::ptrdiff_t{nx} + np;
  std::vector<double> outputs(model.output_count());
  int x_output = -1, y_output = -1;
  for (int j = 0; j < model.output_count(); ++j) {
    if (model.description().outputs[j].name == options.position[0]) x_output = j;
    if (model.description().outputs[j].name == options.position[1]) y_output = j;
  }
  const double first_time = result.causal.estimates.front().time;
  result.smoothed.name = name;
  result.smoothed.counts = result.causal.counts;
  result.smoothed.counts.estimates = 1;
  result.smoothed.counts.fallbacks = is_usable(run.report.status) ? 0 : 1;
  result.smoothed.unpredicted = result.causal.unpredicted;
  result.smoothed.solve_us = {1e6 * run.solve_seconds};
  for (const LoggedEstimate& causal : result.causal.estimates) {
    LoggedEstimate entry;
    entry.time = causal.time;
    entry.fix = causal.fix;
    entry.held_out = causal.held_out;
    entry.fallback = !is_usable(run.report.status);
    entry.values.resize(n);
    entry.sigmas = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN());
    const double time = causal.time - first_time;
    const std::ptrdiff_t node = node_at(run, time);
    state_at(run, model, robot.substeps(), causal.held_out ? time : run.times[node], entry.values.data());
    if (causal.held_out) {
      parameters_at(run, np, time, entry.values.data() + nx);
    } else {
      std::copy_n(run.node_parameters.data() + node * np, np, entry.values.data() + nx);
    }
    if (!causal.held_out && result.has_sigmas)
      for (std::ptrdiff_t j = 0; j < n; ++j)
        entry.sigmas[j] = std::sqrt(std::max(0.0, run.covariances[node * n * n + j * n + j]));
    if (entry.fix >= 0) {
      Model::Nodes request;
      request.count = 1;
      request.states = entry.values.data();
      request.outputs = outputs.data();
      model.observe(request);
      const Fix& fix = log.fixes[static_cast<std::size_t>(entry.fix)];
      entry.residual = std::hypot(outputs[x_output] - fix.x, outputs[y_output] - fix.y);
    }
    result.smoothed.estimates.push_back(std::move(entry));
  }
  return result;
}

}  // namespace rhec::sim
