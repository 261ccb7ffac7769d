#pragma once

#include <cmath>
#include <memory>

#include <Eigen/Core>

#include "rhec/core/model.hpp"
#include "rhec/core/solver.hpp"

namespace rhec {

/// False for what can be no measurement and is left out like a missing one: NaN, infinities, and numbers so large that
/// the arithmetic of a whole window would suffer from them.
inline bool is_measurement(double value) noexcept { return std::abs(value) < 1e15; }

/// What an estimator knows at a time. Valid until the estimator is asked again.
struct Estimate {
  double time = 0.0;
  Eigen::VectorXd state;       ///< x_k, n_x
  Eigen::VectorXd parameters;  ///< the value of the newest interval, n_p
  /// Of [x_k; p], from the information in the measurements and the prior; bounds do not narrow it.
  Eigen::MatrixXd covariance;
  Report report;          ///< of the solver; trivial for a filter
  bool fallback = false;  ///< the solver failed, and the prediction from earlier samples took its place
  /// The time lies beyond the newest node: integrated from there. The covariance is still that of the newest node.
  bool predicted = false;
};

/// What the timeline of an Estimator drives: nodes that follow each other, with intervals between them.
class RHEC_EXPORT EstimationMethod {
 public:
  virtual ~EstimationMethod() = default;
  virtual const Model& model() const noexcept = 0;
  virtual int substeps() const noexcept = 0;

  /// The first node, with what was measured at it (n_y, NaN where missing).
  virtual void start(const double* outputs) noexcept = 0;
  /// The next node: `duration` [s] after the last, the input measured on the way (n_u, NaN where missing), the outputs.
  /// What is no measurement counts as missing. A duration that is not positive makes no node: the outputs belong to the
  /// newest one.
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
