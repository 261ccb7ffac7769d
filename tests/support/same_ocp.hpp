#pragma once

#include "rhec/core/ocp/ocp.hpp"

namespace rhec::testing {

/// The smallest Ocp: another one without what the base class provides.
class SameOcp : public Ocp {
 public:
  explicit SameOcp(const Ocp& of) : of_(of) {}
  Capacity capacity() const noexcept override { return of_.capacity(); }
  int intervals() const noexcept override { return of_.intervals(); }
  int state_count(int node) const noexcept override { return of_.state_count(node); }
  int control_count(int interval) const noexcept override { return of_.control_count(interval); }
  const double* initial_state() const noexcept override { return of_.initial_state(); }
  const double* state_lower(int node) const noexcept override { return of_.state_lower(node); }
  const double* state_upper(int node) const noexcept override { return of_.state_upper(node); }
  const double* control_lower(int interval) const noexcept override { return of_.control_lower(interval); }
  const double* control_upper(int interval) const noexcept override { return of_.control_upper(interval); }
  bool has_second_derivatives() const noexcept override { return of_.has_second_derivatives(); }
  std::size_t scratch_size() const noexcept override { return of_.scratch_size(); }
  double evaluate_stages(const Iterate& point, double* defects, double* costs,
                         std::span<double> scratch) const noexcept override {
    return of_.evaluate_stages(point, defects, costs, scratch);
  }
  void simulate_interval(int interval, Iterate& point, std::span<double> scratch) const noexcept override {
    of_.simulate_interval(interval, point, scratch);
  }
  double linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                   std::span<double> scratch) const noexcept override {
    return of_.linearise(range, point, hessian, qp, scratch);
  }

 private:
  const Ocp& of_;
};

}  // namespace rhec::testing
