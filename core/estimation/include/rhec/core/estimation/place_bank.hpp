#pragma once

#include <cstdint>
#include <vector>

#include "rhec/core/estimation/bank_history.hpp"

namespace rhec {

/// The hypothesis that a map of slip holds, beside a bank for which there is no map (docs/method.md, section 9).
///
/// Its members follow the map, each with another deviation from it. Over the ground the hypothesis may begin or cease
/// to hold: members take over a share of the bank's moments, as interacting multiple models do; the bank takes nothing
/// from them, so that it stays what it is without a map. Likelihoods decide between the two, and how often the map has
/// held on this drive is the prior of its next trial. Where the map knows nothing, the estimate is the bank's.
///
/// Late measurements are used as if they had come in time. Allocates in its constructor only.
class RHEC_EXPORT PlaceBank {
 public:
  struct Setup {
    PriorBank::Setup bank;  ///< with a map; priors of one state
    double change = 100.0;  ///< ground after which the map may begin or cease to hold [m]
    double before = 0.3;    ///< probability that it holds, before anything is known
    double trust = 100.0;   ///< ground over which the share of it where the map holds is learnt [m]
    int nodes = 16;         ///< that late measurements reach back
  };
  /// Throws Error if sizes do not match or there is no map.
  PlaceBank(const std::shared_ptr<const Model>& model, Setup setup);

  void reset() noexcept;
  /// Takes the nodes from this number to the newest, which the history has used or amended; it keeps what is filtered.
  void follow(const BankHistory& history, std::int64_t from) noexcept;

  /// Whether the map knows the newest node's place, and the probability that it is right there.
  bool knows_place() const noexcept { return knows_; }
  double probability() const noexcept { return probability_; }
  /// The mixture of the given moments of [x; p] and those of the map's bank; does nothing where the map knows nothing.
  void fuse(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept;
  const PriorBank& bank() const noexcept { return bank_; }

 private:
  struct State {
    double probability = 0.5, trust = 0.5;
    bool knows = false;
  };
  std::size_t place(std::int64_t number) const noexcept {
    return static_cast<std::size_t>(number % static_cast<std::int64_t>(states_.size()));
  }
  void take_node(const BankHistory::Node& before, const BankHistory::Node& node) noexcept;

  Setup setup_;
  PriorBank bank_;
  std::vector<State> states_;  ///< after each of the last nodes
  AlignedDoubles saved_;
  double probability_ = 0.5;
  double trust_ = 0.5;  ///< probability that the map holds where that changes
  bool knows_ = false;
  Eigen::VectorXd mean_, difference_;
  Eigen::MatrixXd covariance_;
};

}  // namespace rhec
