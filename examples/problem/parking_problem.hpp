#pragma once

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"

/// A kind of problem that rhec does not have: drive from a given state to a goal with little input.
///
///     minimise  sum_{i=0}^{N-1} || u_i ||^2_R  +  || x_N - goal ||^2_V
///     subject to the dynamics, the model's bounds on states and inputs, x_0 and the parameters given
///
/// It adds to HorizonProblem the cost and the given values. All solvers of rhec can solve it.
class ParkingProblem final : public rhec::HorizonProblem {
 public:
  struct Setup {
    int intervals = 20;
    double step = 0.2;                  ///< [s]
    std::vector<double> input_weights;  ///< n_u, diagonal of R
    std::vector<double> goal_weights;   ///< n_x, diagonal of V
  };
  ParkingProblem(std::shared_ptr<const rhec::Model> model, Setup setup)
      : HorizonProblem(
            std::move(model),
            {.structure = {.max_intervals = setup.intervals, .blocked_inputs = {}, .one_block = {}}, .substeps = 1}),
        goal(nx(), 0.0),
        setup_(std::move(setup)),
        given_(capacity().states, 0.0) {
    changing_structure().set_intervals(setup_.intervals);
    changing_structure().finish();
    for (int i = 0; i < intervals(); ++i) set_duration(i, setup_.step);
    const rhec::ModelDescription& about = this->model().description();
    for (int i = 0; i <= intervals(); ++i) {
      for (int j = 0; i > 0 && j < nx(); ++j) {
        lower_row(i)[j] = about.states[j].lower;
        upper_row(i)[j] = about.states[j].upper;
      }
      for (int j = 0; i < intervals() && j < nu(); ++j) {
        lower_row(i)[capacity().states + j] = about.inputs[j].lower;
        upper_row(i)[capacity().states + j] = about.inputs[j].upper;
      }
    }
  }

  std::vector<double> goal;                                             ///< n_x
  double* given_state() noexcept { return given_.data(); }              ///< x_0, n_x
  double* given_parameters() noexcept { return given_.data() + nx(); }  ///< p, n_p

  std::string_view kind() const noexcept override { return "parking"; }
  const double* initial_state() const noexcept override { return given_.data(); }

 private:
  double cost(const rhec::Iterate& iterate, double* stage_costs, std::span<double>) const noexcept override {
    double total = 0.0;
    for (int i = 0; i <= intervals(); ++i) {
      double part = 0.0;
      for_each_term(i, iterate, [&](int, double weight, double error) { part += weight * error * error; });
      if (stage_costs) stage_costs[i] += part;
      total += part;
    }
    return total;
  }

  double write_cost(rhec::StageRange range, const rhec::Iterate& iterate, rhec::Hessian hessian, CostParts parts,
                    rhec::StageQp& qp, std::span<double>) const noexcept override {
    clear_cost(range, hessian, parts, qp);
    double total = 0.0;
    for (int i = range.first; i <= range.last; ++i) {
      for_each_term(i, iterate, [&](int column, double weight, double error) {
        if (parts != CostParts::vectors) qp.H(i)[column * qp.stride() + column] += 2.0 * weight;
        if (parts == CostParts::matrices) return;
        qp.h(i)[column] += 2.0 * weight * error;
        total += weight * error * error;
      });
    }
    return total;
  }

  bool has_late_bounds() const noexcept override { return true; }  // the initial state counts as one
  bool has_constant_cost_hessian() const noexcept override { return true; }

  /// Calls function(column in [s; w], weight, error) for each squared term of a stage.
  template <class Function>
  void for_each_term(int stage, const rhec::Iterate& iterate, const Function& function) const {
    if (stage == intervals()) {
      for (int j = 0; j < nx(); ++j) function(j, setup_.goal_weights[j], iterate.state(stage)[j] - goal[j]);
    } else {
      for (int j = 0; j < nu(); ++j)
        function(capacity().states + j, setup_.input_weights[j], iterate.control(stage)[j]);
    }
  }

  Setup setup_;
  std::vector<double> given_;
};
