#pragma once

#include "rhec/core/base/clock.hpp"
#include "rhec/core/estimation/estimate.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// What the timeline of an Estimator drives: nodes that follow each other, with intervals between them.
class RHEC_EXPORT EstimationMethod {
 public:
  virtual ~EstimationMethod() = default;
  virtual const Model& model() const noexcept = 0;
  virtual int substeps() const noexcept = 0;

  // Outputs and inputs are finite, or NaN where they are missing (see `cleaned`).

  /// The first node, with what was measured at it (n_y).
  virtual void start(const double* outputs) noexcept = 0;
  /// The next node: `duration` [s] after the last, the input measured on the way (n_u), the outputs. A duration that is
  /// not positive makes no node: the outputs belong to the newest one.
  virtual void add_node(double duration, const double* inputs, const double* outputs) noexcept = 0;
  /// Outputs that came late for the node `back` before the newest one; false if that is out of reach.
  virtual bool amend(int back, const double* outputs) noexcept = 0;
  /// The estimate at the newest node; always finite.
  virtual void estimate(Estimate& result, Clock::time_point deadline) noexcept = 0;
  /// Work that can be done before the next node is known; calling it is never needed.
  virtual void prepare() noexcept {}
  virtual void reset() noexcept = 0;
};

}  // namespace rhec
