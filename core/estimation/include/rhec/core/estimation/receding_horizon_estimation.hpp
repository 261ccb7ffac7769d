#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rhec/core/estimation/arrival_cost.hpp"
#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/shift.hpp"
#include "rhec/core/qp/riccati.hpp"

namespace rhec {

/// Receding horizon estimation with structured blocking (docs/method.md, sections 2, 4 and 5): a window of at most
/// `problem.max_intervals` intervals that grows from the start of the run and then slides, with an arrival cost before
/// it.
///
/// Blocks that no random walk links (`Blocking::neighbour_sigma` off) still get a wide prior, `block_sigma`, about the
/// block before: what the data determine is theirs, and a block that they say little about keeps near its neighbour's
/// value rather than being thrown to a bound by noise. Infinite, it reproduces the paper, which reports that blocks of
/// one and three intervals then do not converge.
class RHEC_EXPORT RecedingHorizonEstimation final : public EstimationMethod {
 public:
  struct Setup {
    RheProblem::Setup problem;
    ArrivalKind arrival = ArrivalKind::ekf;
    std::vector<std::shared_ptr<const Blocking>> blockings;  ///< one a parameter
    std::vector<ParameterWalk> walks;                        ///< one a parameter
    Eigen::VectorXd initial_mean;                            ///< of [x; p] at the first node
    Eigen::MatrixXd initial_covariance;
    /// Where the heading is unknown at the start: while the window still grows, that many starts around the circle are
    /// tried and the best is kept.
    int heading_starts = 1;
  };
  /// Throws Error where sizes do not fit or a blocking cannot take the horizon.
  RecedingHorizonEstimation(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Setup setup);

  const Model& model() const noexcept override { return problem_.model(); }
  int substeps() const noexcept override { return problem_.substeps(); }
  void start(const double* outputs) noexcept override;
  void add_node(double duration, const double* inputs, const double* outputs) noexcept override;
  bool amend(int back, const double* outputs) noexcept override;
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override;
  void prepare() noexcept override;
  void reset() noexcept override;

  /// The window as it stands, for those who want to look inside.
  const RheProblem& problem() const noexcept { return problem_; }
  const Iterate& solution() const noexcept { return point_; }
  const Window& window() const noexcept { return window_; }
  const ArrivalCost& arrival() const noexcept { return arrival_; }

 private:
  const Roles& roles() const noexcept { return model().description().roles; }
  void advance_window(double duration, const double* inputs, const double* outputs) noexcept;
  void slide_arrival() noexcept;
  void search_heading(Clock::time_point deadline) noexcept;
  void take_outputs(int node, const double* outputs) noexcept;
  void take_inputs(int interval, const double* inputs) noexcept;
  void start_cold() noexcept;
  void recover() noexcept;
  double objective_from_start(const Iterate& iterate) noexcept;
  void reconsider(Report& report, Clock::time_point deadline) noexcept;
  void write_covariance(int node, Estimate& result) noexcept;

  Setup setup_;
  RheProblem problem_;
  ArrivalCost arrival_;
  std::shared_ptr<Solver> solver_;
  GuessShifter shifter_;
  Iterate point_, trial_, best_;
  Window window_;
  bool started_ = false, solved_ = false, prepared_ = false;
  bool searching_ = false;  ///< the heading has not been found yet
  std::vector<std::uint8_t> begins_, next_begins_;
  std::vector<std::int64_t> first_starts_;
  std::vector<ArrivalCost::Border> borders_;
  std::vector<double> scratch_, inputs_, outputs_;
  StageQp covariance_qp_;
  Riccati covariance_riccati_;
  ActiveSet no_active_bounds_;
  std::vector<double> covariances_;
  Eigen::VectorXd last_state_;  ///< of the newest node, with the parameters of the interval before it
};

}  // namespace rhec
