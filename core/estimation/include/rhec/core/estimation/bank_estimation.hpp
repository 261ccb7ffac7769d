#pragma once

#include <memory>

#include "rhec/core/estimation/bank_history.hpp"
#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/estimation/filter_estimation.hpp"
#include "rhec/core/estimation/place_memory.hpp"

namespace rhec {

/// A bank of Kalman filters with different priors for the Estimator (docs/method.md, section 8). If the initial heading
/// is unknown, filters with constant parameters search it first, as in FilterEstimation; the bank starts from what they
/// find. Late measurements are used as if they had come in time.
/// With a map, what earlier visits have found at a place is weighed against the bank, and the map is written.
class RHEC_EXPORT BankEstimation final : public EstimationMethod {
 public:
  struct Setup {
    PriorBank::Setup bank;
    Eigen::VectorXd initial_state;                         ///< n_x
    Eigen::MatrixXd initial_covariance;                    ///< n_x x n_x
    std::vector<double> parameter_lower, parameter_upper;  ///< bounds of the estimate's mean
    int heading_starts = 1;
    int remembered_nodes = 16;  ///< late measurements of these are used
    /// With a map: places are remembered.
    PlaceMemory::Setup place = {};
  };
  BankEstimation(const std::shared_ptr<const Model>& model, Setup setup);

  const Model& model() const noexcept override { return history_.bank().model(); }
  int substeps() const noexcept override { return setup_.bank.substeps; }
  void start(Measured outputs) noexcept override;
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override;
  int most_between() const noexcept override { return setup_.bank.most_between; }
  int reach() const noexcept override;
  int most_reach() const noexcept override;
  void rewind(int nodes) noexcept override;
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override;
  void rehearse() noexcept override {
    if (!searching_) history_.rehearse();
  }
  void reset() noexcept override;
  bool rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept override;
  std::optional<OutputNoise> output_noise(int output) const noexcept override;
  void end_drive() noexcept override;
  std::shared_ptr<const SlipAhead> slip_ahead() const noexcept override { return place_; }

  /// Null without a map.
  const PlaceMemory* place() const noexcept { return place_.get(); }
  /// Adds to moments of [x; p], the bank's or better ones, what is known of the place.
  void fuse_place(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept {
    if (place_ && !searching_) place_->fuse(mean, covariance);
  }
  /// The history's nodes from this number on have been filtered anew.
  void follow_place(std::int64_t from) noexcept {
    if (place_) place_->amend(history_, from);
  }
  const PriorBank& bank() const noexcept { return history_.bank(); }
  BankHistory& history() noexcept { return history_; }
  const BankHistory& history() const noexcept { return history_; }
  /// Whether the bank does not work yet, since the heading is unknown.
  bool is_searching() const noexcept { return searching_; }

 private:
  void start_bank_if_found() noexcept;
  int before_bank() const noexcept;

  Setup setup_;
  BankHistory history_;
  std::shared_ptr<PlaceMemory> place_;        ///< null without a map
  std::unique_ptr<FilterEstimation> search_;  ///< null if the heading is known
  bool searching_ = false;
  bool is_rebased_ = false;      ///< what was known before the history's first node is not
  std::int64_t searched_ = 0;    ///< number of the newest node while searching
  std::vector<double> nothing_;  ///< outputs of a node without measurements
  Eigen::VectorXd mean_;
  Eigen::MatrixXd covariance_;
  Estimate found_;
};

}  // namespace rhec
