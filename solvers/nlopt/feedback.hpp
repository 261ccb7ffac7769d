#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/ocp/ocp.hpp"
#include "rhec/core/qp/riccati.hpp"

namespace rhec::nlopt {

/// A policy that keeps simulations of unstable dynamics together: w_i = v_i + K_i (s_i - about_i), with v_i as
/// decisions in the place of the controls.
struct Feedback {
  std::vector<Eigen::MatrixXd> gains;  ///< K of each interval; the rows of controls that their bounds fix are zero
  Iterate about;

  /// K_i (s_i - about_i) of one control.
  double of(int interval, int control, const Iterate& iterate) const noexcept {
    const Eigen::MatrixXd& K = gains[static_cast<std::size_t>(interval)];
    double sum = 0.0;
    for (Eigen::Index j = 0; j < K.cols(); ++j)
      sum += K(control, j) * (iterate.state(interval)[j] - about.state(interval)[j]);
    return sum;
  }
};

/// Linear-quadratic regulators about trajectories (docs/method.md, section 7), and how much their dynamics need one.
class Regulator {
 public:
  void setup(const Ocp& ocp);

  /// By how much a deviation of a state grows along the iterate without feedback: the largest diagonal entry of the
  /// products A_k ... A_0 and A_{N-1} ... A_k, at least 1. Diagonal entries do not depend on the units of states.
  double growth(const Ocp& ocp, const Iterate& along, std::span<double> scratch);

  /// The policy of the regulator by the linearisation and Gauss-Newton's Hessian at an iterate, about its states. Null
  /// if a stage is too wide for the recursion, or gains are not finite.
  std::shared_ptr<const Feedback> about(const Ocp& ocp, const Iterate& iterate, std::span<double> scratch);

 private:
  StageQp qp_;
  Riccati riccati_;
  ActiveSet fixed_;
  Iterate step_;
  bool is_possible_ = false;
};

}  // namespace rhec::nlopt
