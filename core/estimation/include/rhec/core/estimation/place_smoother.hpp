#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "rhec/core/estimation/bank_history.hpp"
#include "rhec/core/place/slip_map.hpp"
#include "rhec/core/prior/process_model.hpp"

namespace rhec {

/// Writes a map from smoothed estimates while the drive goes on: parameters with some seconds of hindsight have about
/// half the error of filtered ones.
///
/// The smoother is that of Rauch, Tung and Striebel, by the law that is the most probable on each interval with
/// hindsight (docs/method.md, section 9). It goes back from a newest node over `lag` nodes, writes the older half of
/// them, and begins anew half as many nodes later; so a value has a hindsight of half the lag at least. A few nodes are
/// done at each sample: the time of a sample is bounded. Allocates in its constructor only.
class RHEC_EXPORT PlaceSmoother {
 public:
  struct Setup {
    int lag = 80;                         ///< nodes
    int nodes_at_once = 3;                ///< that are smoothed at each sample: at least 3
    std::vector<double> input_variances;  ///< n_u
    int substeps = 1;
  };
  /// Nodes that a history has to remember for it.
  static int remembered_nodes(const Setup& setup) noexcept { return 2 * setup.lag + 2; }

  /// The history's bank has this model.
  PlaceSmoother(const std::shared_ptr<const Model>& model, const PriorBank& bank, Setup setup);

  void reset() noexcept;
  /// The nodes behind this one have been taken back: what began there begins anew.
  void rewind(std::int64_t newest) noexcept { is_busy_ = is_busy_ && at_ <= newest; }
  /// Goes on with its work; call it once for each node.
  void work(BankHistory& history, SlipMap& map) noexcept;
  /// Writes all nodes that are not written yet, as the drive has ended.
  void finish(BankHistory& history, SlipMap& map) noexcept;

 private:
  void begin(BankHistory& history, std::int64_t write_until) noexcept;
  void step_back(BankHistory& history, SlipMap& map) noexcept;
  void write_stroke(SlipMap& map) noexcept;

  Setup setup_;
  std::shared_ptr<const Model> vehicle_;
  std::shared_ptr<const ProcessModel> model_;
  int nx_, nu_, np_, n_, inputs_;
  std::int64_t written_ = -1;  ///< newest node that is on the map
  std::int64_t write_until_ = -1, at_ = -1;
  bool is_busy_ = false;
  int law_ = 0;
  std::vector<double> weights_, data_, input_, scratch_means_, scratch_variances_;
  Eigen::VectorXd mean_, next_mean_, filtered_, predicted_mean_, scale_;  ///< smoothed: at `at_` and the node after it
  Eigen::MatrixXd covariance_, next_covariance_, filtered_covariance_, predicted_, jacobian_, transition_, across_,
      gain_, scaled_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

}  // namespace rhec
