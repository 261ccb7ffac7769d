#pragma once

#include "kernels/program_kernels.hpp"
#include "rhec/core/stage_qp.hpp"

namespace rhec {

inline ProgramView view_of(const StageQp& qp, const Iterate& point) noexcept {
  ProgramView view;
  view.intervals = view.last = qp.intervals();
  view.states = qp.capacity().states;
  view.controls = qp.capacity().controls;
  view.stride = qp.stride();
  view.state_counts = qp.state_counts();
  view.control_counts = qp.control_counts();
  view.carried_counts = qp.carried_counts();
  view.initial_state_is_given = qp.initial_state_is_given;
  view.F = qp.F(0);
  view.h = qp.h(0);
  view.b = qp.b(0);
  view.lower = qp.lower(0);
  view.upper = qp.upper(0);
  view.values = point.row(0);
  view.costates = point.costate(0);
  view.bounds = point.bound_row(0);
  return view;
}

}  // namespace rhec
