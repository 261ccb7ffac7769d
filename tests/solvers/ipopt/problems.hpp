#pragma once

// Problems that the tests of ipopt share, and the solver with options.

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"
#include "support/random_problem.hpp"

namespace rhec::ipopt::testing {

using rhec::testing::RandomProblem;

inline const Host& host() {
  static const Host one;
  return one;
}
inline std::shared_ptr<Solver> ipopt_with(const std::string& options) {
  return host().make_solver("ipopt", parse_yaml(options, "options.yaml"));
}
inline std::shared_ptr<const Model> bicycle() { return host().make_model("bicycle_slip"); }

inline std::string error_of_options(const std::string& options) {
  return error_of([&] { ipopt_with(options); });
}

inline RandomProblem::RheSpec blocks_of(int block, int intervals = 15) {
  RandomProblem::RheSpec spec;
  spec.intervals = intervals;
  spec.block = block;
  return spec;
}

/// A problem with its objective in other units; counts what is asked of it.
class Scaled final : public Ocp {
 public:
  Scaled(const Ocp& of, double factor) : of_(of), factor_(factor), weighted_(of.capacity()) {}
  mutable int evaluations = 0, linearisations = 0;

  Capacity capacity() const noexcept override { return of_.capacity(); }
  int intervals() const noexcept override { return of_.intervals(); }
  int state_count(int node) const noexcept override { return of_.state_count(node); }
  int control_count(int i) const noexcept override { return of_.control_count(i); }
  const double* initial_state() const noexcept override { return of_.initial_state(); }
  const double* state_lower(int node) const noexcept override { return of_.state_lower(node); }
  const double* state_upper(int node) const noexcept override { return of_.state_upper(node); }
  const double* control_lower(int i) const noexcept override { return of_.control_lower(i); }
  const double* control_upper(int i) const noexcept override { return of_.control_upper(i); }
  bool has_second_derivatives() const noexcept override { return of_.has_second_derivatives(); }
  bool has_small_residuals() const noexcept override { return of_.has_small_residuals(); }
  std::size_t scratch_size() const noexcept override { return of_.scratch_size(); }
  void mark_dynamics(int i, std::uint8_t* states, std::uint8_t* controls) const noexcept override {
    of_.mark_dynamics(i, states, controls);
  }
  double evaluate_stages(const Iterate& point, double* defects, double* stage_costs,
                         std::span<double> scratch) const noexcept override {
    ++evaluations;
    const double cost = of_.evaluate_stages(point, defects, stage_costs, scratch);
    if (stage_costs)
      for (int i = 0; i <= intervals(); ++i) stage_costs[i] *= factor_;
    return factor_ * cost;
  }
  void simulate_interval(int i, Iterate& point, std::span<double> scratch) const noexcept override {
    of_.simulate_interval(i, point, scratch);
  }
  double linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                   std::span<double> scratch) const noexcept override {
    ++linearisations;
    weighted_ = point;
    for (int i = 0; i <= intervals(); ++i)
      for (int j = 0; j < state_count(i); ++j) weighted_.costate(i)[j] /= factor_;
    const double objective = of_.linearise(range, weighted_, hessian, qp, scratch);
    const int rows = capacity().states + capacity().controls;
    for (int i = range.first; i <= range.last; ++i)
      for (auto [values, count] : {std::pair{qp.H(i), rows * qp.stride()}, {qp.h(i), rows}})
        for (int k = 0; k < count; ++k) values[k] *= factor_;
    return factor_ * objective;
  }
  void refresh(const Iterate&, StageQp&, std::span<double>) const noexcept override {}

 private:
  const Ocp& of_;
  double factor_;
  mutable Iterate weighted_;
};

}  // namespace rhec::ipopt::testing
