#pragma once

#include <memory>
#include <vector>

#include "rhec/core/estimation/arrival_cost.hpp"
#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// Inputs and results of an estimation method, node by node.
struct NodeLog {
  std::vector<double> durations;           ///< of each interval [s], N
  std::vector<double> inputs;              ///< measured, N x n_u, NaN where missing
  std::vector<double> outputs;             ///< N+1 x n_y, NaN where missing
  std::vector<double> states, parameters;  ///< estimates at each node when it was the newest, N+1 x n_x and n_p
  int intervals() const noexcept { return static_cast<int>(durations.size()); }
};

/// Wraps an estimation method and records its inputs and results. Its memory grows without limit: for logs, not for a
/// robot.
class RHEC_EXPORT NodeRecorder final : public EstimationMethod {
 public:
  /// Writes into `log`, which may outlive the recorder.
  NodeRecorder(std::unique_ptr<EstimationMethod> method, std::shared_ptr<NodeLog> log)
      : method_(std::move(method)), log_(std::move(log)) {}

  const Model& model() const noexcept override { return method_->model(); }
  int substeps() const noexcept override { return method_->substeps(); }
  void start(const double* outputs) noexcept override;
  void add_node(double duration, const double* inputs, const double* outputs) noexcept override;
  bool amend(int back, const double* outputs) noexcept override;
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override;
  void prepare() noexcept override { method_->prepare(); }
  void reset() noexcept override;

 private:
  void append_outputs(const double* outputs);

  std::unique_ptr<EstimationMethod> method_;
  std::shared_ptr<NodeLog> log_;
  bool started_ = false;
};

/// Estimates of a whole run, each from all of its measurements.
struct SmoothedRun {
  Report report;
  double solve_seconds = 0.0;            ///< the solver's part of the time of `estimate` [s]
  std::vector<double> times;             ///< of the nodes, relative to the first [s], N+1
  std::vector<double> states;            ///< N+1 x n_x
  std::vector<double> inputs;            ///< N x n_u
  std::vector<double> parameters;        ///< N x n_p, one row per interval; of a ramp, the value at its end
  std::vector<double> start_parameters;  ///< the same; of a ramp, the value at its start
  /// Covariance of [x_i; p], with p the values on the interval before node i (at node 0: on the first): (n_x + n_p)^2
  /// numbers per node, from the information in the measurements and the prior; bounds do not narrow it. Empty if the
  /// solver does not provide it.
  std::vector<double> covariances;
  int intervals() const noexcept { return static_cast<int>(times.size()) - 1; }
};

/// Full-information estimation (docs/method.md, section 6): the estimator's problem over a whole run at once, so that
/// every node is estimated from measurements before and after it. Nothing has left the horizon, so the prior of the
/// first node is the only arrival cost. Blocks are marked and linked as in RecedingHorizonEstimation.
class RHEC_EXPORT FullInformationEstimation {
 public:
  struct Setup {
    RheProblem::Setup problem;                               ///< its max_intervals is replaced by the log's
    std::vector<std::shared_ptr<const Blocking>> blockings;  ///< one per parameter
    std::vector<ParameterWalk> walks;                        ///< one per parameter
    Eigen::VectorXd initial_mean;                            ///< of [x; p] at the first node
    Eigen::MatrixXd initial_covariance;
  };
  FullInformationEstimation(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Setup setup);

  /// Starts from the estimates in the log. Throws Error if the solver cannot take the problem, a blocking cannot take
  /// the horizon, or the log has no interval.
  SmoothedRun estimate(NodeLog log, Clock::time_point deadline = Clock::time_point::max()) const;

 private:
  std::shared_ptr<const Model> model_;
  std::shared_ptr<Solver> solver_;
  Setup setup_;
};

/// State of a smoothed run at a time [s] from its first node: integrated from the node before it with the estimated
/// inputs and parameters of that interval; beyond the ends, the state of the first or last node. `state` has n_x
/// entries.
RHEC_EXPORT void state_at(const SmoothedRun& run, const Model& model, int substeps, double time, double* state);

}  // namespace rhec
