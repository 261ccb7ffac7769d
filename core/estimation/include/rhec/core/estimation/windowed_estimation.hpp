#pragma once

#include "rhec/core/estimation/estimation_method.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// An estimation method that solves a problem over a window of nodes, open for inspection.
class RHEC_EXPORT WindowedEstimation : public EstimationMethod {
 public:
  /// False as long as there is no window, for example while a heading is searched by filters.
  virtual bool has_window() const noexcept = 0;
  /// The present horizon. Where its model has `ModelDescription::parameter_states`, the vehicle's parameters are there;
  /// else they are the problem's own.
  virtual const RheProblem& problem() const noexcept = 0;
  virtual const Iterate& solution() const noexcept = 0;
  virtual const Window& window() const noexcept = 0;
  /// What was known before the window: mean and standard deviations of [x; p] (n_x + n_p) at its first node. Returns
  /// false, with the mean alone, if nothing was: the standard deviations are then infinite.
  virtual bool arrival(double* mean, double* sigma) const noexcept = 0;
};

}  // namespace rhec
