#pragma once

#include <memory>
#include <optional>

#include "rhec/core/base/clock.hpp"
#include "rhec/core/estimation/estimate.hpp"
#include "rhec/core/horizon/measured_interval.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/place/slip_ahead.hpp"

namespace rhec {

class FilterMemo;

/// The estimation algorithm behind an Estimator: it gets nodes one after the other, with intervals between them.
class RHEC_EXPORT EstimationMethod {
 public:
  virtual ~EstimationMethod() = default;
  virtual const Model& model() const noexcept = 0;
  virtual int substeps() const noexcept = 0;

  // Outputs and inputs are finite, or NaN if missing (see `cleaned`).

  /// The first node, with its measured outputs (n_y).
  virtual void start(Measured outputs) noexcept = 0;
  /// The next node, after what was measured since the last, with its measured outputs. With a duration that is not
  /// positive, the outputs belong to the newest node instead. Of an interval that ends with a jump, a method may leave
  /// the jump out: its slip then follows late.
  virtual void add(const MeasuredInterval& interval, Measured outputs) noexcept = 0;
  void add_node(double duration, const double* inputs, Measured outputs) noexcept { add({duration, inputs}, outputs); }
  /// How many measurements an interval can have between its nodes.
  virtual int most_between() const noexcept { return 0; }
  /// How many of the newest nodes `rewind` can take back at present; all nodes: as if nothing had been started. And the
  /// largest such number that is possible.
  virtual int reach() const noexcept { return 0; }
  virtual int most_reach() const noexcept { return 0; }
  /// Takes back as many of the newest nodes as `reach` allows, as if they had never been added.
  virtual void rewind(int /*nodes*/) noexcept {}
  /// The estimate at the newest node; always finite.
  virtual void estimate(Estimate& result, Clock::time_point deadline) noexcept = 0;
  /// Does work in advance, before the next node is known; calling it is optional.
  virtual void prepare() noexcept {}
  /// Goes through what the next node will need, without effect: optional, where code and data have not been used for
  /// long, and are in the processor's caches then.
  virtual void rehearse() noexcept {}
  virtual void reset() noexcept = 0;
  /// Goes on at the newest node from moments of [x; p] (n, n x n) that contain all that is known of it: what was
  /// measured before counts no longer. There was a first node. False if the method cannot, and nothing has changed.
  virtual bool rebase(const Eigen::VectorXd& /*mean*/, const Eigen::MatrixXd& /*covariance*/) noexcept { return false; }
  /// What the judge of measurements has calculated before a node is added, for a method that would do the same.
  virtual void listen(std::shared_ptr<const FilterMemo> /*memo*/) {}
  /// The drive has ended: completes what the method keeps beyond it, such as a map.
  virtual void end_drive() noexcept {}
  /// What slip to expect ahead, of a method that remembers places; else null.
  virtual std::shared_ptr<const SlipAhead> slip_ahead() const noexcept { return nullptr; }

  /// The last estimate's covariance by the method's own model, where what was given out contains what this model leaves
  /// out; null where the two are the same.
  virtual const Eigen::MatrixXd* own_covariance() const noexcept { return nullptr; }

  /// What an estimator that adapts its noise has learnt of an output.
  struct OutputNoise {
    double sigma = 0.0;         ///< standard deviation at present
    bool is_identified = true;  ///< false while the residuals say nothing about it, and it is held
  };
  /// Empty for one that does not adapt.
  virtual std::optional<OutputNoise> output_noise(int /*output*/) const noexcept { return {}; }
};

}  // namespace rhec
