#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "feedback.hpp"
#include "rhec/core/ocp/ocp.hpp"
#include "rhec/core/qp/kkt.hpp"

namespace rhec::nlopt {

/// An Ocp with its states eliminated by simulation (single shooting; docs/method.md, section 7):
///
///     minimise f(x)  subject to  lower <= x <= upper,  row_lower <= c(x) <= row_upper
///
/// x = [s_0 if it is free; w_0; ...; w_{N-1}; slacks] without fixed variables; c are the bounded states of nodes 1 .. N
/// and the limits, g + sigma_lower - sigma_upper, with a slack for each side of a soft limit. Without a linear weight a
/// soft limit is no row: f has what its violation costs, whose gradient is continuous. All evaluations at one x share
/// one simulation and one linearisation.
///
/// With a Feedback, x has v_i = w_i - K_i (s_i - about_i) in the place of w_i, so that deviations do not grow with the
/// simulation however unstable the dynamics are; the bounds of controls are rows of c then.
class CondensedProblem {
 public:
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;

  CondensedProblem() = default;
  explicit CondensedProblem(const Ocp& ocp);  ///< for problems of this capacity

  /// Takes on the Ocp's current structure and bounds; false if a lower bound is above its upper bound. The Ocp must
  /// outlive the use of this object until the next call.
  bool take(const Ocp& ocp, std::shared_ptr<const Feedback> feedback = nullptr);
  const std::shared_ptr<const Feedback>& feedback() const noexcept { return feedback_; }

  int variables() const noexcept { return static_cast<int>(variables_.size() + slacks_.size()); }
  int rows() const noexcept { return static_cast<int>(rows_.size()); }
  const Vector& lower() const noexcept { return lower_; }
  const Vector& upper() const noexcept { return upper_; }
  const Vector& row_lower() const noexcept { return row_lower_; }
  const Vector& row_upper() const noexcept { return row_upper_; }

  /// x of an iterate, clipped to the bounds, without slacks. With a Feedback the iterate's states are those of its
  /// simulation.
  Vector read(const Iterate& iterate) const;
  /// The current x with the slacks that its limits need.
  Vector with_fitting_slacks() const;
  /// Simulates, unless x is unchanged since the last call. False if a result is not finite.
  bool move_to(const Vector& x);
  const Vector& x() const noexcept { return x_; }
  double objective() const noexcept { return objective_; }
  /// The objective with the slacks that limits need, whatever those of x are.
  double objective_of_iterate() const noexcept;
  /// One row of c at the current x.
  double row_value(int row) const noexcept;
  /// The largest violation of any bound at the current x.
  double violation() const noexcept;

  // Derivatives at the current x, where `move_to` must have succeeded; computed on demand.
  const Vector& gradient();  ///< of f, by the adjoint sweep
  const Matrix& jacobian();  ///< of c, by forward sensitivities
  /// A diagonal to add to the Hessian where it is to scale the variables: slacks of about one are usual.
  Vector slack_curvature() const;
  bool has_limits() const noexcept { return !limit_values_.empty(); }
  bool has_slacks() const noexcept { return !slacks_.empty(); }
  /// The Hessian of the Lagrangian with the multipliers last set, or its Gauss-Newton approximation; full and
  /// symmetric.
  const Matrix& hessian(Hessian kind);

  /// Takes the multipliers of the bounds of x, then of the rows, positive at upper bounds, in units of the objective.
  /// Sets the iterate's bound multipliers and costates, those of fixed variables included.
  void set_multipliers(const Vector& multipliers);
  /// The core's KKT residual at the current x with the multipliers last set.
  KktResidual residual();
  const Iterate& iterate() const noexcept { return point_; }

  long simulations() const noexcept { return simulations_; }
  long linearisations() const noexcept { return linearisations_; }

 private:
  /// A component of s_stage or w_stage.
  struct Entry {
    bool is_state = false;
    int stage = 0, component = 0;
  };
  /// A bounded state or control, or a limit with the columns of its slacks, -1 where there is none.
  struct Row {
    enum class Of { state, control, limit } of = Of::state;
    int stage = 0, component = 0, below = -1, above = -1;
  };
  struct Slack {
    int stage = 0, component = 0;
    bool is_above = false;
  };
  /// A limit whose violation is in f.
  struct Penalty {
    int stage = 0, component = 0;
  };
  void add_limits();
  double limit_value(int stage, int limit) const noexcept {
    return limit_values_.data()[static_cast<std::ptrdiff_t>(stage) * ocp_->capacity().limit_row() + limit];
  }
  /// How far a limit is beyond its lower side (negative) or its upper one.
  double excess(int stage, int limit) const noexcept;
  double slack_weight(const Slack& of, double value) const noexcept;
  /// Writes the derivatives of a limit to the columns of s_0 and w.
  void add_limit_row(int stage, int limit, Eigen::Ref<Eigen::RowVectorXd> row);
  void write_penalties(Iterate& multipliers) const noexcept;
  bool add(const Entry& entry, double lower, double upper);
  bool add_control(int interval, int control);
  void add_row(const Row& row, double lower, double upper);
  void simulate();
  /// The costates that go with the multipliers of an iterate: those of the dynamics, or of them with the Feedback.
  void find_costates(Iterate& multipliers) const noexcept;
  double reduced_gradient(const Entry& entry, const Iterate& multipliers) const noexcept;
  int& column_of(int interval, int control) noexcept {
    const auto width = static_cast<std::size_t>(ocp_->capacity().controls);
    return control_columns_[static_cast<std::size_t>(interval) * width + static_cast<std::size_t>(control)];
  }
  void linearise();
  void compute_sensitivities();

  const Ocp* ocp_ = nullptr;
  std::shared_ptr<const Feedback> feedback_;
  std::vector<Entry> variables_, fixed_;
  std::vector<Row> rows_;
  std::vector<Slack> slacks_;  ///< the last columns of x
  std::vector<Penalty> penalties_;
  std::vector<double> limit_values_;
  std::vector<double> fixed_values_, lower_list_, upper_list_, row_lower_list_, row_upper_list_;
  std::vector<int> control_columns_;  ///< index of each control in x, or -1; one row per interval
  std::vector<int> columns_before_;   ///< number of variables that node i depends on
  Vector lower_, upper_, row_lower_, row_upper_, x_, gradient_;
  Matrix jacobian_, hessian_;
  std::vector<Matrix> sensitivities_;          ///< ds_i/dx, its columns_before_[i] columns
  std::vector<Matrix> control_sensitivities_;  ///< with a Feedback, dw_i/dx, its columns_before_[i + 1] columns
  bool is_simulated_ = false, is_finite_ = false, is_linearised_ = false, has_gradient_ = false,
       has_sensitivities_ = false;
  double objective_ = 0.0, stage_objective_ = 0.0;
  long simulations_ = 0, linearisations_ = 0;
  Iterate point_, adjoint_;
  StageQp qp_;
  std::vector<double> scratch_;
};

}  // namespace rhec::nlopt
