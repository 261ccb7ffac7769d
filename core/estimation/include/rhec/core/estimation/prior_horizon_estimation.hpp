#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/estimation/bank_estimation.hpp"
#include "rhec/core/estimation/windowed_estimation.hpp"
#include "rhec/core/horizon/shift.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/prior/process_model.hpp"

namespace rhec {

class InformationOf;
class NodeCovariance;
class PriorRestart;

/// Receding horizon estimation whose parameters follow priors (docs/method.md, section 8). A bank of filters runs
/// beside the window. Its weights choose the law by which the parameters vary within the window: that of the most
/// probable member, until another one is clearly more probable. The arrival cost is what that member predicted when the
/// window's first node was the newest, so that no measurement counts twice.
///
/// The estimate is the mixture of the bank with the window in place of the filter of the same law. Of a linear problem
/// without bounds, it is that of the bank; with one member it is that of the window. A window adds bounds, robust
/// losses over all nodes, and a linearisation at the solution.
///
/// Late measurements are used as if they had come in time, if their node is within the horizon.
class RHEC_EXPORT PriorHorizonEstimation final : public WindowedEstimation {
 public:
  struct Setup {
    BankEstimation::Setup filters;
    RheProblem::Setup problem;  ///< of the vehicle
  };
  /// Throws Error if sizes do not match or the solver cannot take the problem.
  PriorHorizonEstimation(const std::shared_ptr<const Model>& model, std::shared_ptr<Solver> solver, Setup setup);
  ~PriorHorizonEstimation() override;

  const Model& model() const noexcept override { return filters_.model(); }
  int substeps() const noexcept override { return problem_.substeps(); }
  void start(Measured outputs) noexcept override;
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override;
  int most_between() const noexcept override { return filters_.most_between(); }
  int reach() const noexcept override { return filters_.reach(); }
  int most_reach() const noexcept override { return filters_.most_reach(); }
  void rewind(int nodes) noexcept override;
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override;
  void rehearse() noexcept override;
  void reset() noexcept override;
  bool rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept override;
  std::optional<OutputNoise> output_noise(int output) const noexcept override { return filters_.output_noise(output); }
  void end_drive() noexcept override { filters_.end_drive(); }
  std::shared_ptr<const SlipAhead> slip_ahead() const noexcept override { return filters_.slip_ahead(); }

  bool has_window() const noexcept override { return has_window_; }
  /// Its model is a ProcessModel.
  const RheProblem& problem() const noexcept override { return problem_; }
  const Iterate& solution() const noexcept override { return point_; }
  const Window& window() const noexcept override { return window_; }
  bool arrival(double* mean, double* sigma) const noexcept override;
  const PriorBank& bank() const noexcept { return filters_.bank(); }
  /// The member whose law the window follows.
  int law() const noexcept { return law_; }

 private:
  const ProcessModel& processes() const noexcept { return *process_model_; }
  void hand_weights_on() noexcept;
  void choose_law() noexcept;
  int& law_at(std::int64_t number) noexcept { return laws_[static_cast<std::size_t>(number) % laws_.size()]; }
  void fill_window() noexcept;
  void fill_interval(int interval, std::int64_t number) noexcept;
  void write_arrival(const double* saved) noexcept;
  void start_cold(Iterate& point) noexcept;
  void combine(Estimate& result) noexcept;
  void give_out(Estimate& result) noexcept;

  /// What the process data of an interval were computed from.
  struct Advance {
    std::int64_t number = -1;  ///< of the node after it
    int law = -1;
    ProcessInterval way = {};
    bool operator==(const Advance&) const = default;
  };

  BankEstimation filters_;
  std::shared_ptr<const ProcessModel> process_model_;
  RheProblem problem_;
  std::shared_ptr<Solver> solver_;
  std::unique_ptr<NodeCovariance> covariance_;
  std::unique_ptr<PriorRestart> restart_;
  GuessShifter shifter_;
  Iterate point_, prior_;
  std::vector<double> scratch_, robust_weights_;
  std::vector<Advance> advances_;   ///< by number, as the data
  std::vector<double> known_data_;  ///< of the last intervals
  std::vector<int> entries_;        ///< of [x; p] in [x; z]
  std::vector<double> parameter_lower_, parameter_upper_;
  Window window_;
  bool has_window_ = false, has_solution_ = false, has_rehearsed_ = false;
  int law_ = 0;
  std::vector<int> laws_;  ///< at the last nodes, in a ring
  Eigen::VectorXd mean_, member_mean_, shift_;
  Eigen::MatrixXd mixture_, member_covariance_, predicted_;
  std::unique_ptr<InformationOf> information_;
};

}  // namespace rhec
