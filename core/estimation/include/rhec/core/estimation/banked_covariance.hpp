#pragma once

#include <algorithm>
#include <memory>

#include "rhec/core/estimation/bank_estimation.hpp"
#include "rhec/core/estimation/windowed_estimation.hpp"

namespace rhec {

/// A window of blocks with a covariance that contains what blocks leave out: that slip varies within each of them. A
/// bank of filters runs beside the window. With its mean xbar and covariance Pbar, the error of the window's estimate x
/// is that of xbar plus the known difference d = x - xbar, so that its second moment is Pbar + d d'. The block model's
/// own covariance stays readable in `own_covariance`.
class RHEC_EXPORT BankedCovariance final : public WindowedEstimation {
 public:
  /// `bank_model`: the bank's, where that of the window's problem has blocked noise; null: the problem's. Throws Error
  /// as BankEstimation does.
  BankedCovariance(std::unique_ptr<WindowedEstimation> blocks, const BankEstimation::Setup& bank,
                   std::shared_ptr<const Model> bank_model = nullptr);

  const Model& model() const noexcept override { return blocks_->model(); }
  int substeps() const noexcept override { return blocks_->substeps(); }
  void start(Measured outputs) noexcept override;
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override;
  int most_between() const noexcept override { return std::min(blocks_->most_between(), bank_.most_between()); }
  int reach() const noexcept override { return std::min(blocks_->reach(), bank_.reach()); }
  int most_reach() const noexcept override { return std::min(blocks_->most_reach(), bank_.most_reach()); }
  void rewind(int nodes) noexcept override;
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override;
  void prepare() noexcept override { blocks_->prepare(); }
  void reset() noexcept override;
  bool rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept override;

  const Eigen::MatrixXd* own_covariance() const noexcept override { return &own_; }

  bool has_window() const noexcept override { return blocks_->has_window(); }
  const RheProblem& problem() const noexcept override { return blocks_->problem(); }
  const Iterate& solution() const noexcept override { return blocks_->solution(); }
  const Window& window() const noexcept override { return blocks_->window(); }
  bool arrival(double* mean, double* sigma) const noexcept override { return blocks_->arrival(mean, sigma); }

 private:
  std::unique_ptr<WindowedEstimation> blocks_;
  BankEstimation bank_;
  Eigen::VectorXd mean_, difference_;
  Eigen::MatrixXd covariance_, own_;
};

}  // namespace rhec
