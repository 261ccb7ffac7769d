#pragma once

#include <memory>
#include <vector>

#include "rhec/core/estimation/arrival_cost.hpp"
#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// What an estimation method was given and answered, node by node.
struct NodeLog {
  std::vector<double> durations;           ///< of each interval [s], N
  std::vector<double> inputs;              ///< measured, N x n_u, NaN where missing
  std::vector<double> outputs;             ///< N+1 x n_y, NaN where missing
  std::vector<double> states, parameters;  ///< estimated at each node when it was the newest, N+1 x n_x and n_p
  int intervals() const noexcept { return static_cast<int>(durations.size()); }
};

/// An estimation method that another one does the work of, and that keeps all that passes through. Grows without limit:
/// for logs, not for a robot.
class RHEC_EXPORT NodeRecorder final : public EstimationMethod {
 public:
  /// Writes into `log`, which may outlive it.
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

/// Estimates of a whole run from all of its measurements.
struct SmoothedRun {
  Report report;
  double solve_seconds = 0.0;            ///< of all that `estimate` took, the solver's part
  std::vector<double> times;             ///< of the nodes, from the first [s], N+1
  std::vector<double> states;            ///< N+1 x n_x
  std::vector<double> inputs;            ///< N x n_u
  std::vector<double> parameters;        ///< N x n_p, of each interval; of a ramp, at its end
  std::vector<double> start_parameters;  ///< the same, but of a ramp at its start
  /// Of [x_i; p], p the values on the interval before node i (at node 0: on the first): (n_x + n_p)^2 numbers a node,
  /// from the information in the measurements and the prior; bounds do not narrow it. Empty where the solver gives
  /// none.
  std::vector<double> covariances;
  int intervals() const noexcept { return static_cast<int>(times.size()) - 1; }
};

/// Full-information estimation: the estimator's problem over the whole of a run at once, so that every node is
/// estimated from what was measured before and after it. Nothing has left the window, so the prior of the first node is
/// the only arrival cost; blocks are marked and linked as in RecedingHorizonEstimation.
class RHEC_EXPORT FullInformationEstimation {
 public:
  struct Setup {
    RheProblem::Setup problem;                               ///< its max_intervals is replaced by the log's
    std::vector<std::shared_ptr<const Blocking>> blockings;  ///< one a parameter
    std::vector<ParameterWalk> walks;                        ///< one a parameter
    Eigen::VectorXd initial_mean;                            ///< of [x; p] at the first node
    Eigen::MatrixXd initial_covariance;
  };
  FullInformationEstimation(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Setup setup);

  /// Starts from the log's own estimates. Throws Error where the solver cannot take the problem, a blocking cannot take
  /// the horizon, or the log has no interval.
  SmoothedRun estimate(NodeLog log, Clock::time_point deadline = Clock::time_point::max()) const;

 private:
  std::shared_ptr<const Model> model_;
  std::shared_ptr<Solver> solver_;
  Setup setup_;
};

/// State of a smoothed run at a time [s] from its first node: integrated from the node before it with what was
/// estimated for that interval; beyond the ends, the first or last node's. `state` gets n_x numbers.
RHEC_EXPORT void state_at(const SmoothedRun& run, const Model& model, int substeps, double time, double* state);

}  // namespace rhec
