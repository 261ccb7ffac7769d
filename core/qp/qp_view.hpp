#pragma once

#include "rhec/core/kernels/qp_kernels.hpp"
#include "rhec/core/qp/stage_qp.hpp"

namespace rhec {

inline QpView view_of(const StageQp& qp, const Iterate& iterate) noexcept {
  return {.intervals = qp.intervals(),
          .last = qp.intervals(),
          .states = qp.capacity().states,
          .controls = qp.capacity().controls,
          .stride = qp.stride(),
          .state_counts = qp.state_counts(),
          .control_counts = qp.control_counts(),
          .identity_counts = qp.identity_counts(),
          .initial_state_is_given = qp.initial_state_is_given,
          .AB = qp.AB(0),
          .h = qp.h(0),
          .b = qp.b(0),
          .lower = qp.lower(0),
          .upper = qp.upper(0),
          .values = iterate.row(0),
          .costates = iterate.costate(0),
          .bounds = iterate.bound_row(0)};
}

inline LimitView view_of_limits(const StageQp& qp) noexcept {
  return {.intervals = qp.intervals(),
          .controls = qp.capacity().controls,
          .limits = qp.capacity().limits,
          .row = qp.capacity().limit_row(),
          .stride = qp.stride(),
          .counts = qp.limit_counts(),
          .G = qp.G(0),
          .sides = qp.limit_lower(0)};
}

}  // namespace rhec
