#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec {

/// Inputs and results of an estimation method, node by node.
struct RHEC_EXPORT NodeLog {
  std::vector<double> durations;           ///< of each interval [s], N
  std::vector<double> inputs;              ///< measured, N x n_u, NaN where missing
  std::vector<double> outputs;             ///< N+1 x n_y, NaN where missing
  std::vector<double> weights;             ///< of these as in Measured; or none at all
  std::vector<BetweenNodes> between;       ///< measurements within each interval, N; or none at all
  std::vector<double> states, parameters;  ///< estimates at each node when it was the newest, N+1 x n_x and n_p
  int intervals() const noexcept { return static_cast<int>(durations.size()); }
  /// Of any interval.
  int most_between() const noexcept;
  /// What was measured at a node, of `output_count` outputs.
  Measured measured(int node, int output_count) const noexcept {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(node) * output_count;
    return {outputs.data() + at, weights.empty() ? nullptr : weights.data() + at};
  }
  /// What was measured on one, of `input_count` inputs.
  MeasuredInterval interval(int i, int input_count) const noexcept;
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
  void start(Measured outputs) noexcept override;
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override;
  int most_between() const noexcept override { return method_->most_between(); }
  int reach() const noexcept override { return method_->reach(); }
  int most_reach() const noexcept override { return method_->most_reach(); }
  void rewind(int nodes) noexcept override;
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override;
  void prepare() noexcept override { method_->prepare(); }
  void rehearse() noexcept override { method_->rehearse(); }
  void reset() noexcept override;
  /// What was measured before counts in the log as before.
  bool rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept override {
    return method_->rebase(mean, covariance);
  }
  void listen(std::shared_ptr<const FilterMemo> memo) override { method_->listen(std::move(memo)); }
  std::optional<OutputNoise> output_noise(int output) const noexcept override { return method_->output_noise(output); }
  void end_drive() noexcept override { method_->end_drive(); }
  std::shared_ptr<const SlipAhead> slip_ahead() const noexcept override { return method_->slip_ahead(); }

 private:
  void append_outputs(Measured outputs);

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
  /// N+1 x n_p, the values at the nodes: of blocks those on the interval before the node (at node 0: on the first), of
  /// priors those of the processes there.
  std::vector<double> node_parameters;
  /// Covariance of [x_i; p], with p the values at node i: (n_x + n_p)^2 numbers per node, from the information in the
  /// measurements and the prior; bounds do not narrow it. Empty if the solver does not provide it.
  std::vector<double> covariances;
  /// Laws of variation that the estimates are a mixture of, the most probable first; none for blocks.
  struct Law {
    std::vector<std::string> texts;  ///< in words, by parameter
    double probability = 0.0;        ///< given all measurements
  };
  std::vector<Law> laws;
  int intervals() const noexcept { return static_cast<int>(times.size()) - 1; }
};

/// Estimates all nodes of a log at once.
class RHEC_EXPORT Smoother {
 public:
  virtual ~Smoother() = default;
  /// The estimates in the log are the initial guess. Throws Error if the log has no interval, or its problem cannot be
  /// solved by the smoother's solver.
  virtual SmoothedRun estimate(NodeLog log, Clock::time_point deadline) const = 0;
  SmoothedRun estimate(NodeLog log) const { return estimate(std::move(log), Clock::time_point::max()); }
};

/// State of a smoothed run at a time [s] from its first node: integrated from the node before it with the estimated
/// inputs and parameters of that interval; beyond the ends, the state of the first or last node. `state` has n_x
/// entries.
RHEC_EXPORT void state_at(const SmoothedRun& run, const Model& model, int substeps, double time, double* state);

/// Parameters (n_p) on the interval at a time [s] from the first node; on a ramp, the value that it has reached. Beyond
/// the ends, those of the first or last interval.
RHEC_EXPORT void parameters_at(const SmoothedRun& run, int parameter_count, double time, double* parameters);

}  // namespace rhec
