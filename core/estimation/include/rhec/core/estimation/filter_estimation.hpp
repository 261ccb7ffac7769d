#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/estimation/kalman_filter.hpp"

namespace rhec {

/// Extended Kalman filter with random-walk parameters for the Estimator: the baseline (docs/method.md, section 5). If
/// the initial heading is unknown, a bank of filters with headings around the circle runs until one explains the
/// measurements best. It remembers its last nodes, so that late measurements can be used at their time.
class RHEC_EXPORT FilterEstimation final : public EstimationMethod {
 public:
  struct Setup {
    KalmanFilter::Noise noise;
    std::vector<double> walk;  ///< n_p, process noise: standard deviation of a parameter per square root of a step
    /// A parameter runs linearly to its next value on an interval, as outputs of motion need it, which see the value at
    /// the end; else it is constant on an interval.
    bool has_ramps = false;
    Eigen::VectorXd initial_mean;
    Eigen::MatrixXd initial_covariance;
    int substeps = 1;
    int heading_starts = 1;
    int most_between = 0;       ///< measurements that an interval can have between its nodes
    int remembered_nodes = 16;  ///< late measurements reach back so far
  };
  FilterEstimation(const std::shared_ptr<const Model>& model, Setup setup);

  const Model& model() const noexcept override { return bank_.front().filter.model(); }
  int substeps() const noexcept override { return setup_.substeps; }
  void start(Measured outputs) noexcept override;
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override;
  int most_between() const noexcept override { return setup_.most_between; }
  int reach() const noexcept override;
  int most_reach() const noexcept override { return setup_.remembered_nodes + 1; }
  void rewind(int nodes) noexcept override;
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override;
  void reset() noexcept override;
  bool rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept override;
  void listen(std::shared_ptr<const FilterMemo> memo) override;
  /// More than one heading is left.
  bool is_searching() const noexcept { return alive_ > 1; }

 private:
  struct Hypothesis {
    KalmanFilter filter;
    double log_likelihood = 0.0;
  };
  /// What is known at a node: of each filter its moments and its likelihood.
  struct Moments {
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    std::vector<double> inputs;  ///< of InputGuess
    double log_likelihood = 0.0;
  };
  struct Node {
    std::vector<Moments> moments;
    std::size_t alive = 1, best = 0;
  };
  Node& node(std::int64_t number) noexcept { return nodes_[static_cast<std::size_t>(number) % nodes_.size()]; }
  void remember() noexcept;
  void take(Measured outputs) noexcept;
  double log_likelihood(const KalmanFilter& filter, Measured outputs) noexcept;

  Setup setup_;
  std::shared_ptr<const FilterMemo> memo_;  ///< null: none that would be of use
  std::vector<Hypothesis> bank_;
  bool is_rebased_ = false;  ///< what was known before the first node that is remembered is not
  std::size_t alive_ = 1, best_ = 0;
  std::vector<Node> nodes_;      ///< the last ones, in a ring
  std::int64_t newest_ = -1;     ///< -1: none
  std::int64_t remembered_ = 0;  ///< how many are known
  std::vector<double> ramp_variances_, predicted_, jacobian_;
};

}  // namespace rhec
