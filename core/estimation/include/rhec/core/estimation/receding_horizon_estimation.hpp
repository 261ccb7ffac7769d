#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/estimation/arrival_cost.hpp"
#include "rhec/core/estimation/windowed_estimation.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/shift.hpp"

namespace rhec {

class NodeCovariance;
class PriorRestart;

/// Receding horizon estimation with structured blocking (docs/method.md, sections 2, 4 and 5). The horizon of at most
/// `problem.max_intervals` intervals grows from the start of the run and then slides, with an arrival cost before it.
///
/// Blocks that are not linked by a random walk (`Blocking::neighbour_sigma` is empty) still have a weak prior,
/// `block_sigma`, about the previous block: what the data determine is unaffected, and a weakly determined block stays
/// near its neighbour's value instead of being driven to a bound by noise. If it is infinite, the method is that of the
/// paper, which reports that blocks of one and three intervals then do not converge.
class RHEC_EXPORT RecedingHorizonEstimation final : public WindowedEstimation {
 public:
  struct Setup {
    RheProblem::Setup problem;
    ArrivalKind arrival = ArrivalKind::ekf;
    std::vector<std::shared_ptr<const Blocking>> blockings;  ///< one per parameter
    std::vector<ParameterWalk> walks;                        ///< one per parameter
    Eigen::VectorXd initial_mean;                            ///< of [x; p] at the first node
    Eigen::MatrixXd initial_covariance;
    /// If the initial heading is unknown: this many headings around the circle are tried while the horizon still grows,
    /// and the best is kept.
    int heading_starts = 1;
    /// Process noise of a state (ModelDescription::noisy_states) that is constant over blocks of intervals. Each
    /// interval costs what it does without blocks, so that the variance of what a block adds to its state stays the
    /// same.
    struct BlockedNoise {
      int state = 0;
      std::shared_ptr<const Blocking> blocking;
    };
    std::vector<BlockedNoise> noises;  ///< in the order of their states
  };
  /// Why a blocking is not one of process noise over such a horizon, whose blocks are independent, and have their
  /// borders where the run has them; empty if it is one.
  static std::string why_not_noise(const Blocking& blocking, int horizon);

  /// Throws Error if sizes do not match or a blocking cannot take the horizon.
  RecedingHorizonEstimation(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Setup setup);
  ~RecedingHorizonEstimation() override;

  /// As it was given: all process noise is an input. In that of the problem, blocked noises are parameters, the last.
  const Model& model() const noexcept override { return *model_; }
  int substeps() const noexcept override { return problem_.substeps(); }
  void start(Measured outputs) noexcept override;
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override;
  int most_between() const noexcept override { return setup_.problem.most_between; }
  int reach() const noexcept override;
  int most_reach() const noexcept override { return setup_.problem.max_intervals + 1; }
  void rewind(int nodes) noexcept override;
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override;
  void prepare() noexcept override;
  void reset() noexcept override;
  bool rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept override;

  bool has_window() const noexcept override { return started_; }
  const RheProblem& problem() const noexcept override { return problem_; }
  const Iterate& solution() const noexcept override { return point_; }
  const Window& window() const noexcept override { return window_; }
  bool arrival(double* mean, double* sigma) const noexcept override;
  const ArrivalCost& arrival_cost() const noexcept { return arrival_; }

 private:
  const Roles& roles() const noexcept { return model().description().roles; }
  /// What was measured on the way to a node, and at it.
  struct Node {
    double duration = 0.0;
    std::vector<double> inputs;
    MeasuredOutputs outputs;
    BetweenNodes between;
  };
  /// What is known before the window's first node, and where the blocks began before it.
  struct Arrival {
    std::int64_t first = -1;
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    std::vector<double> inputs;  ///< of InputGuess
    std::vector<std::int64_t> starts;
  };
  Node& node(std::int64_t number) noexcept { return nodes_[static_cast<std::size_t>(number) % nodes_.size()]; }
  Arrival& arrival_at(std::int64_t first) noexcept {
    return arrivals_[static_cast<std::size_t>(first) % arrivals_.size()];
  }
  void remember(const MeasuredInterval& interval, Measured outputs, std::int64_t number) noexcept;
  void remember_arrival() noexcept;
  void restore_arrival() noexcept;
  void set_structure() noexcept;
  void add_outputs(Measured outputs) noexcept;
  void take_up_solution() noexcept;
  std::int64_t newest() const noexcept { return window_.first + window_.intervals - (prepared_ ? 1 : 0); }
  std::int64_t first_before_preparing() const noexcept { return window_.first - (prepared_ && slid_ ? 1 : 0); }
  void advance_window(const MeasuredInterval& interval, Measured outputs) noexcept;
  void slide_arrival() noexcept;
  void search_heading(Clock::time_point deadline) noexcept;
  void begin_window(Measured outputs) noexcept;
  bool weigh_otherwise(int node, Measured outputs) const noexcept;
  void take_interval(int place, const MeasuredInterval& interval) noexcept;
  void start_cold(Iterate& point) noexcept;
  void recover() noexcept;
  void write_covariance(int node, Estimate& result) noexcept;
  void filter_window(int newest, Estimate& result) noexcept;

  std::shared_ptr<const Model> model_;
  Setup setup_;
  RheProblem problem_;
  ArrivalCost arrival_;
  std::shared_ptr<Solver> solver_;
  GuessShifter shifter_;
  Iterate point_, trial_, best_;
  Window window_;
  Eigen::MatrixXd base_covariance_;
  std::int64_t base_ = -1;  ///< the node from which `rebase` went on; nothing before it is known
  bool started_ = false, solved_ = false, prepared_ = false;
  bool slid_ = false;      ///< preparing has moved the first node, too
  bool has_kept_ = false;  ///< the solution before `rewind`, with its window
  Iterate kept_;
  Window kept_window_;
  std::vector<Node> nodes_;        ///< the last ones, in a ring
  std::vector<Arrival> arrivals_;  ///< of the last first nodes
  bool searching_ = false;         ///< the heading has not been determined yet
  std::vector<std::uint8_t> begins_, next_begins_;
  std::vector<std::int64_t> first_starts_;
  std::vector<int> given_inputs_;  ///< which of the given inputs the problem has
  std::vector<ArrivalCost::Border> borders_;
  std::vector<double> scratch_, inputs_, outputs_;
  std::unique_ptr<NodeCovariance> covariance_;
  std::unique_ptr<PriorRestart> restart_;
  Eigen::VectorXd last_state_;  ///< of the newest node, with the parameters of the interval before it
};

}  // namespace rhec
