#pragma once

#include <cstdint>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/estimation/prior_bank.hpp"

namespace rhec {

/// A bank of filters that remembers its last nodes: their measurements, and its moments before each of these was used.
/// So late measurements are used as if they had come in time, by filtering anew from their node on; and a window finds
/// what was known before its first node.
///
/// Nodes count from 0, the start of the run. Allocates in its constructor only.
class RHEC_EXPORT BankHistory {
 public:
  /// Remembers the last `nodes` nodes (at least 1). With `filtered` nodes above 0 it remembers as many
  /// if these are more, and what was known after each one's measurement; late measurements reach back by `nodes` still.
  BankHistory(PriorBank bank, int nodes, int filtered = 0);

  PriorBank& bank() noexcept { return bank_; }
  const PriorBank& bank() const noexcept { return bank_; }

  /// The first node that is remembered, with its outputs (n_y, NaN where missing). The bank was reset before.
  void start(Measured outputs, std::int64_t number = 0) noexcept;
  /// The next node, after what was measured since the last. There is room for as many measurements between nodes as the
  /// bank was set up for.
  void add(const MeasuredInterval& interval, Measured outputs) noexcept;
  void add(double duration, const double* inputs, Measured outputs) noexcept { add({duration, inputs}, outputs); }
  /// Takes the newest nodes back, as if they had never been added; false, and nothing happens, unless one is left that
  /// is remembered.
  bool rewind(int nodes) noexcept;
  /// Adds outputs to the node `back` before the newest one; where there are some already, they are replaced. Returns
  /// false if that node is forgotten.
  bool amend(int back, Measured outputs) noexcept;
  /// Weights of a remembered node's outputs (n_y, NaN: none) that are better known than from its innovations, as a
  /// window knows them when the node leaves it. Where they differ much from those used, it is filtered anew from there.
  bool reweigh(std::int64_t number, const double* robust_weights) noexcept;

  /// Predicts and updates once, and takes it back.
  void rehearse() noexcept;

  std::int64_t newest() const noexcept { return newest_; }
  /// How many nodes are remembered.
  int count() const noexcept { return count_; }
  /// How many can be.
  int capacity() const noexcept { return static_cast<int>(intervals_.size()); }

  struct Node {
    ProcessInterval way;   ///< the interval before the node
    const double* inputs;  ///< n_u on it
    Measured outputs;
    const BetweenNodes* between;                          ///< of that interval
    const double* predicted;                              ///< PriorBank::save before the outputs were used
    const double* robust_weights = nullptr;               ///< n_y, that the outputs had
    double log_likelihood = 0.0;                          ///< of these outputs, and those between the nodes
    const double* filtered = nullptr;                     ///< PriorBank::save after that; null if it is not kept
    const double *mean = nullptr, *covariance = nullptr;  ///< of [x; p], the mixture's after that; likewise
  };
  /// A node that is remembered.
  Node node(std::int64_t number) const noexcept;

 private:
  struct Interval {
    ProcessInterval way = {};
    double log_likelihood = 0.0, between_log_likelihood = 0.0;  ///< the one contains the other
  };
  std::size_t place(std::int64_t number) const noexcept {
    return static_cast<std::size_t>(number % static_cast<std::int64_t>(intervals_.size()));
  }
  void begin_node() noexcept;
  void predict(std::size_t place) noexcept;
  MeasuredInterval interval(std::size_t place) const noexcept {
    const ProcessInterval& way = intervals_[place].way;
    return between_[place].over(way.duration, inputs_.data() + place * nu_, way.ends_with_jump);
  }
  void update(std::size_t place) noexcept;
  void go_on(std::size_t place) noexcept;
  void begin_again(std::int64_t number) noexcept;
  void filter_from(std::int64_t number) noexcept;

  PriorBank bank_;
  int late_nodes_;
  bool keeps_filtered_;
  std::size_t nu_, ny_, np_;
  std::vector<Interval> intervals_;
  std::vector<BetweenNodes> between_;
  std::vector<double> inputs_;
  std::vector<MeasuredOutputs> outputs_;
  std::vector<double> given_weights_, used_weights_;  ///< n_y a node
  AlignedDoubles predicted_, filtered_, rehearsed_;
  std::vector<double> means_, covariances_;
  Eigen::VectorXd mean_;
  Eigen::MatrixXd covariance_;
  std::int64_t newest_ = -1;
  int count_ = 0;
};

}  // namespace rhec
